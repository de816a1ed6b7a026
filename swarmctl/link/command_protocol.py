"""The MAVLink command protocol for one vehicle: one command at a time, through a lossy link.

The protocol is https://mavlink.io/en/services/command.html; what it leaves open is decided
here. A COMMAND_ACK names only the MAV_CMD it answers, so an answer to an earlier try must not be
taken for an answer to the present one. An ACK says that the vehicle accepted the command, not that
it carried it out: where the vehicle's state shows the result, the state decides.
"""

from __future__ import annotations

import math
from collections import deque
from enum import Enum, auto
from typing import Literal

from swarmctl.events import CommandOutcome, Heartbeat
from swarmctl.link.codec.messages import CommandAck, CommandLong, DataStream
from swarmctl.link.command_request import Attempt, Request, State

ACK_TIMEOUT_S = 1.0
"""Wait for a COMMAND_ACK before the next try, s."""
TRIES = 8
"""Tries before a command counts as unanswered. Over a radio that loses every fifth packet each
way, a try is answered with probability 0.64: with eight tries one command in 3500 is given up, with
four it would be one in sixty, too many for a swarm's take-off."""
PROGRESS_TIMEOUT_S = 5.0
"""Wait after MAV_RESULT_IN_PROGRESS for the next answer, s."""
STATE_TIMEOUT_S = 6.0
"""Wait after the ACK for the state that shows the command done, s: six heartbeats. ArduCopter's
landed state changes 3.4 s after a take-off command, and its next reports may be lost."""
REASON_TIMEOUT_S = 0.3
"""Wait after a refusal for its reason, s: ArduPilot queues the STATUSTEXT, but not the ACK."""
BUSY_RETRY_S = 1.0
"""Wait after TEMPORARILY_REJECTED before the next try, s."""
BUSY_TRIES = 5
"""After so many times TEMPORARILY_REJECTED, the command counts as refused."""
REASON_AGE_S = 2.0
"""A STATUSTEXT older than this does not explain a refusal, s."""


class _Stage(Enum):
    """What the exchange waits for."""

    NOTHING = auto()
    ACK = auto()
    END_OF_PROGRESS = auto()
    READINESS = auto()
    STATE = auto()
    REASON = auto()


