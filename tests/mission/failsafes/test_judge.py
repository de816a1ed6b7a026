"""What the vehicles' failsafe parameters are judged by, as a table."""

from __future__ import annotations

import math

import pytest

from swarmctl.mission.failsafes.judge import (
    RULES,
    JudgedVehicle,
    UnsafeParameter,
    advised_of,
    find_unsafe,
    parameters_of,
    required_of,
)
from swarmctl.mission.failsafes.rules import Demands, OperatorDecides, RuleClass, SetTo
from tests.mission.fake_fleet import ARDUPILOT_SAFE, PX4_SAFE

COPTER = ARDUPILOT_SAFE | {"RTL_ALT_M": 15.0}
PX4 = PX4_SAFE | {"RTL_RETURN_ALT": 30.0}
GROUND_M = 50.0


def vehicle(
    sysid: int, above_home_m: float, values: dict[str, float], *, is_fenced: bool = False
) -> JudgedVehicle:
    autopilot = "ardupilot" if "RTL_ALT_M" in values else "px4"
    demands = Demands(
        gcs_sysid=245,
        speed_mps=7.3,
        acceleration_mps2=1.5,
        height_m=above_home_m,
        reach_m=2000.0,
        is_fenced=is_fenced,
    )
    return JudgedVehicle(sysid, autopilot, demands, GROUND_M, values)


def judged(*vehicles: JudgedVehicle) -> list[tuple[int, str, float | None]]:
    found = find_unsafe(vehicles, separation_m=8.0, ceiling_amsl_m=GROUND_M + 100.0)
    return [(fault.sysid, fault.parameter, right(fault)) for fault in found]


def right(fault: UnsafeParameter) -> float | None:
    """The value to set; None if the operator decides."""
    return fault.verdict.value if isinstance(fault.verdict, SetTo) else None


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_the_judged_parameters_are_the_ones_to_read(autopilot: str) -> None:
    values = COPTER if autopilot == "ardupilot" else PX4
    assert set(parameters_of(autopilot)) == set(values)
    assert parameters_of("other") == ()
    assert not required_of("other")
    assert not advised_of("other")


@pytest.mark.parametrize(
    ("values", "parameter", "value", "to_set"),
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
    values: dict[str, float], parameter: str, value: float, to_set: float | None
) -> None:
    expected = [] if to_set is None else [(7, parameter, to_set)]
    assert judged(vehicle(7, 40.0, values | {parameter: value})) == expected


@pytest.mark.parametrize(
    ("values", "parameter", "allowed"),
    [
        (COPTER, "FS_GCS_ENABLE", {1}),
        (COPTER, "FS_EKF_ACTION", {1, 3}),
        (COPTER, "BATT_FS_LOW_ACT", {0, 1, 2, 3, 4, 6, 7}),
        (COPTER, "BATT_FS_CRT_ACT", {0, 1, 2, 3, 4, 6, 7}),
        (PX4, "NAV_DLL_ACT", {2}),
        (PX4, "COM_OBL_RC_ACT", {3, 5}),
        (PX4, "COM_OBL_ACT", {1, 2}),
        (PX4, "NAV_RCL_ACT", {0, 1, 2, 3}),
    ],
)
def test_no_vehicle_flies_with_an_action_that_is_not_allowed(
    values: dict[str, float], parameter: str, allowed: set[int]
) -> None:
    for action in range(-1, 10):
        found = find_unsafe(
            [vehicle(7, 40.0, values | {parameter: float(action)})],
            separation_m=8.0,
            ceiling_amsl_m=GROUND_M + 100.0,
        )
        required = [f.parameter for f in found if f.rule_class is RuleClass.REQUIRED]
        assert required == ([] if action in allowed else [parameter]), action


@pytest.mark.parametrize(
    ("values", "parameter", "least", "greatest"),
    [(COPTER, "FS_GCS_TIMEOUT", 10.0, 60.0), (PX4, "COM_OF_LOSS_T", 0.5, 5.0)],
)
def test_both_ends_of_a_range_are_right(
    values: dict[str, float], parameter: str, least: float, greatest: float
) -> None:
    for right_value in (least, greatest):
        assert judged(vehicle(7, 40.0, values | {parameter: right_value})) == []
    for wrong in (0.99 * least, 1.01 * greatest):
        (fault,) = judged(vehicle(7, 40.0, values | {parameter: wrong}))
        assert fault[1] == parameter


