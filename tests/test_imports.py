"""The rooms of the house know only what they may (docs/explanation/design.md)."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

COMMON = {
    "swarmctl",
    "swarmctl.commands",
    "swarmctl.decisions",
    "swarmctl.errors",
    "swarmctl.events",
    "swarmctl.frames",
    "swarmctl.results",
    "swarmctl.units",
}
ALLOWED: dict[str, set[str]] = {
    "swarmctl.estimation": {"swarmctl.errors", "swarmctl.units"},
    "swarmctl.formation": {
        "swarmctl.errors",
        "swarmctl.estimation.bounds",
        "swarmctl.estimation.model",
        "swarmctl.units",
    },
    "swarmctl.mission": COMMON | {"swarmctl.estimation", "swarmctl.formation"},
    "swarmctl.link": COMMON,
    "swarmctl.feed": COMMON,
    "swarmctl.recorder": COMMON | {"swarmctl.estimation"},
    "swarmctl.datasets": {"swarmctl.errors", "swarmctl.estimation", "swarmctl.units"},
    "swarmctl.ops": COMMON
    | {
        "swarmctl.estimation",
        "swarmctl.feed",
        "swarmctl.link",
        "swarmctl.mission",
        "swarmctl.recorder",
        "sim",
    },
    "swarmctl.cli": COMMON
    | {
        "swarmctl.formation",
        "swarmctl.mission",
        "swarmctl.ops",
        "swarmctl.datasets",
        "swarmctl.recorder.summary",
        "swarmctl.study",
    },
    "sim": {"swarmctl.errors", "swarmctl.frames", "swarmctl.feed.schema", "swarmctl.units"},
    "swarmctl.study": {
        "sim",
        "swarmctl.errors",
        "swarmctl.estimation",
        "swarmctl.formation",
        "swarmctl.mission",
        "swarmctl.ops",
        "swarmctl.units",
    },
    "missions": {"swarmctl"},
}
"""What of this project each room may import, besides itself; a room inside a room has its own."""

PURE = ("swarmctl.estimation", "swarmctl.formation", "swarmctl.mission")
IMPURE = {"asyncio", "socket", "time", "datetime", "random", "threading", "aiomqtt", "amqtt"}
SOLE_IMPORTERS = {
    "pymavlink": {
        "swarmctl/link/codec/framing.py",
        "swarmctl/link/codec/answer_decoding.py",
        "swarmctl/link/codec/decoding.py",
        "swarmctl/link/codec/telemetry_decoding.py",
        "swarmctl/link/codec/encoding.py",
        "sim/mavlink.py",
    },
    "aiomqtt": {"swarmctl/feed/client.py", "sim/serve.py"},
    "amqtt": {"swarmctl/feed/broker.py"},
    "mavsdk": {"swarmctl/link/mavsdk_link.py"},
}


def sources() -> list[Path]:
    return [p for room in ("swarmctl", "sim", "missions") for p in (ROOT / room).rglob("*.py")]


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            module = node.module or ""
            submodules = (ROOT / Path(*module.split("."))).is_dir()
            yield from (f"{module}.{a.name}" if submodules else module for a in node.names)


def within(name: str, room: str) -> bool:
    return name == room or name.startswith(room + ".")


@pytest.mark.parametrize("path", sources(), ids=module_name)
def test_a_module_imports_only_what_its_room_may_know(path: Path) -> None:
    name = module_name(path)
    rooms = sorted((room for room in ALLOWED if within(name, room)), key=len)[-1:]
    for imported in imports(path):
        if not imported.startswith(("swarmctl", "sim.", "missions", "tests")):
            continue
        for room in rooms:
            allowed = within(imported, room) or any(
                imported == known if known == "swarmctl" else within(imported, known)
                for known in ALLOWED[room]
            )
            assert allowed, f"{name} imports {imported}"


@pytest.mark.parametrize(
    "path", [p for p in sources() if module_name(p).startswith(PURE)], ids=module_name
)
def test_the_core_reads_no_clock_and_no_socket(path: Path) -> None:
    used = {imported.split(".")[0] for imported in imports(path)}
    assert not used & (IMPURE | {"pymavlink"})


@pytest.mark.parametrize(
    "path", [p for p in sources() if within(module_name(p), "swarmctl.study")], ids=module_name
)
def test_a_study_opens_no_socket(path: Path) -> None:
    used = {imported.split(".")[0] for imported in imports(path)}
    assert not used & {"asyncio", "socket", "aiohttp", "aiomqtt", "amqtt", "pymavlink", "mavsdk"}


@pytest.mark.parametrize("library", sorted(SOLE_IMPORTERS))
def test_only_the_modules_made_for_it_import_a_protocol_library(library: str) -> None:
    importers = {
        str(path.relative_to(ROOT))
        for path in sources()
        if any(within(imported, library) for imported in imports(path))
    }
    assert importers == SOLE_IMPORTERS[library]


@pytest.mark.parametrize("path", sorted((ROOT / "tests").rglob("*.py")), ids=module_name)
def test_no_module_imports_from_a_test(path: Path) -> None:
    """What several tests need is in a helper module."""
    assert [name for name in imports(path) if ".test_" in name] == []
