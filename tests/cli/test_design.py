"""``swarmctl design`` as an operator meets it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

import pytest

from tests.command_line import run


def design(*arguments: str, cwd: Path) -> CompletedProcess[str]:
    return run("design", *arguments, cwd=cwd)


def document(*arguments: str, cwd: Path) -> dict[str, Any]:
    done = design(*arguments, "--json", cwd=cwd)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_the_best_formation_of_four_as_json(tmp_path: Path) -> None:
    found = document(
        *("--n", "4", "--d-max", "300", "--range", "5000"),
        *("--sigma-r", "0.5", "--sigma-p", "0.5", "--rho", "0.5"),
        cwd=tmp_path,
    )
    assert found["design"] == "optimal"
    assert len(found["slots"]) == 4
    for slot in found["slots"]:
        assert slot["d_m"] <= 300.0 + 1e-6
        assert slot["along_m"] == pytest.approx(slot["d_m"] * math.cos(slot["theta_rad"]))
        assert slot["cross_m"] == pytest.approx(slot["d_m"] * math.sin(slot["theta_rad"]))
    assert found["predicted"]["sigma_along_m"] > 10.0 * found["predicted"]["sigma_cross_m"] > 0.0
    assert set(found["compared"]) == {"uniform", "paper", "regression", "worst_case", "optimal"}
    assert found["compared"]["optimal"] == 1.0
    assert min(found["compared"].values()) == 1.0


def test_time_and_rate_sharpen_what_is_predicted(tmp_path: Path) -> None:
    once = document("--time", "1", "--rate", "1", cwd=tmp_path)["predicted"]
    often = document("--time", "4", "--rate", "25", cwd=tmp_path)["predicted"]
    for name in ("sigma_along_m", "sigma_cross_m"):
        assert once[name] == pytest.approx(10.0 * often[name])


def test_a_track_may_be_what_counts(tmp_path: Path) -> None:
    """Its bound sharpens with time, and the best design for it is another than for one epoch."""
    brief, long = (
        document("--n", "4", "--objective", "track", "--time", seconds, cwd=tmp_path)
        for seconds in ("10", "60")
    )
    assert long["predicted"]["objective_m"] < 0.8 * brief["predicted"]["objective_m"]
    assert min(long["compared"].values()) == 1.0
    assert long["slots"] != document("--n", "4", cwd=tmp_path)["slots"]


@pytest.mark.parametrize(("n", "name"), [("1", "optimal"), ("2", "uniform")])
def test_what_cannot_be_seen_from_one_place_is_said(tmp_path: Path, n: str, name: str) -> None:
    done = design("--n", n, "--design", name, cwd=tmp_path)
    assert "do not tell where the emitter is" in done.stdout
    assert "nan" not in done.stdout + done.stderr
    found = document("--n", n, "--design", name, cwd=tmp_path)
    assert found["predicted"]["sigma_along_m"] is None


def test_axis_slots_are_behind_unless_ahead_is_asked_for(tmp_path: Path) -> None:
    behind, ahead = (
        sorted(
            slot["along_m"] for slot in document("--design", "paper", *flag, cwd=tmp_path)["slots"]
        )
        for flag in ((), ("--ahead",))
    )
    assert behind[0] == pytest.approx(-300.0)
    assert ahead[-1] == pytest.approx(300.0)


def test_a_table_and_a_picture(tmp_path: Path) -> None:
    done = design("--n", "3", "--plot", "shape.png", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "1-sigma after 10 s at 10 Hz" in done.stdout
    assert (tmp_path / "shape.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        (["--n", "0"], 2, "A formation needs at least one companion, not 0."),
        (["--d-max", "5"], 2, "The minimum separation, 10 m, must be above 0 and not above"),
        (["--range", "200"], 2, "the emitter would be inside the formation"),
        (["--design", "square"], 2, "There is no design 'square'; there are uniform, paper,"),
        (["--rho", "1"], 2, "rho must be at least 0 and below 1; it is 1."),
        (["--objective", "track", "--speed", "500"], 2, "reach beyond the emitter"),
        (["--time", "0"], 2, "Time and rate must be above 0, not 0 s and 10 Hz."),
        (["--plot", "no/where.png"], 2, "--plot no/where.png cannot be written"),
        (["--plot", "shape.xyz"], 2, "--plot shape.xyz cannot be written"),
        (["--n", "40", "--separation", "90", "--d-max", "100"], 2, "do not fit within 100 m"),
    ],
)
def test_bad_input_is_a_sentence(
    tmp_path: Path, arguments: list[str], code: int, sentence: str
) -> None:
    done = design(*arguments, cwd=tmp_path)
    assert done.returncode == code
    assert sentence in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr
