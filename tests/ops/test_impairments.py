"""A whole mission over a bad radio: real bytes, lost, late, overtaken and doubled."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.radio_channel import Impairments, RadioChannel
from swarmctl.ops import in_memory
from swarmctl.ops.in_memory import fly_in_memory
from tests.link.wire import unpack
from tests.summaries import assert_within_limits

BAD_RADIO = Impairments(loss=0.2, duplication=0.05, delay_s=0.3, jitter_s=0.1)
"""Each way: 20 % lost, 5 % doubled, 300-400 ms late, so that 10 Hz messages overtake."""


class Tap(RadioChannel[tuple[int, bytes]]):
    """A channel that remembers what was said at its beginning, before anything was lost."""

    taps: ClassVar[list[Tap]] = []

    def __init__(self, *arguments: Any) -> None:  # noqa: ANN401 - passed on
        super().__init__(*arguments)
        self.said: list[tuple[int, bytes]] = []
        Tap.taps.append(self)

    def send(self, item: tuple[int, bytes], now_s: float) -> None:
        """As a channel does."""
        self.said.append(item)
        super().send(item, now_s)


def changes(states: list[Any]) -> list[Any]:
    """A sequence without its repetitions."""
    return states[:1] + [b for a, b in pairwise(states) if a != b]


@pytest.mark.slow
def test_the_mission_completes_and_each_command_is_executed_once(
    short_mission: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(in_memory, "RadioChannel", Tap)
    Tap.taps.clear()
    summary = fly_in_memory(short_mission(), seed=5, impairments=BAD_RADIO)

    assert summary.result == "located"
    assert_within_limits(summary)
    down, up = Tap.taps
    for tap in (down, up):  # 5 standard deviations of the binomial counts
        expected = tap.sent * 0.8 * 1.05
        assert abs(tap.delivered - expected) < 5.0 * (tap.sent * 0.25) ** 0.5
    # Some of those that fly it were sent again, or this flight would show nothing: of sixteen,
    # each is answered at once with probability 0.64.
    repeated: Counter[int] = Counter()
    for _, data in up.said:
        message = unpack(data)
        if message.get_type() == "COMMAND_LONG" and message.confirmation > 0:
            repeated[message.command] += 1
    flying = {
        mavlink.MAV_CMD_DO_SET_MODE,
        mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
        mavlink.MAV_CMD_NAV_TAKEOFF,
    }
    assert flying & repeated.keys()
    # What each vehicle did, in its own words as they left it.
    for sysid in (1, 2, 3, 4):
        messages = [unpack(data) for i, data in down.said if i == sysid]
        beats = [m for m in messages if m.get_type() == "HEARTBEAT"]
        assert changes([m.custom_mode for m in beats])[1:] == [4, 9]  # GUIDED, LAND
        assert changes([m.base_mode & 128 for m in beats]) == [0, 128, 0]
        landed = changes([m.landed_state for m in messages if m.get_type() == "EXTENDED_SYS_STATE"])
        assert landed == [
            mavlink.MAV_LANDED_STATE_ON_GROUND,
            mavlink.MAV_LANDED_STATE_TAKEOFF,
            mavlink.MAV_LANDED_STATE_IN_AIR,
            mavlink.MAV_LANDED_STATE_LANDING,
            mavlink.MAV_LANDED_STATE_ON_GROUND,
        ]
