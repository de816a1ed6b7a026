"""The parameters of the simulated ArduCopter: those that act here and others as ballast.

The names are those of 4.7 in development, on which the behaviour was measured: MAV_SYSID, but
still centimetres. Earlier releases have SYSID_THISMAV; 4.7.0 itself has metres
(https://ardupilot.org/copter/docs/common-param-name-changes.html).
"""

from __future__ import annotations

from sim.autopilots.parameters import INT32, REAL32, Parameter, Parameters, table

_SINGLE = """
MAV_GCS_SYSID i 255; MAV_OPTIONS i 0; MAV_TELEM_DELAY i 0
FS_GCS_ENABLE b 0; FS_GCS_TIMEOUT f 5; FS_THR_ENABLE b 1; FS_THR_VALUE h 975; FS_OPTIONS i 16
FS_EKF_ACTION b 1; FS_EKF_THRESH f 0.8; FS_EKF_FILT f 5; FS_CRASH_CHECK b 1; FS_VIBE_ENABLE b 1
FS_DR_ENABLE b 2; FS_DR_TIMEOUT f 30
BATT_MONITOR b 4; BATT_CAPACITY i 3300; BATT_LOW_TIMER b 10; BATT_FS_VOLTSRC b 0
BATT_LOW_VOLT f 10.5; BATT_LOW_MAH f 0; BATT_CRT_VOLT f 0; BATT_CRT_MAH f 0
BATT_FS_LOW_ACT b 0; BATT_FS_CRT_ACT b 0; BATT_ARM_VOLT f 0; BATT_ARM_MAH i 0
RTL_ALT i 1500; RTL_ALT_FINAL h 0; RTL_ALT_TYPE b 0; RTL_CLIMB_MIN h 0; RTL_CONE_SLOPE f 3
RTL_LOIT_TIME i 5000; RTL_SPEED h 0; RTL_OPTIONS i 0
LAND_SPEED h 50; LAND_SPEED_HIGH h 0; LAND_ALT_LOW h 1000; LAND_REPOSITION b 1
WPNAV_SPEED f 1000; WPNAV_SPEED_UP f 250; WPNAV_SPEED_DN f 150; WPNAV_ACCEL f 250
WPNAV_ACCEL_Z f 100; WPNAV_RADIUS f 200; WPNAV_JERK f 1; WPNAV_RFND_USE b 1
GUID_TIMEOUT f 3; GUID_OPTIONS i 0; DISARM_DELAY b 10
FENCE_ENABLE b 0; FENCE_TYPE b 7; FENCE_ACTION b 1; FENCE_ALT_MAX f 100; FENCE_RADIUS f 300
FENCE_MARGIN f 2; FENCE_TOTAL b 0; FENCE_ALT_MIN f -10; FENCE_AUTOENABLE b 0; FENCE_OPTIONS h 1
AVOID_ENABLE b 3; AVOID_MARGIN f 2; AVOID_ACCEL_MAX f 3; AVOID_BEHAVE b 0
ARMING_CHECK i 1; ARMING_RUDDER b 2; ARMING_OPTIONS i 0; ARMING_NEED_LOC b 0
FRAME_CLASS b 1; FRAME_TYPE b 0; FORMAT_VERSION h 120; FLTMODE_CH b 5; INITIAL_MODE b 0
PILOT_SPEED_UP h 250; PILOT_SPEED_DN h 0; PILOT_ACCEL_Z h 250; PILOT_TKOFF_ALT f 0
PILOT_THR_BHV h 0; PILOT_THR_FILT f 0; PILOT_Y_RATE f 202.5; PILOT_Y_EXPO f 0
ANGLE_MAX h 3000; PHLD_BRAKE_RATE h 8; PHLD_BRAKE_ANGLE h 3000; TKOFF_SLEW_TIME f 2
LOIT_SPEED f 1250; LOIT_ACC_MAX f 500; LOIT_BRK_ACCEL f 250; LOIT_BRK_DELAY f 1; LOIT_ANG_MAX f 0
PSC_POSXY_P f 1; PSC_VELXY_P f 2; PSC_VELXY_I f 1; PSC_VELXY_D f 0.25; PSC_POSZ_P f 1
PSC_VELZ_P f 5; PSC_ACCZ_P f 0.5; PSC_ACCZ_I f 1; PSC_ACCZ_D f 0; PSC_JERK_XY f 5; PSC_JERK_Z f 5
ATC_ACCEL_R_MAX f 110000; ATC_ACCEL_P_MAX f 110000; ATC_ACCEL_Y_MAX f 27000; ATC_RATE_R_MAX f 0
ATC_RATE_P_MAX f 0; ATC_RATE_Y_MAX f 0; ATC_ANG_RLL_P f 4.5; ATC_ANG_PIT_P f 4.5
ATC_ANG_YAW_P f 4.5; ATC_INPUT_TC f 0.15; ATC_THR_MIX_MAX f 0.5; ATC_THR_MIX_MIN f 0.1
MOT_SPIN_ARM f 0.1; MOT_SPIN_MIN f 0.15; MOT_SPIN_MAX f 0.95; MOT_THST_HOVER f 0.39
MOT_THST_EXPO f 0.65; MOT_SPOOL_TIME f 0.5; MOT_PWM_MIN h 1000; MOT_PWM_MAX h 2000
MOT_BAT_VOLT_MAX f 12.8; MOT_BAT_VOLT_MIN f 9.6; MOT_BAT_CURR_MAX f 0; MOT_HOVER_LEARN b 2
AHRS_EKF_TYPE b 3; AHRS_GPS_GAIN f 1; AHRS_GPS_MINSATS b 6; AHRS_ORIENTATION b 0; AHRS_RP_P f 0.2
AHRS_TRIM_X f 0; AHRS_TRIM_Y f 0; AHRS_TRIM_Z f 0; AHRS_YAW_P f 0.2
EK3_ENABLE b 1; EK3_IMU_MASK b 3; EK3_SRC1_POSXY b 3; EK3_SRC1_VELXY b 3; EK3_SRC1_POSZ b 1
EK3_SRC1_VELZ b 3; EK3_SRC1_YAW b 1; EK3_CHECK_SCALE h 100; EK3_ALT_M_NSE f 2
EK3_POSNE_M_NSE f 0.5; EK3_VELNE_M_NSE f 0.3; EK3_VELD_M_NSE f 0.5; EK3_YAW_M_NSE f 0.5
GPS1_TYPE b 1; GPS2_TYPE b 0; GPS_AUTO_SWITCH b 1; GPS_MIN_ELEV b -100; GPS1_RATE_MS h 200
COMPASS_ENABLE b 1; COMPASS_USE b 1; COMPASS_USE2 b 1; COMPASS_USE3 b 1; COMPASS_AUTODEC b 1
COMPASS_DEC f 0; COMPASS_LEARN b 0; COMPASS_ORIENT b 0; COMPASS_EXTERNAL b 1
INS_GYRO_FILTER h 20; INS_ACCEL_FILTER h 20; INS_FAST_SAMPLE b 1; INS_USE b 1; INS_USE2 b 1
BARO_PRIMARY b 0; BARO_ALT_OFFSET f 0; BARO_PROBE_EXT i 0; BRD_TYPE b 0; BRD_SAFETY_DEFLT b 0
LOG_BITMASK i 176126; LOG_BACKEND_TYPE b 1; LOG_DISARMED b 0; LOG_REPLAY b 0; LOG_FILE_BUFSIZE h 50
MIS_TOTAL h 0; MIS_RESTART b 0; MIS_OPTIONS h 0; RALLY_TOTAL b 0; RALLY_LIMIT_KM f 0.3
RALLY_INCL_HOME b 1; SCHED_LOOP_RATE h 400; SIMPLE b 0; SUPER_SIMPLE b 0; TERRAIN_ENABLE b 1
TERRAIN_SPACING h 100; THROW_TYPE b 0; VISO_TYPE b 0; WP_NAVALT_MIN f 0; WP_YAW_BEHAVIOR b 2
SIM_GPS1_ENABLE b 1; SIM_BATT_VOLTAGE f 12.6; SIM_SPEEDUP f 1; SIM_RC_FAIL b 0; SIM_WIND_SPD f 0
SIM_WIND_DIR f 180; SIM_WIND_TURB f 0; SIM_DRIFT_SPEED f 0.05; SIM_RATE_HZ h 1200
"""


