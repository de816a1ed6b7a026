"""The experiments of the track study, and what the live track is held to in each.

All fly Table 1's engagement with companions at 300 m. The track is always told the truth
about the receivers, that the emitter may manoeuvre, and nothing else.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from swarmctl.estimation.model.receiver_errors import ReceiverErrors
from swarmctl.estimation.track.manoeuvre import Manoeuvre
from swarmctl.study.engagement import Turn
from swarmctl.study.receivers import SimulatedReceivers
from swarmctl.study.registry import ProcessNoise
from swarmctl.study.starts import Anywhere, DrawnEstimate, DrawnTruth, RangeIgnorant, Start

MANOEUVRE = Manoeuvre(20.0)
"""What the track is told of every emitter."""

PERPENDICULAR = (-90.0, 0.0, 90.0)
"""Angles of the companions from the line of sight in the paper's formation of N = 3, degrees."""
ON_A_LINE = (90.0, 90.0, -90.0, -90.0)
"""The paper's formation of N = 4: with the reference UAV, all are on one line."""

TIMES_S = (1.0, 4.0, 8.0, 12.0, 16.0)
"""When a track is judged, s."""


class TrackTolerance(NamedTuple):
    """What the track is held to at some times.

    Attributes:
        times_s: Times since the start.
        ratio: Greatest RMSE over the bound; None for any.
        nees: Least and greatest mean position NEES; None for any.
    """

    times_s: tuple[float, ...]
    ratio: float | None
    nees: tuple[float, float] | None


class Gap(NamedTuple):
    """Receivers that fall silent.

    Attributes:
        from_s: When they fall silent.
        until_s: When they are heard again.
        left: Companions that are heard meanwhile, beside the reference UAV; 0 is silence.
    """

    from_s: float
    until_s: float
    left: int


@dataclass(frozen=True)
class TrackCase:
    """One experiment.

    Attributes:
        title: What it tries, in words.
        start: How a run begins.
        receivers: The errors of the receivers.
        period_s: Time between two measurements.
        tolerances: What the RMSE and the NEES are held to.
        times_s: When the tracks are judged; the last is the end.
        process_noise: Process noise of the models, and of the emitter if the start disturbs it,
            per axis, m²/s³.
        formation: Angles from the line of sight, degrees.
        speed_mps: Speed of the reference UAV; None for Table 1's.
        turn: A change of the emitter's velocity.
        gap: When receivers fall silent.
        echo_ratio: Greatest RMSE over that without echoes; None where there are none.
        first: Latest time of the first estimate, s, and its greatest mean NEES; None for any.
        sides: Whether tracks are counted that are silently on the wrong side.
    """

    title: str
    start: Start
    receivers: SimulatedReceivers
    period_s: float
    tolerances: tuple[TrackTolerance, ...]
    times_s: tuple[float, ...] = TIMES_S
    process_noise: ProcessNoise = (0.0, 0.0)
    formation: tuple[float, ...] = PERPENDICULAR
    speed_mps: float | None = None
    turn: Turn | None = None
    gap: Gap | None = None
    echo_ratio: float | None = None
    first: tuple[float, float] | None = None
    sides: bool = False


WHITE = SimulatedReceivers()
"""Table 1's noise, with equal receivers."""
CLOCKS = SimulatedReceivers(position_m=0.0, errors=ReceiverErrors(9.0, 0.3, 1.5, 60.0))
"""Clocks of 30 ns that drift by 1 ns/s, and GNSS."""
COLOURED = SimulatedReceivers(
    arrival_m=0.0, errors=ReceiverErrors(colour_m=0.5 * math.sqrt(0.5), colour_tau_s=0.5)
)
"""The RDs' 0.5 m lasts for 0.5 s."""

_QUICK_S, _SLOW_S = 0.02, 0.1
_LEFT, _STOP = "the emitter turns left by 90°", "the emitter stops"
_CLOCKS_POOR = (TrackTolerance((12.0, 16.0), 2.0, (1.2, 5.0)),)


def _turning(what: str, turn: Turn, period_s: float = _QUICK_S) -> TrackCase:
    return TrackCase(
        f"{what} at 8 s, from 20 m/s; {1.0 / period_s:g} Hz",
        DrawnEstimate(),
        WHITE,
        period_s,
        (
            TrackTolerance((8.2, 8.5, 9.0, 10.0, 11.0, 12.0), None, (1.0, 6.0)),
            TrackTolerance((13.0, 14.0, 16.0), 2.0, (1.5, 3.0)),
        ),
        times_s=(7.9, 8.2, 8.5, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 16.0),
        process_noise=(0.01, 0.01),
        turn=turn,
    )


