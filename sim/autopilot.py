"""One ArduCopter-mannered autopilot: bytes in, bytes out, and a command for the airframe.

Sans-I/O: :meth:`Autopilot.receive` takes a datagram, :meth:`Autopilot.advance` one step of
time, :meth:`Autopilot.datagrams` hands out what is to be sent. The manners are those measured
on ArduCopter 4.7 in SITL; what is not simulated (parameters, missions, fences, failsafes of the
autopilot itself) answers as an unknown command or not at all.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from sim import modes, setpoints
from sim.config import VehicleConfig
from sim.dynamics import Command, State
from sim.guidance import Descend, TakeOff, Task
from sim.mavlink import (
    ACCEPTED,
    AUTOPILOT_COMPONENT,
    DENIED,
    FAILED,
    UNSUPPORTED,
    Codec,
    Message,
    dialect,
)
from sim.modes import MODES, FlightMode
from sim.navigation import PositionError
from sim.onboard import ARMABLE_S, HOME_SET_S, Onboard
from sim.streams import Streams
from sim.telemetry import MESSAGES, heartbeat
from swarmctl.frames import LocalFrame

AUTO_DISARM_S = 10.0
"""DISARM_DELAY: armed on the ground with nothing to do for so long, it disarms."""
TOUCHDOWN_S = 1.0
"""Ground contact for so long is a landing."""
FORCE_DISARM = 21196.0
"""``param2`` that disarms in the air."""
YAW_RATE_RADPS = math.radians(90.0)
ENDURANCE_S = 1800.0
"""A full battery lasts so long with the motors armed."""
STANDBY_S = 50.0 * ENDURANCE_S
"""A full battery lasts so long with the motors disarmed."""


class Request(NamedTuple):
    """COMMAND_LONG and COMMAND_INT, as far as they are the same."""

    param1: float
    param2: float
    z: float
    frame: int


class Autopilot:
    """The autopilot of one UAV, listening from power-up on.

    Args:
        config: The UAV.
        frame: Frame of the simulated world.
        utc_start_s: UTC at simulation time 0, s.
        navigation: Error of its positions; the caller moves it on.
        truth: True state at the start.
    """

    def __init__(
        self,
        config: VehicleConfig,
        frame: LocalFrame,
        utc_start_s: float,
        navigation: PositionError,
        truth: State,
    ) -> None:
        self._me = Onboard(config, frame, utc_start_s, navigation, truth)
        self._codec = Codec(config.sysid)
        self._streams = Streams(config.boot_delay_s)
        self._commands: dict[int, Callable[[Request], int]] = {
            dialect.MAV_CMD_DO_SET_MODE: self._do_set_mode,
            dialect.MAV_CMD_COMPONENT_ARM_DISARM: self._do_arm_disarm,
            dialect.MAV_CMD_NAV_TAKEOFF: self._do_take_off,
            dialect.MAV_CMD_NAV_LAND: lambda _: self._enter(modes.LAND),
            dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda _: self._enter(modes.RTL),
            dialect.MAV_CMD_SET_MESSAGE_INTERVAL: self._do_set_message_interval,
            dialect.MAV_CMD_REQUEST_MESSAGE: self._do_request_message,
        }
        self._messages: dict[int, Callable[[Message, float], None]] = {
            dialect.MAVLINK_MSG_ID_COMMAND_LONG: self._on_command,
            dialect.MAVLINK_MSG_ID_COMMAND_INT: self._on_command,
            dialect.MAVLINK_MSG_ID_SET_MODE: self._on_set_mode,
            dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT: self._on_setpoint,
            dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED: self._on_setpoint,
            dialect.MAVLINK_MSG_ID_TIMESYNC: self._on_timesync,
        }
        self._after_ack: list[Message] = []

    # --- The three doors ---------------------------------------------------------------

    def receive(self, datagram: bytes, now_s: float) -> None:
        """Take a datagram from whoever sends one.

        Args:
            datagram: Any bytes; what is not a message for this vehicle is ignored.
            now_s: Simulation time, s.
        """
        if now_s < self._me.config.boot_delay_s:
            return
        for message in self._codec.decode(datagram):
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
        me = self._me
        step_s = now_s - me.now_s
        me.now_s, me.truth = now_s, truth
        if me.home_enu is None and me.boot_s >= HOME_SET_S:
            me.set_home_here()
            me.origin_enu = me.home_enu
        me.charge = max(0.0, me.charge - step_s / (ENDURANCE_S if me.armed else STANDBY_S))
        self._detect_landing()
        self._disarm_on_ground()
        self._turn(step_s)
        command = self._fly()
        for message_id in self._streams.due(now_s):
            self._send_telemetry(message_id)
        return command

    def datagrams(self) -> list[bytes]:
        """What is to be sent, in order, one message each; empties the queue."""
        return self._codec.drain()

    # --- Flying ------------------------------------------------------------------------

    def _fly(self) -> Command | None:
        me = self._me
        if not me.armed or me.home_enu is None:
            return None
        if me.landed and not isinstance(me.task, TakeOff):
            return None  # on the ground only a take-off spins the rotors up
        me.task, command = me.task.fly(me.situation(me.home_enu))
        return command

    def _detect_landing(self) -> None:
        me = self._me
        if not me.truth.on_ground:
            me.contact_s, me.landed = None, False
            return
        if me.contact_s is None:
            me.contact_s = me.now_s
        if not me.landed and me.now_s - me.contact_s >= TOUCHDOWN_S:
            me.landed, me.idle_since_s = True, me.now_s

    def _disarm_on_ground(self) -> None:
        me = self._me
        if not me.armed or not me.landed or isinstance(me.task, TakeOff):
            return
        landing = isinstance(me.task, Descend) and me.task.landing
        if landing or me.now_s - me.idle_since_s >= AUTO_DISARM_S:
            me.armed = False

    def _turn(self, step_s: float) -> None:
        me = self._me
        if me.yaw_rad == me.wanted_yaw_rad:
            return
        to_go = math.remainder(me.wanted_yaw_rad - me.yaw_rad, 2.0 * math.pi)
        if abs(to_go) <= YAW_RATE_RADPS * step_s:
            me.yaw_rad = me.wanted_yaw_rad
        else:
            me.yaw_rad += math.copysign(YAW_RATE_RADPS * step_s, to_go)

    def _enter(self, mode: FlightMode) -> int:
        if mode is not self._me.mode:
            self._me.mode, self._me.task = mode, mode.task
            self._after_ack.append(heartbeat(self._me))
        return ACCEPTED

    # --- Messages ----------------------------------------------------------------------

    def _is_for_me(self, message: Message) -> bool:
        """Whether target system and component, 0 meaning everyone, name this autopilot."""
        # TIMESYNC names no target, SET_MODE no component.
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        return system in {0, self._me.config.sysid} and component in {0, AUTOPILOT_COMPONENT}

    def _on_command(self, message: Message, _now_s: float) -> None:
        if message.get_msgId() == dialect.MAVLINK_MSG_ID_COMMAND_INT:
            request = Request(message.param1, message.param2, message.z, message.frame)
        else:
            # ArduCopter reads the altitude of a COMMAND_LONG as relative to home.
            frame = dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT
            request = Request(message.param1, message.param2, message.param7, frame)
        handler = self._commands.get(message.command)
        result = UNSUPPORTED if handler is None else handler(request)
        self._codec.send(
            dialect.MAVLink_command_ack_message(
                message.command,
                result,
                0,
                0,
                message.get_srcSystem(),
                message.get_srcComponent(),
            )
        )
        self._flush_after_ack()

    def _on_set_mode(self, message: Message, _now_s: float) -> None:
        self._set_mode(message.base_mode, message.custom_mode)
        self._flush_after_ack()

    def _on_setpoint(self, message: Message, now_s: float) -> None:
        me = self._me
        if me.mode is not modes.GUIDED or me.home_enu is None or me.origin_enu is None:
            return
        task: Task
        if message.get_msgId() == dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT:
            task = setpoints.global_setpoint(message, me.frame, me.home_alt_amsl_m, now_s)
        else:
            task = setpoints.local_setpoint(
                message, me.origin_enu, me.position_enu, me.yaw_rad, now_s
            )
        me.task = task
        yaw = setpoints.setpoint_yaw(message, me.yaw_rad)
        if yaw is not None:
            me.wanted_yaw_rad = yaw

    def _on_timesync(self, message: Message, now_s: float) -> None:
        if message.tc1 == 0:  # otherwise it is somebody's answer
            boot_ns = round((now_s - self._me.config.boot_delay_s) * 1e9)
            self._codec.send(dialect.MAVLink_timesync_message(boot_ns, message.ts1))

    def _flush_after_ack(self) -> None:
        for message in self._after_ack:
            self._codec.send(message)
        self._after_ack.clear()

    def _send_telemetry(self, message_id: int) -> None:
        message = MESSAGES[message_id](self._me)
        if message is not None:
            self._codec.send(message)

    def _say(self, text: str) -> None:
        self._codec.send(
            dialect.MAVLink_statustext_message(dialect.MAV_SEVERITY_CRITICAL, text.encode())
        )

    # --- Commands ----------------------------------------------------------------------

    def _do_set_mode(self, request: Request) -> int:
        return self._set_mode(_whole(request.param1), _whole(request.param2))

    def _set_mode(self, base_mode: int, custom_mode: int) -> int:
        if base_mode < 0 or not base_mode & dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            return DENIED
        mode = MODES.get(custom_mode)
        if mode is None:
            return FAILED
        return self._enter(mode)

    def _do_arm_disarm(self, request: Request) -> int:
        if request.param1 == 1.0:
            return self._arm()
        if request.param1 == 0.0:
            return self._disarm(forced=request.param2 == FORCE_DISARM)
        return UNSUPPORTED

    def _arm(self) -> int:
        me = self._me
        if me.armed:
            return ACCEPTED
        if me.boot_s < ARMABLE_S:
            self._say("Arm: Need Position Estimate")
            return FAILED
        if me.config.refuses_arming:
            self._say("Arm: Compass not healthy")
            return FAILED
        if not me.mode.can_arm:
            self._say(f"Arm: {me.mode.name} mode not armable")
            return FAILED
        me.armed, me.idle_since_s = True, me.now_s
        me.set_home_here()
        me.task = me.mode.task
        return ACCEPTED

    def _disarm(self, *, forced: bool) -> int:
        me = self._me
        if me.armed and not me.landed and not forced:
            return FAILED
        me.armed = False
        return ACCEPTED

    def _do_take_off(self, request: Request) -> int:
        me = self._me
        if request.frame != dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT:
            return DENIED
        ready = me.armed and me.landed and me.mode is modes.GUIDED
        if not ready or me.home_enu is None:
            return FAILED
        x, y, z = me.position_enu
        target_up = me.home_enu[2] + request.z
        if not math.isfinite(target_up) or target_up <= z:
            return FAILED
        me.task = TakeOff((x, y, target_up), me.now_s)
        return ACCEPTED

    def _do_set_message_interval(self, request: Request) -> int:
        message_id = _whole(request.param1)
        if message_id not in MESSAGES or not math.isfinite(request.param2):
            return DENIED
        self._streams.set_interval(message_id, request.param2, self._me.now_s)
        return ACCEPTED

    def _do_request_message(self, request: Request) -> int:
        build = MESSAGES.get(_whole(request.param1))
        if build is None:
            return FAILED
        message = build(self._me)
        if message is not None:
            self._after_ack.append(message)
        return ACCEPTED


def _whole(value: float) -> int:
    """A parameter that carries a whole number; -1 where it does not carry a finite one."""
    return int(value) if math.isfinite(value) else -1