_STREAM_GROUPS = (
    *("RAW_SENS", "EXT_STAT", "RC_CHAN", "RAW_CTRL", "POSITION"),
    *("EXTRA1", "EXTRA2", "EXTRA3", "PARAMS", "ADSB"),
)


def _series() -> dict[str, Parameter]:
    text = []
    for n in range(1, 17):
        text.append(f"SERVO{n}_MIN h 1100; SERVO{n}_MAX h 1900; SERVO{n}_TRIM h 1500")
        text.append(f"SERVO{n}_REVERSED b 0; SERVO{n}_FUNCTION h {32 + n if n <= 4 else 0}")
        text.append(f"RC{n}_MIN h 1100; RC{n}_MAX h 1900; RC{n}_TRIM h 1500; RC{n}_DZ h 0")
        text.append(f"RC{n}_REVERSED b 0; RC{n}_OPTION h 0")
    text += [f"FLTMODE{n} b {mode}" for n, mode in enumerate((7, 9, 6, 3, 5, 0), 1)]
    for n in range(8):
        text.append(f"SERIAL{n}_BAUD i 115; SERIAL{n}_PROTOCOL b 2; SERIAL{n}_OPTIONS i 0")
    for group in _STREAM_GROUPS:
        text.append(f"MAV1_{group} h 0")
    for axis, d in (("RLL", 0.0036), ("PIT", 0.0036), ("YAW", 0.0)):
        p, i = (0.18, 0.018) if axis == "YAW" else (0.135, 0.135)
        text.append(f"ATC_RAT_{axis}_P f {p}; ATC_RAT_{axis}_I f {i}; ATC_RAT_{axis}_D f {d}")
        text.append(f"ATC_RAT_{axis}_FF f 0; ATC_RAT_{axis}_IMAX f 0.5; ATC_RAT_{axis}_FLTT f 20")
        text.append(f"ATC_RAT_{axis}_FLTD f 20; ATC_RAT_{axis}_FLTE f 0; ATC_RAT_{axis}_SMAX f 0")
    for sensor in ("", "2", "3"):
        for axis in "XYZ":
            text.append(f"INS_ACC{sensor}OFFS_{axis} f 0.001; INS_ACC{sensor}SCAL_{axis} f 1.001")
            text.append(f"INS_GYR{sensor}OFFS_{axis} f 0; COMPASS_OFS{sensor}_{axis} f 5")
        text.append(f"COMPASS_DEV_ID{sensor} i {97539 + len(sensor)}")
    return table("\n".join(text))