@pytest.mark.parametrize(
    ("values", "changed", "expected", "rule_class"),
    [
        # Nothing acts on the loss of a remote control.
        (COPTER, {"FS_THR_ENABLE": 0.0, "FS_OPTIONS": 16.0}, None, None),
        (
            COPTER,
            {"FS_THR_ENABLE": 1.0, "FS_OPTIONS": 16.0},
            ("FS_OPTIONS", 20.0),
            RuleClass.RECOMMENDED,
        ),
        (COPTER, {"FS_THR_ENABLE": 3.0, "FS_OPTIONS": 20.0}, None, None),
        (COPTER, {"WP_ACC": 1.0}, ("WP_ACC", 2.0), RuleClass.RECOMMENDED),
        (COPTER, {"BATT_FS_LOW_ACT": 0.0}, ("BATT_FS_LOW_ACT", 2.0), RuleClass.REPORT_ONLY),
        (COPTER, {"BATT_FS_LOW_ACT": 1.0}, ("BATT_FS_LOW_ACT", 2.0), RuleClass.REPORT_ONLY),
        (COPTER, {"BATT_LOW_VOLT": 0.0, "BATT_LOW_MAH": 500.0}, None, None),
        (COPTER, {"BATT_LOW_VOLT": 0.0}, ("BATT_LOW_VOLT", None), RuleClass.REPORT_ONLY),
        (PX4, {"COM_RCL_EXCEPT": 0.0, "COM_RC_IN_MODE": 4.0}, None, None),
        (PX4, {"COM_RCL_EXCEPT": 1.0}, ("COM_RCL_EXCEPT", 5.0), RuleClass.RECOMMENDED),
        (PX4, {"COM_LOW_BAT_ACT": 0.0}, ("COM_LOW_BAT_ACT", 3.0), RuleClass.RECOMMENDED),
        (PX4, {"COM_LOW_BAT_ACT": 2.0}, ("COM_LOW_BAT_ACT", 3.0), RuleClass.RECOMMENDED),
    ],
)
def test_what_a_flight_may_do_without(
    values: dict[str, float],
    changed: dict[str, float],
    expected: tuple[str, float | None] | None,
    rule_class: RuleClass | None,
) -> None:
    found = find_unsafe(
        [vehicle(7, 40.0, values | changed)],
        separation_m=8.0,
        ceiling_amsl_m=GROUND_M + 100.0,
    )
    if expected is None:
        assert found == []
        return
    (fault,) = found
    assert fault.rule_class is rule_class
    assert (fault.parameter, right(fault)) == expected


FENCED = COPTER | {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 7.0, "FENCE_RADIUS": 2002.0}


@pytest.mark.parametrize(
    ("values", "changed", "fault", "rule_class"),
    [
        # Flying 40 m above home, and at most 2000 m from there.
        (FENCED, {"FENCE_ALT_MAX": 42.0}, None, None),
        (FENCED, {"FENCE_ALT_MAX": 41.0}, "FENCE_ALT_MAX", RuleClass.OPERATOR_ONLY),
        (FENCED, {"FENCE_ALT_MAX": 41.0, "FENCE_MARGIN": 1.0}, None, None),
        (FENCED, {"FENCE_ALT_MAX": 41.0, "FENCE_TYPE": 6.0}, None, None),
        (FENCED, {"FENCE_ALT_MAX": 41.0, "FENCE_ENABLE": 0.0}, None, None),
        (
            FENCED,
            {"FENCE_ALT_MAX": 41.0, "FENCE_ENABLE": 0.0, "FENCE_AUTOENABLE": 3.0},  # when armed
            "FENCE_ALT_MAX",
            RuleClass.OPERATOR_ONLY,
        ),
        (FENCED, {"FENCE_RADIUS": 2001.0}, "FENCE_RADIUS", RuleClass.REPORT_ONLY),
        (FENCED, {"FENCE_RADIUS": 2001.0, "FENCE_TYPE": 5.0}, None, None),
        (PX4, {"GF_MAX_VER_DIST": 40.0}, None, None),
        (PX4, {"GF_MAX_VER_DIST": 39.0}, "GF_MAX_VER_DIST", RuleClass.OPERATOR_ONLY),
        (PX4, {"GF_MAX_VER_DIST": 39.0, "GF_ACTION": 1.0}, None, None),  # says it only
        (PX4, {"GF_MAX_HOR_DIST": 1999.0}, "GF_MAX_HOR_DIST", RuleClass.REPORT_ONLY),
        (PX4, {"GF_MAX_HOR_DIST": 2000.0}, None, None),
    ],
)
def test_a_fence_of_its_own_must_not_end_the_flight(
    values: dict[str, float],
    changed: dict[str, float],
    fault: str | None,
    rule_class: RuleClass | None,
) -> None:
    found = find_unsafe(
        [vehicle(7, 40.0, values | changed)], separation_m=8.0, ceiling_amsl_m=150.0
    )
    assert [(f.parameter, f.rule_class) for f in found] == (
        [] if fault is None else [(fault, rule_class)]
    )
    assert all(isinstance(f.verdict, OperatorDecides) for f in found)


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
    assert judged(vehicle(7, 40.0, values)) == []
    found = find_unsafe(
        [vehicle(7, 40.0, values, is_fenced=True)], separation_m=8.0, ceiling_amsl_m=150.0
    )
    assert [f.parameter for f in found] == ([] if fault is None else [fault])