def _deaf(what: str, left: int, receivers: SimulatedReceivers) -> TrackCase:
    times_s = (4.9, 7.0, 10.0, 12.0, 14.9, 15.5, 16.0)
    return TrackCase(
        f"{what} from 5 to 15 s; 10 Hz",
        DrawnTruth(),
        receivers,
        _SLOW_S,
        (TrackTolerance(times_s, None, (1.0, 4.0)),),
        times_s=times_s,
        process_noise=(0.01, 0.01),
        gap=Gap(4.95, 14.95, left),
    )


CASES = {
    "tracker-range-ignorant": TrackCase(
        "range-ignorant: 10 ± 5 km assumed, 5 km true; 50 Hz",
        RangeIgnorant(),
        WHITE,
        _QUICK_S,
        (TrackTolerance((12.0,), 1.2, (1.5, 2.6)),),
    ),
    "echoes": TrackCase(
        "10 % of the RDs are echoes of +50..300 m, P0; 50 Hz",
        DrawnEstimate(),
        SimulatedReceivers(echoes=0.1),
        _QUICK_S,
        (TrackTolerance(TIMES_S, None, (1.6, 2.6)),),
        echo_ratio=1.3,
    ),
    "clocks": TrackCase(
        "clocks 30 ns and 1 ns/s, navigation 1.5 m for 60 s, P0; 10 Hz",
        DrawnEstimate(),
        CLOCKS,
        _SLOW_S,
        (TrackTolerance(TIMES_S, 1.4, (1.5, 4.0)),),
    ),
    "clocks-20": TrackCase(
        "the same clocks and navigation, P0 x 20²; 10 Hz",
        DrawnEstimate(20.0),
        CLOCKS,
        _SLOW_S,
        _CLOCKS_POOR,
    ),
    "clocks-range-ignorant": TrackCase(
        "the same clocks and navigation, 10 ± 5 km assumed; 10 Hz",
        RangeIgnorant(),
        CLOCKS,
        _SLOW_S,
        _CLOCKS_POOR,
    ),
    "coloured": TrackCase(
        "RD errors of 0.5 m that last for 0.5 s, P0; 50 Hz",
        DrawnEstimate(),
        COLOURED,
        _QUICK_S,
        (TrackTolerance(TIMES_S, 1.3, (1.5, 3.0)),),
    ),
    "line": TrackCase(
        "all UAVs on one line, the side unknown; 10 Hz",
        Anywhere(),
        WHITE,
        _SLOW_S,
        (),
        times_s=(1.0, 2.0, *TIMES_S[1:]),
        formation=ON_A_LINE,
        sides=True,
    ),
    "line-hovering": TrackCase(
        "all UAVs on one line, hovering, the side unknown; 10 Hz",
        Anywhere(),
        WHITE,
        _SLOW_S,
        (),
        times_s=(1.0, 2.0, *TIMES_S[1:]),
        formation=ON_A_LINE,
        speed_mps=0.0,
        sides=True,
    ),
    "no-prior": TrackCase("no prior; 10 Hz", Anywhere(), WHITE, _SLOW_S, (), first=(2.0, 6.0)),
    "no-prior-clocks": TrackCase(
        "no prior, the same clocks and navigation; 10 Hz",
        Anywhere(),
        CLOCKS,
        _SLOW_S,
        (),
        first=(2.0, 6.0),
    ),
    "turn-left": _turning(_LEFT, Turn(8.0, math.pi / 2.0, 1.0)),
    "turn-left-slow": _turning(_LEFT, Turn(8.0, math.pi / 2.0, 1.0), _SLOW_S),
    "turn-right": _turning("the emitter turns right by 90°", Turn(8.0, -math.pi / 2.0, 1.0)),
    "stop": _turning(_STOP, Turn(8.0, 0.0, 0.0)),
    "stop-slow": _turning(_STOP, Turn(8.0, 0.0, 0.0), _SLOW_S),
    "silence": _deaf("no feed", 0, WHITE),
    "one-left": _deaf("one companion heard", 1, WHITE),
    "two-left": _deaf("two companions heard", 2, WHITE),
    "silence-clocks": _deaf("the same clocks and navigation, no feed", 0, CLOCKS),
    "one-left-clocks": _deaf("the same clocks and navigation, one companion heard", 1, CLOCKS),
}
"""The experiments by name."""
