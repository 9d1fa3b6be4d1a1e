"""Commanded motion: limits, continuity, frames, and the dead-man time-out."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from snake_control.control.reference import Reference
from snake_control.trajectory.motion_limits import PITCH_LIMIT_RAD, MotionLimits
from snake_control.trajectory.teleop import HeadVelocityCommand, Teleop

LIMITS = MotionLimits(
    linear_speed=0.05, angular_speed=0.3, linear_acceleration=0.1, angular_acceleration=1.0
)
DT = 0.02


def at(pose=(0, 0, 0.2, 0, 0, 0), rate=(0, 0, 0, 0, 0, 0)):
    return Reference(np.array(pose, dtype=float), np.array(rate, dtype=float))


def command(linear=(0, 0, 0), angular=(0, 0, 0), heading=False):
    return HeadVelocityCommand(
        np.array(linear, dtype=float), np.array(angular, dtype=float), heading
    )


def drive(teleop, one, duration, start=0.0):
    """Command once and sample every DT; return the references."""
    teleop.command(one)
    return [teleop.sample(start + k * DT) for k in range(round(duration / DT) + 1)]


def check_continuous(references, limits=LIMITS, dt=DT):
    """Pose and rate fit together and no acceleration is above its limit."""
    poses = np.array([r.w_d for r in references])
    rates = np.array([r.w_d_dot for r in references])
    np.testing.assert_allclose(
        np.diff(poses, axis=0), (rates[1:] + rates[:-1]) / 2 * dt, atol=1e-12
    )
    change = np.diff(rates, axis=0) / dt
    assert np.linalg.norm(change[:, :3], axis=1).max() <= limits.linear_acceleration * (1 + 1e-9)
    assert np.abs(change[:, 3:]).max() <= limits.angular_acceleration * (1 + 1e-9)


def test_reaches_the_commanded_velocity_within_the_limits():
    teleop = Teleop(at(), 0.0, LIMITS)
    references = drive(teleop, command((0.03, -0.02, 0.0), (0, 0, 0.2)), 2.0)
    check_continuous(references)
    np.testing.assert_allclose(references[-1].w_d_dot, [0.03, -0.02, 0, 0, 0, 0.2], atol=1e-15)


def test_too_fast_a_command_is_slowed_down_in_its_direction():
    teleop = Teleop(at(), 0.0, LIMITS)
    references = drive(teleop, command((3.0, 4.0, 0.0), (0, 0, -7.0)), 3.0)
    check_continuous(references)
    np.testing.assert_allclose(references[-1].w_d_dot, [0.03, 0.04, 0, 0, 0, -0.3], atol=1e-12)


def test_released_head_comes_to_rest():
    teleop = Teleop(at(), 0.0, LIMITS)
    references = drive(teleop, command((0.05, 0, 0), (0, 0, 0.3)), 1.0)
    teleop.release()
    later = [teleop.sample(1.0 + k * DT) for k in range(1, 100)]
    check_continuous(references + later)
    moving = [r.w_d_dot.any() for r in later]
    # 0.05 m/s at 0.1 m/s^2 takes 0.5 s.
    assert moving.index(False) == pytest.approx(0.5 / DT, abs=2)
    assert not any(moving[moving.index(False) :])
    assert teleop.at_rest


def test_commanded_zero_is_no_rest():
    teleop = Teleop(at(), 0.0, LIMITS)
    teleop.command(command())
    teleop.sample(1.0)
    assert not teleop.at_rest
    teleop.release()
    assert teleop.at_rest


def test_without_commands_a_given_motion_is_stopped():
    teleop = Teleop(at(rate=(0.04, 0, 0.03, 0.1, 0, -0.2)), 5.0, LIMITS)
    references = [teleop.sample(5.0 + k * DT) for k in range(60)]
    np.testing.assert_array_equal(references[0].w_d_dot, [0.04, 0, 0.03, 0.1, 0, -0.2])
    check_continuous(references)
    assert teleop.at_rest
    # v^2 / (2 a) along a straight line, and for the yaw.
    np.testing.assert_allclose(references[-1].w_d[0], 0.04 * 0.05 / (2 * 0.1), rtol=1e-2)
    np.testing.assert_allclose(references[-1].w_d[5], -(0.2**2) / 2, rtol=1e-2)


def test_heading_frame_turns_with_the_head():
    teleop = Teleop(at(pose=(0, 0, 0.2, 0.3, -0.5, math.pi / 2)), 0.0, LIMITS)
    references = drive(teleop, command((0.05, 0, 0), heading=True), 2.0)
    np.testing.assert_allclose(references[-1].w_d_dot, [0, 0.05, 0, 0, 0, 0], atol=1e-15)


def test_world_frame_does_not():
    teleop = Teleop(at(pose=(0, 0, 0.2, 0.3, -0.5, math.pi / 2)), 0.0, LIMITS)
    references = drive(teleop, command((0.05, 0, 0)), 2.0)
    np.testing.assert_allclose(references[-1].w_d_dot, [0.05, 0, 0, 0, 0, 0], atol=1e-15)


@pytest.mark.parametrize("heading", [False, True])
def test_angular_velocity_is_the_commanded_one(heading):
    # Once up to speed; finite differences of the attitude, by scipy, are the judge.
    teleop = Teleop(at(pose=(0, 0, 0.2, 0.2, 0.1, 0.7)), 0.0, LIMITS)
    wanted = np.array([0.05, -0.1, 0.15])
    before = drive(teleop, command(angular=wanted, heading=heading), 1.0)
    teleop.command(command(angular=wanted, heading=heading))
    dt = 1e-4
    after = teleop.sample(1.0 + dt)

    def attitude(reference):
        return Rotation.from_euler("ZYX", reference.w_d[:2:-1])

    omega = (attitude(after) * attitude(before[-1]).inv()).as_rotvec() / dt
    yaw = before[-1].w_d[5] if heading else 0.0
    np.testing.assert_allclose(omega, Rotation.from_euler("z", yaw).apply(wanted), atol=2e-3)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("roll", [0.0, 0.5])
def test_pitch_stops_before_the_coordinates_break_down(sign, roll):
    teleop = Teleop(at(pose=(0, 0, 0.2, roll, 0, 0)), 0.0, LIMITS)
    references = drive(teleop, command(angular=(0, 0.3 * sign, 0), heading=True), 12.0)
    check_continuous(references)
    pitch = [sign * r.w_d[4] for r in references]
    assert max(pitch) <= PITCH_LIMIT_RAD + 1e-9
    assert pitch[-1] > PITCH_LIMIT_RAD - 0.01
    back = drive(teleop, command(angular=(0, -0.3 * sign, 0), heading=True), 1.0, start=12.0)
    assert sign * back[-1].w_d[4] < pitch[-1] - 0.1


def test_a_start_beyond_the_pitch_limit_only_comes_back():
    teleop = Teleop(at(pose=(0, 0, 0.2, 0, 1.5, 0)), 0.0, LIMITS)
    references = drive(teleop, command(angular=(0, 0.3, 0)), 1.0)
    assert references[-1].w_d[4] == 1.5
    references = drive(teleop, command(angular=(0, -0.3, 0)), 1.0, 1.0)
    assert references[-1].w_d[4] < 1.3


def test_a_late_sample_is_integrated_in_small_steps():
    fine = Teleop(at(), 0.0, LIMITS)
    late = Teleop(at(), 0.0, LIMITS)
    for teleop in (fine, late):
        teleop.command(command((0.05, 0, 0)))
    for k in range(101):
        fine.sample(k * DT)
    np.testing.assert_allclose(late.sample(2.0).w_d, fine.sample(2.0).w_d, atol=1e-12)


def test_time_that_stands_still_or_runs_back_changes_nothing():
    teleop = Teleop(at(rate=(0.04, 0, 0, 0, 0, 0)), 1.0, LIMITS)
    first = teleop.sample(1.1)
    for t in (1.1, 0.5):
        again = teleop.sample(t)
        np.testing.assert_array_equal(again.w_d, first.w_d)
        np.testing.assert_array_equal(again.w_d_dot, first.w_d_dot)


vectors = st.tuples(*[st.floats(-2.0, 2.0)] * 3)


@given(
    rpy=st.tuples(st.floats(-3, 3), st.floats(-1.3, 1.3), st.floats(-3, 3)),
    commands=st.lists(st.tuples(vectors, vectors, st.booleans()), min_size=1, max_size=6),
)
@settings(max_examples=60, deadline=None)
def test_any_commands_stay_continuous_and_end_at_rest(rpy, commands):
    teleop = Teleop(at(pose=(0, 0, 0.2, *rpy)), 0.0, LIMITS)
    references = [teleop.sample(0.0)]
    t = 0.0
    for linear, angular, heading in commands:
        for _ in range(20):
            teleop.command(command(linear, angular, heading))
            t += DT
            references.append(teleop.sample(t))
    teleop.release()
    for _ in range(150):
        t += DT
        references.append(teleop.sample(t))
    check_continuous(references)
    assert teleop.at_rest
    rates = np.array([r.w_d_dot for r in references])
    assert np.linalg.norm(rates[:, :3], axis=1).max() <= LIMITS.linear_speed * (1 + 1e-9)
    assert max(abs(r.w_d[4]) for r in references) <= PITCH_LIMIT_RAD + 1e-9
