"""Flies a mission on a virtual clock: the same bytes as over UDP and MQTT, at full speed.

Vehicles and controller exchange encoded MAVLink datagrams and feed messages through lists instead
of sockets; all other code is the code that flies live. The same seed gives the same flight, bit
for bit.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from sim.noise import generator
from sim.radio_channel import Impairments, RadioChannel
from sim.world import World
from swarmctl.decisions import Notice
from swarmctl.errors import SwarmError
from swarmctl.link.address import Address
from swarmctl.link.signing import Signing, timestamp_at
from swarmctl.mission.mission_file_loading import load_mission
from swarmctl.mission.snapshot import Snapshot
from swarmctl.ops.mission_signing import signing_key
from swarmctl.ops.recording import Recording
from swarmctl.ops.sim_config import sim_config, simulation_section
from swarmctl.ops.station import Station
from swarmctl.ops.vehicle_links import native_link
from swarmctl.recorder.summary import FlightSummary

STEP_S = 0.02
"""Time between two exchanges of bytes, virtual s: the delay of the in-memory links."""
UTC_START_S = 1_790_000_000.0
"""UTC at virtual time 0, s: fixed, so that a seed fixes the whole recording."""
PERFECT = Impairments()
"""A radio that loses and delays nothing."""
HOPELESS_S = 3600.0
"""A flight that has not ended this long after its time limit counts as hung, s."""


def fly_in_memory(
    mission_path: str | Path,
    out: str | Path | None = None,
    *,
    seed: int | None = None,
    on_snapshot: Callable[[Snapshot], None] | None = None,
    on_notice: Callable[[Notice], None] | None = None,
    snapshot_every_s: float = 10.0,
    until: Callable[[Snapshot], bool] | None = None,
    impairments: Impairments = PERFECT,
) -> FlightSummary:
    """Fly a mission against simulated vehicles on a virtual clock.

    Args:
        mission_path: A mission file with a ``sim`` section.
        out: Directory of the recording; None records nothing but still gives the summary.
        seed: Overrides the mission's seed.
        on_snapshot: Called every ``snapshot_every_s`` of mission time.
        on_notice: Called with each sentence for the operator.
        snapshot_every_s: See ``on_snapshot``, s.
        until: Asked with each snapshot whether the flight may end here, the swarm in the air.
        impairments: What the radio does to MAVLink on its way, in both directions.

    Returns:
        The summary.

    Raises:
        SwarmError: If the mission or its recording cannot be used.
    """
    mission = load_mission(mission_path)
    seed = simulation_section(mission).seed if seed is None else seed
    began = time.perf_counter()
    world = World(sim_config(mission, seed, UTC_START_S))
    down: RadioChannel[tuple[int, bytes]] = RadioChannel(impairments, generator(seed, "downlink"))
    up: RadioChannel[tuple[int, bytes]] = RadioChannel(impairments, generator(seed, "uplink"))
    key = signing_key(mission)
    # On a virtual clock no timestamp is used twice by chance, so none is kept on disk.
    signing = Signing(key, timestamp_at(UTC_START_S), UTC_START_S) if key is not None else None
    with Recording(mission, Path(mission_path), out, seed) as recording:
        link = native_link(mission, signing=signing)
        station = Station(mission, link, 0.0, UTC_START_S, recording)
        recording.open()
        limit = mission.goal.time_limit_s + HOPELESS_S
        snapshot_at, steps, now = 0.0, 0, 0.0
        while not station.ended:
            if now > limit:
                raise SwarmError(f"the flight has not ended {HOPELESS_S:g} s after its time limit")
            steps += 1
            now = steps * STEP_S
            world.advance(now)
            _deliver(up.receive(now), world)
            for datagram in world.datagrams():
                down.send(datagram, now)
            datagrams, publications = down.receive(now), world.publications()
            for sysid, data in datagrams:
                link.receive_datagram(data, Address("memory", sysid), now)
            for topic, payload in publications:
                station.message(topic, payload, now)
            if now >= station.next_wake():
                station.wake(now)
            elif datagrams or publications:
                station.settle(now)
            else:
                continue
            recording.traffic(link.traffic(), UTC_START_S)
            for data, (_, sysid, _) in link.datagrams():
                up.send((sysid, data), now)
            _deliver(up.receive(now), world)
            station.publications()
            for notice in station.notices():
                if on_notice is not None:
                    on_notice(notice)
            if now >= snapshot_at:
                snapshot_at += snapshot_every_s
                snapshot = station.snapshot(now)
                if on_snapshot is not None:
                    on_snapshot(snapshot)
                if until is not None and until(snapshot):
                    break
        return recording.summary(station, time.perf_counter() - began)


def _deliver(datagrams: list[tuple[int, bytes]], world: World) -> None:
    """Hand each datagram to its vehicle."""
    for sysid, data in datagrams:
        world.receive_datagram(sysid, data)
