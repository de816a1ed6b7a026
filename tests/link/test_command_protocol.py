"""The command protocol in virtual time: a vehicle that is slow, deaf, stubborn or confused."""

from __future__ import annotations

import math

import pytest

from swarmctl.events import CommandKind, CommandOutcome
from swarmctl.link.codec.messages import CommandLong, DataStream, MavCmd
from swarmctl.link.command_request import Attempt, Request
from tests.link.exchange_bench import (
    ARM,
    ASK,
    INTERVALS,
    REQUEST_ARM,
    REQUEST_HOME,
    REQUEST_STREAMS,
    REQUEST_TAKE_OFF,
    TAKE_OFF,
    Bench,
)


@pytest.fixture
def bench() -> Bench:
    return Bench()


# --- Answers ---------------------------------------------------------------------------


def test_an_accepted_command_ends_at_once_and_leaves_no_timer(bench: Bench) -> None:
    bench.submit(REQUEST_HOME)
    assert bench.sent == [(100.0, Attempt(ASK, 0))]
    bench.wait(0.25)
    bench.ack(MavCmd.REQUEST_MESSAGE)
    assert bench.outcomes == [
        CommandOutcome(
            received_s=100.25,
            sysid=3,
            command=CommandKind.REQUEST_HOME,
            result="accepted",
            detail="ACCEPTED",
        )
    ]
    assert bench.exchange.next_timer() == math.inf
    bench.wait(60.0)
    assert len(bench.sent) == len(bench.outcomes) == 1


@pytest.mark.parametrize("result", ["DENIED", "UNSUPPORTED", "FAILED", "MAV_RESULT 77"])
def test_a_refusal_names_the_result(bench: Bench, result: str) -> None:
    bench.submit(REQUEST_HOME)
    bench.ack(MavCmd.REQUEST_MESSAGE, result)
    bench.wait(1.0)
    assert bench.results == [("RequestHome", "refused")]
    assert bench.outcomes[0].detail == result
    assert len(bench.sent) == 1


def test_an_ack_of_another_command_is_none(bench: Bench) -> None:
    bench.submit(REQUEST_HOME)
    bench.ack(MavCmd.NAV_TAKEOFF)
    bench.ack(MavCmd.NAV_TAKEOFF, "FAILED")
    bench.wait(0.9)
    assert bench.outcomes == []


def test_an_ack_nobody_waits_for_is_ignored(bench: Bench) -> None:
    bench.ack(MavCmd.REQUEST_MESSAGE)
    assert (bench.sent, bench.outcomes) == ([], [])


# --- Loss ------------------------------------------------------------------------------


def test_eight_tries_one_second_apart_with_a_rising_confirmation_counter(bench: Bench) -> None:
    bench.submit(REQUEST_HOME)
    bench.wait(60.0)
    assert bench.sent == [(100.0 + n, Attempt(ASK, n)) for n in range(8)]
    assert bench.results == [("RequestHome", "no_answer")]
    assert bench.outcomes[0].received_s == 108.0
    assert bench.outcomes[0].detail == "no COMMAND_ACK to 8 tries in 8.0 s"


@pytest.mark.parametrize("lost", [1, 2, 3])
def test_the_answer_to_a_later_try_counts(bench: Bench, lost: int) -> None:
    bench.submit(REQUEST_HOME)
    bench.wait(lost + 0.1)
    bench.ack(MavCmd.REQUEST_MESSAGE)
    assert bench.results == [("RequestHome", "accepted")]
    assert len(bench.sent) == lost + 1


def test_a_late_timer_call_does_not_skip_a_try(bench: Bench) -> None:
    bench.submit(REQUEST_HOME)
    bench.exchange.handle_timer(103.7)
    assert len(bench.exchange.attempts()) == 1
    assert bench.exchange.next_timer() == 104.7


# --- Order -----------------------------------------------------------------------------