@pytest.mark.parametrize(
    ("values", "parameter"),
    [(COPTER, "FENCE_ALT_MAX"), (COPTER, "FS_OPTIONS"), (PX4, "GF_MAX_VER_DIST")],
)
def test_a_value_that_is_not_a_number_is_never_right(
    values: dict[str, float], parameter: str
) -> None:
    assert judged(vehicle(7, 40.0, values)) == []
    found = judged(vehicle(7, 40.0, values | {parameter: math.nan}))
    assert found == [(7, parameter, None)]


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_required_rule_always_knows_what_to_set(autopilot: str) -> None:
    demands = vehicle(7, 40.0, COPTER, is_fenced=True).demands
    for rule in RULES[autopilot]:
        if rule.rule_class is RuleClass.REQUIRED:
            assert isinstance(rule.check(math.nan, {}, demands), SetTo)
            for value in (math.inf, -1.0, 0.0, 1.0, 5.0, 48.0, 1e9):
                assert not isinstance(rule.check(value, {}, demands), OperatorDecides)


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
    vehicles = [
        vehicle(sysid, above, values | {name: least})
        for sysid, above, least in zip((1, 2), (40.0, 52.0), returns_m, strict=True)
    ]
    expected = [
        (sysid, name, to_set) for sysid, to_set in zip((1, 2), rights, strict=True) if to_set
    ]
    assert judged(*vehicles) == expected


def test_firmware_without_a_timeout_parameter_is_not_judged_by_it() -> None:
    values = {name: value for name, value in COPTER.items() if name != "FS_GCS_TIMEOUT"}
    assert judged(vehicle(1, 40.0, values)) == []


def test_what_is_right_is_judged_right() -> None:
    vehicles = [
        vehicle(1, 40.7, COPTER | {"RTL_ALT_M": 60.0}),
        vehicle(2, 52.7, PX4 | {"RTL_RETURN_ALT": 60.0}),
    ]
    rights = {(s, p): r for s, p, r in judged(*vehicles)}
    assert rights == {(1, "RTL_ALT_M"): 40.0, (2, "RTL_RETURN_ALT"): 52.0}
    vehicles = [
        vehicle(1, 40.7, COPTER | {"RTL_ALT_M": 40.0}),
        vehicle(2, 52.7, PX4 | {"RTL_RETURN_ALT": 52.0}),
    ]
    assert judged(*vehicles) == []


def test_every_vehicles_faults_are_found_at_once() -> None:
    found = judged(
        vehicle(1, 40.0, COPTER | {"FS_GCS_ENABLE": 0.0, "MAV_GCS_SYSID": 255.0}),
        vehicle(2, 52.0, PX4 | {"NAV_DLL_ACT": 0.0}),
    )
    assert found == [
        (1, "FS_GCS_ENABLE", 1.0),
        (1, "MAV_GCS_SYSID", 245.0),
        (2, "NAV_DLL_ACT", 2.0),
    ]
