"""The command line as a user meets it: processes, sockets, signals, exit codes."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader

from swarmctl.recorder.summary import read_summary
from tests.summaries import assert_within_limits

pytestmark = pytest.mark.live

Short = Callable[..., Path]

SPEEDUP = "12"


class Command:
    """A ``swarmctl`` process whose output is read as it comes."""

    def __init__(self, *arguments: str, cwd: Path) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "swarmctl", *arguments],
            cwd=cwd,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self.errors = ""
        self._reader = threading.Thread(target=self._read_errors)
        self._reader.start()

    def _read_errors(self) -> None:
        assert self.process.stderr is not None
        self.errors = self.process.stderr.read()

    def until(self, text: str) -> None:
        """Read standard output until a line holds a text."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if text in line:
                return
        self.process.wait()
        self._reader.join()
        pytest.fail(f"{text!r} never came; errors: {self.errors}")

    def interrupt(self) -> None:
        """Ctrl-C: SIGINT to the whole process group, as a terminal sends it."""
        os.killpg(self.process.pid, signal.SIGINT)

    def end(self, timeout: float = 120.0) -> tuple[int, str, str]:
        """Exit code, the rest of standard output, standard error."""
        assert self.process.stdout is not None
        output = self.process.stdout.read()
        code = self.process.wait(timeout)
        self._reader.join()
        self.process.stdout.close()
        assert self.process.stderr is not None
        self.process.stderr.close()
        assert "Traceback" not in self.errors + output
        return code, output, self.errors


def swarmctl(*arguments: str, cwd: Path) -> tuple[int, str, str]:
    return Command(*arguments, cwd=cwd).end()


def topics_of(out: Path) -> set[str]:
    with (out / "mission.mcap").open("rb") as stream:
        return {channel.topic for _, channel, _ in make_reader(stream).iter_messages()}


@pytest.mark.slow
def test_the_demo_over_udp_and_the_embedded_broker(short_mission: Short, tmp_path: Path) -> None:
    out = tmp_path / "out"
    code, output, errors = swarmctl(
        "demo", str(short_mission()), "--headless", "--speedup", SPEEDUP, "--out", str(out),
        cwd=tmp_path,
    )  # fmt: skip
    assert code == 0, errors
    summary = read_summary(out)
    assert summary.result == "located"
    assert summary.seed == 1
    assert_within_limits(summary)
    assert re.search(r"approaching .* to the orbit", output)
    assert "/truth/EmitterTruth" in topics_of(out)


@pytest.mark.slow
def test_the_demo_over_mosquitto(short_mission: Short, tmp_path: Path, mosquitto: str) -> None:
    out = tmp_path / "out"
    code, _, errors = swarmctl(
        "demo", str(short_mission()), "--headless", "--speedup", SPEEDUP, "--out", str(out),
        "--broker", mosquitto, cwd=tmp_path,
    )  # fmt: skip
    assert code == 0, errors
    assert read_summary(out).result == "located"


@pytest.mark.slow
def test_sim_and_run_are_the_demo_in_two_processes(short_mission: Short, tmp_path: Path) -> None:
    # The consent that the mission does not give comes with the command.
    mission = str(short_mission(swarm__set_failsafes=False))
    out = tmp_path / "out"
    simulator = Command("sim", mission, "--speedup", SPEEDUP, cwd=tmp_path)
    simulator.until("simulating 4 vehicles")
    code, _, errors = swarmctl(
        "run", mission, "--headless", "--speedup", SPEEDUP, "--out", str(out), "--set-failsafes",
        cwd=tmp_path,
    )  # fmt: skip
    simulator.interrupt()
    assert simulator.end()[0] == 0
    assert code == 0, errors
    assert read_summary(out).seed is None