def test_one_command_at_a_time_in_order(bench: Bench) -> None:
    bench.submit(REQUEST_HOME, REQUEST_ARM, REQUEST_TAKE_OFF)
    assert [attempt.command for _, attempt in bench.sent] == [ASK]
    bench.ack(MavCmd.REQUEST_MESSAGE)
    assert [attempt.command for _, attempt in bench.sent] == [ASK, ARM]
    bench.heartbeat(armed=True)
    assert [attempt.command for _, attempt in bench.sent] == [ASK, ARM, TAKE_OFF]
    bench.ack(MavCmd.NAV_TAKEOFF)
    assert [name for name, _ in bench.results] == ["RequestHome", "Arm", "TakeOff"]


def test_the_next_command_leaves_after_one_without_answer(bench: Bench) -> None:
    bench.submit(REQUEST_HOME, REQUEST_TAKE_OFF)
    bench.wait(8.0)
    bench.ack(MavCmd.NAV_TAKEOFF)
    assert bench.results == [("RequestHome", "no_answer"), ("TakeOff", "accepted")]


# --- In progress -----------------------------------------------------------------------


def test_in_progress_extends_the_wait_without_a_retry(bench: Bench) -> None:
    bench.submit(REQUEST_HOME)
    for _ in range(3):
        bench.wait(0.9)
        bench.ack(MavCmd.REQUEST_MESSAGE, "IN_PROGRESS")
    bench.wait(4.9)
    bench.ack(MavCmd.REQUEST_MESSAGE)
    assert bench.results == [("RequestHome", "accepted")]
    assert len(bench.sent) == 1


def test_in_progress_and_then_silence_is_no_answer(bench: Bench) -> None:
    bench.submit(REQUEST_HOME)
    bench.ack(MavCmd.REQUEST_MESSAGE, "IN_PROGRESS")
    bench.wait(60.0)
    assert bench.results == [("RequestHome", "no_answer")]
    assert bench.outcomes[0].received_s == 105.0
    assert bench.outcomes[0].detail == "IN_PROGRESS, then no word for 5 s"


# --- Several steps ---------------------------------------------------------------------


def test_every_step_is_acknowledged_before_the_next_and_the_outcome_is_one(bench: Bench) -> None:
    bench.submit(REQUEST_STREAMS, REQUEST_HOME)
    for step in range(3):
        assert [attempt for _, attempt in bench.sent] == [
            Attempt(command, 0) for command in INTERVALS[: step + 1]
        ]
        assert bench.outcomes == []
        bench.ack(MavCmd.SET_MESSAGE_INTERVAL)
    assert bench.results == [("StreamTelemetry", "accepted")]
    assert bench.sent[-1][1] == Attempt(ASK, 0)


def test_a_refused_step_ends_the_request_and_is_named(bench: Bench) -> None:
    bench.submit(REQUEST_STREAMS)
    bench.ack(MavCmd.SET_MESSAGE_INTERVAL)
    bench.ack(MavCmd.SET_MESSAGE_INTERVAL, "DENIED")
    bench.wait(60.0)
    assert bench.results == [("StreamTelemetry", "refused")]
    assert bench.outcomes[0].detail == "DENIED to SET_MESSAGE_INTERVAL(2, 1000000)"
    assert len(bench.sent) == 2


POSITION, STATUS = DataStream(6, 10), DataStream(2, 1)


def test_a_refused_step_that_has_another_way_goes_it_and_the_others_are_asked_for_still(
    bench: Bench,
) -> None:
    bench.submit(Request(CommandKind.STREAM_TELEMETRY, INTERVALS, instead=(POSITION, None, STATUS)))
    bench.ack(MavCmd.SET_MESSAGE_INTERVAL, "UNSUPPORTED")
    bench.ack(MavCmd.SET_MESSAGE_INTERVAL, "DENIED")
    bench.ack(MavCmd.SET_MESSAGE_INTERVAL)
    assert [attempt.command for _, attempt in bench.sent] == [
        INTERVALS[0],
        POSITION,
        *INTERVALS[1:],
    ]
    assert bench.results == [("StreamTelemetry", "accepted")]
    assert bench.outcomes[0].detail == "SET_MESSAGE_INTERVAL UNSUPPORTED: replaced"