DEFAULTS = table(_SINGLE) | _series()

_BEFORE_4_7: dict[str, tuple[str, float]] = {
    "MAV_SYSID": ("SYSID_THISMAV", 1.0),
    "MAV_GCS_SYSID": ("SYSID_MYGCS", 1.0),
} | {name: (name.replace("MAV1_", "SR0_"), 1.0) for name in DEFAULTS if name.startswith("MAV1_")}
_SINCE_4_7 = {
    "RTL_ALT": ("RTL_ALT_M", 0.01),
    "RTL_ALT_FINAL": ("RTL_ALT_FINAL_M", 0.01),
    "RTL_CLIMB_MIN": ("RTL_CLIMB_MIN_M", 0.01),
    "RTL_SPEED": ("RTL_SPEED_MS", 0.01),
    "LAND_SPEED": ("LAND_SPD_MS", 0.01),
    "LAND_SPEED_HIGH": ("LAND_SPD_HIGH_MS", 0.01),
    "LAND_ALT_LOW": ("LAND_ALT_LOW_M", 0.01),
    "WPNAV_SPEED": ("WP_SPD", 0.01),
    "WPNAV_SPEED_UP": ("WP_SPD_UP", 0.01),
    "WPNAV_SPEED_DN": ("WP_SPD_DN", 0.01),
    "WPNAV_ACCEL": ("WP_ACC", 0.01),
    "WPNAV_ACCEL_Z": ("WP_ACC_Z", 0.01),
    "WPNAV_RADIUS": ("WP_RADIUS_M", 0.01),
}
_RENAMED: dict[str, dict[str, tuple[str, float]]] = {
    "4.6": _BEFORE_4_7,
    "4.7-dev": {},
    "4.7": _SINCE_4_7,
}


def parameters(release: str, sysid: int) -> Parameters:
    """The parameters of one vehicle, at their defaults.

    Args:
        release: Release that names them: 4.6, 4.7-dev or 4.7.
        sysid: System id of the vehicle.
    """
    renamed = _RENAMED[release]
    defaults = {}
    for name, parameter in (DEFAULTS | {"MAV_SYSID": Parameter(INT32, sysid)}).items():
        present, factor = renamed.get(name, (name, 1.0))
        kind = parameter.type if factor == 1.0 else REAL32
        defaults[present] = Parameter(kind, parameter.value * factor)
    return Parameters(defaults, bytewise=False, renamed=renamed)
