"""Ways through joint space, and how they are followed."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snake_control.control.joint_motion import JointMotion, Phase
from snake_control.control.joint_way import JointWay

DT = 0.02
ANGLES = st.lists(st.floats(-2.5, 2.5), min_size=4, max_size=4)


@given(corners=st.lists(ANGLES, min_size=2, max_size=4), speed=st.floats(0.01, 6.0))
def test_a_way_keeps_its_limits_is_smooth_and_ends_at_its_last_corner(corners, speed):
    speeds = speed * np.array([1.0, 0.5, 2.0, 1.0])
    way = JointWay(corners, speeds, 1.5)
    np.testing.assert_allclose(way.at(0.0).phi, corners[0], atol=1e-9)
    np.testing.assert_array_equal(way.at(way.duration).phi, corners[-1])
    times = np.linspace(0.0, way.duration, 800)
    points = [way.at(t) for t in times]
    rates = np.array([point.rate for point in points])
    assert (np.abs(rates) <= speeds * (1 + 1e-9)).all()
    assert np.abs(rates).max(initial=0.0) <= way.top_speed * (1 + 1e-9)
    np.testing.assert_allclose(rates[[0, -1]], 0.0, atol=1e-9)
    dt = times[1] - times[0]
    if dt > 1e-6:
        assert np.abs(np.diff(rates, axis=0) / dt).max() <= 1.5 * (1 + 1e-6)
        # The rate is the derivative of the angle.
        phi = np.array([point.phi for point in points])
        moved = np.diff(phi, axis=0) - 0.5 * dt * (rates[1:] + rates[:-1])
        assert np.abs(moved).max() <= 1.5 * dt**2


def test_all_joints_start_and_arrive_together_and_the_slowest_sets_the_pace():
    way = JointWay([[0.0, 0.0, 0.0], [1.0, -0.5, 0.0]], [0.5, 0.1, 0.5], 2.0)
    rates = np.array([way.at(t).rate for t in np.linspace(0.0, way.duration, 200)])
    np.testing.assert_allclose(rates[:, 1], -0.5 * rates[:, 0], atol=1e-12)
    assert rates[:, 0].max() == pytest.approx(0.2)
    # 1 rad at 0.2 rad/s, and a ramp of twice v / a.
    assert way.duration == pytest.approx(1.0 / 0.2 + 2 * 0.2 / 2.0)


def motion(corners, speed=0.5, t=0.0, patience=2.0) -> JointMotion:
    way = JointWay(corners, np.full(len(corners[0]), speed), 1.0)
    return JointMotion(way, gain=2.0, acceleration=1.0, tolerance=0.01, patience=patience, t=t)


def follow(made: JointMotion, phi, moves=1.0, longest=60.0, t=0.0, delay=0):
    """Let joints do a share of what they are told, cycles late; return all steps."""
    phi, seen, told = np.array(phi, dtype=float), [], []
    while t < longest:
        step = made.step(phi, t)
        seen.append(step)
        if step.phase.over:
            break
        told.append(step.velocities)
        phi = phi + DT * moves * (told[-1 - delay] if len(told) > delay else np.zeros_like(phi))
        t += DT
    return seen, phi, t


@pytest.mark.parametrize("delay", [0, 2])
def test_it_arrives_when_it_was_planned_to(delay):
    made = motion([[0.0, 0.2], [1.0, 0.0]])
    planned = JointWay([[0.0, 0.2], [1.0, 0.0]], [0.5, 0.5], 1.0).duration
    seen, phi, t = follow(made, [0.0, 0.2], delay=delay)
    assert seen[-1].phase is Phase.ARRIVED
    assert seen[-1].progress == 1.0
    np.testing.assert_allclose(phi, [1.0, 0.0], atol=0.01)
    assert planned - DT <= t <= planned + 1.0
    assert all(step.pace == 1.0 for step in seen)
    progress = [step.progress for step in seen]
    assert progress == sorted(progress)
    np.testing.assert_array_equal(seen[-1].velocities, 0.0)


def test_the_others_wait_for_a_joint_that_lags_and_it_is_named():
    made = motion([[0.0, 0.0], [1.0, 1.0]])
    seen, phi, _ = follow(made, [0.0, 0.0], moves=np.array([1.0, 0.4]))
    assert seen[-1].phase is Phase.ARRIVED
    assert min(step.pace for step in seen) < 0.8
    assert all(step.worst == 1 for step in seen[50:-1] if step.error > 0.05)
    assert max(step.error for step in seen) < 0.3
    np.testing.assert_allclose(phi, 1.0, atol=0.01)


@pytest.mark.parametrize("blocked", [0.0, np.array([1.0, 0.0])])
def test_it_is_given_up_when_a_joint_does_not_move(blocked):
    made = motion([[0.0, 0.0], [1.0, 1.0]])
    seen, phi, t = follow(made, [0.0, 0.0], moves=blocked)
    assert seen[-1].phase is Phase.GIVEN_UP
    np.testing.assert_array_equal(seen[-1].velocities, 0.0)
    assert t < 6.0
    assert np.abs(phi[0] - phi[1]) < 0.5


def test_it_is_given_up_a_little_short_of_the_end_too():
    made = motion([[0.0], [0.05]])
    seen, _, t = follow(made, [0.0], moves=0.0)
    assert seen[-1].phase is Phase.GIVEN_UP
    assert seen[-2].phase is Phase.ARRIVING
    assert seen[-1].error == pytest.approx(0.05)
    assert t < 4.0


def test_a_stop_brakes_no_harder_than_twice_the_plan_and_leaves_the_joints_at_rest():
    made = motion([[0.0], [2.0]])
    phi, before, hardest = np.zeros(1), 0.0, 0.0
    for k in range(400):
        if k == 60:
            made.stop()
        step = made.step(phi, DT * k)
        hardest = max(hardest, abs(step.velocities[0] - before) / DT)
        before = float(step.velocities[0])
        phi = phi + DT * step.velocities
        if step.phase.over:
            break
    assert step.phase is Phase.STOPPED
    assert 60 < k < 60 + 0.6 / DT
    assert hardest < 2.0
    assert 0.2 < phi[0] < 1.0


def test_others_may_slow_it_down_and_let_it_go_on():
    made = motion([[0.0], [1.0]], patience=1.0)
    phi, t = np.zeros(1), 0.0
    for _ in range(50):
        step = made.step(phi, t, allowed=0.3)
        phi, t = phi + DT * step.velocities, t + DT
    assert step.pace == pytest.approx(0.3)
    seen, phi, _ = follow(made, phi, t=t)
    assert seen[-1].phase is Phase.ARRIVED
    # Who allows nothing at all has it given up in the end.
    made = motion([[0.0], [1.0]], patience=1.0)
    steps = [made.step(np.zeros(1), DT * k, allowed=0.0) for k in range(150)]
    assert steps[-1].phase is Phase.GIVEN_UP


def test_who_stands_there_already_has_arrived():
    made = motion([[0.3, 0.1], [0.3, 0.1]])
    step = made.step(np.array([0.3, 0.1]), 0.0)
    assert step.phase is Phase.ARRIVED
    assert (step.progress, step.time_left) == (1.0, 0.0)


def test_a_clock_that_stood_still_for_long_makes_no_jump():
    made = motion([[0.0], [2.0]])
    made.step(np.zeros(1), 0.0)
    step = made.step(np.zeros(1), 30.0)
    assert step.progress < 0.05
    assert abs(step.velocities[0]) < 0.2


def test_after_a_pause_it_begins_at_rest_again():
    made = motion([[0.0], [2.0]])
    phi, speeds = np.zeros(1), []
    for k in range(120):
        if 60 <= k < 70:
            made.pause()
            continue
        step = made.step(phi, DT * k)
        speeds.append(abs(float(step.velocities[0])))
        phi = phi + DT * step.velocities
    assert speeds[59] > 0.3
    assert speeds[60] < 0.15
    assert max(abs(b - a) for a, b in itertools.pairwise(speeds[60:])) < 2.0 * DT
    assert speeds[-1] == pytest.approx(0.5, abs=0.02)
