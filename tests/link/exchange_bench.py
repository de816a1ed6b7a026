"""An exchange in virtual time, and requests to put to it."""

from __future__ import annotations

from swarmctl.events import CommandKind, CommandOutcome, Heartbeat, LandedState, Mode
from swarmctl.link.codec.messages import CommandAck, CommandLong, MavCmd
from swarmctl.link.command_protocol import CommandExchange
from swarmctl.link.command_request import Attempt, Request, State

ASK = CommandLong(MavCmd.REQUEST_MESSAGE, (242.0,))
ARM = CommandLong(MavCmd.COMPONENT_ARM_DISARM, (1.0,))
TAKE_OFF = CommandLong(MavCmd.NAV_TAKEOFF, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 20.0))
INTERVALS = tuple(
    CommandLong(MavCmd.SET_MESSAGE_INTERVAL, (float(message), 1e6)) for message in (33, 2, 242)
)


def shows_armed(state: State) -> bool:
    return isinstance(state, Heartbeat) and state.armed


def shows_airborne(state: State) -> bool:
    return isinstance(state, LandedState) and state.state == "taking_off"


REQUEST_HOME = Request(CommandKind.REQUEST_HOME, (ASK,))
REQUEST_ARM = Request(CommandKind.ARM, (ARM,), shows_armed, needs_state=True)
REQUEST_TAKE_OFF = Request(CommandKind.TAKE_OFF, (TAKE_OFF,), shows_airborne)
REQUEST_STREAMS = Request(CommandKind.STREAM_TELEMETRY, INTERVALS)


class Bench:
    """An exchange with a clock that moves from timer to timer."""

    def __init__(self) -> None:
        self.exchange = CommandExchange(3)
        self.now = 100.0
        self.sent: list[tuple[float, Attempt]] = []
        self.outcomes: list[CommandOutcome] = []

    def submit(self, *requests: Request) -> None:
        for request in requests:
            self.exchange.submit(request, self.now)
        self._drain()

    def ack(self, command: MavCmd, result: str = "ACCEPTED") -> None:
        self.exchange.on_ack(CommandAck(command, result, 255), self.now)
        self._drain()

    def heartbeat(self, *, armed: bool) -> None:
        state = Heartbeat(
            received_s=self.now,
            sysid=3,
            autopilot="ardupilot",
            is_multirotor=True,
            mode=Mode.OTHER,
            mode_name="STABILIZE",
            armed=armed,
        )
        self.exchange.on_state(state, self.now)
        self._drain()

    def taking_off(self) -> None:
        self.exchange.on_state(
            LandedState(received_s=self.now, sysid=3, state="taking_off"), self.now
        )
        self._drain()

    def text(self, text: str) -> None:
        self.exchange.on_text(text, self.now)
        self._drain()

    def wait(self, seconds: float) -> None:
        """Let time pass, serving timers when they are due and never otherwise."""
        end = self.now + seconds
        while self.exchange.next_timer() <= end:
            self.now = self.exchange.next_timer()
            self.exchange.handle_timer(self.now)
            self._drain()
        self.now = end

    def _drain(self) -> None:
        self.sent += [(self.now, attempt) for attempt in self.exchange.attempts()]
        self.outcomes += self.exchange.outcomes()

    @property
    def times_sent(self) -> list[float]:
        return [when - 100.0 for when, _ in self.sent]

    @property
    def results(self) -> list[tuple[str, str]]:
        return [(outcome.command, outcome.result) for outcome in self.outcomes]
