"""Tasks by themselves: who follows whom, and what is asked of the airframe."""

from __future__ import annotations

import pytest

from sim.autopilots.flight_tasks import FlyAcceleration, FlyAxes, FlyVelocity, Hold, Situation
from sim.autopilots.takeoff_and_landing import Descend, ReturnClimb, ReturnCruise, TakeOff, sink
from swarmctl.units import Vector

HOME = (1.0, 2.0, 3.0)


def situation(
    position: Vector, velocity: Vector = (0.0, 0.0, 0.0), now_s: float = 10.0
) -> Situation:
    return Situation(now_s, position, velocity, HOME)


def test_hold_brakes_first_and_holds_the_place_where_it_stopped() -> None:
    task, command = Hold().fly(situation((5.0, 6.0, 7.0), (4.0, 0.0, 0.0)))
    assert task == Hold()
    assert command is not None
    assert command.error_enu == command.velocity_enu == (0.0, 0.0, 0.0)
    task, _ = task.fly(situation((9.0, 6.0, 7.0), (0.1, 0.0, 0.0)))
    assert task == Hold((9.0, 6.0, 7.0))
    task, command = task.fly(situation((9.5, 6.0, 7.0)))
    assert task == Hold((9.0, 6.0, 7.0))
    assert command is not None
    assert command.error_enu == (-0.5, 0.0, 0.0)


def test_velocity_becomes_hold_after_its_timeout() -> None:
    task = FlyVelocity((4.0, 0.0, 0.0), set_s=10.0, timeout_s=3.0)
    assert task.fly(situation(HOME, (4.0, 0.0, 0.0), 13.0))[0] == task
    assert task.fly(situation(HOME, (4.0, 0.0, 0.0), 13.1))[0] == Hold()


def test_acceleration_asks_for_a_velocity_ahead_until_its_timeout() -> None:
    task = FlyAcceleration((1.5, 0.0, -0.6), set_s=10.0, timeout_s=3.0)
    same, command = task.fly(situation(HOME, (2.0, 0.0, 0.0), 12.0))
    assert same == task
    assert command is not None
    # The velocity loop accelerates by three times the velocity error.
    assert command.velocity_enu == pytest.approx((2.5, 0.0, -0.2))
    assert task.fly(situation(HOME, (2.0, 0.0, 0.0), 13.1))[0] == Hold()


def test_each_axis_follows_its_position_or_its_velocity() -> None:
    task = FlyAxes((None, 7.0, 3.0), (2.0, 0.5, 0.0))
    _, command = task.fly(situation(HOME))
    assert command is not None
    assert command.error_enu == (0.0, 5.0, 0.0)
    assert command.velocity_enu == (2.0, 0.5, 0.0)
    # Without a position the vertical one drifts: 10 m in 65 s.
    _, command = FlyAxes((None, None, None), (2.0, 0.0, 0.0)).fly(situation(HOME))
    assert command is not None
    assert command.velocity_enu[2] == pytest.approx(10.0 / 65.0, rel=0.01)


def test_take_off_spools_up_climbs_and_becomes_hold() -> None:
    task = TakeOff((1.0, 2.0, 23.0), started_s=10.0, spool_up_s=3.0, climb_mps=2.5)
    assert task.fly(situation(HOME, now_s=12.9)) == (task, None)
    following, command = task.fly(situation(HOME, now_s=13.1))
    assert following == task
    assert command is not None
    assert (command.error_enu, command.velocity_enu) == ((0.0, 0.0, 0.0), (0.0, 0.0, 2.5))
    _, command = task.fly(situation((1.0, 2.0, 21.0), now_s=18.0))
    assert command is not None
    assert command.error_enu == (0.0, 0.0, 2.0)
    assert task.fly(situation((1.0, 2.0, 22.8), now_s=20.0))[0] == Hold((1.0, 2.0, 23.0))


LANDING = Descend(True, fast_mps=1.5, slow_mps=0.5, slow_below_m=10.0)


@pytest.mark.parametrize(
    ("descent", "height_m", "rate"),
    [(LANDING, 11.0, 1.5), (LANDING, 9.0, 0.5), (sink(2.5), 9.0, 2.5), (sink(2.5), 0.0, 2.5)],
)
def test_descent_rates(descent: Descend, height_m: float, rate: float) -> None:
    task, command = descent.fly(situation((8.0, 9.0, HOME[2] + height_m)))
    assert task == descent.at((8.0, 9.0, HOME[2] + height_m))
    assert command is not None
    assert command.velocity_enu == (0.0, 0.0, -rate)


def test_the_legs_of_a_return() -> None:
    task, command = ReturnClimb(15.0, LANDING).fly(situation((100.0, 0.0, 8.0)))
    assert task == ReturnClimb(15.0, LANDING, anchor_enu=(100.0, 0.0, 8.0))
    assert command is not None
    assert command.error_enu == (0.0, 0.0, HOME[2] + 15.0 - 8.0)
    task, command = task.fly(situation((100.0, 0.0, 18.0)))
    assert task == ReturnCruise(18.0, LANDING)
    assert command is not None
    assert command.error_enu == (-99.0, 2.0, 0.0)
    # Over home it still brakes before it descends.
    passing = situation((1.5, 2.0, 18.0), (3.0, 0.0, 0.0))
    assert task.fly(passing)[0] == task
    assert task.fly(situation((1.5, 2.0, 18.0)))[0] == LANDING.at(HOME)
