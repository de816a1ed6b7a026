"""How a simulated autopilot handles commands: who may command, what is acknowledged and done.

Any system id may command, as on real autopilots: the acknowledgement goes to whoever asked.
COMMAND_LONG, COMMAND_INT and the old SET_MODE are understood.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from typing import ClassVar, NamedTuple

from sim.autopilots.boot_sequence import REBOOT_S
from sim.autopilots.flight import Flight
from sim.autopilots.flight_modes import FlightMode
from sim.autopilots.message_intervals import MessageIntervals
from sim.autopilots.mission_flight import FlyLegs
from sim.autopilots.mission_items import MISSION
from sim.autopilots.onboard_state import OnboardState
from sim.autopilots.telemetry import Builders, autopilot_version
from sim.mavlink import ACCEPTED, DENIED, UNSUPPORTED, Message, dialect

FORCE = 21196.0
"""``param2`` of the command that disarms even in the air."""


class Request(NamedTuple):
    """What a COMMAND_LONG and a COMMAND_INT have in common."""

    param1: float
    param2: float
    param3: float
    z: float
    frame: int


class CommandHandler(Flight):
    """The commands of one vehicle.

    Args:
        onboard: State of the autopilot.
    """

    telemetry: ClassVar[Builders]

    def __init__(self, onboard: OnboardState) -> None:
        super().__init__(onboard)
        self._intervals = self._default_intervals()
        self._after_ack: list[Message] = []
        self._commands: dict[int, Callable[[Request], int]] = {
            dialect.MAV_CMD_DO_SET_MODE: self._do_set_mode,
            dialect.MAV_CMD_COMPONENT_ARM_DISARM: self._do_arm_disarm,
            dialect.MAV_CMD_NAV_TAKEOFF: self._do_take_off,
            dialect.MAV_CMD_NAV_LAND: lambda _: self._enter(self._land()),
            dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda _: self._enter(self._return()),
            dialect.MAV_CMD_MISSION_START: lambda _: self._start_mission(),
            dialect.MAV_CMD_DO_SET_MISSION_CURRENT: lambda request: self._go_to_item(
                _whole(request.param1)
            ),
            dialect.MAV_CMD_SET_MESSAGE_INTERVAL: self._do_set_message_interval,
            dialect.MAV_CMD_REQUEST_MESSAGE: self._do_request_message,
            dialect.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: self._do_request_capabilities,
            dialect.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: self._do_reboot,
        }

    # --- What a subclass fills in ------------------------------------------------------

    @abstractmethod
    def _land(self) -> FlightMode:
        """The mode that lands."""

    @abstractmethod
    def _return(self) -> FlightMode:
        """The mode that flies home."""

    @abstractmethod
    def _mode_asked_for(self, base_mode: int, main: int, sub: int) -> FlightMode | int:
        """The mode of a request, or the MAV_RESULT that refuses it."""

    @abstractmethod
    def _do_take_off(self, request: Request) -> int:
        """MAV_CMD_NAV_TAKEOFF."""

    @abstractmethod
    def _start_mission(self) -> int:
        """MAV_CMD_MISSION_START."""

    # --- Requests ----------------------------------------------------------------------

    def _on_command(self, message: Message, _now_s: float) -> None:
        if message.get_msgId() == dialect.MAVLINK_MSG_ID_COMMAND_INT:
            z, frame = message.z, message.frame
        else:
            # ArduCopter reads the altitude of a COMMAND_LONG as relative to home; PX4 asks for
            # no frame.
            z, frame = message.param7, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT
        request = Request(message.param1, message.param2, message.param3, z, frame)
        handler = self._commands.get(message.command)
        result = UNSUPPORTED if handler is None else handler(request)
        peer = message.get_srcSystem(), message.get_srcComponent()
        self._codec.send(dialect.MAVLink_command_ack_message(message.command, result, 0, 0, *peer))
        self._flush_after_ack()

    def _on_set_mode(self, message: Message, _now_s: float) -> None:
        main, sub = self._split_custom_mode(message.custom_mode)
        self._set_mode(message.base_mode, main, sub)
        self._flush_after_ack()

    def _split_custom_mode(self, custom_mode: int) -> tuple[int, int]:
        """Main mode and sub-mode of a ``custom_mode``."""
        return custom_mode, 0

    def _flush_after_ack(self) -> None:
        for message in self._after_ack:
            self._codec.send(message)
        self._after_ack.clear()

    def _send_telemetry(self, message_id: int) -> None:
        message = self.telemetry[message_id](self._me)
        if message is not None:
            self._codec.send(message)

    # --- Commands ----------------------------------------------------------------------

    def _do_set_mode(self, request: Request) -> int:
        return self._set_mode(
            _whole(request.param1), _whole(request.param2), _whole(request.param3)
        )

    def _set_mode(self, base_mode: int, main: int, sub: int) -> int:
        if base_mode < 0 or not base_mode & dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            return DENIED
        mode = self._mode_asked_for(base_mode, main, sub)
        return self._enter(mode) if isinstance(mode, FlightMode) else mode

    def _do_arm_disarm(self, request: Request) -> int:
        if request.param1 == 1.0:
            return self._arm()
        if request.param1 == 0.0:
            return self._disarm(forced=request.param2 == FORCE)
        return UNSUPPORTED

    def _do_set_message_interval(self, request: Request) -> int:
        message_id = _whole(request.param1)
        if message_id not in self.telemetry or not math.isfinite(request.param2):
            return self.traits.unknown_interval
        self._intervals.set_interval(message_id, request.param2, self._me.now_s)
        return ACCEPTED

    def _do_request_message(self, request: Request) -> int:
        build = self.telemetry.get(_whole(request.param1))
        if build is None:
            return self.traits.unknown_message
        message = build(self._me)
        if message is not None:
            self._after_ack.append(message)
        return ACCEPTED

    def _do_request_capabilities(self, _request: Request) -> int:
        self._after_ack.append(autopilot_version(self._me))
        return ACCEPTED

    def _do_reboot(self, request: Request) -> int:
        if request.param1 != 1.0:
            return UNSUPPORTED
        me = self._me
        if me.armed:
            return self.traits.refused
        heartbeat_s = me.boot_sequence.heartbeat_s
        me.power_up_s = me.now_s + REBOOT_S - heartbeat_s
        self._restart()
        return ACCEPTED

    def _go_to_item(self, seq: int) -> int:
        me = self._me
        if not 0 <= seq < len(self._uploads.stored(MISSION)):
            return DENIED
        self._notice_new_mission()
        me.mission_seq = seq
        if isinstance(me.task, FlyLegs):
            me.task = self._mission()
        return ACCEPTED

    def _restart(self) -> None:
        """Forget what does not outlast a reboot: all but parameters, missions and fences."""
        me = self._me
        me.mode = self.traits.first_mode
        me.task = me.mode.task(me.parameters)
        me.failsafe = False
        me.origin_enu = me.home_enu = None
        self._uploads.abort()
        self._after_ack.clear()
        self._intervals = self._default_intervals()

    def _default_intervals(self) -> MessageIntervals:
        me = self._me
        return MessageIntervals(me.power_up_s + me.boot_sequence.heartbeat_s, self.traits.unasked_s)


def _whole(value: float) -> int:
    """The whole number that a command's parameter carries; -1 if it is not finite."""
    return int(value) if math.isfinite(value) else -1
