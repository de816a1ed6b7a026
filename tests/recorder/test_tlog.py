"""The MAVLink log, read back by pymavlink."""

from __future__ import annotations

from pathlib import Path

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarmctl.recorder.tlog import TlogWriter

UTC_S = 1_790_000_000.123459


def frames() -> list[bytes]:
    sender = mavlink.MAVLink(None, srcSystem=3, srcComponent=1)
    messages = [
        mavlink.MAVLink_heartbeat_message(2, 3, 81, 4, 4, 3),
        mavlink.MAVLink_statustext_message(6, b"a text of some length"),
        mavlink.MAVLink_system_time_message(1_790_000_000_000_000, 4_000),
    ]
    return [message.pack(sender) for message in messages]


def test_pymavlink_reads_back_frames_and_times(tmp_path: Path) -> None:
    path = tmp_path / "vehicles.tlog"
    log = TlogWriter(path)
    for k, frame in enumerate(frames()):
        log.write(frame, UTC_S + 0.25 * k)
    log.close()

    reader = mavutil.mavlink_connection(str(path))
    read = []
    while (message := reader.recv_msg()) is not None:
        read.append(message)
    reader.close()
    assert [m.get_type() for m in read] == ["HEARTBEAT", "STATUSTEXT", "SYSTEM_TIME"]
    assert [bytes(m.get_msgbuf()) for m in read] == frames()
    assert [m.get_srcSystem() for m in read] == [3, 3, 3]
    for k, message in enumerate(read):
        # Two low bits of the microseconds belong to the number of the link.
        assert abs(message._timestamp - (UTC_S + 0.25 * k)) < 5e-6
        assert message._link == 0


def test_the_bytes_are_big_endian_microseconds_and_the_frame(tmp_path: Path) -> None:
    path = tmp_path / "a.tlog"
    log = TlogWriter(path)
    log.write(b"\xfd frame", 1_790_000_000.500003)
    log.close()
    assert path.read_bytes() == (1_790_000_000_500_000).to_bytes(8, "big") + b"\xfd frame"
