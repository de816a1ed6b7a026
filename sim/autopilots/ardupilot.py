"""The ``ardupilot`` personality: ArduCopter as measured on 4.7 in development, in SITL."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import ClassVar

from sim.autopilots import ardupilot_fence, setpoints, telemetry
from sim.autopilots.ardupilot_fence import CIRCLE, GIVE_UP_M, MAX_ALT, POLYGON, FenceWatch
from sim.autopilots.ardupilot_modes import (
    AUTO,
    BATTERY_ACTIONS,
    BRAKE,
    FENCE_ACTIONS,
    GCS_ACTIONS,
    GUIDED,
    LAND,
    LOITER,
    MODES,
    POSHOLD,
    RTL,
    STABILIZE,
    homing,
    landing,
)
from sim.autopilots.ardupilot_parameters import parameters
from sim.autopilots.autopilot import Autopilot, Request
from sim.autopilots.flight_modes import FlightMode
from sim.autopilots.flight_tasks import (
    Descend,
    FlyAcceleration,
    FlyTo,
    FlyVelocity,
    TakeOff,
    Task,
)
from sim.autopilots.geofence import Fence
from sim.autopilots.mission_flight import FlyLegs, Pace
from sim.autopilots.mission_protocol import TransferManners
from sim.autopilots.onboard_state import CAPACITY_MAH, Fitting, Onboard
from sim.autopilots.telemetry import home_position
from sim.autopilots.traits import CAPABILITIES, Manners, Timeline
from sim.mavlink import ACCEPTED, DENIED, FAILED, Message, dialect
from swarmctl.units import Vector

SPOOL_UP_S = 3.35
"""From the take-off command to the first movement."""
GPS_LOSS_S = 8.0
"""Without GPS for so long it lands."""

RESTRAINED = (FlyVelocity, FlyAcceleration)
"""What is held back at the fence; positions beyond it are not taken at all."""

_STREAM_GROUPS = {
    dialect.MAV_DATA_STREAM_RAW_SENSORS: (),
    dialect.MAV_DATA_STREAM_EXTENDED_STATUS: (
        dialect.MAVLINK_MSG_ID_MISSION_CURRENT,
        dialect.MAVLINK_MSG_ID_SYS_STATUS,
        dialect.MAVLINK_MSG_ID_GPS_RAW_INT,
    ),
    dialect.MAV_DATA_STREAM_RC_CHANNELS: (),
    dialect.MAV_DATA_STREAM_POSITION: (
        dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    ),
    dialect.MAV_DATA_STREAM_EXTRA1: (dialect.MAVLINK_MSG_ID_ATTITUDE,),
    dialect.MAV_DATA_STREAM_EXTRA2: (dialect.MAVLINK_MSG_ID_VFR_HUD,),
    dialect.MAV_DATA_STREAM_EXTRA3: (
        dialect.MAVLINK_MSG_ID_SYSTEM_TIME,
        dialect.MAVLINK_MSG_ID_BATTERY_STATUS,
        dialect.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    ),
}
"""Messages of REQUEST_DATA_STREAM's groups."""

_SINCE_4_0 = (dialect.MAV_CMD_SET_MESSAGE_INTERVAL, dialect.MAV_CMD_REQUEST_MESSAGE)
"""Commands that older firmware does not know."""

MANNERS = Manners(
    autopilot=dialect.MAV_AUTOPILOT_ARDUPILOTMEGA,
    flight_sw_version=4 << 24 | 7 << 16 | dialect.FIRMWARE_VERSION_TYPE_OFFICIAL,
    capabilities=CAPABILITIES | dialect.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT,
    uid_base=0x53494D00,
    boot=Timeline(heartbeat_s=1.0, gps_fix_s=10.0, home_set_s=20.0, armable_s=43.0),
    first_mode=STABILIZE,
    always_healthy=dialect.MAV_SYS_STATUS_GEOFENCE,
    streams={
        dialect.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
        dialect.MAVLINK_MSG_ID_TIMESYNC: 10.0,
    },
    refused=FAILED,
    unknown_message=FAILED,
    unknown_interval=DENIED,
    parameters_per_s=1500.0,
)


