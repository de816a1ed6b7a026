"""Which vehicles are tested: the simulated ones in virtual time, or any at an endpoint."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.conformance.harness import InMemory, Udp, Vehicle

PERSONALITIES = ("ardupilot", "px4")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--vehicle",
        action="append",
        default=[],
        metavar="PERSONALITY=URL",
        help="test a vehicle at an endpoint instead of the simulated ones",
    )


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    # Where this file is not loaded at the start there is no such option.
    given = metafunc.config.getoption("--vehicle", default=[])
    places = dict(each.split("=", 1) for each in given) if given else dict.fromkeys(PERSONALITIES)
    if unknown := set(places) - set(PERSONALITIES):
        raise pytest.UsageError(f"--vehicle knows {PERSONALITIES}, not {sorted(unknown)}")
    for fixture in (*PERSONALITIES, "either"):
        if fixture in metafunc.fixturenames:
            chosen = [p for p in places if fixture in {p, "either"}]
            values = [(p, places[p]) for p in chosen]
            metafunc.parametrize(fixture, values, indirect=True, ids=chosen)


def _vehicle(request: pytest.FixtureRequest) -> Iterator[Vehicle]:
    personality, url = request.param
    if url is None:
        vehicle: Vehicle = InMemory(personality)
        vehicle.ready()
        yield vehicle
        return
    there = Udp(url)
    there.ready()
    yield there
    there.hush()
    there.close()


ardupilot = pytest.fixture(_vehicle, name="ardupilot")
px4 = pytest.fixture(_vehicle, name="px4")
either = pytest.fixture(_vehicle, name="either")
