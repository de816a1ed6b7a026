"""What the feed takes, what it refuses, and how it says so."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmctl import events
from swarmctl.feed.intake import FeedIntake
from swarmctl.feed.schema import (
    ArrivalTimeMessage,
    RangeDifferenceMessage,
    receivers_truth_topic,
    tdoa_topic,
    toa_topic,
    truth_topic,
)

TOPIC = tdoa_topic("alpha")
TOA_TOPIC = toa_topic("alpha", 2)
NOW = 17.5
GOOD: dict[str, Any] = {
    "v": 1,
    "epoch_utc_s": 1.79e9,
    "reference": 1,
    "receiver": 2,
    "rd_m": -12.5,
    "sigma_m": 3.0,
    "rho": 0.5,
    "clock_sigma_s": 2e-9,
    "seq": 7,
}


ARRIVAL: dict[str, Any] = {
    "v": 1,
    "receiver": 2,
    "toa_s": 1_790_000_012,
    "toa_frac_s": 0.350_007_421_912_345_6,
    "burst": 3,
    "sigma_s": 7e-9,
    "clock_sigma_s": 2e-9,
    "seq": 7,
}


def message(**changes: object) -> dict[str, Any]:
    return GOOD | changes


def encode(value: object) -> bytes:
    return msgspec.json.encode(value)


@pytest.fixture
def intake() -> FeedIntake:
    return FeedIntake("alpha", receivers=[1, 2, 3, 4])


def arrival(**changes: object) -> bytes:
    return encode(ARRIVAL | changes)


def rejected_kinds(observations: list[events.Observation]) -> list[str]:
    return [o.kind for o in observations if isinstance(o, events.InputRejected)]


def test_one_message_becomes_one_observation(intake: FeedIntake) -> None:
    assert intake.receive(TOPIC, encode(GOOD), NOW) == [
        events.RangeDifferences(
            received_s=NOW,
            epoch_utc_s=1.79e9,
            reference=1,
            items=(events.RangeDifference(receiver=2, rd_m=-12.5, sigma_m=3.0),),
            rho=0.5,
            clock_sigma_s=2e-9,
            seq=7,
        )
    ]
    assert (intake.messages_in, intake.range_differences_in) == (1, 1)
    assert not intake.rejected


def test_what_the_schema_encodes_is_taken(intake: FeedIntake) -> None:
    sent = RangeDifferenceMessage(
        epoch_utc_s=5.25, reference=3, receiver=4, rd_m=1.0, sigma_m=2.0, rho=0.0,
        clock_sigma_s=0.0, seq=0,
    )  # fmt: skip
    (taken,) = intake.receive(TOPIC, encode(sent), NOW)
    assert isinstance(taken, events.RangeDifferences)
    assert (taken.epoch_utc_s, taken.reference, taken.items[0].receiver) == (5.25, 3, 4)


def test_a_list_is_grouped_by_epoch_and_reference(intake: FeedIntake) -> None:
    batch = [
        message(receiver=2),
        message(receiver=3, epoch_utc_s=1.79e9 + 0.1, seq=9),
        message(receiver=4, clock_sigma_s=5e-9),
        message(receiver=1, reference=2),
    ]
    taken = intake.receive(TOPIC, encode(batch), NOW)
    assert [
        (o.epoch_utc_s, o.reference, [i.receiver for i in o.items], o.seq, o.clock_sigma_s)
        for o in taken
        if isinstance(o, events.RangeDifferences)
    ] == [
        (1.79e9, 1, [2, 4], 7, 5e-9),  # the worst clock of the group speaks for it
        (1.79e9 + 0.1, 1, [3], 9, 2e-9),
        (1.79e9, 2, [1], 7, 2e-9),
    ]
    assert intake.range_differences_in == 4


REJECTED = {
    "not json": (b"range difference: 12 m", "not_json"),
    "empty": (b"", "not_json"),
    "truncated": (encode(GOOD)[:-1], "not_json"),
    "NaN": (encode(GOOD).replace(b"-12.5", b"NaN"), "not_json"),
    "Infinity": (encode(GOOD).replace(b"-12.5", b"Infinity"), "not_json"),
    "nested beyond the stack": (b'{"x":' + b"[" * 100_000, "not_json"),
    "an integer of 5000 digits": (encode(GOOD).replace(b":7", b":" + b"7" * 5000), "wrong_schema"),
    "larger than a float": (encode(GOOD).replace(b"-12.5", b"1e999"), "wrong_schema"),
    "a number": (b"12.5", "wrong_schema"),
    "missing field": (encode({k: v for k, v in GOOD.items() if k != "sigma_m"}), "wrong_schema"),
    "wrong version": (encode(message(v=2)), "wrong_schema"),
    "wrong type": (encode(message(rd_m="12.5")), "wrong_schema"),
    "null": (encode(message(rd_m=None)), "wrong_schema"),
    "negative sigma": (encode(message(sigma_m=-1.0)), "wrong_schema"),
    "rho of one": (encode(message(rho=1.0)), "wrong_schema"),
    "sysid 0": (encode(message(receiver=0)), "wrong_schema"),
    "absurd range difference": (encode(message(rd_m=-1.1e6)), "absurd_value"),
    "absurd sigma": (encode(message(sigma_m=1e7)), "absurd_value"),
    "sigma too good": (encode(message(sigma_m=1e-200)), "absurd_value"),
    "absurd clock": (encode(message(clock_sigma_s=1.0)), "absurd_value"),
    "epoch in milliseconds": (encode(message(epoch_utc_s=1.79e12)), "absurd_value"),
    "negative epoch": (encode(message(epoch_utc_s=-1.0)), "absurd_value"),
    "seq beyond 64 bits": (encode(message(seq=2**63)), "absurd_value"),
    "unknown receiver": (encode(message(receiver=9)), "unknown_receiver"),
    "unknown reference": (encode(message(reference=9)), "unknown_reference"),
    "against itself": (encode(message(receiver=1)), "receiver_is_reference"),
}


@pytest.mark.parametrize(("payload", "kind"), REJECTED.values(), ids=REJECTED.keys())
def test_each_kind_is_reported_once_and_then_counted(
    intake: FeedIntake, payload: bytes, kind: str
) -> None:
    (first,) = intake.receive(TOPIC, payload, NOW)
    assert isinstance(first, events.InputRejected)
    assert (first.received_s, first.source, first.kind) == (NOW, "feed", kind)
    assert first.detail.startswith(f"{TOPIC}: ")
    assert intake.receive(TOPIC, payload, NOW) == []
    assert intake.rejected == {kind: 2}
    assert intake.range_differences_in == 0
    # The next good one is taken.
    assert rejected_kinds(intake.receive(TOPIC, encode(GOOD), NOW)) == []
    assert (intake.messages_in, intake.range_differences_in) == (3, 1)


def test_a_rejection_says_what_is_known(intake: FeedIntake) -> None:
    (fault,) = intake.receive(TOPIC, encode(message(receiver=9)), NOW)
    assert isinstance(fault, events.InputRejected)
    assert fault.detail == (
        "swarm/alpha/tdoa: receiver 9 is not of this swarm: its receivers are 1, 2, 3, 4."
    )


def test_another_topic_is_not_taken(intake: FeedIntake) -> None:
    observations = intake.receive(tdoa_topic("bravo"), encode(GOOD), NOW)
    assert rejected_kinds(observations) == ["unexpected_topic"]


def test_a_bad_entry_does_not_spoil_its_list(intake: FeedIntake) -> None:
    batch = [message(receiver=2), message(receiver=3, sigma_m="?"), message(receiver=4)]
    fault, taken = intake.receive(TOPIC, encode(batch), NOW)
    assert isinstance(fault, events.InputRejected)
    assert fault.kind == "wrong_schema"
    assert isinstance(taken, events.RangeDifferences)
    assert [item.receiver for item in taken.items] == [2, 4]


def test_the_same_receiver_counts_once_in_an_epoch(intake: FeedIntake) -> None:
    fault, taken = intake.receive(TOPIC, encode([GOOD, message(rd_m=99.0)]), NOW)
    assert isinstance(fault, events.InputRejected)
    assert fault.kind == "duplicate_receiver"
    assert isinstance(taken, events.RangeDifferences)
    assert [item.rd_m for item in taken.items] == [-12.5]


def test_one_epoch_has_one_rho(intake: FeedIntake) -> None:
    fault, taken = intake.receive(TOPIC, encode([GOOD, message(receiver=3, rho=0.2)]), NOW)
    assert isinstance(fault, events.InputRejected)
    assert fault.kind == "mixed_rho"
    assert isinstance(taken, events.RangeDifferences)
    assert [item.receiver for item in taken.items] == [2]


# --- Arrival times ---------------------------------------------------------------------


def test_an_arrival_time_becomes_one_observation_and_loses_nothing(intake: FeedIntake) -> None:
    assert intake.receive(TOA_TOPIC, arrival(), NOW) == [
        events.ArrivalTime(
            received_s=NOW,
            receiver=2,
            toa_s=1_790_000_012,
            toa_frac_s=0.350_007_421_912_345_6,
            burst=3,
            sigma_s=7e-9,
            clock_sigma_s=2e-9,
            seq=7,
        )
    ]
    assert (intake.messages_in, intake.arrival_times_in) == (1, 1)
    assert not intake.rejected


def test_the_topics_are_a_subscription_to_both_kinds(intake: FeedIntake) -> None:
    assert intake.topics == ("swarm/alpha/tdoa", "swarm/alpha/toa/+")
    assert TOA_TOPIC == "swarm/alpha/toa/2"


def test_a_receiver_may_send_several_arrival_times_at_once(intake: FeedIntake) -> None:
    sent = [
        ArrivalTimeMessage(
            receiver=2, toa_s=5, toa_frac_s=0.0, burst=burst, sigma_s=1e-8, clock_sigma_s=0.0, seq=0
        )
        for burst in (1, 2)
    ]
    fault, *taken = reversed(
        intake.receive(TOA_TOPIC, encode([sent[0], ARRIVAL | {"burst": -1}, sent[1]]), NOW)
    )
    assert isinstance(fault, events.InputRejected)
    assert fault.kind == "wrong_schema"
    assert "an arrival time message" in fault.detail
    assert [o.burst for o in taken if isinstance(o, events.ArrivalTime)] == [2, 1]


REJECTED_ARRIVALS = {
    "not json": (b"noon", "not_json"),
    "NaN": (arrival().replace(b"7e-9", b"NaN"), "not_json"),
    "infinite fraction": (arrival(toa_frac_s=0.5).replace(b"0.5", b"Infinity"), "not_json"),
    "nested beyond the stack": (b'{"x":' + b"[" * 100_000, "not_json"),
    "missing field": (encode({k: v for k, v in ARRIVAL.items() if k != "burst"}), "wrong_schema"),
    "a range difference": (encode(GOOD), "wrong_schema"),
    "wrong version": (arrival(v=2), "wrong_schema"),
    "one float for both parts": (arrival(toa_s=1_790_000_012.35), "wrong_schema"),
    "fraction of one": (arrival(toa_frac_s=1.0), "wrong_schema"),
    "negative fraction": (arrival(toa_frac_s=-1e-9), "wrong_schema"),
    "fraction in nanoseconds": (arrival(toa_frac_s=350_007_421), "wrong_schema"),
    "before 1970": (arrival(toa_s=-1), "wrong_schema"),
    "no error at all": (arrival(sigma_s=0.0), "wrong_schema"),
    "milliseconds": (arrival(toa_s=1_790_000_012_350), "absurd_value"),
    "400 digits": (arrival().replace(b"1790000012", b"9" * 400), "wrong_schema"),
    "sigma in nanoseconds": (arrival(sigma_s=7.0), "absurd_value"),
    "sigma in metres": (arrival(sigma_s=2.1), "absurd_value"),
    "sigma too good": (arrival(sigma_s=1e-200), "absurd_value"),
    "absurd clock": (arrival(clock_sigma_s=1.0), "absurd_value"),
    "burst beyond 64 bits": (arrival(burst=2**63), "absurd_value"),
    "seq beyond 64 bits": (arrival(seq=2**63), "absurd_value"),
    "another receiver's topic": (arrival(receiver=3), "wrong_topic"),
}


@pytest.mark.parametrize(
    ("payload", "kind"), REJECTED_ARRIVALS.values(), ids=REJECTED_ARRIVALS.keys()
)
def test_each_kind_of_bad_arrival_time_is_reported_once_and_then_counted(
    intake: FeedIntake, payload: bytes, kind: str
) -> None:
    (first,) = intake.receive(TOA_TOPIC, payload, NOW)
    assert isinstance(first, events.InputRejected)
    assert (first.received_s, first.source, first.kind) == (NOW, "feed", kind)
    assert first.detail.startswith(f"{TOA_TOPIC}: ")
    assert intake.receive(TOA_TOPIC, payload, NOW) == []
    assert intake.rejected == {kind: 2}
    assert intake.arrival_times_in == 0
    assert rejected_kinds(intake.receive(TOA_TOPIC, arrival(), NOW)) == []
    assert intake.arrival_times_in == 1


@pytest.mark.parametrize(
    ("topic", "kind"),
    [
        (toa_topic("alpha", 9), "unknown_receiver"),
        ("swarm/alpha/toa/09", "wrong_topic"),
        ("swarm/alpha/toa/", "wrong_topic"),
        (toa_topic("bravo", 9), "unexpected_topic"),
        ("swarm/alpha/toa", "unexpected_topic"),
    ],
)
def test_the_topic_names_a_receiver_of_this_swarm(
    intake: FeedIntake, topic: str, kind: str
) -> None:
    assert rejected_kinds(intake.receive(topic, arrival(receiver=9), NOW)) == [kind]


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda children: st.lists(children) | st.dictionaries(st.text(), children),
    max_leaves=8,
)
MUTATED_FIELDS = st.dictionaries(st.sampled_from(sorted(GOOD | ARRIVAL)), JSON, max_size=3)


def spliced(payload: bytes, at: float, insert: bytes, drop: int) -> bytes:
    index = int(at * len(payload))
    return payload[:index] + insert + payload[index + drop :]


PAYLOADS = (
    st.binary()
    | JSON.map(encode)
    | MUTATED_FIELDS.map(lambda fields: encode(message(**fields)))
    | MUTATED_FIELDS.map(lambda fields: arrival(**fields))
    | st.lists(MUTATED_FIELDS.map(lambda fields: message(**fields))).map(encode)
    | st.builds(
        spliced, st.just(encode([GOOD, GOOD])), st.floats(0, 1), st.binary(), st.integers(0, 9)
    )
)


@given(st.lists(PAYLOADS, max_size=4))
def test_no_bytes_raise_and_the_next_good_message_is_taken(payloads: list[bytes]) -> None:
    intake = FeedIntake("alpha", receivers=[1, 2, 3, 4])
    for payload in payloads:
        for observation in (
            *intake.receive(TOPIC, payload, NOW),
            *intake.receive(TOA_TOPIC, payload, NOW),
        ):
            # What comes out can be recorded and read back.
            assert isinstance(
                observation, events.RangeDifferences | events.ArrivalTime | events.InputRejected
            )
            kind = type(observation)
            assert msgspec.json.decode(msgspec.json.encode(observation), type=kind) == observation
    good = message(epoch_utc_s=123.456)
    (taken,) = intake.receive(TOPIC, encode(good), NOW)
    assert isinstance(taken, events.RangeDifferences)
    assert taken.items == (events.RangeDifference(2, -12.5, 3.0),)


@pytest.mark.parametrize("topic", [truth_topic("alpha"), receivers_truth_topic("alpha")])
def test_the_truth_is_no_measurement(intake: FeedIntake, topic: str) -> None:
    assert rejected_kinds(intake.receive(topic, b"{}", NOW)) == ["unexpected_topic"]
