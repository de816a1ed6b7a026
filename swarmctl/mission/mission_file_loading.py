"""Reading a mission file: every fault in it, not only the first.

Two layers of checks. Field by field (types, bounds, misspelt names) pydantic lists all faults.
Between fields, :data:`RULES` compares what the first layer left usable: a rule is skipped only
when a field it needs is itself at fault, so faults of both layers are reported together.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, get_args

import yaml
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from swarmctl.errors import Fault, MissionFileError
from swarmctl.formation.separation import slot_separation
from swarmctl.frames import LocalFrame
from swarmctl.mission.mission_file import Mission


def load_mission(path: str | Path) -> Mission:
    """Read a mission file; a path in it is found from where it is.

    Raises:
        MissionFileError: If it cannot be read or has faults; all of them are listed.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        fault = Fault("the file", repr(str(path)), f"cannot be read ({reason}); give a YAML file")
        raise MissionFileError(str(path), (fault,)) from error
    mission = parse_mission(text, str(path))
    if not mission.swarm.signing_key_file:
        return mission
    key_file = str(path.parent / mission.swarm.signing_key_file)
    swarm = mission.swarm.model_copy(update={"signing_key_file": key_file})
    return mission.model_copy(update={"swarm": swarm})


def parse_mission(text: str, path: str = "mission") -> Mission:
    """Make a mission of YAML text; ``path`` names it in faults.

    Raises:
        MissionFileError: If it has faults; all of them are listed.
    """
    try:
        raw = yaml.safe_load(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"line {mark.line + 1}" if mark is not None else "the text"
        problem = getattr(error, "problem", None) or "it cannot be parsed"
        raise MissionFileError(path, (Fault(where, "not YAML", str(problem)),)) from error
    if not isinstance(raw, dict):
        found = type(raw).__name__ if raw is not None else "empty"
        fault = Fault("the file", found, "a mission is a mapping of sections (swarm, limits, ...)")
        raise MissionFileError(path, (fault,))
    faults: list[Fault] = []
    mission = None
    try:
        mission = Mission.model_validate(raw)
    except ValidationError as error:
        faults += [_fault(e) for e in error.errors()]
    view = _View(raw, {fault.field for fault in faults})
    for rule in RULES:
        try:
            faults += rule(view)
        except _UnusableFieldError:
            continue
    if mission is None or faults:
        raise MissionFileError(path, tuple(faults))
    return mission


def _fault(error: ErrorDetails) -> Fault:
    field = ".".join(str(part) for part in error["loc"])
    if error["type"] == "missing":
        return Fault(field, "missing", "this field is required")
    value = error["input"]
    shown = "a section" if isinstance(value, dict | list) else repr(value)
    if error["type"] == "extra_forbidden":
        return Fault(field, shown, "no such field; is it misspelt?")
    return Fault(field, shown, error["msg"].removeprefix("Input ").lower())


class _UnusableFieldError(Exception):
    """A rule needs a field that is itself at fault or absent."""


class _View:
    """The raw file, with defaults, minus the fields at fault."""

    def __init__(self, raw: dict[str, Any], bad: set[str]) -> None:
        self._raw = raw
        self._bad = bad

    def _find(self, path: str) -> object:
        if any(path == bad or path.startswith(bad + ".") for bad in self._bad):
            raise _UnusableFieldError
        value: object = self._raw
        model: type[BaseModel] = Mission
        for part in path.split("."):
            info = model.model_fields[part]
            if isinstance(value, dict):
                value = value.get(part, info.default)
            else:  # a section left out: its default is a model
                value = getattr(value, part, info.default)
            for kind in (info.annotation, *get_args(info.annotation)):  # X, or X | None
                if isinstance(kind, type) and issubclass(kind, BaseModel):
                    model = kind
        return value

    def has(self, path: str) -> bool:
        """Whether a field that may be left out was given."""
        return self._find(path) is not None

    def number(self, path: str) -> float:
        value = self._find(path)
        if not isinstance(value, int | float | str):
            raise _UnusableFieldError
        return float(value)

    def text(self, path: str) -> str:
        return str(self._find(path))

    def vehicles(self) -> Iterator[tuple[str, int, float]]:
        """Path, system id and altitude of every usable vehicle."""
        items = self._find("swarm.vehicles")
        for i, item in enumerate(items if isinstance(items, list) else []):
            path = f"swarm.vehicles.{i}"
            if not any(bad == path or bad.startswith(path + ".") for bad in self._bad):
                yield path, int(item["sysid"]), float(item["altitude_amsl_m"])


def _swarm_rules(view: _View) -> list[Fault]:
    faults = []
    seen: dict[int, str] = {}
    for path, sysid, _ in view.vehicles():
        if sysid in seen:
            faults.append(
                Fault(f"{path}.sysid", str(sysid), f"used by {seen[sysid]} too; ids are unique")
            )
        seen.setdefault(sysid, path)
    reference = int(view.number("swarm.reference"))
    if reference not in seen:
        known = ", ".join(str(s) for s in seen)
        faults.append(Fault("swarm.reference", str(reference), f"one of the vehicles: {known}"))
    return faults


def _gcs_rule(view: _View) -> list[Fault]:
    gcs = int(view.number("swarm.gcs_sysid"))
    if gcs in {sysid for _, sysid, _ in view.vehicles()}:
        return [Fault("swarm.gcs_sysid", str(gcs), "an id that no vehicle has")]
    return []


def _altitude_rules(view: _View) -> list[Fault]:
    ceiling = view.number("limits.ceiling_amsl_m")
    ground = view.number("origin.alt_amsl_m")
    return [
        Fault(
            f"{path}.altitude_amsl_m",
            f"{altitude:g}",
            f"between {ground + 10:g} m (10 m above origin.alt_amsl_m) and"
            f" limits.ceiling_amsl_m = {ceiling:g} m",
        )
        for path, _, altitude in view.vehicles()
        if not ground + 10.0 <= altitude <= ceiling
    ]


def _slot_rules(view: _View) -> list[Fault]:
    d_max = view.number("limits.d_max_m")
    margin = view.number("formation.margin_m")
    altitudes = [altitude for _, _, altitude in view.vehicles()]
    separation = slot_separation(
        altitudes,
        view.number("limits.min_separation_m"),
        view.number("formation.separation_margin_m"),
    )
    spread = max(altitudes) - min(altitudes) if altitudes else 0.0
    least = max(separation, spread) + margin
    if d_max > least:
        return []
    return [
        Fault(
            "limits.d_max_m",
            f"{d_max:g}",
            f"more than {least:g} m: the larger of the slots' separation {separation:g} m and"
            f" the altitude spread {spread:g} m, plus formation.margin_m = {margin:g} m",
        )
    ]


def _speed_rule(view: _View) -> list[Fault]:
    cruise, top = view.number("limits.cruise_speed_mps"), view.number("limits.max_speed_mps")
    if cruise * 1.1 <= top:
        return []
    return [
        Fault(
            "limits.cruise_speed_mps",
            f"{cruise:g}",
            f"at most limits.max_speed_mps = {top:g} less a tenth, so that followers can catch up",
        )
    ]


def _fence_rule(view: _View) -> list[Fault]:
    fence = view.number("limits.geofence_radius_m")
    d_max = view.number("limits.d_max_m")
    radius = view.number("limits.stand_off_m") + view.number("formation.stand_off_margin_m")
    nearest, farthest = _prior_distances_m(view)
    # All round the emitter, with a companion behind the reference UAV.
    needed = farthest + radius + d_max
    faults = []
    if needed > fence:
        faults.append(
            Fault(
                "limits.geofence_radius_m",
                f"{fence:g}",
                f"at least {needed:.0f} m: the emitter is expected up to {farthest:.0f} m from"
                f" the origin, and the orbit round it with the formation reaches"
                f" {needed - farthest:.0f} m farther",
            )
        )
    if nearest < radius:
        faults.append(
            Fault(
                "limits.stand_off_m",
                f"{radius - view.number('formation.stand_off_margin_m'):g}",
                f"less than the {nearest:.0f} m between the launch area and the expected"
                " emitter, with formation.stand_off_margin_m to spare",
            )
        )
    return faults


_PLACE = ("emitter.lat_deg", "emitter.lon_deg", "emitter.sigma_m")


def _prior_rule(view: _View) -> list[Fault]:
    if not view.has("emitter.sector"):
        return [
            Fault(path, "missing", "this field is required, or emitter.sector instead of the place")
            for path in _PLACE
            if not view.has(path)
        ]
    faults = [
        Fault(path, f"{view.number(path):g}", "left out: emitter.sector is given instead")
        for path in _PLACE
        if view.has(path)
    ]
    nearest, farthest = (view.number(f"emitter.sector.{end}_m") for end in ("nearest", "farthest"))
    if nearest >= farthest:
        faults.append(
            Fault(
                "emitter.sector.farthest_m",
                f"{farthest:g}",
                f"more than emitter.sector.nearest_m = {nearest:g}",
            )
        )
    return faults


def _prior_distances_m(view: _View) -> tuple[float, float]:
    """Least and greatest distance of the expected emitter from the origin."""
    if view.has("emitter.sector"):
        return (
            view.number("emitter.sector.nearest_m"),
            view.number("emitter.sector.farthest_m"),
        )
    origin = LocalFrame(
        math.radians(view.number("origin.lat_deg")),
        math.radians(view.number("origin.lon_deg")),
        view.number("origin.alt_amsl_m"),
    )
    east, north, _ = origin.to_enu(
        math.radians(view.number("emitter.lat_deg")),
        math.radians(view.number("emitter.lon_deg")),
        view.number("emitter.alt_amsl_m"),
    )
    distance = math.hypot(east, north)
    return distance, distance


def _echo_rule(view: _View) -> list[Fault]:
    least, most = (view.number(f"sim.receivers.nlos_{end}_m") for end in ("min", "max"))
    if least <= most:
        return []
    return [
        Fault("sim.receivers.nlos_max_m", f"{most:g}", f"at least nlos_min_m = {least:g} m"),
    ]


_FULL_ONLY = (
    "navigation_sigma_m",
    "clock_bias_ns",
    "clock_drift_ns_per_s",
    "colour_sigma_m",
    "manoeuvre_speed_mps",
)


def _filter_rule(view: _View) -> list[Fault]:
    faults = []
    drift, bias = view.number("filter.clock_drift_ns_per_s"), view.number("filter.clock_bias_ns")
    if drift > 0.0 and bias == 0.0:
        faults.append(
            Fault("filter.clock_bias_ns", "0", "above 0, since filter.clock_drift_ns_per_s is")
        )
    if view.text("filter.kind") != "ncrkf":
        return faults
    asked = [f"filter.{name}" for name in _FULL_ONLY if view.number(f"filter.{name}") > 0.0]
    asked += ["emitter.sector"] if view.has("emitter.sector") else []
    if asked:
        faults.append(
            Fault("filter.kind", "ncrkf", f"tracker: the linear filter takes no {asked[0]}")
        )
    return faults


RULES: tuple[Callable[[_View], list[Fault]], ...] = (
    _swarm_rules,
    _gcs_rule,
    _altitude_rules,
    _slot_rules,
    _speed_rule,
    _fence_rule,
    _prior_rule,
    _filter_rule,
    _echo_rule,
)
"""Every check between fields; each names the field to change and what would be right."""
