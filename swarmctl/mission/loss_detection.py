"""How long a silence counts as the loss of a vehicle."""

from __future__ import annotations

from swarmctl.mission.fleet import VehicleState

LOST_AFTER_S = 5.0
"""A vehicle without a position for this long counts as lost in flight."""
HEARTBEAT_LOST_AFTER_S = 10.0
"""A vehicle without a heartbeat for this long counts as lost, too. Heartbeats come once a second:
over a radio that loses every fifth packet, each vehicle goes 5 s without one about once an hour."""


class LossDetection:
    """Tells whether a vehicle has been silent for so long that it counts as lost.

    Args:
        hiccup_s: Silence that this computer may be to blame for, s; granted on top.
    """

    def __init__(self, hiccup_s: float) -> None:
        self._hiccup_s = hiccup_s

    def is_lost(self, vehicle: VehicleState, now: float) -> bool:
        """Whether a vehicle has fallen silent at the controller's time ``now``, s."""
        beat, report = vehicle.heartbeat, vehicle.position
        if beat is None:
            return True
        if report is not None and now - report.received_s > LOST_AFTER_S + self._hiccup_s:
            return True
        return now - beat.received_s > HEARTBEAT_LOST_AFTER_S + self._hiccup_s
