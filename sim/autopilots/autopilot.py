"""What all simulated autopilots understand and say: bytes in, bytes out, a command to fly.

Sans-I/O: :meth:`Autopilot.receive` takes a datagram, :meth:`Autopilot.advance` one step of
time, :meth:`Autopilot.datagrams` hands out what is to be sent. A personality fills in the
traits measured on a real autopilot; what is not simulated (log and file transfer) answers as an
unknown command or not at all.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from typing import ClassVar, NamedTuple

from sim.autopilots.battery import Battery
from sim.autopilots.boot_sequence import REBOOT_S
from sim.autopilots.flight import Flight
from sim.autopilots.flight_modes import FlightMode
from sim.autopilots.message_intervals import MessageIntervals
from sim.autopilots.mission_flight import FlyLegs
from sim.autopilots.mission_items import MISSION
from sim.autopilots.onboard_state import Installation, OnboardState
from sim.autopilots.parameters import Parameters, ParameterServer
from sim.autopilots.telemetry import Builders, autopilot_version
from sim.dynamics import Command, State
from sim.mavlink import (
    ACCEPTED,
    AUTOPILOT_COMPONENT,
    DENIED,
    UNSUPPORTED,
    Message,
    dialect,
)
from swarmctl.errors import SimulationError

FORCE = 21196.0
"""``param2`` that disarms in the air."""


class Request(NamedTuple):
    """COMMAND_LONG and COMMAND_INT, as far as they are the same."""

    param1: float
    param2: float
    param3: float
    z: float
    frame: int


class Autopilot(Flight):
    """The autopilot of one UAV, listening from power-up on.

    Args:
        installation: What it is built into.
        parameters: Its parameters with their defaults.

    Raises:
        SimulationError: Its owner has set a parameter that it does not have.
    """

    telemetry: ClassVar[Builders]

    def __init__(self, installation: Installation, parameters: Parameters) -> None:
        config = installation.config
        for name, value in config.parameters:
            if name not in parameters:
                raise SimulationError(
                    f"The simulated UAV {config.sysid} has no parameter {name}: "
                    f"name one that its {config.autopilot} autopilot has."
                )
            parameters.assign(name, value)
        mode = self.traits.first_mode
        super().__init__(
            OnboardState(
                *installation,
                self.traits,
                parameters,
                mode,
                mode.task(parameters),
                config.boot_delay_s,
                Battery(config.charge),
            )
        )
        self._streams = self._fresh_streams()
        self._parameters = ParameterServer(
            parameters, self.traits.parameters_per_s, self._codec.send
        )
        self._gcs_heard_s: float | None = None
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
        self._messages: dict[int, Callable[[Message, float], None]] = {
            dialect.MAVLINK_MSG_ID_HEARTBEAT: self._on_heartbeat,
            dialect.MAVLINK_MSG_ID_COMMAND_LONG: self._on_command,
            dialect.MAVLINK_MSG_ID_COMMAND_INT: self._on_command,
            dialect.MAVLINK_MSG_ID_SET_MODE: self._on_set_mode,
            dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT: self._on_setpoint,
            dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED: self._on_setpoint,
            dialect.MAVLINK_MSG_ID_TIMESYNC: self._on_timesync,
            dialect.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: self._parameters.on_request_list,
            dialect.MAVLINK_MSG_ID_PARAM_REQUEST_READ: self._parameters.on_request_read,
            dialect.MAVLINK_MSG_ID_PARAM_SET: self._parameters.on_set,
            dialect.MAVLINK_MSG_ID_MISSION_COUNT: self._plans.on_count,
            dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT: self._plans.on_item,
            dialect.MAVLINK_MSG_ID_MISSION_REQUEST_LIST: lambda m, _: self._plans.on_request_list(
                m
            ),
            dialect.MAVLINK_MSG_ID_MISSION_REQUEST_INT: self._on_mission_request,
            dialect.MAVLINK_MSG_ID_MISSION_REQUEST: self._on_mission_request,
            dialect.MAVLINK_MSG_ID_MISSION_SET_CURRENT: lambda m, _: self._on_set_current(m),
            dialect.MAVLINK_MSG_ID_MISSION_CLEAR_ALL: lambda m, _: self._plans.on_clear_all(m),
        }

    # --- The three doors ---------------------------------------------------------------

    def receive(self, datagram: bytes, now_s: float) -> None:
        """Take a datagram from whoever sends one.

        Args:
            datagram: Any bytes; what is not a message for this vehicle is ignored.
            now_s: Simulation time, s.
        """
        for message in self._codec.decode(datagram):
            if now_s < self._me.power_up_s:  # a reboot may be among the messages
                return
            handler = self._messages.get(message.get_msgId())
            if handler is not None and self._is_for_me(message):
                handler(message, now_s)

    def advance(self, now_s: float, truth: State) -> Command | None:
        """Live through one time step; to be called at regular steps.

        Args:
            now_s: Simulation time, s.
            truth: True state of the airframe at that time.

        Returns:
            What the airframe is to do until the next call; None with the rotors idle.
        """
        step_s = now_s - self._me.now_s
        was_armed = self._me.armed
        command = self._live(now_s, truth)
        self._follow_mission(was_armed)
        self._flush_after_ack()
        self._plans.advance(now_s)
        self._parameters.advance(step_s)
        for message_id in self._streams.due(now_s):
            self._send_telemetry(message_id)
        return command

    def datagrams(self) -> list[bytes]:
        """What is to be sent, in order, one message each; empties the queue."""
        return self._codec.drain()

    # --- What a personality fills in ---------------------------------------------------

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

    @abstractmethod
    def _on_setpoint(self, message: Message, now_s: float) -> None:
        """SET_POSITION_TARGET_*."""

    @abstractmethod
    def _is_gcs(self, message: Message) -> bool:
        """Whether a HEARTBEAT is one whose absence is a failsafe."""

    # --- Messages ----------------------------------------------------------------------

    def _is_for_me(self, message: Message) -> bool:
        """Whether target system and component, 0 meaning everyone, name this autopilot."""
        # TIMESYNC and HEARTBEAT name no target, SET_MODE no component.
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        return system in {0, self._me.config.sysid} and component in {0, AUTOPILOT_COMPONENT}

    def _on_heartbeat(self, message: Message, now_s: float) -> None:
        if self._is_gcs(message):
            self._gcs_heard_s = now_s

    def _gcs_silent_s(self) -> float:
        """Time since the ground station was last heard, s; 0 if it never was."""
        return 0.0 if self._gcs_heard_s is None else self._me.now_s - self._gcs_heard_s

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

    def _on_timesync(self, message: Message, now_s: float) -> None:
        if message.tc1 == 0:  # otherwise it is somebody's answer
            me = self._me
            boot_ns = round(me.clock.elapsed_s(now_s - me.power_up_s) * 1e9)
            self._codec.send(dialect.MAVLink_timesync_message(boot_ns, message.ts1))

    def _on_mission_request(self, message: Message, _now_s: float) -> None:
        me = self._me
        home = None
        if me.home_enu is not None:
            lat, lon, alt = me.frame.to_geodetic(*me.home_enu)
            home = (round(math.degrees(lat) * 1e7), round(math.degrees(lon) * 1e7), alt)
        self._plans.on_request(message, home)

    # --- Mission -----------------------------------------------------------------------

    def _go_to_item(self, seq: int) -> int:
        me = self._me
        if not 0 <= seq < len(self._plans.stored(MISSION)):
            return DENIED
        self._look_at_plan()
        me.mission_seq = seq
        if isinstance(me.task, FlyLegs):
            me.task = self._mission()
        return ACCEPTED

    def _on_set_current(self, message: Message) -> None:
        if self._go_to_item(message.seq) == ACCEPTED:
            self._send_telemetry(dialect.MAVLINK_MSG_ID_MISSION_CURRENT)

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
        self._streams.set_interval(message_id, request.param2, self._me.now_s)
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
        # It is acknowledged, and heard of again when it has started.
        heartbeat_s = me.boot_sequence.heartbeat_s
        me.power_up_s = me.now_s + REBOOT_S - heartbeat_s
        self._restart()
        return ACCEPTED

    def _restart(self) -> None:
        """Forget what does not outlast a reboot: all but parameters and plans."""
        me = self._me
        me.mode = self.traits.first_mode
        me.task = me.mode.task(me.parameters)
        me.failsafe = False
        me.origin_enu = me.home_enu = None
        self._plans.abort()
        self._parameters.abort()
        self._gcs_heard_s = None
        self._after_ack.clear()
        self._streams = self._fresh_streams()

    def _fresh_streams(self) -> MessageIntervals:
        me = self._me
        return MessageIntervals(me.power_up_s + me.boot_sequence.heartbeat_s, self.traits.unasked_s)


def _whole(value: float) -> int:
    """A parameter that carries a whole number; -1 where it does not carry a finite one."""
    return int(value) if math.isfinite(value) else -1