class CommandExchange:
    """Brings requests to one vehicle, in order, and ends each with exactly one outcome.

    The caller hands in what the vehicle says and the time, calls :meth:`handle_timer` when
    :meth:`next_timer` is due, and after any call sends :meth:`attempts` and reports
    :meth:`outcomes`. All times are monotonic seconds.

    Args:
        sysid: System id of the vehicle.
    """

    def __init__(self, sysid: int) -> None:
        self._sysid = sysid
        self._queue: deque[Request] = deque()
        self._attempts: list[Attempt] = []
        self._outcomes: list[CommandOutcome] = []
        self._request: Request
        self._stage = _Stage.NOTHING
        self._deadline_s = math.inf
        self._step = 0
        self._step_began_s = 0.0
        self._tries = 0
        self._acks = 0
        self._busy = 0
        self._refusal = ""
        self._replaced = ""
        self._text = ""
        self._text_s = -math.inf
        self._heartbeat: Heartbeat | None = None
        # Per MAV_CMD: answers to earlier tries that may still come, and until when.
        self._late_acks: dict[int, tuple[int, float]] = {}

    def submit(self, request: Request, now: float) -> None:
        """Queue a request; it leaves when those before it have ended.

        A request equal to one that still waits or is under way is not queued again; its outcome
        serves both. Over a bad radio the queue would otherwise grow without end.
        """
        under_way = () if self._stage is _Stage.NOTHING else (self._request,)
        alike = [r for r in (*under_way, *self._queue) if r.kind is request.kind]
        if alike and alike[-1].steps == request.steps:
            return
        self._queue.append(request)
        if self._stage is _Stage.NOTHING:
            self._begin_next(now)

    def on_ack(self, ack: CommandAck, now: float) -> None:
        """Take a COMMAND_ACK."""
        if self._stage is _Stage.NOTHING or ack.command != self._command.command:
            return
        waiting = self._stage in {_Stage.ACK, _Stage.END_OF_PROGRESS}
        if ack.result == "IN_PROGRESS":
            if waiting:
                self._wait(_Stage.END_OF_PROGRESS, now + PROGRESS_TIMEOUT_S)
            return
        self._acks += 1
        late, until_s = self._late_acks.get(ack.command, (0, 0.0))
        if late > 0 and now < until_s:
            self._late_acks[ack.command] = (late - 1, until_s)
        elif not waiting:
            pass
        elif ack.result == "ACCEPTED":
            self._accepted(now)
        elif self._is_optional:
            self._next_step(now)
        elif ack.result == "TEMPORARILY_REJECTED" and self._busy < BUSY_TRIES - 1:
            self._busy += 1
            self._wait(_Stage.READINESS, now + BUSY_RETRY_S)
        elif self._request.instead:
            self._replaced = (
                self._replaced or f"{self._command.command.name} {ack.result}: replaced"
            )
            self._go_another_way(self._request.instead[self._step : self._step + 1])
            self._next_step(now)
        else:
            self._refused(ack.result, now)

    def on_state(self, state: State, now: float) -> None:
        """Take a state that the vehicle shows."""
        if self._stage is _Stage.NOTHING:
            return
        if isinstance(state, Heartbeat):
            self._heartbeat = state
        if self._stage is _Stage.REASON and not self._may_be_done_already:
            return
        request = self._request
        if request.shown_by and self._step == len(request.steps) - 1 and request.shown_by(state):
            self._finish("accepted", "the vehicle's state shows it", now)

    def on_text(self, text: str, now: float) -> None:
        """Take a STATUSTEXT: it may explain a refusal."""
        self._text, self._text_s = text, now
        if self._stage is _Stage.REASON and not self._may_be_done_already:
            self._finish_refused(now)

    def handle_timer(self, now: float) -> None:
        """Retry or give up, if :meth:`next_timer` is due."""
        if now < self._deadline_s:
            return
        if self._stage is _Stage.READINESS:
            self._end_step(now)
            self._tries = self._acks = 0
            self._try(now)
        elif self._stage is _Stage.ACK and self._tries < TRIES:
            self._try(now)
        elif self._stage is _Stage.ACK and self._is_optional:
            self._next_step(now)
        elif self._stage is _Stage.ACK:
            waited_s = now - self._step_began_s
            # A vehicle that does not answer this step will not answer the next.
            self._go_another_way(self._request.instead[self._step :])
            self._finish("no_answer", f"no COMMAND_ACK to {TRIES} tries in {waited_s:.1f} s", now)
        elif self._stage is _Stage.END_OF_PROGRESS:
            waited = f"IN_PROGRESS, then no word for {PROGRESS_TIMEOUT_S:.0f} s"
            self._finish("no_answer", waited, now)
        elif self._stage is _Stage.REASON:
            self._finish_refused(now)
        elif self._heartbeat is None:
            self._finish(
                "no_answer", f"ACCEPTED, but no HEARTBEAT for {STATE_TIMEOUT_S:.0f} s", now
            )
        else:
            armed = "armed" if self._heartbeat.armed else "disarmed"
            shown = f"{self._heartbeat.mode_name} and {armed}"
            waited = f"ACCEPTED, but after {STATE_TIMEOUT_S:.0f} s HEARTBEAT shows {shown}"
            self._finish("refused", waited, now)

    def next_timer(self) -> float:
        """When :meth:`handle_timer` is due; infinity for never."""
        return self._deadline_s

    def attempts(self) -> list[Attempt]:
        """Drain what to send."""
        attempts, self._attempts = self._attempts, []
        return attempts

    def outcomes(self) -> list[CommandOutcome]:
        """Drain the outcomes."""
        outcomes, self._outcomes = self._outcomes, []
        return outcomes

    @property
    def _command(self) -> CommandLong:
        request = self._request
        mandatory = len(request.steps)
        if self._step < mandatory:
            return request.steps[self._step]
        return request.optional[self._step - mandatory]

    @property
    def _is_optional(self) -> bool:
        return self._step >= len(self._request.steps)

    @property
    def _is_last(self) -> bool:
        return self._step == len(self._request.steps) + len(self._request.optional) - 1

    @property
    def _may_be_done_already(self) -> bool:
        """Whether a refusal may mean that an earlier try was obeyed and its ACK was lost."""
        return self._tries > 1 and self._request.shown_by is not None

    def _wait(self, stage: _Stage, deadline_s: float) -> None:
        self._stage = stage
        self._deadline_s = deadline_s

    def _begin_next(self, now: float) -> None:
        if self._queue:
            self._request = self._queue.popleft()
            self._replaced = ""
            self._step = 0
            self._begin_step(now)
        else:
            self._wait(_Stage.NOTHING, math.inf)

    def _begin_step(self, now: float) -> None:
        self._step_began_s = now
        self._tries = 0
        self._acks = 0
        self._busy = 0
        self._try(now)

    def _try(self, now: float) -> None:
        self._wait(_Stage.ACK, now + ACK_TIMEOUT_S)
        self._attempts.append(Attempt(self._command, self._tries))
        self._tries += 1

    def _end_step(self, now: float) -> None:
        self._late_acks[self._command.command] = (self._tries - self._acks, now + ACK_TIMEOUT_S)

    def _accepted(self, now: float) -> None:
        if self._request.needs_state and self._is_last:
            self._heartbeat = None
            self._wait(_Stage.STATE, now + STATE_TIMEOUT_S)
        else:
            self._next_step(now)

    def _go_another_way(self, instead: tuple[CommandLong | DataStream | None, ...]) -> None:
        self._attempts += [Attempt(packet, 0) for packet in instead if packet is not None]

    def _next_step(self, now: float) -> None:
        if self._is_last:
            self._finish("accepted", self._replaced or "ACCEPTED", now)
            return
        self._end_step(now)
        self._step += 1
        self._begin_step(now)

    def _refused(self, result: str, now: float) -> None:
        self._refusal = result
        if self._may_be_done_already:
            self._wait(_Stage.REASON, now + STATE_TIMEOUT_S)
        elif self._has_reason(now):
            self._finish_refused(now)
        else:
            self._wait(_Stage.REASON, now + REASON_TIMEOUT_S)

    def _has_reason(self, now: float) -> bool:
        return self._text_s >= max(self._step_began_s, now - REASON_AGE_S)

    def _finish_refused(self, now: float) -> None:
        detail = self._refusal
        if len(self._request.steps) > 1:
            params = ", ".join(f"{param:.9g}" for param in self._command.params)
            detail += f" to {self._command.command.name}({params})"
        if self._has_reason(now):
            detail += f": {self._text}"
        self._finish("refused", detail, now)

    def _finish(
        self, result: Literal["accepted", "refused", "no_answer"], detail: str, now: float
    ) -> None:
        self._end_step(now)
        self._outcomes.append(
            CommandOutcome(
                received_s=now,
                sysid=self._sysid,
                command=self._request.kind,
                result=result,
                detail=detail,
            )
        )
        self._begin_next(now)
