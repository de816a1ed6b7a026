"""The public interface: ``import swarmctl`` and what it offers."""

import subprocess
import sys
import typing

import pytest

import swarmctl


def loaded_by(code: str) -> set[str]:
    """Names of the modules that a new interpreter has loaded after running some code."""
    done = subprocess.run(
        [sys.executable, "-c", f"{code}; import sys; print(*sys.modules)"],
        check=True,
        capture_output=True,
        text=True,
    )
    return set(done.stdout.split())


@pytest.mark.parametrize("name", swarmctl.__all__)
def test_every_public_name_is_there_and_explained(name: str) -> None:
    value = getattr(swarmctl, name)
    assert value is getattr(swarmctl, name)
    assert name in dir(swarmctl)
    assert f"``{name}``" in str(swarmctl.__doc__) or name.endswith("Error")
    if isinstance(value, type):
        assert value.__doc__


def test_every_public_error_is_a_swarm_error_and_none_is_missing() -> None:
    from swarmctl import errors  # noqa: PLC0415 - a module, not a public name

    public = {name for name in swarmctl.__all__ if name.endswith("Error")}
    assert all(issubclass(getattr(swarmctl, name), swarmctl.SwarmError) for name in public)
    assert public >= {name for name in vars(errors) if name.endswith("Error")}


def test_a_name_that_is_not_public_is_refused() -> None:
    with pytest.raises(AttributeError, match="no attribute 'Debrief'"):
        _ = swarmctl.Debrief  # type: ignore[attr-defined]


def test_importing_the_package_loads_nothing_else() -> None:
    loaded = loaded_by("import swarmctl")
    assert "numpy" not in loaded
    assert {name for name in loaded if name.startswith("swarmctl")} == {"swarmctl"}


def test_a_name_loads_only_what_it_needs() -> None:
    loaded = loaded_by("from swarmctl import MissionResult, UsageError")
    assert "numpy" not in loaded


def test_a_star_import_brings_every_name() -> None:
    names: dict[str, typing.Any] = {}
    exec("from swarmctl import *", names)
    assert names.keys() >= set(swarmctl.__all__)


def test_the_command_line_loads_numpy_only_for_a_command_that_needs_it() -> None:
    assert "numpy" not in loaded_by("import swarmctl.cli")