def test_steps_that_are_not_answered_all_go_the_other_way_at_once(bench: Bench) -> None:
    bench.submit(Request(CommandKind.STREAM_TELEMETRY, INTERVALS, instead=(POSITION, None, STATUS)))
    bench.wait(60.0)
    asked = [attempt.command for _, attempt in bench.sent]
    assert asked == [INTERVALS[0]] * 8 + [POSITION, STATUS]
    assert bench.results == [("StreamTelemetry", "no_answer")]
    assert bench.outcomes[0].received_s == 108.0


# --- Late and repeated answers ---------------------------------------------------------


def test_the_other_answers_to_a_retried_step_do_not_answer_the_next_step(bench: Bench) -> None:
    bench.submit(REQUEST_HOME, REQUEST_STREAMS)
    bench.ack(MavCmd.REQUEST_MESSAGE)
    bench.wait(2.1)
    for _ in range(3):  # to each of three tries, the first one late
        bench.ack(MavCmd.SET_MESSAGE_INTERVAL)
    steps = [attempt.command for _, attempt in bench.sent if attempt.command is not ASK]
    assert steps == [INTERVALS[0]] * 3 + [INTERVALS[1]]
    bench.ack(MavCmd.SET_MESSAGE_INTERVAL)
    assert bench.sent[-1][1] == Attempt(INTERVALS[2], 0)


def test_where_the_second_answer_never_comes_one_retry_makes_up_for_it(bench: Bench) -> None:
    bench.submit(REQUEST_STREAMS)
    bench.wait(1.1)
    bench.ack(MavCmd.SET_MESSAGE_INTERVAL)  # the only answer: the first try was lost
    bench.ack(MavCmd.SET_MESSAGE_INTERVAL)  # to the second step, but taken for a late one
    bench.wait(1.0)
    assert bench.sent[-1][1] == Attempt(INTERVALS[1], 1)
    bench.ack(MavCmd.SET_MESSAGE_INTERVAL)
    assert bench.sent[-1][1] == Attempt(INTERVALS[2], 0)
    bench.ack(MavCmd.SET_MESSAGE_INTERVAL)
    assert bench.results == [("StreamTelemetry", "accepted")]


def test_a_late_refusal_does_not_refuse_the_same_command_asked_again(bench: Bench) -> None:
    bench.submit(REQUEST_HOME)
    bench.wait(1.2)
    bench.ack(MavCmd.REQUEST_MESSAGE, "FAILED")
    bench.wait(0.3)
    bench.submit(REQUEST_HOME)
    bench.ack(MavCmd.REQUEST_MESSAGE, "FAILED")  # to the second try of the first
    bench.ack(MavCmd.REQUEST_MESSAGE)
    assert bench.results == [("RequestHome", "refused"), ("RequestHome", "accepted")]


def test_answers_are_late_for_a_second_only(bench: Bench) -> None:
    bench.submit(REQUEST_HOME)
    bench.wait(8.0)
    bench.wait(1.0)
    bench.submit(REQUEST_HOME)
    bench.ack(MavCmd.REQUEST_MESSAGE)
    assert bench.results == [("RequestHome", "no_answer"), ("RequestHome", "accepted")]


def test_a_repeated_answer_gives_no_second_outcome(bench: Bench) -> None:
    bench.submit(REQUEST_HOME, REQUEST_TAKE_OFF)
    bench.ack(MavCmd.REQUEST_MESSAGE)
    bench.ack(MavCmd.REQUEST_MESSAGE)
    bench.ack(MavCmd.REQUEST_MESSAGE, "FAILED")
    assert bench.results == [("RequestHome", "accepted")]