@pytest.mark.slow
def test_run_at_another_speed_than_its_vehicles_is_refused(
    short_mission: Short, tmp_path: Path
) -> None:
    mission = str(short_mission())
    simulator = Command("sim", mission, "--speedup", "20", cwd=tmp_path)
    simulator.until("simulating 4 vehicles")
    code, output, _ = swarmctl("run", mission, "--headless", "--out", "out", cwd=tmp_path)
    simulator.interrupt()
    simulator.end()
    assert code == 3
    assert "times as fast as this controller's: start `swarmctl run` with the same" in output


def test_a_mission_with_five_faults_lists_five(short_mission: Short, tmp_path: Path) -> None:
    path = short_mission(
        limits__d_max_m=-1,
        swarm__reference=9,
        swarm__autopilot="arducopter",
        origin__lat_deg=95,
        goal__orbits=2,
    )
    code, output, errors = swarmctl("demo", str(path), "--headless", cwd=tmp_path)
    assert code == 2
    assert not output
    assert errors.splitlines() == [
        f"{path}: 5 faults",
        "  swarm.autopilot is 'arducopter': should be 'auto', 'ardupilot' or 'px4'",
        "  origin.lat_deg is 95: should be less than or equal to 85",
        "  limits.d_max_m is -1: should be greater than 0",
        "  goal.orbits is 2: no such field; is it misspelt?",
        "  swarm.reference is 9: one of the vehicles: 1, 2, 3, 4",
    ]


def test_a_mission_that_is_not_there(tmp_path: Path) -> None:
    code, _, errors = swarmctl("run", "nowhere.yaml", cwd=tmp_path)
    assert code == 2
    assert "nowhere.yaml is neither a mission file nor a shipped mission (beacon_drift" in errors


def test_a_udp_port_in_use_is_named(short_mission: Short, tmp_path: Path) -> None:
    mission = short_mission()
    port = int(yaml.safe_load(mission.read_text())["swarm"]["link"].rpartition(":")[2])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", port))
        code, _, errors = swarmctl("demo", str(mission), "--headless", "--out", "out", cwd=tmp_path)
    assert code == 3
    assert f"UDP port {port} on 127.0.0.1 is in use" in errors
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("link", "code", "says"),
    [
        ("carrier-pigeon://0.0.0.0:1", 2, "swarm.link is 'carrier-pigeon://0.0.0.0:1': should be"),
        ("udpin://0.0.0.0:99999", 2, "'udpin://0.0.0.0:99999' is no MAVLink link: it should be"),
        ("tcp://127.0.0.1:1", 3, "tcp://127.0.0.1:1 cannot be opened (Connect call failed"),
        ("serial:///dev/nothing:57600", 3, "serial:///dev/nothing:57600 cannot be opened"),
    ],
)
def test_a_link_that_cannot_be_meant_or_opened_is_named(
    short_mission: Short, tmp_path: Path, link: str, code: int, says: str
) -> None:
    mission = str(short_mission(swarm__link=link))
    ended, _, errors = swarmctl("run", mission, "--headless", "--out", "out", cwd=tmp_path)
    assert (ended, says in errors) == (code, True), errors
    assert not (tmp_path / "out").exists()


def test_forwarding_to_what_is_no_station_is_bad_input(
    short_mission: Short, tmp_path: Path
) -> None:
    code, _, errors = swarmctl(
        "run", str(short_mission()), "--headless", "--forward", "udpin://0.0.0.0:14551",
        cwd=tmp_path,
    )  # fmt: skip
    assert code == 2
    assert "--forward is 'udpin://0.0.0.0:14551': it should be udpout://host:port" in errors


def test_a_broker_port_in_use_is_named(short_mission: Short, tmp_path: Path) -> None:
    mission = short_mission()
    port = int(yaml.safe_load(mission.read_text())["feed"]["broker"].rpartition(":")[2])
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", port))
        taken.listen()
        code, _, errors = swarmctl("demo", str(mission), "--headless", cwd=tmp_path)
    assert code == 3
    assert str(port) in errors


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--listen", "udpin://127.0.0.1:1"), "--listen goes with --receivers-only"),
        (("--receivers-only", "--listen", "14600"), "'14600' is no MAVLink link"),
        (("--receivers-only", "--listen", "tcp://127.0.0.1:1"), "it should be udpin://host:port"),
    ],
)
def test_receivers_that_cannot_be_meant_are_bad_input(
    tmp_path: Path, arguments: tuple[str, ...], says: str
) -> None:
    code, _, errors = swarmctl("sim", "sitl_px4", *arguments, cwd=tmp_path)
    assert code == 2
    assert says in errors


