"""The phase table."""

import pytest

from swarmctl.mission.phases import TRANSITIONS, Phase, Trigger, can, diagram, next_phase


def test_a_mission_without_trouble_passes_every_phase_once() -> None:
    phase, seen = Phase.WAITING, [Phase.WAITING]
    for trigger in (
        Trigger.HEARD,
        Trigger.CHECKED,
        Trigger.AIRBORNE,
        Trigger.FORMED,
        Trigger.AT_RADIUS,
        Trigger.OBSERVED,
        Trigger.HOME,
        Trigger.LANDED,
    ):
        phase = next_phase(phase, trigger)
        seen.append(phase)
    assert seen == list(Phase)


BREAKS_OFF = pytest.mark.parametrize("trigger", [Trigger.FAILED, Trigger.CALLED_HOME])


@BREAKS_OFF
@pytest.mark.parametrize(
    "phase", [Phase.LAUNCHING, Phase.FORMING, Phase.APPROACHING, Phase.ORBITING]
)
def test_a_failure_or_the_operator_in_the_air_leads_home(phase: Phase, trigger: Trigger) -> None:
    assert next_phase(phase, trigger) is Phase.RETURNING


@BREAKS_OFF
@pytest.mark.parametrize("phase", [Phase.WAITING, Phase.CHECKING])
def test_a_failure_or_the_operator_on_the_ground_ends_the_mission(
    phase: Phase, trigger: Trigger
) -> None:
    assert next_phase(phase, trigger) is Phase.ENDED


@BREAKS_OFF
@pytest.mark.parametrize("phase", [Phase.RETURNING, Phase.LANDING, Phase.ENDED])
def test_nothing_interrupts_the_way_home(phase: Phase, trigger: Trigger) -> None:
    assert not can(phase, trigger)


def test_a_move_that_is_not_in_the_table_is_an_error() -> None:
    with pytest.raises(ValueError, match="no move from waiting on every vehicle disarmed"):
        next_phase(Phase.WAITING, Trigger.LANDED)


def test_every_phase_is_reached_and_only_the_last_is_final() -> None:
    assert set(TRANSITIONS.values()) | {Phase.WAITING} == set(Phase)
    assert {start for start, _ in TRANSITIONS} == set(Phase) - {Phase.ENDED}


def test_the_diagram_shows_every_move() -> None:
    lines = diagram().splitlines()
    assert len(lines) == len(TRANSITIONS) + 3
    assert "    waiting --> checking: every vehicle heard" in lines
