"""Mission files: every fault is found, named, and comes with what would be right."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from swarmctl.errors import MissionFileError
from swarmctl.mission.mission_file_loading import load_mission, parse_mission
from tests.missions import short_mission_text

SHIPPED = sorted((Path(__file__).parents[2] / "missions").glob("*.yaml"))
DEMO = SHIPPED[0].parent / "beacon_drift.yaml"


def faults(**changes: object) -> dict[str, str]:
    """Faults of the demo mission with some fields set (``__`` for a dot; None deletes)."""
    raw: dict[str, Any] = yaml.safe_load(DEMO.read_text())
    for path, value in changes.items():
        *parents, last = path.split("__")
        section: Any = raw
        for part in parents:
            section = section[int(part) if part.isdigit() else part]
        key: Any = int(last) if last.isdigit() else last
        if value is None:
            del section[key]
        else:
            section[key] = value
    with pytest.raises(MissionFileError) as caught:
        parse_mission(yaml.safe_dump(raw), "m.yaml")
    assert caught.value.exit_code == 2
    assert str(caught.value).startswith("m.yaml: ")
    return {fault.field: str(fault) for fault in caught.value.faults}


@pytest.mark.parametrize("path", SHIPPED, ids=lambda p: p.stem)
def test_every_shipped_mission_is_good(path: Path) -> None:
    assert load_mission(path).name == path.stem


def test_five_faults_are_five_lines() -> None:
    found = faults(
        limits__d_max_m=-300,
        swarm__reference=9,
        origin__lat_deg="north",
        formation__design="square",
        gaol={"sigma_m": 5},
    )
    assert found == {
        "limits.d_max_m": "limits.d_max_m is -300: should be greater than 0",
        "swarm.reference": "swarm.reference is 9: one of the vehicles: 1, 2, 3, 4",
        "origin.lat_deg": "origin.lat_deg is 'north': should be a valid number, unable to parse"
        " string as a number",
        "formation.design": "formation.design is 'square': should be 'optimal',"
        " 'paper', 'uniform', 'regression' or 'worst_case'",
        "gaol": "gaol is a section: no such field; is it misspelt?",
    }


@pytest.mark.parametrize(
    ("field", "value", "says"),
    [
        ("swarm__vehicles__1__sysid", 1, "used by swarm.vehicles.0 too; ids are unique"),
        ("swarm__gcs_sysid", 3, "an id that no vehicle has"),
        ("swarm__vehicles__3__altitude_amsl_m", 130, "limits.ceiling_amsl_m = 120 m"),
        ("swarm__vehicles__0__altitude_amsl_m", 8, "between 12 m (10 m above origin.alt_amsl_m)"),
        ("limits__d_max_m", 40, "more than 51 m"),
        ("limits__cruise_speed_mps", 12.5, "at most limits.max_speed_mps = 13 less a tenth"),
        ("limits__geofence_radius_m", 2700, "at least 3304 m"),
        ("limits__stand_off_m", 2600, "less than the 2579 m between the launch area"),
        ("swarm__link", "http://10.0.0.1:80", "should be one or a list of udpin://host:port"),
        ("swarm__link", ["udpin://0.0.0.0:14550", "tcp://"], "a list of udpin://host:port"),
        ("swarm__link", [], "should be one or a list of udpin://host:port"),
        ("feed__broker", "http://localhost", "should be mqtt://[user:password@]host[:port]"),
        ("sim__receivers__rate_hz", 0, "should be greater than or equal to 0.001"),
        ("sim__receivers__clock_bias_sigma_ns", -1, "should be greater than or equal to 0"),
        ("sim__receivers__clock_bias_sigma_ns", 1e9, "should be less than or equal to 100000"),
        ("sim__receivers__clock_drift_sigma_ns_per_s", float("inf"), "less than or equal to 1000"),
        ("sim__receivers__nlos_share", 5, "should be less than or equal to 1"),
        ("sim__receivers__nlos_max_m", 40, "is 40: at least nlos_min_m = 50 m"),
        ("sim__receivers__colour_tau_s", 0, "should be greater than 0"),
        ("sim__receivers__clock_bias_ns", 10, "no such field; is it misspelt?"),
        ("emitter__sigma_m", float("nan"), "should be a finite number"),
        ("limits__d_max_m", None, "this field is required"),
        ("swarm", None, "this field is required"),
    ],
)
def test_each_fault_is_named_with_what_is_right(field: str, value: object, says: str) -> None:
    found = faults(**{field: value})
    assert says in found[field.replace("__", ".")]


def test_a_default_is_compared_as_if_it_were_written_and_a_mission_may_have_no_simulation() -> None:
    assert (
        "nlos_min_m = 400 m"
        in faults(sim__receivers={"nlos_min_m": 400})["sim.receivers.nlos_max_m"]
    )
    parse_mission(short_mission_text(sim=None))


def test_vehicles_may_share_an_altitude_if_slots_are_far_enough_apart_for_it() -> None:
    """Staggered ones stand 8 m apart; those that are not, that and 5 m and 3 m more."""
    level = [{"sysid": 1 + i, "altitude_amsl_m": 30} for i in range(4)]
    parse_mission(short_mission_text(swarm__vehicles=level))
    found = faults(swarm__vehicles=level, limits__d_max_m=31)
    assert "more than 31 m: the larger of the slots' separation 16 m" in found["limits.d_max_m"]
    assert "more than 51 m" in faults(limits__d_max_m=40)["limits.d_max_m"]


def test_a_fault_in_one_field_does_not_hide_a_rule_between_others() -> None:
    found = faults(limits__ceiling_amsl_m="high", swarm__reference=7)
    assert set(found) == {"limits.ceiling_amsl_m", "swarm.reference"}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "a mission is a mapping of sections"),
        ("- 1\n- 2\n", "a mission is a mapping of sections"),
        ("name: [1, 2\nswarm: {\n", "line 2"),
    ],
)
def test_text_that_is_no_mission(text: str, says: str) -> None:
    with pytest.raises(MissionFileError, match=says):
        parse_mission(text)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(MissionFileError, match="cannot be read \\(No such file or directory\\)"):
        load_mission(tmp_path / "none.yaml")


def test_a_file_that_is_not_text(tmp_path: Path) -> None:
    path = tmp_path / "binary.yaml"
    path.write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(MissionFileError, match="not UTF-8"):
        load_mission(path)


def test_a_prior_is_a_place_or_a_sector() -> None:
    sector = {"bearing_deg": 60, "width_deg": 60, "nearest_m": 1000, "farthest_m": 2000}
    assert faults(emitter__lat_deg=None) == {
        "emitter.lat_deg": "emitter.lat_deg is missing: this field is required, or emitter.sector"
        " instead of the place"
    }
    found = faults(emitter__sector=sector | {"farthest_m": 900}, filter__kind="tracker")
    assert found.keys() == {
        "emitter.lat_deg",
        "emitter.lon_deg",
        "emitter.sigma_m",
        "emitter.sector.farthest_m",
    }
    assert "left out: emitter.sector is given" in found["emitter.sigma_m"]
    wide = {"alt_amsl_m": 0, "sector": sector | {"farthest_m": 9000}}
    assert "expected up to 9000 m" in faults(emitter=wide)["limits.geofence_radius_m"]
    near = {"alt_amsl_m": 0, "sector": sector | {"nearest_m": 300}}
    assert "less than the 300 m" in faults(emitter=near)["limits.stand_off_m"]
    misspelt = {"alt_amsl_m": 0, "sector": sector | {"bearing": 3}}
    assert "no such field" in faults(emitter=misspelt)["emitter.sector.bearing"]


def test_the_linear_filter_is_not_asked_for_what_it_cannot() -> None:
    found = faults(filter__kind="ncrkf", filter__clock_bias_ns=10)
    assert found == {
        "filter.kind": "filter.kind is ncrkf: tracker: the linear filter takes no"
        " filter.clock_bias_ns"
    }
    found = faults(filter__kind="tracker", filter__clock_drift_ns_per_s=0.2)
    assert found.keys() == {"filter.clock_bias_ns"}
