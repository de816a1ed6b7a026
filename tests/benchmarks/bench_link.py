"""What the link costs: 50 vehicles, 10 Hz of positions from each and of setpoints to each.

``make bench`` prints the share of one core that the link layer takes, both ways, everything
else a vehicle says at 1-2 Hz included: frames found and checked, events made, setpoints
written, statistics, heartbeats. The sockets are not in it.
"""

from __future__ import annotations

import os
import time

from swarmctl.commands import GoTo
from swarmctl.link.address import Address
from swarmctl.link.mavlink_link import MavlinkLink
from swarmctl.link.signing import Signing, timestamp_at
from tests.link.signers import KEY, Signer
from tests.link.wire import Sender

VEHICLES = 50
SECONDS = 30
RATE_HZ = 10
SLOW = ("SYSTEM_TIME", "SYS_STATUS", "GPS_RAW_INT", "EXTENDED_SYS_STATE", "ATTITUDE")
UTC_S = 1_790_000_000.0


def cost(*, signed: bool) -> float:
    """Share of one core."""
    start = timestamp_at(UTC_S)
    signing = Signing(KEY, start, UTC_S) if signed else None
    link = MavlinkLink(gcs_sysid=245, vehicles=None, signing=signing)
    used_s = 0.0
    senders = [Signer(i, timestamp=start) if signed else Sender(i) for i in range(1, VEHICLES + 1)]
    places = [Address(f"10.0.0.{i}", 14550) for i in range(VEHICLES)]
    setpoints = [
        GoTo(sysid=i, lat_rad=0.9, lon_rad=0.2, alt_amsl_m=50.0, velocity_enu=(5.0, 1.0, 0.0))
        for i in range(1, VEHICLES + 1)
    ]
    for period in range(SECONDS * RATE_HZ):
        now = period / RATE_HZ
        # What the vehicles pack is theirs to pay for.
        datagrams = []
        for sender, place in zip(senders, places, strict=True):
            if period % RATE_HZ == 0:
                datagrams.append((sender.heartbeat(armed=True), place))
                datagrams += [(sender.pack(name), place) for name in SLOW]
            position = sender.pack(
                "GLOBAL_POSITION_INT",
                time_boot_ms=round(now * 1e3),
                lat=544_000_000 + period,
                lon=112_000_000,
                alt=50_000,
                vx=300,
            )
            datagrams.append((position, place))
        began = time.process_time()
        for data, place in datagrams:
            link.receive_datagram(data, place, now)
        if now >= link.next_timer():
            link.handle_timer(now)
        for setpoint in setpoints:
            link.send(setpoint, now)
        events, sent, traffic = link.events(), link.datagrams(), link.traffic()
        used_s += time.process_time() - began
        assert len(events) >= VEHICLES
        assert len(sent) >= VEHICLES
        assert len(traffic) == len(sent) + len(datagrams)
    assert not link.rejected
    return used_s / SECONDS


def main() -> None:
    """Measure with and without signing."""
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    print(f"{VEHICLES} vehicles, {RATE_HZ} Hz of positions and of setpoints, in and out:")
    for signed in (False, True):
        name = "signed" if signed else "unsigned"
        print(f"  {name}: {min(cost(signed=signed) for _ in range(3)):.1%} of one core")


if __name__ == "__main__":
    main()
