"""What the vehicles' failsafe parameters are judged by, as a table."""

from __future__ import annotations

import math

import pytest

from swarmctl.mission.failsafes.judge import Craft, advised_of, parameters_of, required_of, unsafe
from swarmctl.mission.failsafes.rules import Demands, Weight
from tests.mission.fake_fleet import ARDUPILOT_SAFE, PX4_SAFE

COPTER = ARDUPILOT_SAFE | {"RTL_ALT_M": 15.0}
PX4 = PX4_SAFE | {"RTL_RETURN_ALT": 30.0}
GROUND_M = 50.0


def craft(
    sysid: int, above_home_m: float, values: dict[str, float], *, is_fenced: bool = False
) -> Craft:
    autopilot = "ardupilot" if "RTL_ALT_M" in values else "px4"
    demands = Demands(
        gcs_sysid=245,
        speed_mps=7.3,
        acceleration_mps2=1.5,
        height_m=above_home_m,
        reach_m=2000.0,
        is_fenced=is_fenced,
    )
    return Craft(sysid, autopilot, demands, GROUND_M, values)


def judged(*crafts: Craft) -> list[tuple[int, str, float]]:
    found = unsafe(crafts, separation_m=8.0, ceiling_amsl_m=GROUND_M + 100.0)
    return [(fault.sysid, fault.parameter, fault.right) for fault in found]


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_the_judged_parameters_are_the_ones_to_read(autopilot: str) -> None:
    values = COPTER if autopilot == "ardupilot" else PX4
    assert set(parameters_of(autopilot)) == set(values)
    assert parameters_of("other") == ()
    assert not required_of("other")
    assert not advised_of("other")


@pytest.mark.parametrize(
    ("values", "parameter", "value", "right"),
    [
        (COPTER, "FS_GCS_ENABLE", 1.0, None),
        (COPTER, "FS_GCS_ENABLE", 0.0, 1.0),  # off
        (COPTER, "FS_GCS_ENABLE", 3.0, 1.0),  # SmartRTL: along its own path
        (COPTER, "FS_GCS_ENABLE", 5.0, 1.0),  # lands where it is
        (COPTER, "FS_GCS_ENABLE", math.nan, 1.0),
        (COPTER, "FS_GCS_TIMEOUT", 60.0, None),
        (COPTER, "FS_GCS_TIMEOUT", 5.0, 10.0),  # five lost heartbeats
        (COPTER, "FS_GCS_TIMEOUT", 120.0, 10.0),
        (COPTER, "MAV_GCS_SYSID", 245.0, None),
        (COPTER, "MAV_GCS_SYSID", 255.0, 245.0),  # QGroundControl's silence
        (COPTER, "RTL_CLIMB_MIN_M", -1.0, None),
        (COPTER, "RTL_CLIMB_MIN_M", 5.0, 0.0),
        (COPTER, "FS_EKF_ACTION", 3.0, None),
        (COPTER, "FS_EKF_ACTION", 0.0, 1.0),  # flies on
        (COPTER, "FS_EKF_ACTION", 2.0, 1.0),  # by a stick
        (COPTER, "GUID_OPTIONS", 64.0, None),  # waypoint navigation for bare positions
        (COPTER, "GUID_OPTIONS", 113.0, 65.0),  # neither position nor velocity is held
        (COPTER, "GUID_OPTIONS", math.nan, 0.0),
        (COPTER, "WP_SPD", 7.3 * (1.0 - 1e-7), None),  # as 730 cm/s in a float of 32 bits
        (COPTER, "WP_SPD", 7.2, 8.0),
        (COPTER, "WP_SPD", math.nan, 8.0),
        (COPTER, "BATT_FS_LOW_ACT", 5.0, 2.0),  # the motors stop
        (COPTER, "BATT_FS_CRT_ACT", 5.0, 1.0),
        (COPTER, "BATT_FS_CRT_ACT", 0.0, None),
        (PX4, "NAV_RCL_ACT", 0.0, None),
        (PX4, "NAV_RCL_ACT", 5.0, 2.0),  # terminates the flight
        (PX4, "NAV_RCL_ACT", 6.0, 2.0),  # stops the motors
        (PX4, "MPC_XY_VEL_MAX", 7.3, None),
        (PX4, "MPC_XY_VEL_MAX", 5.0, 8.0),
        (PX4, "NAV_DLL_ACT", 2.0, None),
        (PX4, "NAV_DLL_ACT", 0.0, 2.0),  # off
        (PX4, "NAV_DLL_ACT", 1.0, 2.0),  # hovers for ever
        (PX4, "NAV_DLL_ACT", 3.0, 2.0),  # lands where it is
        (PX4, "COM_OBL_RC_ACT", 3.0, None),  # returns
        (PX4, "COM_OBL_RC_ACT", 5.0, None),  # hovers
        (PX4, "COM_OBL_RC_ACT", 0.0, 5.0),  # position mode: sinks without a remote control
        (PX4, "COM_OBL_RC_ACT", 4.0, 5.0),  # lands at the first hiccup
        (PX4, "COM_OBL_RC_ACT", 7.0, 5.0),  # disarms
        (PX4, "COM_OBL_ACT", 2.0, None),
        (PX4, "COM_OBL_ACT", 0.0, 1.0),  # lands
        (PX4, "COM_OF_LOSS_T", 0.5, None),
        (PX4, "COM_OF_LOSS_T", 5.0, None),
        (PX4, "COM_OF_LOSS_T", 0.0, 1.0),
        (PX4, "COM_OF_LOSS_T", 60.0, 1.0),
    ],
)
def test_each_parameter(
    values: dict[str, float], parameter: str, value: float, right: float | None
) -> None:
    expected = [] if right is None else [(7, parameter, right)]
    assert judged(craft(7, 40.0, values | {parameter: value})) == expected


