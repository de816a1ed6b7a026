"""The simulator's truth: what is taken, and what is not."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmctl import events
from swarmctl.feed.schema import ReceiverTruthMessage, TruthMessage
from swarmctl.feed.truth import TruthIntake, decode_receivers_truth, decode_truth

NOW = 17.5


def encode(value: object) -> bytes:
    return msgspec.json.encode(value)


@given(st.binary())
def test_no_bytes_raise(payload: bytes) -> None:
    intake = TruthIntake("alpha")
    for topic in intake.topics:
        assert not intake.receive(topic, payload, NOW)


def test_truth_is_decoded_in_si_and_radians() -> None:
    sent = TruthMessage(
        epoch_utc_s=1.79e9,
        lat_deg=45.0,
        lon_deg=-90.0,
        alt_amsl_m=3.0,
        velocity_enu=(1.0, 2.0, 0.0),
    )
    assert decode_truth(encode(sent), NOW) == events.EmitterTruth(
        received_s=NOW,
        epoch_utc_s=1.79e9,
        lat_rad=math.pi / 4,
        lon_rad=-math.pi / 2,
        alt_amsl_m=3.0,
        velocity_enu=(1.0, 2.0, 0.0),
    )


TRUTH = {
    "epoch_utc_s": 1.79e9,
    "lat_deg": 45.0,
    "lon_deg": -90.0,
    "alt_amsl_m": 3.0,
    "velocity_enu": [1.0, 2.0, 0.0],
}


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"truth",
        b'{"v": 1, "receiver": 2, "rd_m": -12.5}',
        b'{"x":' + b"[" * 100_000,
        encode(TRUTH | {"v": 2}),
        encode(TRUTH | {"epoch_utc_s": -1.0}),
        encode(TRUTH | {"epoch_utc_s": 1e11}),
        encode(TRUTH | {"lat_deg": 90.1}),
        encode(TRUTH | {"lon_deg": -361.0}),
        encode(TRUTH | {"alt_amsl_m": 1e300}),
        encode(TRUTH | {"velocity_enu": [0.0, 0.0, -1e300]}),
    ],
)
def test_what_is_no_truth_is_none(payload: bytes) -> None:
    assert decode_truth(encode(TRUTH), NOW) is not None
    assert decode_truth(payload, NOW) is None


OFF = ReceiverTruthMessage(
    epoch_utc_s=1.79e9, receiver=2, clock_m=3.5, drift_mps=-0.06, navigation_enu=(0.4, -0.1, 0.9)
)


def test_the_truth_about_the_receivers_is_decoded_one_by_one() -> None:
    other = msgspec.structs.replace(OFF, receiver=3)
    expected = events.ReceiverTruth(
        received_s=NOW,
        epoch_utc_s=1.79e9,
        receiver=2,
        clock_m=3.5,
        drift_mps=-0.06,
        navigation_enu=(0.4, -0.1, 0.9),
    )
    assert decode_receivers_truth(encode([OFF, other]), NOW) == [
        expected,
        msgspec.structs.replace(expected, receiver=3),
    ]


@pytest.mark.parametrize(
    "change",
    [
        {"v": 2},
        {"receiver": 0},
        {"epoch_utc_s": 1e11},
        {"epoch_utc_s": -1.0},
        {"clock_m": -1e300},
        {"drift_mps": 1e300},
        {"navigation_enu": [0.0, -1e300, 0.0]},
        {"navigation_enu": [0.0, 0.0]},
    ],
    ids=lambda change: str(*change),
)
def test_what_is_no_truth_about_receivers_is_none(change: dict[str, Any]) -> None:
    good = msgspec.to_builtins(OFF)
    assert len(decode_receivers_truth(encode([good]), NOW)) == 1
    assert decode_receivers_truth(encode([good | change]), NOW) == []
    assert decode_receivers_truth(encode(good), NOW) == []


def test_each_topic_has_its_message() -> None:
    intake = TruthIntake("alpha")
    assert intake.topics == ("swarm/alpha/truth", "swarm/alpha/truth/receivers")
    kinds = [
        [type(truth) for truth in intake.receive(topic, payload, NOW)]
        for topic in intake.topics
        for payload in (encode(TRUTH), encode([OFF, OFF]))
    ]
    assert kinds == [[events.EmitterTruth], [], [], [events.ReceiverTruth] * 2]
