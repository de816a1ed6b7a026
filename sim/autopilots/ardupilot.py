"""The simulated ArduCopter, as measured on 4.7 in development, in SITL."""

from __future__ import annotations

import math
from typing import ClassVar

from sim.autopilots import ardupilot_setpoints, boot_sequence, message_intervals, telemetry
from sim.autopilots.ardupilot_failsafes import ArduPilotFailsafes
from sim.autopilots.ardupilot_fence import CIRCLE, MAX_ALT, POLYGON, FenceWatch, names
from sim.autopilots.ardupilot_modes import (
    AUTO,
    GUIDED,
    LAND,
    MODES,
    RTL,
    STABILIZE,
    homing,
    landing,
)
from sim.autopilots.ardupilot_parameters import parameters
from sim.autopilots.autopilot import Autopilot
from sim.autopilots.command_handler import Request
from sim.autopilots.flight_modes import FlightMode
from sim.autopilots.flight_tasks import FlyAcceleration, FlyTo, FlyVelocity, Task
from sim.autopilots.geofence import Fence
from sim.autopilots.mission_flight import FlyLegs, Pace
from sim.autopilots.mission_protocol import UploadTraits
from sim.autopilots.onboard_state import Installation
from sim.autopilots.takeoff_and_landing import Descend, TakeOff
from sim.autopilots.telemetry import home_position
from sim.autopilots.traits import CAPABILITIES, Traits
from sim.mavlink import ACCEPTED, DENIED, FAILED, Message, dialect
from swarmctl.units import Vector

SPOOL_UP_S = 3.35
"""Time from the take-off command to the first movement, s."""
RESTRAINED = (FlyVelocity, FlyAcceleration)
"""Tasks that are slowed down at the fence; a position beyond the fence is ignored."""

_SINCE_4_0 = (dialect.MAV_CMD_SET_MESSAGE_INTERVAL, dialect.MAV_CMD_REQUEST_MESSAGE)
"""Commands that ArduPilot before 4.0 does not know."""

TRAITS = Traits(
    autopilot=dialect.MAV_AUTOPILOT_ARDUPILOTMEGA,
    flight_sw_version=4 << 24 | 7 << 16 | dialect.FIRMWARE_VERSION_TYPE_OFFICIAL,
    capabilities=CAPABILITIES | dialect.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT,
    uid_base=0x53494D00,
    boot=boot_sequence.ARDUPILOT,
    first_mode=STABILIZE,
    always_healthy=dialect.MAV_SYS_STATUS_GEOFENCE,
    unasked_s=message_intervals.ARDUPILOT,
    refused=FAILED,
    unknown_message=FAILED,
    unknown_interval=DENIED,
    parameters_per_s=1500.0,
)