@pytest.mark.parametrize("broker", ["http://localhost", "mqtts://localhost"])
def test_a_broker_that_cannot_be_meant_is_bad_input(
    short_mission: Short, tmp_path: Path, broker: str
) -> None:
    mission = str(short_mission())
    code, _, errors = swarmctl("demo", mission, "--headless", "--broker", broker, cwd=tmp_path)
    assert code == 2
    assert "mqtt://" in errors


def test_no_broker_is_named(short_mission: Short, tmp_path: Path) -> None:
    mission = short_mission()
    broker = yaml.safe_load(mission.read_text())["feed"]["broker"].removeprefix("mqtt://")
    code, _, errors = swarmctl("run", str(mission), "--headless", cwd=tmp_path)
    assert code == 3
    assert f"No MQTT broker can be reached at {broker}" in errors


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        ("silent", "vehicle 3 never answered on udpin://"),
        pytest.param("refuses_arming", "vehicle 3 refused to arm", marks=pytest.mark.slow),
    ],
)
def test_a_vehicle_at_fault_is_named(
    short_mission: Short, tmp_path: Path, kind: str, says: str
) -> None:
    mission = short_mission(sim__faults=[{"sysid": 3, "kind": kind}])
    code, output, _ = swarmctl(
        "demo", str(mission), "--headless", "--speedup", SPEEDUP, "--out", "out", cwd=tmp_path
    )
    assert code == 3
    assert says in output
    assert read_summary(tmp_path / "out").result in {"vehicle_silent", "arming_refused"}


@pytest.mark.slow
def test_ctrl_c_brings_the_swarm_home_and_closes_the_recording(
    short_mission: Short, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    command = Command(
        "demo", str(short_mission()), "--headless", "--speedup", SPEEDUP, "--out", str(out),
        cwd=tmp_path,
    )  # fmt: skip
    command.until("to the orbit")
    command.interrupt()
    code, output, _ = command.end()
    assert code == 130
    assert "the operator asked for the return home; bringing the swarm home" in output
    summary = read_summary(out)
    assert summary.result == "cancelled"
    assert "/decision/MissionEnded" in topics_of(out)


@pytest.mark.slow
def test_a_second_ctrl_c_leaves_at_once_and_says_what_the_vehicles_do(
    short_mission: Short, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    command = Command(
        "demo", str(short_mission()), "--headless", "--speedup", "5", "--out", str(out),
        cwd=tmp_path,
    )  # fmt: skip
    command.until("to the orbit")
    command.interrupt()
    command.interrupt()  # as make and timeout pass a signal on: still the first
    command.until("to the launch points")
    command.interrupt()
    code, _, errors = command.end(timeout=10.0)
    assert code == 130
    assert "nobody commands the vehicles now:" in errors
    for sysid in (1, 2, 3, 4):
        assert re.search(rf"vehicle {sysid} \(GUIDED, \d+ m AMSL\) brakes about 3 s after", errors)
    assert "/decision/Plan" in topics_of(out)


def test_a_recording_is_never_overwritten(short_mission: Short, tmp_path: Path) -> None:
    mission = str(short_mission(sim__faults=[{"sysid": 3, "kind": "silent"}]))  # soon over
    arguments = ("demo", mission, "--in-memory", "--out", "out")
    assert swarmctl(*arguments, cwd=tmp_path)[0] == 3
    code, _, errors = swarmctl(*arguments, cwd=tmp_path)
    assert code == 2
    assert "out" in errors


def test_the_version(tmp_path: Path) -> None:
    code, output, _ = swarmctl("--version", cwd=tmp_path)
    assert (code, output) == (0, "swarmctl 0.2.0\n")
