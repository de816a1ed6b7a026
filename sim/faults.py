"""Faults that a simulated vehicle can have."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Faults:
    """The faults of one vehicle.

    A vehicle that is off the air (``silent``, or past ``dies_at_s``) flies on by itself, but
    neither hears nor is heard, and its receiver delivers nothing.

    Attributes:
        silent: It never sends or receives anything.
        refuses_arming: It denies every request to arm, with a STATUSTEXT. The pre-arm bit of
            SYS_STATUS does not show it: real autopilots have checks that run only then.
        dies_at_s: Simulation time at which it falls silent, s; None for never.
        gps_lost_at_s: Simulation time from which it has no GPS, s; None for never.
    """

    silent: bool = False
    refuses_arming: bool = False
    dies_at_s: float | None = None
    gps_lost_at_s: float | None = None

    def is_on_air(self, now_s: float) -> bool:
        """Whether the vehicle sends and receives at a simulation time (s)."""
        return not self.silent and (self.dies_at_s is None or now_s < self.dies_at_s)

    def gps_works(self, now_s: float) -> bool:
        """Whether the vehicle's GPS works at a simulation time (s)."""
        return self.gps_lost_at_s is None or now_s < self.gps_lost_at_s
