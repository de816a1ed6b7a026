"""The ``px4`` personality: PX4 as measured on v1.16, in SITL, on its onboard link."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import ClassVar

from sim.autopilots import px4_setpoints, telemetry
from sim.autopilots.autopilot import Autopilot, Request
from sim.autopilots.flight_modes import FlightMode
from sim.autopilots.flight_tasks import FlyAxes, Hold, TakeOff, Task
from sim.autopilots.geofence import Fence
from sim.autopilots.mission_flight import FlyLegs, Pace
from sim.autopilots.mission_protocol import TransferManners
from sim.autopilots.onboard_state import Fitting, Onboard
from sim.autopilots.px4_modes import (
    AUTO,
    DATALINK_LOSS_ACTIONS,
    FENCE_ACTIONS,
    LAND,
    LOITER,
    MISSION,
    MODES,
    OFFBOARD,
    OFFBOARD_LOSS_ACTIONS,
    POSCTL,
    RESUMED_FROM,
    RTL,
    TAKEOFF,
    homing,
    landing,
)
from sim.autopilots.px4_parameters import parameters
from sim.autopilots.traits import CAPABILITIES, Manners, Timeline
from sim.mavlink import ACCEPTED, DENIED, FAILED, TEMPORARILY_REJECTED, Message, dialect

OFFBOARD_ENTRY_S = 0.5
"""A stream slower than 2 Hz does not open OFFBOARD."""
OFFBOARD_LOSS_EXTRA_S = 0.1
"""What it takes longer than COM_OF_LOSS_T to notice that the stream is lost."""
SPOOL_UP_S = 2.0
GPS_LOSS_S = 5.0
"""EKF2_NOAID_TOUT: without GPS for so long it has no position."""
IDLE_EXTRA_S = 2.0
"""What the measured auto-disarm, 12 s, is longer than COM_DISARM_PRFLT."""
TAKE_OFF_CLEARANCE_M = 0.5
"""A take-off to less above the ground goes to MIS_TAKEOFF_ALT instead."""

TOO_FAR = "exceeding maximum distance to Home"
TOO_HIGH = "exceeding maximum altitude above Home"
OUTSIDE = "approaching or outside geofence"
"""What it says of its fences."""

MANNERS = Manners(
    autopilot=dialect.MAV_AUTOPILOT_PX4,
    flight_sw_version=1 << 24 | 16 << 16 | dialect.FIRMWARE_VERSION_TYPE_OFFICIAL,
    capabilities=CAPABILITIES | dialect.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE,
    uid_base=0x50583400,
    boot=Timeline(heartbeat_s=1.0, gps_fix_s=2.0, home_set_s=3.0, armable_s=4.5),
    first_mode=LOITER,
    always_healthy=0,
    streams={
        dialect.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
        dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 1.0 / 50.0,
        dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 1.0 / 30.0,
        dialect.MAVLINK_MSG_ID_ATTITUDE: 1.0 / 20.0,
        dialect.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: 1.0 / 20.0,
        dialect.MAVLINK_MSG_ID_TIMESYNC: 1.0 / 10.0,
        dialect.MAVLINK_MSG_ID_VFR_HUD: 1.0 / 10.0,
        dialect.MAVLINK_MSG_ID_GPS_RAW_INT: 1.0 / 5.0,
        dialect.MAVLINK_MSG_ID_SYS_STATUS: 1.0 / 5.0,
        dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0 / 5.0,
        dialect.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
        dialect.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
        dialect.MAVLINK_MSG_ID_BATTERY_STATUS: 2.0,
        dialect.MAVLINK_MSG_ID_HOME_POSITION: 2.0,
    },
    refused=TEMPORARILY_REJECTED,
    unknown_message=DENIED,
    unknown_interval=FAILED,
    parameters_per_s=500.0,
)


class Px4(Autopilot):
    """PX4.

    Args:
        fitting: What it is built into.
    """

    manners = MANNERS
    transfer = TransferManners(
        asks_int=True, repeat_s=0.25, give_up_s=5.0, says_so=False, home_is_first=False
    )
    telemetry: ClassVar[Mapping[int, Callable[[Onboard], Message | None]]] = telemetry.COMMON

    def __init__(self, fitting: Fitting) -> None:
        super().__init__(fitting, parameters(fitting.config.sysid))
        self._setpoint_s = -math.inf
        self._previous_setpoint_s = -math.inf
        self._takeoff_up_m = 0.0
        self._offboard_lost = self._datalink_lost = False
        self._breached: set[str] = set()
        self._battery_stage = 0
        self._gps_lost_since_s: float | None = None
        self._messages[dialect.MAVLINK_MSG_ID_PING] = self._on_ping

    # --- Failsafes ---------------------------------------------------------------------

    def _watch(self) -> None:
        self._watch_offboard()
        self._watch_datalink()
        self._watch_battery()
        self._watch_gps()
        self._watch_fence()
        self._watch_mission()
        if self._me.mode is TAKEOFF and self._me.flown and isinstance(self._me.task, Hold):
            self._me.mode = LOITER

    def _watch_offboard(self) -> None:
        me = self._me
        silent_s = me.now_s - self._setpoint_s
        if self._offboard_lost and silent_s < OFFBOARD_ENTRY_S:
            # It was in OFFBOARD by somebody's will, and nobody has changed that since.
            super()._enter(OFFBOARD)
            self._offboard_lost = me.failsafe = False
        elif (
            me.mode is OFFBOARD
            and silent_s > me.parameters["COM_OF_LOSS_T"] + OFFBOARD_LOSS_EXTRA_S
        ):
            action = OFFBOARD_LOSS_ACTIONS.get(int(me.parameters["COM_OBL_RC_ACT"]), POSCTL)
            self._fail(action, "No offboard signal")
            self._offboard_lost = action in RESUMED_FROM

    def _watch_datalink(self) -> None:
        me = self._me
        action = DATALINK_LOSS_ACTIONS.get(int(me.parameters["NAV_DLL_ACT"]))
        lost = action is not None and self._gcs_silent_s() > me.parameters["COM_DL_LOSS_T"]
        if lost and not self._datalink_lost and me.armed and action is not None:
            self._fail(action, "GCS connection lost")
        self._datalink_lost = lost

    def _watch_battery(self) -> None:
        me, parameters = self._me, self._me.parameters
        thresholds = ("BAT_LOW_THR", "BAT_CRIT_THR", "BAT_EMERGEN_THR")
        stage = sum(me.charge < parameters[name] for name in thresholds)
        if stage <= self._battery_stage or not me.armed:
            return
        self._battery_stage = stage
        what = int(parameters["COM_LOW_BAT_ACT"])
        text = ("", "Low battery", "Critical battery", "Emergency battery level")[stage]
        if (what == 2 and stage >= 2) or (what == 3 and stage == 3):
            self._fail(LAND, text)
        elif what in {1, 3} and stage == 2:
            self._fail(RTL, text)
        else:
            self._say(text)

    def _watch_gps(self) -> None:
        me = self._me
        if me.gps_ok or not me.armed:
            self._gps_lost_since_s = None
            return
        if self._gps_lost_since_s is None:
            self._gps_lost_since_s = me.now_s
        # It descends blindly, which it shows as landing.
        if me.now_s - self._gps_lost_since_s >= GPS_LOSS_S and me.mode is not LAND:
            self._fail(LAND, "No valid position estimate")

    def _watch_fence(self) -> None:
        me = self._me
        breached = self._beyond_m().keys()
        fresh, self._breached = breached - self._breached, set(breached)
        if not me.armed or me.landed:
            return
        action = FENCE_ACTIONS.get(int(me.parameters["GF_ACTION"]))
        for name in sorted(fresh):
            if action is None:
                self._say(f"Geofence: {name}")
            else:
                self._fail(action, f"Geofence: {name}")

    def _fail(self, mode: FlightMode, text: str) -> None:
        self._say(text)
        if self._me.mode is LAND:
            return
        super()._enter(mode)
        self._offboard_lost = False
        self._me.failsafe = True

    def _build_fences(self) -> dict[str, Fence]:
        me, parameters = self._me, self._me.parameters
        if parameters["GF_ACTION"] == 0.0 or me.home_enu is None:
            return {}
        up, across = parameters["GF_MAX_VER_DIST"], parameters["GF_MAX_HOR_DIST"]
        fences = {OUTSIDE: self._planned_fence()}
        if up > 0.0:
            fences[TOO_HIGH] = Fence(ceiling_up_m=me.home_enu[2] + up)
        if across > 0.0:
            fences[TOO_FAR] = self._home_circle(across)
        return fences

    def _is_gcs(self, message: Message) -> bool:
        return bool(message.type == dialect.MAV_TYPE_GCS)

    # --- Modes -------------------------------------------------------------------------

    def _land(self) -> FlightMode:
        return LAND

    def _return(self) -> FlightMode:
        return RTL

    def _split_custom_mode(self, custom_mode: int) -> tuple[int, int]:
        return custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF

    def _mode_asked_for(self, base_mode: int, main: int, sub: int) -> FlightMode | int:
        if not (0 <= main <= 0xFF and 0 <= sub <= 0xFF):
            return TEMPORARILY_REJECTED
        mode = MODES.get(main << 16 | sub << 24)
        if mode is None:
            return TEMPORARILY_REJECTED
        if mode is OFFBOARD and not self._streamed():
            return ACCEPTED  # so it says, and stays in the mode it is in
        if mode is MISSION and not self._mission().legs:
            self._say("Mission rejected: no valid mission available")
            return TEMPORARILY_REJECTED
        return mode

    def _streamed(self) -> bool:
        """Whether setpoints come fast enough to be flown."""
        # By the time of the request, which is at most one step after now_s.
        fresh = self._me.now_s - self._setpoint_s < OFFBOARD_ENTRY_S
        return fresh and self._setpoint_s - self._previous_setpoint_s < OFFBOARD_ENTRY_S

    def _enter(self, mode: FlightMode) -> int:
        self._offboard_lost = self._me.failsafe = False
        return super()._enter(mode)

    def _restart(self) -> None:
        super()._restart()
        self._offboard_lost = False
        self._setpoint_s = self._previous_setpoint_s = -math.inf

    # --- Mission -----------------------------------------------------------------------

    def _task_of(self, mode: FlightMode) -> Task:
        return self._mission() if mode is MISSION else super()._task_of(mode)

    def _mission(self) -> FlyLegs:
        mission = super()._mission()
        legs, pace = mission.legs, mission.pace
        if self._me.landed and legs and legs[0].kind != "take_off":
            legs = (legs[0]._replace(kind="take_off", hold_s=0.0), *legs)
        return FlyLegs(legs, pace)

    def _start_mission(self) -> int:
        mode = self._mode_asked_for(AUTO, 4, 4)
        return self._enter(mode) if isinstance(mode, FlightMode) else mode

    def _watch_mission(self) -> None:
        task = self._me.task
        if self._me.mode is not MISSION or not isinstance(task, FlyLegs):
            return
        if task.leg is None:
            super()._enter(LOITER)
        elif task.leg.kind == "return":
            super()._enter(RTL)

    def _pace(self) -> Pace:
        parameters = self._me.parameters
        return Pace(
            climb_mps=parameters["MPC_TKO_SPEED"],
            spool_up_s=SPOOL_UP_S,
            radius_m=parameters["NAV_ACC_RAD"],
            landing=landing(parameters),
            homing=homing(parameters),
        )

    # --- Arming and take-off -----------------------------------------------------------

    def _arming_refusal(self) -> str | None:
        me = self._me
        if not me.position_ok or self._breached:
            return "Arming denied: Resolve system health failures first"
        if me.config.refuses_arming:
            return "Preflight Fail: Compass not healthy"
        if not me.mode.can_arm:
            return f"Arming denied: mode {me.mode.name}"
        return None

    def _arm(self) -> int:
        me = self._me
        was_armed = me.armed
        result = super()._arm()
        if result == ACCEPTED and not was_armed:
            self._battery_stage = 0
            if me.mode is TAKEOFF:
                self._begin_take_off()
        return result

    def _idle_limit_s(self) -> float:
        me = self._me
        if me.flown:
            return me.parameters["COM_DISARM_LAND"]
        return me.parameters["COM_DISARM_PRFLT"] + IDLE_EXTRA_S

    def _may_lift(self) -> bool:
        me = self._me
        if isinstance(me.task, FlyLegs):
            return me.task.lifts
        return isinstance(me.task, TakeOff) or (
            isinstance(me.task, FlyAxes) and me.task.lifts(me.position_enu)
        )

    def _do_take_off(self, request: Request) -> int:
        me = self._me
        if me.home_enu is None:
            return TEMPORARILY_REJECTED
        x, y, z = me.position_enu
        self._takeoff_up_m = me.frame.up_at(x, y, request.z) if abs(request.z) < 1e5 else math.nan
        if not self._takeoff_up_m > z + TAKE_OFF_CLEARANCE_M:  # true for NaN
            self._takeoff_up_m = z + me.parameters["MIS_TAKEOFF_ALT"]
        self._enter(TAKEOFF)
        if me.armed:
            self._begin_take_off()
        return ACCEPTED

    def _begin_take_off(self) -> None:
        me = self._me
        x, y, _ = me.position_enu
        climb_mps = me.parameters["MPC_TKO_SPEED"]
        spool_up_s = SPOOL_UP_S if me.landed else 0.0
        me.task = TakeOff((x, y, self._takeoff_up_m), me.now_s, spool_up_s, climb_mps)

    def _speed_limit_mps(self) -> float:
        return self._me.parameters["MPC_XY_VEL_MAX"]

    # --- Messages ----------------------------------------------------------------------

    def _on_setpoint(self, message: Message, now_s: float) -> None:
        me = self._me
        if me.home_enu is None or me.origin_enu is None:
            return
        try:
            if message.get_msgId() == dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT:
                task = px4_setpoints.global_setpoint(message, me.frame, me.home_alt_amsl_m, now_s)
            else:
                task = px4_setpoints.local_setpoint(message, me.origin_enu, me.yaw_rad, now_s)
        except px4_setpoints.RefusedError as refusal:
            self._say(str(refusal))
            return
        self._previous_setpoint_s, self._setpoint_s = self._setpoint_s, now_s
        if me.mode is not OFFBOARD:
            return
        self._follow(task, message)

    def _on_ping(self, message: Message, _now_s: float) -> None:
        if message.target_system == 0 and message.target_component == 0:
            peer = message.get_srcSystem(), message.get_srcComponent()
            self._codec.send(dialect.MAVLink_ping_message(message.time_usec, message.seq, *peer))
