"""``swarmctl study`` as a researcher meets it: processes, files, a cluster, exit codes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from tests.command_line import run

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "docs" / "how-to" / "my_study.py"

CLUSTER = """
import sys
from distributed import LocalCluster
if __name__ == "__main__":
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


def study(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return run("study", *arguments, cwd=cwd)


@pytest.mark.slow
def test_table_1_leaves_figures_and_numbers(tmp_path: Path) -> None:
    done = study("table1", "--runs", "4", "--out", "deep/out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    out = tmp_path / "deep" / "out"
    names = {path.name for path in out.iterdir()}
    assert {"table1.csv", "table1.json"} < names
    assert {name[:4] for name in names if name.startswith("fig")} == {
        f"fig{number}" for number in range(2, 10)
    }
    for word in ("perpendicular", "uniform", "NCRKF, the paper's", "bound, CV", "deep/out"):
        assert word in done.stdout


@pytest.mark.slow
@pytest.mark.live
def test_consistency_as_json_is_the_same_on_a_cluster(tmp_path: Path) -> None:
    """Workers in processes of their own, which know nothing of the example but what is sent."""
    pytest.importorskip("distributed")
    command = ["consistency", "--runs", "5", "--case", "literal", "--json", "--with", str(EXAMPLE)]
    here = study(*command, cwd=tmp_path)
    assert here.returncode == 0, here.stderr
    document = json.loads(here.stdout)
    assert (document["runs"], document["seed"], document["rho"]) == (5, 0, 0.5)
    judged = document["rows"][0]
    assert judged["filter"] == "NCRKF"
    assert [instant["time_s"] for instant in judged["instants"]] == [1.0, 4.0, 8.0, 12.0]
    assert judged["instants"][0]["ratio_cv"][1] < judged["instants"][0]["ratio_cv"][0]
    assert judged["shortfalls"] is not None
    others = [row["filter"] for row in document["rows"][-3:]]
    assert others == ["NCRKF, relative", "NCRKF, relative CA", "uncorrelated EKF"]
    assert document["rows"][-1]["shortfalls"] is None

    # Its scheduler, too, in another process: it loads what it is sent.
    cluster = subprocess.Popen(
        [sys.executable, "-c", CLUSTER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        assert cluster.stdout is not None
        address = cluster.stdout.readline().strip().replace("tcp://", "dask://")
        away = study(*command, "--executor", address, cwd=tmp_path)
    finally:
        cluster.communicate("", timeout=30)
    assert away.returncode == 0, away.stderr
    assert away.stdout == here.stdout


@pytest.mark.slow
def test_the_track_s_cases_are_tables_or_json(tmp_path: Path) -> None:
    """Beside the filters, with what the case asks for; how long it takes is said first."""
    command = ["track", "--runs", "2", "--case", "no-prior"]
    shown = study(*command, cwd=tmp_path)
    assert shown.returncode == 0, shown.stderr
    assert "2 runs a case take about 1 min on one core." in shown.stderr
    for word in ("no prior; 10 Hz", "RMSE/bound", "iterated", "latest first estimate (s): 0."):
        assert word in shown.stdout
    done = study(*command, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert (document["runs"], document["seed"]) == (2, 0)
    rows = document["rows"]
    assert [row["filter"] for row in rows][:2] == ["tracker", "NCRKF"]
    assert [instant["time_s"] for instant in rows[0]["instants"]] == [1.0, 4.0, 8.0, 12.0, 16.0]
    assert {"latest first estimate (s)", "share of the RDs set aside"} <= {
        measure["name"] for measure in rows[0]["measures"]
    }
    assert rows[0]["shortfalls"] is not None


@pytest.mark.slow
def test_the_health_of_the_track_is_a_table_or_json(tmp_path: Path) -> None:
    shown = study("health", "--runs", "2", cwd=tmp_path)
    assert shown.returncode == 0, shown.stderr
    for word in ("fault", "false/h", "a clock jumps by 100 ns", "tolerance"):
        assert word in shown.stdout
    done = study("health", "--runs", "2", "--seed", "1", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert (document["runs"], document["seed"]) == (2, 1)
    good, noisy = document["rows"][:2]
    assert (good["fault"], good["named"], good["latest_s"]) == ("none", None, None)
    assert noisy["fault"] == "noise doubled"
    assert noisy["named"][0] == 1.0


@pytest.mark.slow
def test_information_says_what_eq_51_is_worth(tmp_path: Path) -> None:
    command = ["information", "--runs", "3", "--epochs", "50", "--with", str(EXAMPLE)]
    done = study(*command, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    out = tmp_path / "study-information"
    assert (out / "information.png").stat().st_size > 1000
    document = json.loads((out / "information.json").read_text())
    assert set(document["formations"]) == {"perpendicular", "uniform", "axis behind"}
    assert "Cramér-Rao bound" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        (["consistency", "--case", "easy"], 2, "There is no case 'easy'; there are matched,"),
        (["track", "--case", "easy"], 2, "There is no case 'easy'; there are tracker-range-"),
        (["consistency", "--executor", "tcp://a:1"], 2, "must look like dask://host:port."),
        (["consistency", "--executor", "dask://127.0.0.1:9"], 3, "No dask scheduler answers"),
        (["consistency", "--with", "gone.py"], 2, "gone.py is no Python file"),
        (["table1", "--runs", "2", "--out", "taken"], 2, "--out taken cannot be made: File exists"),
        (["table1", "--runs", "1"], 2, "Input should be greater than or equal to 2"),
        (["table1", "--runs", "2", "--with", "broken.py"], 3, "breaks failed at epoch 0: oh"),
    ],
)
def test_bad_input_is_a_sentence(
    tmp_path: Path, arguments: list[str], code: int, sentence: str
) -> None:
    (tmp_path / "taken").touch()
    (tmp_path / "broken.py").write_text(
        "from swarmctl.study.filters import ncrkf\n"
        "class Broken:\n"
        "    relative = False\n"
        "    start, estimate = ncrkf().start, ncrkf().estimate\n"
        "    def step(self, belief, scan):\n"
        "        raise ValueError('oh')\n"
        "def register(registry):\n"
        "    registry.register_filter('breaks', lambda q: Broken())\n"
    )
    done = study(*arguments, cwd=tmp_path)
    assert done.returncode == code
    assert sentence in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr


@pytest.mark.live
@pytest.mark.parametrize("workers", ["1", "2"])
def test_ctrl_c_ends_a_long_study(tmp_path: Path, workers: str) -> None:
    process = subprocess.Popen(
        [
            # A shell's background job starts with SIGINT ignored, and hands that on.
            *("env", "--default-signal=INT", sys.executable, "-m", "swarmctl", "study"),
            *("consistency", "--runs", "100000", "--case", "range-ignorant", "--workers", workers),
        ],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        # Under way: a chunk's arrays are filled. A busy processor is all that can be seen.
        deadline = time.monotonic() + 60.0
        family = psutil.Process(process.pid)
        while _cpu_s(family) < 3.0 * int(workers):
            assert time.monotonic() < deadline
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(timeout=0.1)
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
    assert process.returncode == 130
    assert "Traceback" not in errors


def _cpu_s(family: psutil.Process) -> float:
    total = 0.0
    for process in (family, *family.children(recursive=True)):
        try:
            times = process.cpu_times()
        except psutil.NoSuchProcess:
            continue
        total += times.user + times.system
    return total
