"""The ground station, sans I/O: vehicle link, feed, controller and recorder joined.

Both shells drive it, the asyncio one (:mod:`swarmctl.ops.live`) and the one on a virtual clock
(:mod:`swarmctl.ops.in_memory`).
"""

from __future__ import annotations

from typing import Protocol, TypedDict

from swarmctl.commands import Inquiry
from swarmctl.decisions import EstimateMade, Notice
from swarmctl.events import (
    FeedConnection,
    LinkConnection,
    Observation,
    OperatorRequest,
    Record,
)
from swarmctl.feed.intake import FeedIntake
from swarmctl.feed.truth import TruthIntake
from swarmctl.link.vehicle_link import VehicleLink
from swarmctl.mission.controller import Controller
from swarmctl.mission.mission_file import Mission
from swarmctl.mission.snapshot import Snapshot, take_snapshot
from swarmctl.ops.estimate_publication import EstimatePublication


class TrafficCounts(TypedDict):
    """What went in and out of a station; the meanings are those of ``FlightSummary``."""

    mavlink_messages_in: int
    mavlink_rejected: int
    setpoints_out: int
    setpoints_dropped: int
    feed_rejected: int
    rd_dropped: int
    rd_aside: int
    rd_repeated: int


class Recorder(Protocol):
    """Where a station records."""

    def record(self, record: Record, utc_s: float) -> None:
        """Keep a record made at ``utc_s``."""


class Station:
    """A ground station that flies one mission.

    Args:
        mission: The mission.
        link: Reaches the vehicles. Whoever made it moves its bytes.
        now: Monotonic time, s.
        utc_offset_s: The station's own UTC less its monotonic time, s; stamps the recording.
        recorder: Where everything is recorded; None for nowhere.
        hiccup_s: Silence that this computer may be to blame for, in the station's seconds.
        shadow: Every command is computed and recorded, but only requests for information are
            sent: others fly the vehicles.

    Attributes:
        controller: Decides.
        link: As above.
        intake: Reads the measurement feed.

    Raises:
        FormationError: If the formation does not fit the mission's limits.
    """

    def __init__(
        self,
        mission: Mission,
        link: VehicleLink,
        now: float,
        utc_offset_s: float,
        recorder: Recorder | None,
        hiccup_s: float = 0.0,
        *,
        shadow: bool = False,
    ) -> None:
        swarm = mission.swarm.name
        self.controller = Controller(mission, now, hiccup_s, shadow=shadow)
        self.link = link
        self.intake = FeedIntake(swarm, mission.swarm.sysids)
        self._truth = TruthIntake(swarm)
        self._estimates = EstimatePublication(swarm, mission.frame, now)
        self._shadow = shadow
        self._utc_offset_s = utc_offset_s
        self._recorder = recorder
        self._notices: list[Notice] = []

    @property
    def topics(self) -> tuple[str, ...]:
        """MQTT topics to subscribe to; the truth is for the recorder alone."""
        topics = self.intake.topics
        return topics if self._recorder is None else (*topics, *self._truth.topics)

    @property
    def ended(self) -> bool:
        """Whether the mission is over."""
        return self.controller.ended

    def connection(self, url: str, connected: bool, now: float) -> None:
        """A link that calls (TCP, a serial line) was lost, or is back."""
        self._observe(LinkConnection(received_s=now, url=url, connected=connected), now)

    def message(self, topic: str, payload: bytes, now: float) -> None:
        """Take an MQTT message; call :meth:`settle` after the last."""
        if topic in self._truth.topics:
            self._record_truth(topic, payload, now)
            return
        for event in self.intake.receive(topic, payload, now):
            self._observe(event, now)

    def broker_state(self, connected: bool, now: float) -> None:
        """The broker was lost, or is back."""
        self._observe(FeedConnection(received_s=now, connected=connected), now)

    def request_return(self, now: float) -> None:
        """The operator wants the swarm home; call :meth:`settle` after."""
        self._observe(OperatorRequest(received_s=now, request="return_home"), now)

    def wake(self, now: float) -> None:
        """Run the timers that are due."""
        if now >= self.link.next_timer():
            self.link.handle_timer(now)
        if now >= self.controller.next_tick():
            self.controller.tick(now)
        self.settle(now)

    def next_wake(self) -> float:
        """When :meth:`wake` is due, monotonic s."""
        return min(self.link.next_timer(), self.controller.next_tick())

    def settle(self, now: float) -> None:
        """Carry what has come in through controller and link until nothing is left to do."""
        controller, link, utc = self.controller, self.link, now + self._utc_offset_s
        recorder = self._recorder
        while True:
            events = link.events()
            for event in events:
                self._observe(event, now)
            for decision in controller.decisions():
                if recorder is not None:
                    recorder.record(decision, utc)
                if isinstance(decision, EstimateMade):
                    self._estimates.offer(decision, controller.fleet.utc(now), now)
                elif isinstance(decision, Notice):
                    self._notices.append(decision)
            commands = controller.commands()
            for command in commands:
                if recorder is not None:
                    recorder.record(command, utc)
                if not self._shadow or isinstance(command, Inquiry):
                    link.send(command, now)
            if not events and not commands:
                break

    def publications(self) -> list[tuple[str, bytes]]:
        """Drain the MQTT messages to publish, as (topic, payload)."""
        return self._estimates.drain()

    def notices(self) -> list[Notice]:
        """Drain the sentences for the operator."""
        drained, self._notices = self._notices, []
        return drained

    def snapshot(self, now: float) -> Snapshot:
        """The mission at this instant."""
        return take_snapshot(self.controller, now)

    def counts(self) -> TrafficCounts:
        """What went in and out, for the summary."""
        counts = self.controller.tracking.counts
        return {
            "mavlink_messages_in": self.link.messages_in,
            "setpoints_out": self.link.setpoints_out,
            "setpoints_dropped": self.link.setpoints_dropped,
            "mavlink_rejected": sum(self.link.rejected.values()),
            "feed_rejected": sum(self.intake.rejected.values()),
            "rd_dropped": counts.dropped,
            "rd_aside": counts.aside,
            "rd_repeated": counts.repeated,
        }

    def _record_truth(self, topic: str, payload: bytes, now: float) -> None:
        """Record the simulator's truth; nothing that flies sees it."""
        if self._recorder is not None:
            for truth in self._truth.receive(topic, payload, now):
                self._recorder.record(truth, now + self._utc_offset_s)

    def _observe(self, event: Observation, now: float) -> None:
        if self._recorder is not None:
            self._recorder.record(event, now + self._utc_offset_s)
        self.controller.receive(event, now)