def test_answers_repeated_by_the_network_do_not_make_the_next_one_late(bench: Bench) -> None:
    bench.submit(REQUEST_ARM)
    bench.ack(MavCmd.COMPONENT_ARM_DISARM)
    bench.ack(MavCmd.COMPONENT_ARM_DISARM)
    bench.heartbeat(armed=True)
    bench.submit(REQUEST_ARM)
    bench.ack(MavCmd.COMPONENT_ARM_DISARM, "FAILED")
    bench.wait(0.3)
    assert bench.results == [("Arm", "accepted"), ("Arm", "refused")]


# --- Asked again -----------------------------------------------------------------------


def test_a_request_that_is_repeated_while_it_waits_or_is_under_way_is_sent_once(
    bench: Bench,
) -> None:
    for _ in range(3):
        bench.submit(REQUEST_HOME, REQUEST_TAKE_OFF)
    bench.ack(MavCmd.REQUEST_MESSAGE)
    bench.ack(MavCmd.NAV_TAKEOFF)
    assert [attempt.command for _, attempt in bench.sent] == [ASK, TAKE_OFF]
    assert bench.results == [("RequestHome", "accepted"), ("TakeOff", "accepted")]
    bench.submit(REQUEST_HOME)
    assert len(bench.sent) == 3


def test_the_last_wish_counts_when_another_of_its_kind_came_between(bench: Bench) -> None:
    """Guided, land, guided: the third is no repetition of the first."""
    guided = Request(CommandKind.SET_MODE, (CommandLong(MavCmd.DO_SET_MODE, (1.0, 4.0)),))
    land = Request(CommandKind.SET_MODE, (CommandLong(MavCmd.DO_SET_MODE, (1.0, 9.0)),))
    bench.submit(guided, land, guided)
    for _ in range(3):
        bench.ack(MavCmd.DO_SET_MODE)
    modes = [request.steps[0] for request in (guided, land, guided)]
    assert [attempt.command for _, attempt in bench.sent] == modes


# --- Vehicles that are not ready yet ---------------------------------------------------


def test_a_vehicle_that_is_not_ready_yet_is_asked_again_later(bench: Bench) -> None:
    bench.submit(REQUEST_HOME)
    for _ in range(2):
        bench.ack(MavCmd.REQUEST_MESSAGE, "TEMPORARILY_REJECTED")
        assert bench.outcomes == []
        bench.wait(1.0)
    bench.ack(MavCmd.REQUEST_MESSAGE)
    assert bench.times_sent == [0.0, 1.0, 2.0]
    assert bench.results == [("RequestHome", "accepted")]


def test_a_vehicle_that_never_gets_ready_has_refused(bench: Bench) -> None:
    bench.submit(REQUEST_HOME)
    for _ in range(5):
        bench.ack(MavCmd.REQUEST_MESSAGE, "TEMPORARILY_REJECTED")
        bench.text("Preflight Fail: no global position")
        bench.wait(1.0)
    assert bench.times_sent == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert bench.results == [("RequestHome", "refused")]
    assert bench.outcomes[0].detail == ("TEMPORARILY_REJECTED: Preflight Fail: no global position")


# --- What a vehicle may refuse ---------------------------------------------------------


@pytest.mark.parametrize("answer", ["ACCEPTED", "DENIED", "TEMPORARILY_REJECTED", None])
def test_optional_steps_come_last_and_may_be_refused_or_unanswered(
    bench: Bench, answer: str | None
) -> None:
    first, second, third = INTERVALS
    bench.submit(Request(CommandKind.STREAM_TELEMETRY, (first,), optional=(second, third)))
    bench.ack(MavCmd.SET_MESSAGE_INTERVAL)
    for _ in (second, third):
        if answer is None:
            bench.wait(8.0)
        else:
            bench.ack(MavCmd.SET_MESSAGE_INTERVAL, answer)
    order = list(dict.fromkeys(attempt.command for _, attempt in bench.sent))
    assert order == [first, second, third]
    assert bench.results == [("StreamTelemetry", "accepted")]
    assert bench.exchange.next_timer() == math.inf
