"""What a simulated autopilot can do when after power-up."""

from __future__ import annotations

from dataclasses import dataclass

REBOOT_S = 1.2
"""Time from the acknowledgement of a reboot to the next heartbeat, s."""


@dataclass(frozen=True)
class BootSequence:
    """Times from power-up, s.

    Attributes:
        heartbeat_s: First HEARTBEAT.
        gps_fix_s: GPS fix, and with it UTC.
        home_set_s: Position, origin and home are set.
        armable_s: Arming checks pass.
    """

    heartbeat_s: float
    gps_fix_s: float
    home_set_s: float
    armable_s: float


ARDUPILOT = BootSequence(heartbeat_s=1.0, gps_fix_s=10.0, home_set_s=20.0, armable_s=43.0)
"""As measured on ArduCopter."""
PX4 = BootSequence(heartbeat_s=1.0, gps_fix_s=2.0, home_set_s=3.0, armable_s=4.5)
"""As measured on PX4."""
QUICK = BootSequence(heartbeat_s=0.0, gps_fix_s=1.0, home_set_s=2.0, armable_s=4.0)
"""For simulations that do not ask for a full boot (``full_boot``)."""
