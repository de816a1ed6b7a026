"""Filters and formations by name: those of the studies, and a researcher's own."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from swarmctl.errors import UsageError
from swarmctl.study.batch_filter import BatchFilter
from swarmctl.study.filters import iterated_ekf
from swarmctl.study.registry import JUDGED, standard_registry

MY_FILTER = """
import math
from swarmctl.study.filters import iterated_ekf

def register(registry):
    registry.register_filter("two iterations", lambda q: iterated_ekf(2, process_noise=q))
    registry.register_formation("line", [(math.pi, 100.0), (0.0, 200.0)])
"""


@pytest.fixture(autouse=True)
def imports(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """What a test imports is gone after it."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    modules = set(sys.modules)
    yield
    for name in set(sys.modules) - modules:
        if name.startswith("mine_"):
            del sys.modules[name]


def file_with(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_the_formations_are_the_paper_s() -> None:
    """Eqs. (29), N = 3: 300 m, at 90° and at 120° from the line of sight."""
    registry = standard_registry()
    assert list(registry.formations()) == ["perpendicular", "uniform"]
    for name, angle in (("perpendicular", 90.0), ("uniform", 120.0)):
        slots = registry.formations()[name]
        np.testing.assert_allclose(np.degrees(slots[:, 0]), [-angle, 0.0, angle])
        np.testing.assert_array_equal(slots[:, 1], 300.0)


def test_a_filter_is_made_for_the_case_s_process_noise() -> None:
    """The judged one is among them; one of one's own comes last."""
    told: list[tuple[float, float]] = []

    def make(process_noise: tuple[float, float]) -> BatchFilter:
        told.append(process_noise)
        return own

    own = iterated_ekf(3)
    registry = standard_registry()
    registry.register_filter("mine", make)
    made = registry.filters((0.1, 0.2))
    assert told == [(0.1, 0.2)]
    assert made["mine"] is own
    assert list(made)[-1] == "mine"
    assert JUDGED in made
    assert made["iterated EKF"] == iterated_ekf(process_noise=(0.1, 0.2))
    assert made[JUDGED] != registry.filters((0.0, 0.0))[JUDGED]


def test_a_formation_of_one_s_own_joins_the_others() -> None:
    registry = standard_registry()
    registry.register_formation("line", [(math.pi, 100), (0, 200)])
    np.testing.assert_array_equal(registry.formations()["line"], [[math.pi, 100.0], [0.0, 200.0]])
    # What is given out is the reader's: it does not change what is registered.
    registry.formations()["line"][:] = 0.0
    assert registry.formations()["line"][0, 1] == 100.0


def test_what_is_registered_is_in_this_registry_only() -> None:
    registry = standard_registry()
    registry.register_filter("mine", lambda q: iterated_ekf(process_noise=q))
    registry.register_formation("line", [(math.pi, 100), (0, 200)])
    assert "mine" not in standard_registry().filters((0.0, 0.0))
    assert "line" not in standard_registry().formations()


def test_a_name_is_given_once() -> None:
    registry = standard_registry()
    with pytest.raises(UsageError, match="There is a filter called 'OKF' already"):
        registry.register_filter("OKF", lambda q: iterated_ekf(process_noise=q))
    with pytest.raises(UsageError, match="There is a formation called 'uniform' already"):
        registry.register_formation("uniform", [(0.0, 1.0)])


@pytest.mark.parametrize(
    "slots", [[], [(0.0,)], [(0.0, 1.0, 2.0)], [(0.0, math.nan)], [(math.inf, 1.0)], (0.0, 1.0)]
)
def test_slots_that_are_no_pairs_of_numbers_are_refused(slots: list[tuple[float, float]]) -> None:
    registry = standard_registry()
    with pytest.raises(UsageError, match="formation 'bad' must be pairs"):
        registry.register_formation("bad", slots)
    assert "bad" not in registry.formations()


def test_a_file_registers_a_filter_and_a_formation(tmp_path: Path) -> None:
    """And is found by its name from then on, by worker processes as well."""
    path = file_with(tmp_path, "mine_good.py", MY_FILTER)
    # A file that is given twice registers once.
    registry = standard_registry([path, path])
    assert registry.filters((0.1, 0.2))["two iterations"] == iterated_ekf(
        2, process_noise=(0.1, 0.2)
    )
    assert registry.formations()["line"].shape == (2, 2)
    assert str(tmp_path) in sys.path
    # And it may serve another study in this process.
    assert "line" in standard_registry([path]).formations()


@pytest.mark.parametrize("name", ["absent.py", "mine_text.txt", "mine-dashed.py", "mine_folder.py"])
def test_what_is_no_python_file_is_refused(tmp_path: Path, name: str) -> None:
    for path in ("mine_text.txt", "mine-dashed.py"):
        (tmp_path / path).touch()
    (tmp_path / "mine_folder.py").mkdir()
    with pytest.raises(UsageError, match=rf"{name} is no Python file: --with takes one such as"):
        standard_registry([tmp_path / name])


def test_a_file_without_register_is_told_what_to_define(tmp_path: Path) -> None:
    path = file_with(tmp_path, "mine_empty.py", "")
    with pytest.raises(UsageError, match=rf"{path} must define register\(registry\)"):
        standard_registry([path])


def test_a_register_that_fails_is_named_with_its_reason(tmp_path: Path) -> None:
    path = file_with(tmp_path, "mine_raising.py", "def register(registry):\n    1 / 0\n")
    with pytest.raises(UsageError, match=rf"{path} cannot be used: .* ZeroDivisionError\("):
        standard_registry([path])


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("1 / 0", "ZeroDivisionError"),
        ("def", "SyntaxError"),
        ("import no_such_module", "ModuleNotFoundError"),
    ],
)
def test_a_file_that_fails_is_named_with_its_reason(tmp_path: Path, text: str, reason: str) -> None:
    path = file_with(tmp_path, f"mine_{reason}.py", text)
    with pytest.raises(UsageError, match=rf"{path} cannot be loaded: {reason}\("):
        standard_registry([path])


def test_what_a_file_does_wrong_here_is_told_in_our_words(tmp_path: Path) -> None:
    text = MY_FILTER.replace("two iterations", "OKF")
    with pytest.raises(UsageError, match="There is a filter called 'OKF' already"):
        standard_registry([file_with(tmp_path, "mine_taken.py", text)])


def test_a_file_called_like_another_module_is_refused(tmp_path: Path) -> None:
    """It would not be loaded: the other one would."""
    path = file_with(tmp_path, "json.py", MY_FILTER)
    with pytest.raises(UsageError, match=r"another module is called json\. Rename"):
        standard_registry([path])
