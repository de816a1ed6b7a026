"""A second station that shadows a flight: it computes every command and sends none."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as dialect

from sim.world import World
from swarmctl.commands import Arm, Command, GoTo, SetMode, TakeOff
from swarmctl.events import Record
from swarmctl.link.address import Address
from swarmctl.mission.mission_file_loading import parse_mission
from swarmctl.ops.sim_config import sim_config
from swarmctl.ops.station import Station
from swarmctl.ops.vehicle_links import native_link
from tests.missions import short_mission_text

UTC0 = 1_790_000_000.0
STEP_S = 0.02
INQUIRIES = {
    dialect.MAV_CMD_SET_MESSAGE_INTERVAL,
    dialect.MAV_CMD_REQUEST_MESSAGE,
}


class Tape:
    """Keeps what is recorded."""

    def __init__(self) -> None:
        self.records: list[Record] = []

    def record(self, record: Record, utc_s: float) -> None:
        self.records.append(record)


class Rehearsal:
    """A world in which one station may fly, and another shadows."""

    def __init__(self, *, is_flown: bool) -> None:
        mission = parse_mission(short_mission_text())
        other = parse_mission(short_mission_text(swarm__gcs_sysid=246, feed__timeout_s=10))
        self.world = World(sim_config(mission, 3, UTC0))
        self.tape = Tape()
        listening = native_link(other)
        self.shadow = Station(other, listening, 0.0, UTC0, self.tape, shadow=True)
        self.stations = [(self.shadow, listening)]
        if is_flown:
            flying = native_link(mission)
            self.stations.append((Station(mission, flying, 0.0, UTC0, None), flying))
        self.sent: list[bytes] = []

    def run(self) -> None:
        """Until the shadow ends."""
        steps = 0
        while not self.shadow.ended:
            steps += 1
            now = steps * STEP_S
            assert now < 900.0, f"the shadow is still {self.shadow.snapshot(now).phase}"
            self.world.advance(now)
            datagrams, publications = self.world.datagrams(), self.world.publications()
            for station, link in self.stations:
                for sysid, data in datagrams:
                    link.receive_datagram(data, Address("memory", sysid), now)
                for topic, payload in publications:
                    station.message(topic, payload, now)
                if now >= station.next_wake():
                    station.wake(now)
                else:
                    station.settle(now)
                for data, (_, sysid, _) in link.datagrams():
                    self.world.receive_datagram(sysid, data)
                    if station is self.shadow:
                        self.sent.append(data)

    def computed(self) -> list[Command]:
        """Every command the shadow computed."""
        return [record for record in self.tape.records if isinstance(record, Command)]

    def require_only_inquiries(self) -> None:
        """Whatever it sent asks for information or for the time, but for its heartbeat."""
        parser = dialect.MAVLink(None)
        messages = [message for data in self.sent for message in parser.parse_buffer(data)]
        kinds = {message.get_type() for message in messages}
        assert kinds == {"HEARTBEAT", "TIMESYNC", "COMMAND_LONG"}
        asked = {m.command for m in messages if m.get_type() == "COMMAND_LONG"}
        assert asked == INQUIRIES


def test_a_shadow_of_a_flight_computes_a_whole_mission_and_sends_no_command() -> None:
    rehearsal = Rehearsal(is_flown=True)
    rehearsal.run()
    assert rehearsal.shadow.controller.result[0] == "located"
    rehearsal.require_only_inquiries()
    computed = rehearsal.computed()
    launch = [(type(c), c.sysid) for c in computed if isinstance(c, SetMode | Arm | TakeOff)]
    assert launch == [(kind, s) for s in (1, 2, 3, 4) for kind in (SetMode, Arm, TakeOff)]
    assert sum(isinstance(command, GoTo) for command in computed) > 1000


def test_a_rehearsal_on_the_ground_lifts_nobody() -> None:
    """Receivers on the ground hear nothing, and that is what ends it."""
    rehearsal = Rehearsal(is_flown=False)
    rehearsal.run()
    assert rehearsal.shadow.controller.result[0] == "feed_silent"
    rehearsal.require_only_inquiries()
    assert {c.sysid for c in rehearsal.computed() if isinstance(c, GoTo)} == {1, 2, 3, 4}
    assert not any(
        vehicle.is_armed for vehicle in rehearsal.shadow.controller.fleet.vehicles.values()
    )
    assert all(rehearsal.world.vehicle_state(sysid).on_ground for sysid in (1, 2, 3, 4))