class ArduPilot(Autopilot):
    """ArduCopter.

    Args:
        fitting: What it is built into.
    """

    manners = MANNERS
    transfer = TransferManners(
        asks_int=False, repeat_s=1.0, give_up_s=8.0, says_so=True, home_is_first=True
    )
    telemetry: ClassVar[Mapping[int, Callable[[Onboard], Message | None]]] = telemetry.ARDUPILOT

    def __init__(self, fitting: Fitting) -> None:
        config = fitting.config
        super().__init__(fitting, parameters(config.parameter_names, config.sysid))
        self._gcs_lost = self._battery_low = self._battery_critical = False
        self._fence_watch = FenceWatch()
        self._low_since_s: float | None = None
        self._critical_since_s: float | None = None
        self._gps_lost_since_s: float | None = None
        self._messages[dialect.MAVLINK_MSG_ID_REQUEST_DATA_STREAM] = self._on_request_data_stream
        self._commands[dialect.MAV_CMD_GET_HOME_POSITION] = self._do_get_home_position
        if not config.knows_intervals:
            for command in _SINCE_4_0:
                del self._commands[command]
        self._commands[dialect.MAV_CMD_DO_FENCE_ENABLE] = self._do_fence_enable

    # --- Failsafes ---------------------------------------------------------------------

    def _watch(self) -> None:
        me, parameters = self._me, self._me.parameters
        me.gps_ok = me.gps_ok and parameters["SIM_GPS1_ENABLE"] == 1.0
        me.full_v = parameters["SIM_BATT_VOLTAGE"]
        self._watch_gcs()
        self._watch_battery()
        self._watch_gps()
        self._watch_fence()
        me.failsafe = self._gcs_lost or self._battery_low or self._battery_critical

    def _watch_gcs(self) -> None:
        parameters = self._me.parameters
        enabled = int(parameters["FS_GCS_ENABLE"])
        lost = enabled != 0 and self._gcs_silent_s() > parameters["FS_GCS_TIMEOUT"]
        if lost and not self._gcs_lost and self._me.armed:
            self._fail(GCS_ACTIONS.get(enabled), "GCS Failsafe")
        elif self._gcs_lost and not lost:
            self._say("GCS Failsafe Cleared", dialect.MAV_SEVERITY_WARNING)
        self._gcs_lost = lost and (self._gcs_lost or self._me.armed)

    def _watch_battery(self) -> None:
        me, parameters = self._me, self._me.parameters
        left_mah = me.charge * CAPACITY_MAH
        low = me.voltage_v < parameters["BATT_LOW_VOLT"] or left_mah < parameters["BATT_LOW_MAH"]
        critical = (
            me.voltage_v < parameters["BATT_CRT_VOLT"] or left_mah < parameters["BATT_CRT_MAH"]
        )
        self._low_since_s = _since(self._low_since_s, low, me.now_s)
        self._critical_since_s = _since(self._critical_since_s, critical, me.now_s)
        timer_s = parameters["BATT_LOW_TIMER"]
        if not me.armed:
            self._battery_low = self._battery_critical = False
            return
        if not self._battery_critical and _for(self._critical_since_s, me.now_s, timer_s):
            self._battery_critical = self._battery_low = True
            action = BATTERY_ACTIONS.get(int(parameters["BATT_FS_CRT_ACT"]))
            self._fail(action, "Battery 1 is critical")
        if not self._battery_low and _for(self._low_since_s, me.now_s, timer_s):
            self._battery_low = True
            self._fail(BATTERY_ACTIONS.get(int(parameters["BATT_FS_LOW_ACT"])), "Battery 1 is low")

    def _watch_gps(self) -> None:
        me = self._me
        lost = me.armed and not me.gps_ok
        self._gps_lost_since_s = _since(self._gps_lost_since_s, lost, me.now_s)
        needs_position = me.mode in {AUTO, GUIDED, LOITER, RTL, POSHOLD, BRAKE}
        if needs_position and _for(self._gps_lost_since_s, me.now_s, GPS_LOSS_S):
            self._fail(LAND, "EKF Failsafe: changed to LAND Mode")

    def _watch_fence(self) -> None:
        me, watch, notice = self._me, self._fence_watch, dialect.MAV_SEVERITY_NOTICE
        if not self.fences() and not watch.breached:
            return
        was_breached, beyond_m = bool(watch.breached), self._beyond_m()
        fresh = watch.look(beyond_m, me.now_s)
        if not me.armed:
            return
        if was_breached and not watch.breached:
            self._say("Fence breach cleared", notice)
        if not fresh:
            return
        if not me.landed:
            self._say(f"{ardupilot_fence.named(fresh)} breached", notice)
        action = FENCE_ACTIONS.get(int(me.parameters["FENCE_ACTION"]))
        if action is None:
            return
        if me.landed:
            me.armed = False
            return
        self._enter(LAND if max(beyond_m[name] for name in fresh) > GIVE_UP_M else action)
        watch.recovering = True

    def _fail(self, mode: FlightMode | None, text: str) -> None:
        """Say what failed and do what is set for it; on the ground that is to disarm."""
        self._say(text)
        if mode is None:
            return
        if self._me.landed:
            self._me.armed = False
        elif self._me.mode is not LAND:
            self._enter(mode)

    def _build_fences(self) -> dict[str, Fence]:
        me, parameters = self._me, self._me.parameters
        if parameters["FENCE_ENABLE"] != 1.0 or me.home_enu is None:
            return {}
        ceiling_up_m = me.home_enu[2] + parameters["FENCE_ALT_MAX"]
        fences = {
            MAX_ALT: Fence(ceiling_up_m=ceiling_up_m),
            CIRCLE: self._home_circle(parameters["FENCE_RADIUS"]),
            POLYGON: self._planned_fence(),
        }
        kinds = int(parameters["FENCE_TYPE"])
        return {name: fence for bit, (name, fence) in enumerate(fences.items()) if kinds >> bit & 1}

    def _restrained(self, velocity_enu: Vector) -> Vector:
        me = self._me
        here, margin_m = me.position_enu, me.parameters["FENCE_MARGIN"]
        if isinstance(me.task, RESTRAINED):
            for fence in self.fences().values():
                if fence.contains(here):  # else it is free to go, and acts on its breach
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
        me, watch = self._me, self._fence_watch
        if mode is me.mode:
            return ACCEPTED
        if mode is AUTO and not self._may_enter_auto():
            return FAILED
        if (
            watch.recovering
            and int(me.parameters["FENCE_OPTIONS"]) & ardupilot_fence.NO_MODE_CHANGE
            and me.armed
            and not me.landed
        ):
            text = f"Mode change to {mode.name} failed: in fence recovery"
            self._say(text, dialect.MAV_SEVERITY_WARNING)
            return FAILED
        super()._enter(mode)
        self._after_ack.append(telemetry.heartbeat(me))
        if me.parameters["FENCE_ACTION"] != 0.0 and watch.mode_changed(me.now_s):
            self._say("Manual recovery started", dialect.MAV_SEVERITY_INFO)
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
        # On the ground it waits for MISSION_START, or for a throttle that it has not.
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
        if me.config.refuses_arming:
            return "Arm: Compass not healthy"
        if not me.mode.can_arm:
            return f"Arm: {me.mode.name} mode not armable"
        if self._fence_watch.breached:
            return f"Arm: Vehicle breaching {ardupilot_fence.named(self._fence_watch.breached)}"
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
            task = setpoints.global_setpoint(
                message, me.frame, me.home_alt_amsl_m, me.position_enu, now_s, timeout_s
            )
        else:
            task = setpoints.local_setpoint(
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
        for group, message_ids in _STREAM_GROUPS.items():
            if everything or group == message.req_stream_id:
                for message_id in message_ids:
                    self._streams.set_interval(message_id, interval_us, now_s)


def _since(since_s: float | None, holds: bool, now_s: float) -> float | None:
    """Simulation time since which something holds, s."""
    if not holds:
        return None
    return now_s if since_s is None else since_s


def _for(since_s: float | None, now_s: float, duration_s: float) -> bool:
    """Whether something has held for a duration, s."""
    return since_s is not None and now_s - since_s >= duration_s
