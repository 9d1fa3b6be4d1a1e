"""Through poses at given times."""

from __future__ import annotations

import math

import numpy as np
import pytest

from snake_control.errors import TrajectoryError
from snake_control.trajectory.waypoints import Waypoints, times_at_speed

POSES = np.array(
    [
        [0.0, 0.0, 0.2, 0.4, 0.3, 3.1],
        [0.1, 0.05, 0.19, 0.4, 0.2, -3.1],
        [0.2, 0.0, 0.2, 0.3, 0.3, -2.9],
        [0.25, 0.02, 0.21, 0.4, 0.3, -3.0],
    ]
)
TIMES = [1.0, 5.0, 8.0, 12.0]


def test_every_pose_is_met_at_its_time_and_both_ends_are_at_rest() -> None:
    motion = Waypoints(TIMES, POSES, start=100.0)
    assert motion.duration == 11.0
    for time, pose in zip(TIMES, POSES, strict=True):
        at = motion.sample(99.0 + time)
        np.testing.assert_allclose(at.w_d[:5], pose[:5], atol=1e-12)
        assert math.remainder(at.w_d[5] - pose[5], math.tau) == pytest.approx(0.0, abs=1e-12)
    for t in (50.0, 100.0, 111.0, 500.0):
        np.testing.assert_allclose(motion.sample(t).w_d_dot, 0.0, atol=1e-12)


def test_it_goes_the_shorter_way_round() -> None:
    motion = Waypoints(TIMES, POSES)
    yaw = [motion.sample(t).w_d[5] for t in np.linspace(0.0, 11.0, 200)]
    assert min(yaw) > 3.0
    assert max(yaw) < 3.5
    assert np.abs(np.diff(yaw)).max() < 0.02


def test_it_is_smooth_up_to_the_acceleration() -> None:
    motion = Waypoints(TIMES, POSES)
    h = 1e-4
    for t in np.linspace(0.5, 10.5, 21):
        before, at, after = (motion.sample(float(t + k * h)) for k in (-1, 0, 1))
        np.testing.assert_allclose((after.w_d - before.w_d) / (2 * h), at.w_d_dot, atol=1e-6)
        change = (after.w_d_dot - before.w_d_dot) / (2 * h)
        np.testing.assert_allclose(change, at.w_d_ddot, atol=1e-3)
    for knot in (4.0, 7.0):
        left, right = motion.sample(knot - 1e-9), motion.sample(knot + 1e-9)
        np.testing.assert_allclose(left.w_d_ddot, right.w_d_ddot, atol=1e-6)


@pytest.mark.parametrize(
    ("times", "change", "words"),
    [
        ([0.0, 1.0, 1.0, 2.0], {}, "pose 2 comes at 1 s, not after pose 1 at 1 s"),
        ([0.0, 1.0, 0.5, 2.0], {}, "pose 2 comes at 0.5 s"),
        ([0.0, math.nan, 2.0, 3.0], {}, "pose 1 is not finite"),
        (TIMES, {(2, 1): math.inf}, "pose 2 is not finite"),
        (TIMES, {(3, 4): 1.5}, "pose 3: pitch 1.5 rad"),
        ([0.0, 1.0], {}, "2 times and poses of shape"),
    ],
)
def test_what_is_wrong_with_a_pose_is_named(
    times: list[float], change: dict[tuple[int, int], float], words: str
) -> None:
    poses = POSES.copy()
    for index, value in change.items():
        poses[index] = value
    with pytest.raises(TrajectoryError, match=words):
        Waypoints(times, poses)


def test_times_follow_from_the_slower_of_both_speeds() -> None:
    poses = np.zeros((4, 6))
    poses[1:, 0] = 0.3
    poses[2:, 5] = 0.5
    times = times_at_speed(poses, speed=0.03, turning_speed=0.1)
    np.testing.assert_allclose(times[:3], [0.0, 10.0, 15.0])
    assert times[3] > times[2], "a pose given twice is no division by zero"
