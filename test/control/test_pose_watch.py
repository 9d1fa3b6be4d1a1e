"""The watch of poses against joints: nothing wrong is named nothing, a planted fault by its name.

More of it, over all joints and several robots: test/pose_watch/campaign.py.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snake_control.config import Config
from snake_control.control.pose_hypotheses import Cause, Hypotheses
from snake_control.control.pose_watch import PoseWatch
from snake_control.errors import ModelError
from snake_control.experiment.cases import load_case
from snake_control.mock.motion_capture import Noise
from snake_control.model.rotation import quaternion_from_rpy
from snake_control.plant.kinematic import KinematicPlant
from support.experiments import LONG_ROBOT
from support.robots import PAPER, ROBOTS
from support.watched_robot import Planted, watched_run


@pytest.fixture(scope="module")
def config() -> Config:
    return load_case((), 3)


def named(config: Config, duration_s: float, planted: Planted, seed: int = 5, **more):
    """The first cause that is named, its joints and when; the verdict a second later."""
    first = None
    for at in watched_run(config, duration_s, seed, planted, **more):
        verdict = at.verdict
        if verdict.cause is not Cause.NOTHING and first is None:
            first = verdict.cause, verdict.joints, at.t
        if first is not None and at.t > first[2] + 1.0:
            break
    return first, verdict


def test_nothing_is_named_when_nothing_is_wrong(config: Config) -> None:
    first, verdict = named(config, 20.0, Planted())
    assert first is None
    assert verdict.segments > 20
    assert verdict.residual < 1.3
    assert "agree" in verdict.text


@pytest.mark.parametrize("noise", [Noise(0.0005, 0.002), Noise(0.003, 0.015)])
def test_at_rest_nothing_is_judged(config: Config, noise: Noise) -> None:
    first, verdict = named(config, 8.0, Planted(), noise=noise, moves=False)
    assert first is None
    assert verdict.segments == 0
    assert "too little motion" in verdict.text


def test_slight_imperfections_are_not_named(config: Config) -> None:
    slight = Planted(slip=tuple((wheel, 0.1) for wheel in range(4)), zeros_rad=0.005, early_s=0.01)
    first, _ = named(config, 15.0, slight)
    assert first is None


@pytest.mark.parametrize("joint", [1, 4, 5, 8, 11])
def test_a_wrong_direction_is_named_within_four_seconds(config: Config, joint: int) -> None:
    first, verdict = named(config, 6.0, Planted(flipped=joint))
    assert first is not None
    assert first[:2] == (Cause.WRONG_DIRECTION, (joint,))
    # Joint 5 takes longest: by its angle the head is in the floor, and the supervisor goes slowly.
    assert first[2] < 4.0
    assert (verdict.cause, verdict.joints) == first[:2]
    assert verdict.explained > 0.9
    assert f"joint {joint} " in verdict.text


@pytest.mark.parametrize("pair", [(1, 3), (2, 4), (4, 6), (7, 8), (6, 11)])
def test_swapped_joints_are_named_within_four_seconds(
    config: Config, pair: tuple[int, int]
) -> None:
    first, verdict = named(config, 5.0, Planted(swapped=pair))
    assert first is not None
    assert first[:2] == (Cause.SWAPPED_JOINTS, pair)
    assert first[2] < 4.0
    assert f"joints {pair[0]} and {pair[1]} " in verdict.text


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_marker_off_the_tip_is_named_with_its_offset(config: Config, axis: int) -> None:
    offset = np.zeros(3)
    offset[axis] = 0.02
    first, verdict = named(config, 22.0, Planted(offset=tuple(offset.tolist())))
    assert first is not None
    assert first[0] is Cause.WRONG_MARKER_OFFSET
    assert verdict.cause is Cause.WRONG_MARKER_OFFSET
    # Attitude changes little along Case 3 but for pitching, so sideways it is known worst.
    np.testing.assert_allclose(verdict.marker_offset_m, offset, atol=0.015)


def test_sliding_wheels_are_named(config: Config) -> None:
    first, _ = named(config, 16.0, Planted(skid_m_s=0.03, slips_from_s=6.0))
    assert first is not None
    assert first[0] is Cause.WHEEL_SLIP
    assert 6.0 < first[2] < 12.0


def test_the_watch_follows_whoever_carries_the_robot_and_forgives_afterwards() -> None:
    """Joints at rest, the robot carried about: that is no fault of a joint."""
    watch = PoseWatch(PAPER)
    phi = np.array(PAPER.start_joint_angles_rad)
    rng = np.random.default_rng(2)
    causes = set()
    for step in range(3000):
        t = 0.01 * step
        way = 0.1 * np.sin(0.5 * t) if t < 12.0 else 0.1 * np.sin(6.0)
        position = np.array((way, 0.3 * way, 0.3)) + rng.normal(0.0, 0.0005, 3)
        quaternion = Rotation.from_euler("z", way).as_quat()
        watch.joints(round(1e9 * t), phi)
        watch.pose(round(1e9 * t), position, quaternion)
        causes.add(watch.verdict.cause)
    assert causes == {Cause.NOTHING, Cause.WHEEL_SLIP}
    watch.reset()
    assert watch.verdict.cause is Cause.NOTHING
    assert watch.verdict.segments == 0


@pytest.mark.parametrize("robot", [PAPER, LONG_ROBOT, ROBOTS["planar"]])
def test_hypotheses_are_every_direction_and_pairs_of_the_same_axis(robot) -> None:
    hypotheses = Hypotheses(robot)
    phi = np.linspace(0.1, 1.0, robot.joints)
    angles = hypotheses.angles(phi)
    np.testing.assert_array_equal(angles[0], phi)
    directions = 0
    for hypothesis, true in zip(hypotheses.each, angles, strict=True):
        expected = phi.copy()
        which = [joint - 1 for joint in hypothesis.joints]
        if hypothesis.cause is Cause.WRONG_DIRECTION:
            directions += 1
            expected[which] *= -1.0
        elif hypothesis.cause is Cause.SWAPPED_JOINTS:
            assert len({robot.joint_axes[joint] for joint in which}) == 1
            expected[which] = expected[which[::-1]]
        np.testing.assert_array_equal(true, expected)
    assert directions == robot.joints


def exact(watch: PoseWatch, u: np.ndarray, late: int, steps: int = 400) -> None:
    """Poses and angles of a plant, without noise; poses arrive ``late`` cycles after the joints."""
    plant = KinematicPlant(PAPER)
    state = plant.reset(PAPER.start_joint_angles_rad)
    poses = []
    for step in range(steps):
        now = round(step * 2e7)
        watch.joints(now, state.phi)
        poses.append((now, state.w[:3], quaternion_from_rpy(state.w[3:])))
        if step >= late:
            watch.pose(*poses[step - late])
        state = plant.step(u * np.cos(0.02 * step), 0.02)


def test_without_noise_nothing_remains_however_late_the_poses_are() -> None:
    u = np.linspace(-0.1, 0.1, PAPER.joints)
    residuals = []
    for late in (0, 1, 10):
        watch = PoseWatch(PAPER)
        exact(watch, u, late)
        assert watch.verdict.segments > 4
        residuals.append(watch.verdict.residual)
    assert max(residuals) < 0.02
    assert np.ptp(residuals) < 0.01


def test_a_gap_begins_a_new_segment() -> None:
    watch = PoseWatch(PAPER)
    exact(watch, np.full(PAPER.joints, 0.05), 0)
    before = watch.verdict
    plant = KinematicPlant(PAPER)
    # Somewhere else, a second later: what happened in between belongs to no segment.
    state = plant.reset(np.zeros(PAPER.joints), (5.0, 5.0, 0.0, 0.0, 0.0, 2.0))
    for step in range(100):
        now = round(9e9 + step * 2e7)
        watch.joints(now, state.phi)
        watch.pose(now, state.w[:3], quaternion_from_rpy(state.w[3:]))
    assert watch.verdict == before


def test_what_is_no_joint_state_is_refused_and_old_ones_are_left_out() -> None:
    watch = PoseWatch(PAPER)
    with pytest.raises(ModelError, match="expected 11 finite numbers"):
        watch.joints(0, [0.0] * 10)
    watch.joints(20, np.zeros(11))
    watch.joints(10, np.ones(11))
    watch.pose(20, np.zeros(3), (0.0, 0.0, 0.0, 1.0))
    watch.pose(10, np.ones(3), (0.0, 0.0, 0.0, 1.0))
    assert watch.verdict.cause is Cause.NOTHING
