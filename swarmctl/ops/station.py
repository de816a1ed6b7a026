"""The ground station, sans I/O: link, feed, controller and recorder joined.

Both shells drive it, the asyncio one (:mod:`swarmctl.ops.live`) and the one on a virtual clock
(:mod:`swarmctl.ops.in_memory`): bytes in with the time, bytes out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol, TypedDict

import msgspec
import numpy as np

from swarmctl.commands import Inquiry
from swarmctl.decisions import Estimate, Notice
from swarmctl.estimation.bounds.consistency import ellipse
from swarmctl.events import (
    EmitterTruth,
    FeedConnection,
    LinkConnection,
    Observation,
    OperatorRequest,
    ReceiverTruth,
    Record,
)
from swarmctl.feed.intake import FeedIntake, decode_receivers_truth, decode_truth
from swarmctl.feed.schema import (
    EstimateMessage,
    estimate_topic,
    receivers_truth_topic,
    truth_topic,
)
from swarmctl.link.codec.messages import Address
from swarmctl.link.mavlink_link import MavlinkLink
from swarmctl.link.signing import Signing
from swarmctl.link.vehicle_link import Backend
from swarmctl.mission.controller import Controller
from swarmctl.mission.mission_file import Mission
from swarmctl.mission.snapshot import Snapshot, take_snapshot
from swarmctl.units import CHI2_95_2DOF

ESTIMATE_PERIOD_S = 0.5
"""The estimate is published at most this often, station's s."""


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
    """Where a station records: every record and every MAVLink frame with its UTC, s."""

    def record(self, record: Record, utc_s: float) -> None:
        """Keep a record."""

    def frame(self, raw: bytes, utc_s: float) -> None:
        """Keep a MAVLink frame."""


class Station:
    """A ground station that flies one mission.

    Args:
        mission: The mission.
        now: Monotonic time, s.
        utc_offset_s: The station's own UTC less its monotonic time, s; stamps the recording.
        recorder: Where everything is recorded; None for nowhere.
        hiccup_s: Silence that this computer may be to blame for, in the station's seconds.
        shadow: Every command is computed and recorded, but only requests for information are
            sent: others fly the vehicles.
        signing: Signs MAVLink, and refuses what is not signed; None without a key.
        stations: Addresses of other ground stations that MAVLink is passed on to.
        backend: Reaches the vehicles instead of MAVLink of the station's own, and moves its bytes
            by itself.
        speedup: The station's seconds in one of the computer's, for the vehicles' clocks.

    Raises:
        FormationError: If the formation does not fit the mission's limits.
    """

    def __init__(
        self,
        mission: Mission,
        now: float,
        utc_offset_s: float,
        recorder: Recorder | None,
        hiccup_s: float = 0.0,
        *,
        shadow: bool = False,
        signing: Signing | None = None,
        stations: Sequence[Address] = (),
        backend: Backend[Any] | None = None,
        speedup: float = 1.0,
    ) -> None:
        sysids = mission.swarm.sysids
        self.controller = Controller(mission, now, hiccup_s, shadow=shadow)
        self._shadow = shadow
        self._mavlink = MavlinkLink(
            gcs_sysid=mission.swarm.gcs_sysid,
            vehicles=sysids,
            signing=signing,
            stations=stations,
            speedup=speedup,
        )
        self.link: Backend[Any] = backend or self._mavlink
        self.intake = FeedIntake(mission.swarm.name, sysids)
        self._frame = mission.frame
        self._utc_offset_s = utc_offset_s
        self._recorder = recorder
        self._swarm = mission.swarm.name
        self._truth_topics = (truth_topic(self._swarm), receivers_truth_topic(self._swarm))
        self._publish_at = now
        self._publications: list[tuple[str, bytes]] = []
        self._notices: list[Notice] = []

    @property
    def topics(self) -> tuple[str, ...]:
        """MQTT topics to subscribe to; the truth is for the recorder alone."""
        topics = self.intake.topics
        return topics if self._recorder is None else (*topics, *self._truth_topics)

    @property
    def ended(self) -> bool:
        """Whether the mission is over."""
        return self.controller.ended

    def opened(self, urls: Sequence[str], called: Sequence[Address], now: float) -> None:
        """The vehicles' endpoints are open.

        Args:
            urls: Their URLs.
            called: Addresses of those that call instead of listening.
            now: Monotonic time, s.
        """
        self._mavlink.listen(urls, now)
        for address in called:
            self._mavlink.open(address, now)

    def connection(self, address: Address, url: str, connected: bool, now: float) -> None:
        """A connection of an endpoint that calls was lost, or is back."""
        if connected:
            self._mavlink.open(address, now)
        else:
            self._mavlink.close(address)
        self._observe(LinkConnection(received_s=now, url=url, connected=connected), now)

    def datagram(self, data: bytes, address: Address, now: float) -> None:
        """Take a datagram, or whole frames of a stream; call :meth:`settle` after the last."""
        self._mavlink.receive_datagram(data, address, now)

    def message(self, topic: str, payload: bytes, now: float) -> None:
        """Take an MQTT message; call :meth:`settle` after the last."""
        if topic in self._truth_topics:
            for truth in self._truths(topic, payload, now):
                if self._recorder is not None:
                    self._recorder.record(truth, now + self._utc_offset_s)
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
                if isinstance(decision, Estimate) and now >= self._publish_at:
                    self._publish_at = now + ESTIMATE_PERIOD_S
                    self._publish(decision, now)
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
        if recorder is not None:
            for frame_s, raw in self._mavlink.traffic():
                recorder.frame(raw, frame_s + self._utc_offset_s)
        else:
            self._mavlink.traffic()

    def datagrams(self) -> list[tuple[bytes, Address]]:
        """Drain the datagrams to send."""
        return self._mavlink.datagrams()

    def publications(self) -> list[tuple[str, bytes]]:
        """Drain the MQTT messages to publish, as (topic, payload)."""
        drained, self._publications = self._publications, []
        return drained

    def notices(self) -> list[Notice]:
        """Drain the sentences for the operator."""
        drained, self._notices = self._notices, []
        return drained

    def snapshot(self, now: float) -> Snapshot:
        """The mission at this instant."""
        return take_snapshot(self.controller, now)

    def counts(self) -> TrafficCounts:
        """What went in and out, for the summary."""
        return {
            "mavlink_messages_in": self.link.messages_in,
            "setpoints_out": self.link.setpoints_out,
            "setpoints_dropped": self.link.setpoints_dropped,
            "mavlink_rejected": sum(self.link.rejected.values()),
            "feed_rejected": sum(self.intake.rejected.values()),
            "rd_dropped": self.controller.observer.dropped,
            "rd_aside": self.controller.observer.aside,
            "rd_repeated": self.controller.observer.repeated,
        }

    def _truths(
        self, topic: str, payload: bytes, now: float
    ) -> Sequence[EmitterTruth | ReceiverTruth]:
        if topic == self._truth_topics[1]:
            return decode_receivers_truth(payload, now)
        truth = decode_truth(payload, now)
        return [] if truth is None else [truth]

    def _observe(self, event: Observation, now: float) -> None:
        if self._recorder is not None:
            self._recorder.record(event, now + self._utc_offset_s)
        self.controller.receive(event, now)

    def _publish(self, estimate: Estimate, now: float) -> None:
        lat, lon, alt = self._frame.to_geodetic(*estimate.position_enu)
        utc = self.controller.fleet.utc(now)
        cov = np.array(estimate.covariance).reshape(6, 6)
        major, minor, angle = ellipse(cov)
        scale = math.sqrt(CHI2_95_2DOF)
        message = EstimateMessage(
            epoch_utc_s=estimate.epoch_utc_s,
            lat_deg=math.degrees(lat),
            lon_deg=math.degrees(lon),
            alt_amsl_m=alt,
            position_enu=estimate.position_enu,
            velocity_enu=estimate.velocity_enu,
            covariance_enu=tuple(cov[:3, :3].ravel().tolist()),
            ellipse_95=(scale * float(major), scale * float(minor), float(angle)),
            age_s=max(0.0, utc - estimate.epoch_utc_s) if utc is not None else 0.0,
        )
        self._publications.append((estimate_topic(self._swarm), msgspec.json.encode(message)))
