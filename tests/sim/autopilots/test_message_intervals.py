"""Message intervals."""

from __future__ import annotations

import pytest

from sim.autopilots.message_intervals import MessageIntervals

HEARTBEAT, ATTITUDE, POSITION = 0, 30, 33
DEFAULTS = {HEARTBEAT: 1.0}


def sent(streams: MessageIntervals, start_s: float, duration_s: float) -> list[tuple[float, int]]:
    """What a loop of 50 Hz sends."""
    steps = range(round(start_s * 50) + 1, round((start_s + duration_s) * 50) + 1)
    return [(k / 50, message) for k in steps for message in streams.due(k / 50)]


def test_only_the_heartbeat_by_default() -> None:
    messages = sent(MessageIntervals(3.0, DEFAULTS), 3.0, 10.0)
    assert {message for _, message in messages} == {HEARTBEAT}
    times = [time for time, _ in messages]
    assert times == pytest.approx([3.02, *range(4, 14)])


@pytest.mark.parametrize("rate_hz", [0.5, 3.0, 10.0, 30.0, 50.0, 80.0, 200.0])
def test_the_mean_rate_is_exact(rate_hz: float) -> None:
    streams = MessageIntervals(0.0, DEFAULTS)
    streams.set_interval(POSITION, 1e6 / rate_hz, 0.0)
    count = sum(message == POSITION for _, message in sent(streams, 0.0, 20.0))
    assert count == 20.0 * rate_hz


def test_no_message_comes_more_often_than_200_times_a_second() -> None:
    streams = MessageIntervals(0.0, DEFAULTS)
    streams.set_interval(POSITION, 1000.0, 0.0)
    assert sum(message == POSITION for _, message in sent(streams, 0.0, 2.0)) == 400


def test_off_and_back_to_default() -> None:
    streams = MessageIntervals(0.0, DEFAULTS)
    streams.set_interval(ATTITUDE, 1e5, 0.0)
    streams.set_interval(HEARTBEAT, -1.0, 0.0)
    assert {message for _, message in sent(streams, 0.0, 5.0)} == {ATTITUDE}
    streams.set_interval(ATTITUDE, 0.0, 5.0)
    streams.set_interval(HEARTBEAT, 0.0, 5.0)
    assert [message for _, message in sent(streams, 5.0, 3.0)] == 3 * [HEARTBEAT]


def test_everything_off_is_silent() -> None:
    streams = MessageIntervals(0.0, DEFAULTS)
    streams.set_interval(HEARTBEAT, -1.0, 0.0)
    assert sent(streams, 0.0, 5.0) == []
