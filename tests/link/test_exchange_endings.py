"""How a command ends: what state confirms it, and what reason is given for a refusal."""

from __future__ import annotations

import pytest

from swarmctl.link.codec.messages import MavCmd
from tests.link.exchange_bench import (
    REQUEST_ARM,
    REQUEST_HOME,
    REQUEST_TAKE_OFF,
    Bench,
)


@pytest.fixture
def bench() -> Bench:
    return Bench()


# --- Confirmation by state -------------------------------------------------------------


def test_an_ack_alone_does_not_confirm(bench: Bench) -> None:
    bench.submit(REQUEST_ARM)
    bench.ack(MavCmd.COMPONENT_ARM_DISARM)
    bench.wait(2.5)
    assert bench.outcomes == []
    bench.heartbeat(armed=False)
    assert bench.outcomes == []
    bench.heartbeat(armed=True)
    assert bench.results == [("Arm", "accepted")]


def test_the_state_confirms_where_the_ack_was_lost(bench: Bench) -> None:
    bench.submit(REQUEST_ARM)
    bench.wait(0.2)
    bench.heartbeat(armed=True)
    assert bench.results == [("Arm", "accepted")]
    bench.wait(60.0)
    assert len(bench.sent) == 1


def test_a_state_before_the_command_left_confirms_nothing(bench: Bench) -> None:
    bench.heartbeat(armed=True)
    bench.submit(REQUEST_HOME, REQUEST_ARM)
    bench.heartbeat(armed=True)
    bench.ack(MavCmd.REQUEST_MESSAGE)
    bench.wait(0.5)
    assert bench.results == [("RequestHome", "accepted")]


def test_a_state_that_does_not_follow_the_ack_is_a_refusal(bench: Bench) -> None:
    bench.submit(REQUEST_ARM)
    bench.ack(MavCmd.COMPONENT_ARM_DISARM)
    bench.wait(1.0)
    bench.heartbeat(armed=False)
    bench.wait(60.0)
    assert bench.results == [("Arm", "refused")]
    assert bench.outcomes[0].received_s == 106.0
    expected = "ACCEPTED, but after 6 s HEARTBEAT shows STABILIZE and disarmed"
    assert bench.outcomes[0].detail == expected


def test_no_heartbeat_after_the_ack_is_no_answer(bench: Bench) -> None:
    bench.submit(REQUEST_ARM)
    bench.heartbeat(armed=False)
    bench.ack(MavCmd.COMPONENT_ARM_DISARM)
    bench.wait(60.0)
    assert bench.results == [("Arm", "no_answer")]
    assert bench.outcomes[0].detail == "ACCEPTED, but no HEARTBEAT for 6 s"


def test_where_the_ack_is_enough_no_state_is_waited_for(bench: Bench) -> None:
    bench.submit(REQUEST_TAKE_OFF)
    bench.ack(MavCmd.NAV_TAKEOFF)
    assert bench.results == [("TakeOff", "accepted")]


def test_a_refused_retry_is_accepted_if_the_state_shows_that_the_first_try_worked(
    bench: Bench,
) -> None:
    bench.submit(REQUEST_TAKE_OFF)  # obeyed, its ACK lost
    bench.wait(1.1)
    bench.ack(MavCmd.NAV_TAKEOFF, "FAILED")  # to the retry: it is airborne already
    assert bench.outcomes == []
    bench.wait(0.5)
    bench.taking_off()
    assert bench.results == [("TakeOff", "accepted")]


def test_a_refused_first_try_stays_refused_whatever_the_state_shows(bench: Bench) -> None:
    bench.submit(REQUEST_TAKE_OFF)
    bench.ack(MavCmd.NAV_TAKEOFF, "FAILED")  # it was airborne before
    bench.taking_off()
    bench.wait(1.0)
    assert bench.results == [("TakeOff", "refused")]


def test_a_refused_retry_is_refused_if_no_state_shows_otherwise(bench: Bench) -> None:
    bench.submit(REQUEST_TAKE_OFF)
    bench.wait(1.1)
    bench.ack(MavCmd.NAV_TAKEOFF, "FAILED")
    bench.text("not in this mode")
    assert bench.outcomes == []
    bench.wait(4.9)
    assert bench.outcomes == []
    bench.wait(1.1)
    assert bench.results == [("TakeOff", "refused")]


# --- Reasons ---------------------------------------------------------------------------


def test_the_reason_may_come_before_the_refusal(bench: Bench) -> None:
    bench.submit(REQUEST_ARM)
    bench.text("Arm: first")
    bench.text("Arm: Need Position Estimate")
    bench.ack(MavCmd.COMPONENT_ARM_DISARM, "FAILED")
    assert bench.results == [("Arm", "refused")]
    assert bench.outcomes[0].detail == "FAILED: Arm: Need Position Estimate"


def test_the_reason_may_come_shortly_after_the_refusal(bench: Bench) -> None:
    bench.submit(REQUEST_ARM)
    bench.ack(MavCmd.COMPONENT_ARM_DISARM, "FAILED")
    bench.wait(0.2)
    assert bench.outcomes == []
    bench.text("Arm: Need Position Estimate")
    assert bench.outcomes[0].detail == "FAILED: Arm: Need Position Estimate"
    assert bench.outcomes[0].received_s == 100.2


def test_a_reason_is_waited_for_shortly_only(bench: Bench) -> None:
    bench.submit(REQUEST_ARM)
    bench.ack(MavCmd.COMPONENT_ARM_DISARM, "FAILED")
    bench.wait(60.0)
    assert bench.outcomes[0].detail == "FAILED"
    assert bench.outcomes[0].received_s == 100.3


def test_what_was_said_before_the_command_is_no_reason(bench: Bench) -> None:
    bench.text("EKF3 IMU0 is using GPS")
    bench.wait(0.1)
    bench.submit(REQUEST_ARM)
    bench.ack(MavCmd.COMPONENT_ARM_DISARM, "FAILED")
    bench.wait(1.0)
    assert bench.outcomes[0].detail == "FAILED"


def test_what_was_said_long_ago_is_no_reason(bench: Bench) -> None:
    bench.submit(REQUEST_HOME)
    bench.text("EKF3 IMU0 is using GPS")
    bench.wait(2.1)
    bench.ack(MavCmd.REQUEST_MESSAGE, "FAILED")
    bench.wait(1.0)
    assert bench.outcomes[0].detail == "FAILED"


def test_a_text_does_not_end_a_command_that_was_not_refused(bench: Bench) -> None:
    bench.submit(REQUEST_ARM)
    bench.text("Arming motors")
    bench.ack(MavCmd.COMPONENT_ARM_DISARM)
    bench.text("Arming motors")
    assert bench.outcomes == []
