import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from snake_control.ax12.following import FollowWatch
from snake_control.ax12.modulation import VelocityLimits
from snake_control.ax12.units import RAD_PER_TICK, RAD_S_PER_SPEED_UNIT
from snake_control.ax12.velocity import JointModeVelocity
from support.servo_model import ServoModel

UNIT = RAD_S_PER_SPEED_UNIT

DT = 0.02


def watched(velocity, moves, seconds, load=0.0):
    """When the watch gives a joint up that moves so (functions of time), and its doubt then."""
    watch, angle, t = FollowWatch(1.0), 0.0, 0.0
    watch.step(velocity(0.0), DT, angle, load)
    while t < seconds:
        angle += moves(t) * DT
        t += DT
        watch.step(velocity(t), DT, round(angle / RAD_PER_TICK) * RAD_PER_TICK, load)
        if watch.failed:
            return t, watch.doubt
    return None


@pytest.mark.parametrize("load", [0.0, 0.9])
@pytest.mark.parametrize("v", [0.01, 0.05, -0.5, 3.0])
def test_a_joint_that_follows_is_not_given_up(v, load):
    assert watched(lambda _: v, lambda _: v, 20.0, load) is None
    assert watched(lambda _: v, lambda _: 0.3 * v, 20.0, load) is None, "slow under its load"


@pytest.mark.parametrize("v", [0.1, -0.5, 3.0])
def test_a_joint_that_does_not_move_is_given_up_after_the_time(v):
    at, doubt = watched(lambda _: v, lambda _: 0.0, 10.0)
    assert at == pytest.approx(1.1, abs=0.05)
    assert "does not change" in doubt


@pytest.mark.parametrize("v", [0.01, 0.5, -3.0])
def test_one_that_pushes_is_called_blocked(v):
    at, doubt = watched(lambda _: v, lambda _: 0.0, 20.0, load=0.7 if v > 0 else -0.7)
    assert doubt == "blocked? load 70 %"
    # Eight positions of way are what it takes at least, twice.
    assert at == pytest.approx(max(1.0, 16 * RAD_PER_TICK / abs(v)), abs=0.1)


@pytest.mark.parametrize("v", [0.01, -0.04])
def test_a_creeping_joint_that_does_not_push_has_more_time(v):
    at, doubt = watched(lambda _: v, lambda _: 0.0, 60.0, load=0.2)
    assert at == pytest.approx(80 * RAD_PER_TICK / abs(v), abs=0.1)
    assert "does not change" in doubt


def test_a_creeping_joint_may_hesitate():
    assert watched(lambda _: 0.02, lambda t: 0.02 if t % 12.0 > 8.0 else 0.0, 60.0) is None


def test_a_joint_that_goes_the_wrong_way_is_given_up():
    at, doubt = watched(lambda _: 0.5, lambda _: -0.5, 10.0)
    assert at == pytest.approx(1.1, abs=0.05)
    assert doubt == "it moves otherwise than told"


@pytest.mark.parametrize("stays_from", [3.0, 3.3, 3.49])
def test_a_joint_that_stops_following_is_given_up_in_one_and_a_half_times_the_time(stays_from):
    at, _ = watched(lambda _: 0.5, lambda t: 0.5 * (t < stays_from), 10.0)
    assert 1.0 - 0.05 <= at - stays_from <= 1.5 + 0.05


def test_a_doubt_that_was_wrong_is_dropped():
    watch = FollowWatch(1.0)
    seen = []
    for k in range(100):
        angle = 0.0 if k < 40 else 0.5 * (k - 40) * DT
        watch.step(0.5, DT, angle, 0.0)
        seen.append(watch.doubt != "")
        assert not watch.failed
    assert any(seen)
    assert not seen[-1]


def test_rest_and_reversal_begin_anew():
    assert watched(lambda _: 0.0, lambda _: 0.0, 10.0) is None
    assert watched(lambda t: 0.5 if t % 1.4 < 0.38 else 0.0, lambda _: 0.0, 10.0) is None
    assert watched(lambda t: math.copysign(0.5, math.sin(5 * t)), lambda _: 0.0, 10.0) is None


def go_and_rest(t):
    return 0.5 if t % 0.3 < 0.2 else 0.0


def test_a_short_rest_does_not_hide_a_joint_that_does_not_follow():
    at, _ = watched(go_and_rest, lambda _: 0.0, 10.0)
    assert at < 3.0
    assert watched(go_and_rest, go_and_rest, 10.0) is None


def test_an_unknown_angle_is_no_success():
    watch = FollowWatch(1.0)
    for _ in range(60):
        watch.step(0.5, DT, math.nan, math.nan)
    assert watch.failed


@settings(max_examples=40, deadline=None)
@given(
    st.floats(-0.45, 0.45),
    st.floats(0.5 * UNIT, 2.0),
    st.floats(0.2, 60.0),
    st.floats(-1.0, 1.0),
    st.sampled_from([1, 5, 23]),
)
def test_a_servo_that_carries_a_load_is_not_given_up(load, speed, period, bias, gap):
    """Swings and drifts, also such as creep, with commands that fail to come now and then."""
    limits = VelocityLimits(5, 1019, 5.5, 0.0, DT, 0.15, 33)
    servo, control, watch = ServoModel(load=load), JointModeVelocity(limits), FollowWatch(1.0)
    sent = control.latch(0.0)
    for k in range(1000):
        t = k * DT
        servo.run(sent, DT)
        present = servo.measured(0.01)
        watch.step(control.expected, DT, present.angle, load)
        assert not watch.failed
        wanted = speed * (math.sin(math.tau * t / period) + bias)
        sent = control.step(0.0 if gap > 1 and k % gap == 0 else wanted, DT, present)