@pytest.mark.parametrize(
    ("values", "changed", "right", "weight"),
    [
        # Nothing acts on the loss of a remote control.
        (COPTER, {"FS_THR_ENABLE": 0.0, "FS_OPTIONS": 16.0}, None, None),
        (COPTER, {"FS_THR_ENABLE": 1.0, "FS_OPTIONS": 16.0}, ("FS_OPTIONS", 20.0), Weight.BETTER),
        (COPTER, {"FS_THR_ENABLE": 3.0, "FS_OPTIONS": 20.0}, None, None),
        (COPTER, {"WP_ACC": 1.0}, ("WP_ACC", 2.0), Weight.BETTER),
        (COPTER, {"BATT_FS_LOW_ACT": 0.0}, ("BATT_FS_LOW_ACT", 2.0), Weight.KNOWN),
        (COPTER, {"BATT_FS_LOW_ACT": 1.0}, ("BATT_FS_LOW_ACT", 2.0), Weight.KNOWN),
        (COPTER, {"BATT_LOW_VOLT": 0.0, "BATT_LOW_MAH": 500.0}, None, None),
        (COPTER, {"BATT_LOW_VOLT": 0.0}, ("BATT_LOW_VOLT", math.nan), Weight.KNOWN),
        (PX4, {"COM_RCL_EXCEPT": 0.0, "COM_RC_IN_MODE": 4.0}, None, None),
        (PX4, {"COM_RCL_EXCEPT": 1.0}, ("COM_RCL_EXCEPT", 5.0), Weight.BETTER),
        (PX4, {"COM_LOW_BAT_ACT": 0.0}, ("COM_LOW_BAT_ACT", 3.0), Weight.BETTER),
        (PX4, {"COM_LOW_BAT_ACT": 2.0}, ("COM_LOW_BAT_ACT", 3.0), Weight.BETTER),
    ],
)
def test_what_a_flight_may_do_without(
    values: dict[str, float],
    changed: dict[str, float],
    right: tuple[str, float] | None,
    weight: Weight | None,
) -> None:
    found = unsafe(
        [craft(7, 40.0, values | changed)],
        separation_m=8.0,
        ceiling_amsl_m=GROUND_M + 100.0,
    )
    if right is None:
        assert found == []
        return
    (fault,) = found
    assert fault.weight is weight
    assert fault.parameter == right[0]
    assert fault.right == pytest.approx(right[1], nan_ok=True)


FENCED = COPTER | {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 7.0, "FENCE_RADIUS": 2002.0}


@pytest.mark.parametrize(
    ("values", "changed", "fault", "weight"),
    [
        # Flying 40 m above home, and at most 2000 m from there.
        (FENCED, {"FENCE_ALT_MAX": 42.0}, None, None),
        (FENCED, {"FENCE_ALT_MAX": 41.0}, "FENCE_ALT_MAX", Weight.OWN),
        (FENCED, {"FENCE_ALT_MAX": 41.0, "FENCE_MARGIN": 1.0}, None, None),
        (FENCED, {"FENCE_ALT_MAX": 41.0, "FENCE_TYPE": 6.0}, None, None),
        (FENCED, {"FENCE_ALT_MAX": 41.0, "FENCE_ENABLE": 0.0}, None, None),
        (
            FENCED,
            {"FENCE_ALT_MAX": 41.0, "FENCE_ENABLE": 0.0, "FENCE_AUTOENABLE": 3.0},  # when armed
            "FENCE_ALT_MAX",
            Weight.OWN,
        ),
        (FENCED, {"FENCE_RADIUS": 2001.0}, "FENCE_RADIUS", Weight.KNOWN),
        (FENCED, {"FENCE_RADIUS": 2001.0, "FENCE_TYPE": 5.0}, None, None),
        (PX4, {"GF_MAX_VER_DIST": 40.0}, None, None),
        (PX4, {"GF_MAX_VER_DIST": 39.0}, "GF_MAX_VER_DIST", Weight.OWN),
        (PX4, {"GF_MAX_VER_DIST": 39.0, "GF_ACTION": 1.0}, None, None),  # says it only
        (PX4, {"GF_MAX_HOR_DIST": 1999.0}, "GF_MAX_HOR_DIST", Weight.KNOWN),
        (PX4, {"GF_MAX_HOR_DIST": 2000.0}, None, None),
    ],
)
def test_a_fence_of_its_own_must_not_end_the_flight(
    values: dict[str, float], changed: dict[str, float], fault: str | None, weight: Weight | None
) -> None:
    found = unsafe([craft(7, 40.0, values | changed)], separation_m=8.0, ceiling_amsl_m=150.0)
    assert [(f.parameter, f.weight) for f in found] == ([] if fault is None else [(fault, weight)])
    assert all(math.isnan(f.right) for f in found)


