"""The two trajectories that nobody commands."""

import numpy as np
import pytest

from snake_control.trajectory.hold import Hold
from snake_control.trajectory.line import Line

START = np.array([0.0, 0.0, 0.2, 0.39, 0.39, 0.0])
VELOCITY = np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.02])


def test_table_1_line():
    line = Line(START, VELOCITY, start=100.0)
    reference = line.sample(160.0)
    np.testing.assert_allclose(reference.w_d, START + 60 * VELOCITY, rtol=1e-14)
    np.testing.assert_array_equal(reference.w_d_dot, VELOCITY)


def test_start_is_held_before_and_the_end_after():
    line = Line(START, VELOCITY, start=10.0, duration=5.0)
    for t, elapsed, rate in ((9.0, 0.0, 0.0), (12.0, 2.0, 1.0), (15.0, 5.0, 0.0), (99.0, 5.0, 0.0)):
        reference = line.sample(t)
        np.testing.assert_allclose(reference.w_d, START + elapsed * VELOCITY, rtol=1e-14)
        np.testing.assert_array_equal(reference.w_d_dot, rate * VELOCITY)


def test_pose_is_continuous_across_start_and_end():
    line = Line(START, VELOCITY, start=1.0, duration=2.0)
    t = np.arange(0.0, 4.0, 0.001)
    poses = np.array([line.sample(s).w_d for s in t])
    assert np.abs(np.diff(poses, axis=0)).max() <= 0.001 * VELOCITY.max() * (1 + 1e-9)


def test_rate_is_the_derivative_of_the_pose():
    line = Line(START, VELOCITY, start=0.0)
    slope = (line.sample(7.001).w_d - line.sample(6.999).w_d) / 0.002
    np.testing.assert_allclose(slope, line.sample(7.0).w_d_dot, atol=1e-12)


@pytest.mark.parametrize(("duration", "length"), [(0.0, 60.0), (4.0, 4.0)])
def test_path_runs_from_start_to_end(duration, length):
    line = Line(START, VELOCITY, start=3.0, duration=duration)
    path = line.path(points=5, endless_s=60.0)
    assert [t for t, _ in path] == pytest.approx([3.0 + length * k / 4 for k in range(5)])
    for t, pose in path:
        np.testing.assert_allclose(pose, line.sample(t).w_d, rtol=1e-12)


def test_hold_holds_a_copy():
    pose = START.copy()
    hold = Hold(pose)
    pose[0] = 9.0
    for t in (0.0, 1e6):
        np.testing.assert_array_equal(hold.sample(t).w_d, START)
        np.testing.assert_array_equal(hold.sample(t).w_d_dot, np.zeros(6))
