"""``swarmctl track`` as its user meets it."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest

from tests.command_line import run

ROOM = Path(__file__).parents[1] / "datasets" / "room"


def track(*arguments: str, cwd: Path) -> CompletedProcess[str]:
    files = ("--receivers", "receivers.csv", "--measurements", "measurements.csv", "--out", "out")
    return run("track", *files, *arguments, cwd=cwd)


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """The first four seconds of the data set that ships."""
    for name in ("receivers.csv", "truth.csv"):
        shutil.copy(ROOM / name, tmp_path)
    lines = (ROOM / "measurements.csv").read_text(encoding="utf-8").splitlines()
    (tmp_path / "measurements.csv").write_text("\n".join(lines[:801]) + "\n", encoding="utf-8")
    return tmp_path


def test_it_leaves_estimates_figures_and_plots(room: Path) -> None:
    done = track("--truth", "truth.csv", cwd=room)
    assert done.returncode == 0, done.stderr
    assert "RMSE" in done.stdout
    summary = json.loads((room / "out" / "summary.json").read_text(encoding="utf-8"))
    assert {"rmse_m", "mean_nees", "median_nees", "share_rejected", "share_lost"} <= set(summary)
    with (room / "out" / "estimates.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == summary["epochs"] == 800
    found = [row for row in rows if row["east_m"]]
    assert len(found) == summary["estimates"]
    # The summary is of the file: its error at the last epoch is a fair share of the RMSE's.
    errors = []
    with (room / "truth.csv").open(encoding="utf-8") as file:
        truth = {f"{float(row['time_s']):.15g}": row for row in csv.DictReader(file)}
    for row in found:
        if row["time_s"] in truth:
            true = truth[row["time_s"]]
            errors.append([float(row[k]) - float(true[k]) for k in ("east_m", "north_m", "up_m")])
        sigmas = [float(row[f"cov_{axis}_{axis}"]) for axis in ("east", "north", "up")]
        assert min(sigmas) > 0.0
    # Every tenth epoch has a true position: the same RMSE but for what happens in between.
    assert np.sqrt(np.mean(np.square(errors)) * 3.0) == pytest.approx(summary["rmse_m"], rel=0.2)
    assert found[-1]["health"] == "tracking"
    for plot in ("track.png", "error.png"):
        assert (room / "out" / plot).read_bytes().startswith(b"\x89PNG")


def test_without_a_truth_and_of_known_height(room: Path) -> None:
    done = track("--height", "0.1", "--filter", "ekf", "--at", "3.5,4,0", "--within", "1", cwd=room)
    assert done.returncode == 0, done.stderr
    summary = json.loads((room / "out" / "summary.json").read_text(encoding="utf-8"))
    assert "rmse_m" not in summary
    assert summary["assumed"]["height_m"] == 0.1


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--truth", "none.csv"), "none.csv cannot be read: No such file or directory."),
        (("--at", "1,2"), "--at is '1,2'; three numbers E,N,U in metres would be right."),
        (("--sigma", "0"), "sigma_m must be above 0, not 0."),
        (("--out", "truth.csv"), "--out truth.csv cannot be written: File exists."),
    ],
)
def test_bad_arguments_are_a_sentence(
    room: Path, arguments: tuple[str, ...], sentence: str
) -> None:
    done = track(*arguments, cwd=room)
    assert done.returncode == 2
    assert done.stderr.strip() == sentence


def test_a_feed_that_is_replayed_is_said_at_the_end_and_in_the_summary(room: Path) -> None:
    lines = (room / "measurements.csv").read_text(encoding="utf-8").splitlines()
    for k in range(501, len(lines)):  # the last second again, with new times
        lines[k] = lines[k].split(",")[0] + "," + lines[k - 200].split(",", 1)[1]
    (room / "measurements.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    done = track(cwd=room)
    assert done.returncode == 0, done.stderr
    summary = json.loads((room / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["wrong"][0]["cause"] == "repeated"
    assert summary["repeated"] > 0
    said = " ".join(done.stdout.split())
    assert f"of the time: {summary['wrong'][0]['sentence']}" in said
    rows = (room / "out" / "estimates.csv").read_text(encoding="utf-8").splitlines()
    assert rows[-1].endswith("degraded,repeated")


def test_a_bad_line_is_named_and_ends_it_and_costs_no_earlier_result(room: Path) -> None:
    earlier = room / "out" / "estimates.csv"
    earlier.parent.mkdir()
    earlier.write_text("of an earlier run", encoding="utf-8")
    with (room / "measurements.csv").open("a", encoding="utf-8") as file:
        file.write("1.0,sw-low,nw-low,0.5\n")
    done = track(cwd=room)
    assert done.returncode == 2
    assert done.stderr.strip() == (
        "measurements.csv, line 802: time_s is 1 after 3.995; lines sorted by time would be right."
    )
    assert [path.name for path in earlier.parent.iterdir()] == [earlier.name]
    assert earlier.read_text(encoding="utf-8") == "of an earlier run"


def test_receivers_that_were_elsewhere_in_time_are_said(room: Path) -> None:
    (room / "receivers.csv").write_text(
        "receiver,east_m,north_m,up_m,time_s\n"
        + "".join(
            f"{name}{level},{x},{y},1,{t}\n"
            for name, x, y in (("sw", 0, 0), ("nw", 0, 8), ("se", 7, 0), ("ne", 7, 8))
            for level in ("-low", "-top")
            for t in (100, 101)
        ),
        encoding="utf-8",
    )
    done = track(cwd=room)
    assert done.returncode == 2
    assert "no line has the positions of both its receivers in receivers.csv" in done.stderr
    assert "Traceback" not in done.stderr
