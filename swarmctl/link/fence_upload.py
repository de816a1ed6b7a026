"""Uploads a geofence to one vehicle through a lossy link, and reads it back.

The protocol is https://mavlink.io/en/services/mission.html with mission type FENCE. The vehicle
asks for the announced fence again and again until it has it, so an upload is announced again only
while the vehicle has not asked. After the vehicle has acknowledged the fence, it is read back.
"""

from __future__ import annotations

import math
from collections import deque
from enum import Enum, auto
from typing import Literal

from swarmctl.commands import UploadFence
from swarmctl.events import CommandKind, CommandOutcome
from swarmctl.link.codec.messages import (
    AskForItem,
    AskForPlan,
    EndPlan,
    FenceAck,
    FenceCount,
    FenceItem,
    FenceMessage,
    FenceRequest,
    PlanPacket,
    SendItem,
    StartPlan,
)

ANSWER_TIMEOUT_S = 1.0
"""Wait for an answer before the next try, s."""
TRIES = 4
"""Tries of one step before it is given up."""
UPLOAD_TIMEOUT_S = 10.0
"""Longest upload, s; the vehicle itself gives up after 8 s at the latest."""
QUIET_S = 3.0
"""A vehicle that stops asking for so many seconds has the item or is gone; reading back tells."""
POSITION_TOLERANCE_RAD = 2e-9
"""Two units on the wire, about a centimetre."""
RADIUS_TOLERANCE_M = 0.5
"""ArduPilot keeps the radius of a circle in whole metres."""


class _Stage(Enum):
    """What the exchange waits for."""

    NOTHING = auto()
    UPLOAD = auto()
    COUNT = auto()
    ITEM = auto()


class FenceExchange:
    """Uploads fences to one vehicle, one after the other; each ends in one CommandOutcome.

    The caller hands in what the vehicle says and the time, calls :meth:`handle_timer` when
    :meth:`next_timer` is due, and after any call sends :meth:`packets` and reports
    :meth:`outcomes`. All times are monotonic seconds.

    Args:
        sysid: System id of the vehicle.
    """

    def __init__(self, sysid: int) -> None:
        self._sysid = sysid
        self._queue: deque[UploadFence] = deque()
        self._packets: list[PlanPacket] = []
        self._outcomes: list[CommandOutcome] = []
        self._fence: UploadFence
        self._stage = _Stage.NOTHING
        self._question: PlanPacket
        self._tries = 0
        self._due_s = math.inf
        self._give_up_s = math.inf
        self._asked_for = False

    def submit(self, fence: UploadFence, now: float) -> None:
        """Upload a fence, after those before it."""
        self._queue.append(fence)
        if self._stage is _Stage.NOTHING:
            self._begin_next(now)

    def on_message(self, message: FenceMessage, now: float) -> None:
        """Take a message about the vehicle's fence."""
        match message:
            case FenceRequest() if self._stage is _Stage.UPLOAD:
                self._asked_for = True
                self._due_s = min(now + QUIET_S, self._give_up_s)
                if message.seq == 0:
                    self._packets.append(SendItem(self._fence))
            case FenceAck() if self._stage is _Stage.UPLOAD:
                if message.result == "ACCEPTED":
                    self._ask(_Stage.COUNT, AskForPlan(), now)
                else:
                    self._finish("refused", f"MISSION_ACK says {message.result}", now)
            case FenceCount() if self._stage is _Stage.COUNT:
                if message.count == 1:
                    self._ask(_Stage.ITEM, AskForItem(), now)
                else:
                    self._packets.append(EndPlan())
                    self._finish("refused", f"read back, it has {message.count} items, not 1", now)
            case FenceItem() if self._stage is _Stage.ITEM and message.seq == 0:
                self._packets.append(EndPlan())
                fault = self._difference(message)
                if fault:
                    self._finish("refused", f"read back, {fault}", now)
                else:
                    self._finish("accepted", "read back as it was sent", now)
            case _:
                pass  # repeated, or too late

    def handle_timer(self, now: float) -> None:
        """Ask again or give up, if :meth:`next_timer` is due."""
        if now < self._due_s:
            return
        if self._asked_for and now < self._give_up_s:
            self._ask(_Stage.COUNT, AskForPlan(), now)
        elif self._asked_for:
            self._finish("no_answer", "it asks for the fence again and again", now)
        elif self._tries < TRIES:
            self._try(now)
        else:
            what = {_Stage.UPLOAD: "MISSION_COUNT", _Stage.COUNT: "MISSION_REQUEST_LIST"}
            answered = what.get(self._stage, "MISSION_REQUEST_INT")
            self._finish("no_answer", f"no answer to {answered}", now)

    def next_timer(self) -> float:
        """When :meth:`handle_timer` is due; infinity for never."""
        return self._due_s

    def packets(self) -> list[PlanPacket]:
        """Drain what to send."""
        packets, self._packets = self._packets, []
        return packets

    def outcomes(self) -> list[CommandOutcome]:
        """Drain the outcomes."""
        outcomes, self._outcomes = self._outcomes, []
        return outcomes

    def _difference(self, item: FenceItem) -> str:
        sent = self._fence
        if not item.is_circle_inclusion:
            return f"it is MAV_CMD {item.command}, not an inclusion circle"
        if not abs(item.radius_m - sent.radius_m) <= RADIUS_TOLERANCE_M:  # NaN, too
            return f"its radius is {item.radius_m:g} m, not {sent.radius_m:g} m"
        offset = max(abs(item.lat_rad - sent.lat_rad), abs(item.lon_rad - sent.lon_rad))
        return "" if offset <= POSITION_TOLERANCE_RAD else "its centre is elsewhere"

    def _begin_next(self, now: float) -> None:
        if self._queue:
            self._fence = self._queue.popleft()
            self._give_up_s = now + UPLOAD_TIMEOUT_S
            self._ask(_Stage.UPLOAD, StartPlan(), now)
        else:
            self._stage = _Stage.NOTHING
            self._due_s = math.inf

    def _ask(self, stage: _Stage, question: PlanPacket, now: float) -> None:
        self._stage, self._question = stage, question
        self._tries, self._asked_for = 0, False
        self._try(now)

    def _try(self, now: float) -> None:
        self._tries += 1
        self._due_s = now + ANSWER_TIMEOUT_S
        self._packets.append(self._question)

    def _finish(
        self, result: Literal["accepted", "refused", "no_answer"], detail: str, now: float
    ) -> None:
        self._outcomes.append(
            CommandOutcome(
                received_s=now,
                sysid=self._sysid,
                command=CommandKind.UPLOAD_FENCE,
                result=result,
                detail=detail,
            )
        )
        self._asked_for = False
        self._begin_next(now)