class ArduPilot(Autopilot):
    """ArduCopter.

    Args:
        installation: What the vehicle gives it.
    """

    traits = TRAITS
    transfer = UploadTraits(
        asks_int=False, repeat_s=1.0, give_up_s=8.0, says_so=True, home_is_first=True
    )
    telemetry: ClassVar[telemetry.Builders] = telemetry.ARDUPILOT

    def __init__(self, installation: Installation) -> None:
        config = installation.config
        super().__init__(installation, parameters(config.parameter_names, config.sysid))
        self._failsafes = ArduPilotFailsafes(self._me, self._say, self._enter)
        self._fence_watch = FenceWatch(self._me, self._say, self._enter)
        self._messages[dialect.MAVLINK_MSG_ID_REQUEST_DATA_STREAM] = self._on_request_data_stream
        self._commands[dialect.MAV_CMD_GET_HOME_POSITION] = self._do_get_home_position
        if not config.knows_intervals:
            for command in _SINCE_4_0:
                del self._commands[command]
        self._commands[dialect.MAV_CMD_DO_FENCE_ENABLE] = self._do_fence_enable

    # --- Failsafes and fences ----------------------------------------------------------

    def _watch(self) -> None:
        me, parameters = self._me, self._me.parameters
        me.gps_ok = me.gps_ok and parameters["SIM_GPS1_ENABLE"] == 1.0
        me.battery.full_v = parameters["SIM_BATT_VOLTAGE"]
        self._failsafes.watch(self._gcs_silent_s())
        if self.fences() or self._fence_watch.breached:
            self._fence_watch.watch(self._beyond_m())
        me.failsafe = self._failsafes.active

    def _build_fences(self) -> dict[str, Fence]:
        me, parameters = self._me, self._me.parameters
        if parameters["FENCE_ENABLE"] != 1.0 or me.home_enu is None:
            return {}
        ceiling_up_m = me.home_enu[2] + parameters["FENCE_ALT_MAX"]
        fences = {
            MAX_ALT: Fence(ceiling_up_m=ceiling_up_m),
            CIRCLE: self._home_circle(parameters["FENCE_RADIUS"]),
            POLYGON: self._uploaded_fence(),
        }
        kinds = int(parameters["FENCE_TYPE"])
        return {name: fence for bit, (name, fence) in enumerate(fences.items()) if kinds >> bit & 1}

    def _restrained(self, velocity_enu: Vector) -> Vector:
        me = self._me
        here, margin_m = me.position_enu, me.parameters["FENCE_MARGIN"]
        if isinstance(me.task, RESTRAINED):
            for fence in self.fences().values():
                if fence.contains(here):  # outside, the failsafe acts instead
                    velocity_enu = fence.restrain(here, velocity_enu, margin_m)
        return velocity_enu

    def _do_fence_enable(self, request: Request) -> int:
        if request.param1 not in {0.0, 1.0}:
            return DENIED
        self._me.parameters.assign("FENCE_ENABLE", request.param1)
        return ACCEPTED

    def _is_gcs(self, message: Message) -> bool:
        return bool(message.get_srcSystem() == self._me.parameters["MAV_GCS_SYSID"])

    # --- Modes -------------------------------------------------------------------------

    def _land(self) -> FlightMode:
        return LAND

    def _return(self) -> FlightMode:
        return RTL

    def _mode_asked_for(self, base_mode: int, main: int, sub: int) -> FlightMode | int:
        return MODES.get(main, FAILED)

    def _enter(self, mode: FlightMode) -> int:
        me = self._me
        if mode is me.mode:
            return ACCEPTED
        if mode is AUTO and not self._may_enter_auto():
            return FAILED
        if self._fence_watch.forbids_mode_change():
            text = f"Mode change to {mode.name} failed: in fence recovery"
            self._say(text, dialect.MAV_SEVERITY_WARNING)
            return FAILED
        super()._enter(mode)
        self._after_ack.append(telemetry.heartbeat(me))
        self._fence_watch.mode_changed()
        return ACCEPTED

    # --- Mission -----------------------------------------------------------------------

    def _may_enter_auto(self) -> bool:
        me, legs = self._me, self._mission().legs
        if legs and me.armed and me.landed and legs[0].kind != "take_off":
            self._say("Auto: Missing Takeoff Cmd")
        elif legs:
            return True
        self._say("Mode change to AUTO failed: init failed", dialect.MAV_SEVERITY_WARNING)
        return False

    def _task_of(self, mode: FlightMode) -> Task:
        # On the ground AUTO waits for MISSION_START.
        return super()._task_of(mode) if mode is not AUTO or self._me.landed else self._mission()

    def _start_mission(self) -> int:
        me = self._me
        result = self._enter(AUTO) if me.armed else FAILED
        if result == ACCEPTED and not isinstance(me.task, FlyLegs):
            me.task = self._mission()
        return result

    def _pace(self) -> Pace:
        parameters = self._me.parameters
        return Pace(
            climb_mps=0.01 * parameters["WPNAV_SPEED_UP"],
            spool_up_s=SPOOL_UP_S,
            radius_m=0.01 * parameters["WPNAV_RADIUS"],
            landing=landing(parameters),
            homing=homing(parameters),
        )

    # --- Arming and take-off -----------------------------------------------------------

    def _arming_refusal(self) -> str | None:
        me = self._me
        if not me.position_ok:
            return "Arm: Need Position Estimate"
        if me.config.faults.refuses_arming:
            return "Arm: Compass not healthy"
        if not me.mode.can_arm:
            return f"Arm: {me.mode.name} mode not armable"
        if self._fence_watch.breached:
            return f"Arm: Vehicle breaching {names(self._fence_watch.breached)}"
        return None

    def _idle_limit_s(self) -> float:
        task = self._me.doing
        is_landing = isinstance(task, Descend) and task.landing
        return 0.0 if is_landing else self._me.parameters["DISARM_DELAY"]

    def _may_lift(self) -> bool:
        task = self._me.task
        return isinstance(self._me.doing, TakeOff) or (isinstance(task, FlyLegs) and task.lifts)

    def _do_take_off(self, request: Request) -> int:
        me = self._me
        if request.frame != dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT:
            return DENIED
        ready = me.armed and me.landed and me.mode is GUIDED
        if not ready or me.home_enu is None:
            return FAILED
        x, y, z = me.position_enu
        target_up = me.home_enu[2] + request.z
        if not math.isfinite(target_up) or target_up <= z:
            return FAILED
        climb_mps = 0.01 * me.parameters["WPNAV_SPEED_UP"]
        me.task = TakeOff((x, y, target_up), me.now_s, SPOOL_UP_S, climb_mps)
        return ACCEPTED

    def _speed_limit_mps(self) -> float:
        return 0.01 * self._me.parameters["WPNAV_SPEED"]

    # --- Messages ----------------------------------------------------------------------

    def _on_setpoint(self, message: Message, now_s: float) -> None:
        me = self._me
        if me.mode is not GUIDED or me.home_enu is None or me.origin_enu is None:
            return
        timeout_s = me.parameters["GUID_TIMEOUT"]
        if message.get_msgId() == dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT:
            task = ardupilot_setpoints.global_setpoint(
                message, me.frame, me.home_alt_amsl_m, me.position_enu, now_s, timeout_s
            )
        else:
            task = ardupilot_setpoints.local_setpoint(
                message, me.origin_enu, me.position_enu, me.yaw_rad, now_s, timeout_s
            )
        if isinstance(task, FlyTo) and not self._allows(task.position_enu):
            return
        self._follow(task, message)

    def _do_get_home_position(self, _request: Request) -> int:
        home = home_position(self._me)
        if home is None:
            return FAILED
        self._after_ack.append(home)
        return ACCEPTED

    def _on_request_data_stream(self, message: Message, now_s: float) -> None:
        rate_hz = message.req_message_rate if message.start_stop else 0
        interval_us = 1e6 / rate_hz if rate_hz > 0 else -1.0
        everything = message.req_stream_id == dialect.MAV_DATA_STREAM_ALL
        for group, message_ids in message_intervals.STREAM_GROUPS.items():
            if everything or group == message.req_stream_id:
                for message_id in message_ids:
                    self._intervals.set_interval(message_id, interval_us, now_s)
