"""Message signing against pymavlink's own, in both directions, and against its attackers."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.link.codec.encoding import Encoder
from swarmctl.link.codec.framing import split
from swarmctl.link.codec.messages import CommandLong, Frame, MavCmd
from swarmctl.link.signing import EPOCH_UTC_S, MAX_AGE, UNITS_PER_S, Signing, timestamp_at
from tests.link.signers import KEY, START, Signer, receiver
from tests.link.wire import Sender


def signing(timestamp: int = START) -> Signing:
    return Signing(KEY, timestamp, 0.0)


def frame(raw: bytes) -> Frame:
    (found,), faults = split(raw)
    assert faults == []
    return found


def fault(ours: Signing, raw: bytes) -> str | None:
    found = ours.check(frame(raw))
    return None if found is None else found.kind


# --- Agreement with pymavlink ----------------------------------------------------------


def test_the_timestamp_counts_10_us_since_2015() -> None:
    assert EPOCH_UTC_S == 1_420_070_400  # date -ud 2015-01-01 +%s
    assert timestamp_at(EPOCH_UTC_S + 1.5) == 150_000
    assert timestamp_at(0.0) == 0


@given(st.integers(0, 2**48 - 2), st.integers(0, 255), st.binary(max_size=50))
def test_what_pymavlink_signs_is_believed(timestamp: int, link_id: int, text: bytes) -> None:
    sender = Signer(7, timestamp=timestamp, link_id=link_id)
    ours = signing(timestamp=0)
    assert fault(ours, sender.pack("STATUSTEXT", text=text, severity=1)) is None
    assert fault(ours, sender.heartbeat()) is None
    assert ours.timestamp == timestamp + 1  # the greatest that was seen


def test_what_we_sign_is_believed_by_pymavlink() -> None:
    ours = signing()
    encoder = Encoder(245, ours, link_id=9)
    mav = receiver()
    arm = CommandLong(MavCmd.COMPONENT_ARM_DISARM, (1.0,))
    for raw in (encoder.heartbeat(), encoder.command_long(1, arm, 0), encoder.timesync(5)):
        message = mav.decode(bytearray(raw))
        assert message.get_signed()
        assert message.get_link_id() == 9
        # Altering any byte of it must break it, so that the line above shows something.
        with pytest.raises(mavlink.MAVError):
            receiver().decode(bytearray(raw[:-1] + bytes((raw[-1] ^ 1,))))
    assert ours.timestamp == START + 3


def test_our_timestamp_follows_utc_and_never_repeats_or_runs_back() -> None:
    ours = Signing(KEY, START, 1_790_000_000.0)
    used = [ours.next_timestamp() for _ in range(3)]
    ours.advance(10.0)
    used.append(ours.next_timestamp())
    ours.advance(5.0)
    used.append(ours.next_timestamp())
    assert used == [START, START + 1, START + 2, START + 1_000_000, START + 1_000_001]


# --- Refusals --------------------------------------------------------------------------


def test_what_is_not_signed_is_refused_in_both_versions_of_mavlink() -> None:
    sender = Sender(1)
    assert fault(signing(), sender.heartbeat()) == "unsigned"
    assert fault(signing(), sender.pack_v1("ATTITUDE")) == "unsigned"


def test_radio_status_is_let_through_unsigned_as_radios_have_no_key() -> None:
    radio = Sender(51, compid=68)
    assert fault(signing(), radio.pack("RADIO_STATUS", rssi=100)) is None
    assert fault(signing(), radio.pack_v1("RADIO_STATUS", rssi=100)) is None


def test_another_key_is_refused() -> None:
    assert fault(signing(), Signer(key=bytes(32)).heartbeat()) == "wrongly_signed"


@given(st.integers(0, 10_000), st.integers(1, 255))
def test_no_byte_of_a_signed_frame_can_be_changed(place: int, flip: int) -> None:
    """Header, payload, link id, timestamp or signature: the checksum or the signature tells."""
    raw = bytearray(Signer().heartbeat())
    raw[place % len(raw)] ^= flip
    frames, _ = split(bytes(raw))
    assert all(signing().check(found) is not None for found in frames)


def test_a_frame_counts_once_and_an_overtaken_one_not_at_all() -> None:
    sender = Signer()
    first, second, third = (sender.heartbeat() for _ in range(3))
    ours = signing()
    assert fault(ours, second) is None
    assert fault(ours, second) == "replayed"
    assert fault(ours, first) == "replayed"
    assert fault(ours, third) is None


def test_each_component_and_link_has_timestamps_of_its_own() -> None:
    ours = signing()
    assert fault(ours, Signer(1, timestamp=START + 500).heartbeat()) is None
    assert fault(ours, Signer(2, timestamp=START + 100).heartbeat()) is None
    assert fault(ours, Signer(1, timestamp=START + 100, link_id=1).heartbeat()) is None
    assert fault(ours, Signer(1, timestamp=START + 100).heartbeat()) == "replayed"


@pytest.mark.parametrize(("behind", "expected"), [(MAX_AGE, None), (MAX_AGE + 1, "replayed")])
def test_a_recording_of_an_unknown_stream_is_too_old_after_a_minute(
    behind: int, expected: str | None
) -> None:
    assert MAX_AGE == 60 * UNITS_PER_S
    assert fault(signing(), Signer(timestamp=START - behind).heartbeat()) == expected


def test_a_forged_frame_from_the_future_does_not_silence_its_vehicle() -> None:
    ours = signing()
    forged = Signer(key=bytes(32), timestamp=START + 10**9)
    assert fault(ours, forged.heartbeat()) == "wrongly_signed"
    assert ours.timestamp == START
    assert fault(ours, Signer().heartbeat()) is None