@pytest.mark.parametrize(
    ("values", "fault"),
    [
        (FENCED, None),
        (FENCED | {"FENCE_TYPE": 3.0}, "FENCE_TYPE"),
        (FENCED | {"FENCE_ENABLE": 0.0}, "FENCE_TYPE"),
        (PX4, None),
        (PX4 | {"GF_ACTION": 1.0}, "GF_ACTION"),
    ],
)
def test_it_is_said_when_the_fence_uploaded_to_it_does_nothing(
    values: dict[str, float], fault: str | None
) -> None:
    assert judged(craft(7, 40.0, values)) == []
    found = unsafe([craft(7, 40.0, values, is_fenced=True)], separation_m=8.0, ceiling_amsl_m=150.0)
    assert [f.parameter for f in found] == ([] if fault is None else [fault])


@pytest.mark.parametrize(("name", "values"), [("RTL_ALT_M", COPTER), ("RTL_RETURN_ALT", PX4)])
@pytest.mark.parametrize(
    ("returns_m", "rights"),
    [
        # Flying at 40 and 52 m above home; a return climbs but never descends.
        ((0.0, 0.0), [None, None]),
        ((30.0, 30.0), [None, None]),
        ((40.0, 52.0), [None, None]),
        ((60.0, 70.0), [None, None]),  # raised, and apart
        ((43.9, 0.0), [None, None]),
        ((44.1, 0.0), [40.0, None]),  # 7.9 m below the other
        ((60.0, 60.0), [40.0, 52.0]),  # both climb to the same
        ((52.0, 30.0), [40.0, None]),
        ((60.0, 67.9), [40.0, 52.0]),
        ((60.0, 101.0), [40.0, 52.0]),  # above the ceiling
    ],
)
def test_returns_are_apart_and_below_the_ceiling(
    name: str,
    values: dict[str, float],
    returns_m: tuple[float, float],
    rights: list[float | None],
) -> None:
    crafts = [
        craft(sysid, above, values | {name: least})
        for sysid, above, least in zip((1, 2), (40.0, 52.0), returns_m, strict=True)
    ]
    expected = [(sysid, name, right) for sysid, right in zip((1, 2), rights, strict=True) if right]
    assert judged(*crafts) == expected


def test_firmware_without_a_timeout_parameter_is_not_judged_by_it() -> None:
    values = {name: value for name, value in COPTER.items() if name != "FS_GCS_TIMEOUT"}
    assert judged(craft(1, 40.0, values)) == []


def test_what_is_right_is_judged_right() -> None:
    crafts = [
        craft(1, 40.7, COPTER | {"RTL_ALT_M": 60.0}),
        craft(2, 52.7, PX4 | {"RTL_RETURN_ALT": 60.0}),
    ]
    rights = {(s, p): r for s, p, r in judged(*crafts)}
    assert rights == {(1, "RTL_ALT_M"): 40.0, (2, "RTL_RETURN_ALT"): 52.0}
    crafts = [
        craft(1, 40.7, COPTER | {"RTL_ALT_M": rights[1, "RTL_ALT_M"]}),
        craft(2, 52.7, PX4 | {"RTL_RETURN_ALT": rights[2, "RTL_RETURN_ALT"]}),
    ]
    assert judged(*crafts) == []


def test_every_vehicles_faults_are_found_at_once() -> None:
    found = judged(
        craft(1, 40.0, COPTER | {"FS_GCS_ENABLE": 0.0, "MAV_GCS_SYSID": 255.0}),
        craft(2, 52.0, PX4 | {"NAV_DLL_ACT": 0.0}),
    )
    assert found == [
        (1, "FS_GCS_ENABLE", 1.0),
        (1, "MAV_GCS_SYSID", 245.0),
        (2, "NAV_DLL_ACT", 2.0),
    ]
