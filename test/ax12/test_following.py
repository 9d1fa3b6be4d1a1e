import math

import pytest

from snake_control.ax12.following import FollowWatch
from snake_control.ax12.units import RAD_PER_TICK

DT = 0.02


def watched(velocity, moves, seconds, sensor_ticks=1.0):
    """Whether the watch gives a joint up that moves so; both functions of time."""
    watch, angle, t = FollowWatch(1.0), 0.0, 0.0
    while t < seconds:
        seen = round(angle / RAD_PER_TICK / sensor_ticks) * sensor_ticks * RAD_PER_TICK
        watch.step(velocity(t), DT, seen)
        if watch.failed:
            return t
        angle += moves(t) * DT
        t += DT
    return None


@pytest.mark.parametrize("v", [0.05, -0.5, 3.0])
def test_a_joint_that_follows_is_not_given_up(v):
    assert watched(lambda _: v, lambda _: v, 10.0) is None
    assert watched(lambda _: v, lambda _: 0.3 * v, 10.0) is None, "slow under its load"


@pytest.mark.parametrize("v", [0.06, -0.5, 3.0])
def test_a_joint_that_does_not_move_is_given_up_after_the_time(v):
    assert watched(lambda _: v, lambda _: 0.0, 10.0) == pytest.approx(1.0, abs=0.05)


def test_a_joint_that_goes_the_wrong_way_is_given_up():
    assert watched(lambda _: 0.5, lambda _: -0.5, 10.0) == pytest.approx(1.0, abs=0.05)


def test_a_joint_that_stops_following_is_given_up_in_the_next_window():
    assert watched(lambda _: 0.5, lambda t: 0.5 * (t < 3.3), 10.0) == pytest.approx(5.0, abs=0.15)


def test_way_too_short_for_the_sensor_is_waited_for():
    found = watched(lambda _: 0.02, lambda _: 0.0, 10.0)
    assert found == pytest.approx(8 * RAD_PER_TICK / 0.02, abs=0.1)
    assert watched(lambda _: 0.02, lambda _: 0.02, 20.0) is None


def test_rest_and_reversal_begin_anew():
    assert watched(lambda _: 0.0, lambda _: 0.0, 10.0) is None
    assert watched(lambda t: 0.5 if t % 1.0 < 0.5 else 0.0, lambda _: 0.0, 10.0) is None
    assert watched(lambda t: math.copysign(0.5, math.sin(5 * t)), lambda _: 0.0, 10.0) is None


def test_an_unknown_angle_is_no_success():
    watch = FollowWatch(1.0)
    for _ in range(60):
        watch.step(0.5, DT, math.nan)
    assert watch.failed
