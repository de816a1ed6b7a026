"""The simulated PX4, as measured on v1.16, in SITL, on its onboard link."""

from __future__ import annotations

import math
from typing import ClassVar

from sim.autopilots import boot_sequence, message_intervals, px4_setpoints, telemetry
from sim.autopilots.autopilot import Autopilot
from sim.autopilots.command_handler import Request
from sim.autopilots.flight_modes import FlightMode
from sim.autopilots.flight_tasks import FlyAxes, Hold, Task
from sim.autopilots.geofence import Fence
from sim.autopilots.mission_flight import FlyLegs, Pace
from sim.autopilots.mission_protocol import UploadTraits
from sim.autopilots.onboard_state import Installation
from sim.autopilots.px4_failsafes import OFFBOARD_ENTRY_S, Px4Failsafes
from sim.autopilots.px4_modes import (
    AUTO,
    LAND,
    LOITER,
    MISSION,
    MODES,
    OFFBOARD,
    RTL,
    TAKEOFF,
    homing,
    landing,
)
from sim.autopilots.px4_parameters import parameters
from sim.autopilots.takeoff_and_landing import TakeOff
from sim.autopilots.traits import CAPABILITIES, Traits
from sim.mavlink import ACCEPTED, DENIED, FAILED, TEMPORARILY_REJECTED, Message, dialect

SPOOL_UP_S = 2.0
"""Time from the take-off command to the first movement, s."""
IDLE_EXTRA_S = 2.0
"""The measured auto-disarm, 12 s, is this much longer than COM_DISARM_PRFLT, s."""
TAKE_OFF_CLEARANCE_M = 0.5
"""A take-off to less than this above the ground goes to MIS_TAKEOFF_ALT instead, m."""

TOO_FAR = "exceeding maximum distance to Home"
TOO_HIGH = "exceeding maximum altitude above Home"
OUTSIDE = "approaching or outside geofence"
"""What PX4 says when it breaches a fence."""

TRAITS = Traits(
    autopilot=dialect.MAV_AUTOPILOT_PX4,
    flight_sw_version=1 << 24 | 16 << 16 | dialect.FIRMWARE_VERSION_TYPE_OFFICIAL,
    capabilities=CAPABILITIES | dialect.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE,
    uid_base=0x50583400,
    boot=boot_sequence.PX4,
    first_mode=LOITER,
    always_healthy=0,
    unasked_s=message_intervals.PX4,
    refused=TEMPORARILY_REJECTED,
    unknown_message=DENIED,
    unknown_interval=FAILED,
    parameters_per_s=500.0,
)


class Px4(Autopilot):
    """PX4.

    Args:
        installation: What the vehicle gives it.
    """

    traits = TRAITS
    transfer = UploadTraits(
        asks_int=True, repeat_s=0.25, give_up_s=5.0, says_so=False, home_is_first=False
    )
    telemetry: ClassVar[telemetry.Builders] = telemetry.COMMON

    def __init__(self, installation: Installation) -> None:
        super().__init__(installation, parameters(installation.config.sysid))
        self._setpoint_s = -math.inf
        self._previous_setpoint_s = -math.inf
        self._takeoff_up_m = 0.0
        self._failsafes = Px4Failsafes(self._me, self._say, super()._enter)
        self._messages[dialect.MAVLINK_MSG_ID_PING] = self._on_ping

    # --- Failsafes and fences ----------------------------------------------------------

    def _watch(self) -> None:
        silent_s = self._me.now_s - self._setpoint_s
        self._failsafes.watch(silent_s, self._gcs_silent_s(), self._beyond_m().keys())
        self._watch_mission()
        if self._me.mode is TAKEOFF and self._me.flown and isinstance(self._me.task, Hold):
            self._me.mode = LOITER

    def _build_fences(self) -> dict[str, Fence]:
        me, parameters = self._me, self._me.parameters
        if parameters["GF_ACTION"] == 0.0 or me.home_enu is None:
            return {}
        up, across = parameters["GF_MAX_VER_DIST"], parameters["GF_MAX_HOR_DIST"]
        fences = {OUTSIDE: self._uploaded_fence()}
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
            return ACCEPTED  # it acknowledges, but stays in its mode
        if mode is MISSION and not self._mission().legs:
            self._say("Mission rejected: no valid mission available")
            return TEMPORARILY_REJECTED
        return mode

    def _streamed(self) -> bool:
        """Whether setpoints come fast enough for OFFBOARD."""
        # The request came at most one step after now_s.
        fresh = self._me.now_s - self._setpoint_s < OFFBOARD_ENTRY_S
        return fresh and self._setpoint_s - self._previous_setpoint_s < OFFBOARD_ENTRY_S

    def _enter(self, mode: FlightMode) -> int:
        self._failsafes.clear()
        return super()._enter(mode)

    def _restart(self) -> None:
        super()._restart()
        self._failsafes.clear()
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
        if not me.position_ok or self._failsafes.breached:
            return "Arming denied: Resolve system health failures first"
        if me.config.faults.refuses_arming:
            return "Preflight Fail: Compass not healthy"
        if not me.mode.can_arm:
            return f"Arming denied: mode {me.mode.name}"
        return None

    def _arm(self) -> int:
        me = self._me
        was_armed = me.armed
        result = super()._arm()
        if result == ACCEPTED and not was_armed:
            self._failsafes.forget_battery()
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
