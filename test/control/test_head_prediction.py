"""The prediction of the head from the joints: how near to the plant, and when it ends."""

from __future__ import annotations

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snake_control.config import Config, load
from snake_control.control.head_filter import HeadEstimate, HeadFilter
from snake_control.control.head_prediction import (
    End,
    Ended,
    HeadPredictor,
    Prediction,
    PredictionLimits,
)
from snake_control.control.supervisor import Supervisor
from snake_control.errors import ModelError
from snake_control.experiment.cases import config_directory, load_case
from snake_control.experiment.lockstep import LockstepSample, lockstep
from snake_control.experiment.servos import TICK_RAD, LimitedServos
from snake_control.model.rotation import quaternion_from_rpy, rpy_rate_map
from snake_control.plant.kinematic import KinematicPlant
from snake_control.trajectory.configured import configured_trajectory

DT = 0.02
BRIDGE = 15
"""Steps of a gap of 0.3 s."""


def run(config: Config, duration_s: float) -> list[LockstepSample]:
    plant = KinematicPlant(config.robot, 0.01)
    state = plant.reset(config.robot.start_joint_angles_rad)
    goal = configured_trajectory(config.trajectory_generator, state.w)
    guide = Supervisor(config.robot, config.controller, config.supervisor, DT)
    servos = LimitedServos(config.robot)
    return list(lockstep(plant, state, guide, goal.sample, duration_s, DT, servos))


@pytest.fixture(scope="module", params=["paper_robot", "planar_snake"])
def motion(request: pytest.FixtureRequest) -> tuple[Config, list[LockstepSample]]:
    config = load(config_directory() / f"{request.param}.yaml")
    return config, run(config, 20.0)


def ns(t: float) -> int:
    return round(t * 1e9)


def truth(sample: LockstepSample) -> HeadEstimate:
    w, w_dot = sample.state.w, sample.state.w_dot
    return HeadEstimate(
        ns(sample.t),
        w[:3],
        Rotation.from_quat(quaternion_from_rpy(w[3:])),
        w_dot[:3],
        rpy_rate_map(w[3:]) @ w_dot[3:],
    )


def predictor(config: Config, samples: list[LockstepSample], ticks: bool = False, **limits: float):
    made = HeadPredictor(config.robot, PredictionLimits(**limits))
    for sample in samples:
        phi = sample.state.phi
        read = np.round(phi / TICK_RAD) * TICK_RAD if ticks else phi
        made.joints(ns(sample.t), read, sample.state.phi_dot)
    return made


def errors(answer: Prediction | Ended, sample: LockstepSample) -> tuple[float, float, float]:
    assert isinstance(answer, Prediction), answer
    there, is_there = truth(sample), answer.estimate
    assert is_there.stamp_ns == there.stamp_ns
    turn = (is_there.rotation * there.rotation.inv()).magnitude()
    speed = np.linalg.norm(is_there.velocity - there.velocity)
    return float(np.linalg.norm(is_there.position - there.position)), turn, float(speed)


def test_with_exact_angles_it_is_the_plant(motion) -> None:
    config, samples = motion
    for begin in range(10, len(samples) - BRIDGE, 60):
        gap = samples[begin - 1 : begin + BRIDGE + 1]
        made = predictor(config, gap, max_position_std_m=1.0, max_attitude_std_rad=1.0)
        made.measured(truth(gap[1]))
        position, turn, _ = errors(made.predict(), gap[-1])
        assert position < 2e-5
        assert turn < 5e-5


def test_read_in_ticks_it_errs_as_it_says(motion) -> None:
    config, samples = motion
    found = []
    for begin in range(10, len(samples) - BRIDGE, 15):
        gap = samples[begin - 1 : begin + BRIDGE + 1]
        made = predictor(config, gap, ticks=True, max_position_std_m=1.0, max_attitude_std_rad=1.0)
        made.measured(truth(gap[1]))
        answer = made.predict()
        position, turn, _ = errors(answer, gap[-1])
        found.append((position / answer.position_std_m, turn / answer.attitude_std_rad, position))
    in_std = np.array(found)
    assert len(in_std) > 50
    assert np.percentile(in_std[:, :2], 95, axis=0).max() < 2.0
    assert np.median(in_std[:, 2]) < 2e-3


def test_the_twist_begins_as_measured_and_goes_over_to_that_of_the_joints(motion) -> None:
    config, samples = motion
    gap = samples[399 : 400 + BRIDGE]
    off = np.array([0.02, -0.01, 0.005, 0.05, 0.02, -0.03])
    answers = []
    for wrong in (np.zeros(6), off):
        made = predictor(config, gap, max_position_std_m=1.0, max_attitude_std_rad=1.0)
        there = truth(gap[1])
        made.measured(
            dataclasses.replace(
                there,
                velocity=there.velocity + wrong[:3],
                angular_velocity=there.angular_velocity + wrong[3:],
            )
        )
        answers.append([made.predict(ns(sample.t)).estimate for sample in gap[1:]])
    np.testing.assert_array_equal(answers[0][0].velocity, truth(gap[1]).velocity)
    np.testing.assert_array_equal(answers[0][0].angular_velocity, truth(gap[1]).angular_velocity)
    for k, (right, other) in enumerate(zip(*answers, strict=True)):
        left = off * np.exp(-k * DT / 0.1)
        np.testing.assert_allclose(other.velocity - right.velocity, left[:3], atol=1e-12)
        turning = other.angular_velocity - right.angular_velocity
        np.testing.assert_allclose(turning, left[3:], atol=1e-12)


def test_its_velocity_is_the_derivative_of_its_position(motion) -> None:
    """Between two joint states the joints turn evenly, so an exact velocity is known there."""
    config, samples = motion
    a, b = samples[300], samples[301]
    made = HeadPredictor(config.robot, PredictionLimits(smooth_s=1e-6))
    for sample in (a, b):
        made.joints(ns(sample.t), sample.state.phi, (b.state.phi - a.state.phi) / DT)
    made.measured(truth(a))
    h = 1_000_000
    before, at, after = (made.predict(ns(a.t) + 10_000_000 + d).estimate for d in (-h, 0, h))
    slope = (after.position - before.position) / (2e-9 * h)
    turning = (after.rotation * before.rotation.inv()).as_rotvec() / (2e-9 * h)
    assert np.linalg.norm(slope) > 1e-3
    np.testing.assert_allclose(at.velocity, slope, atol=1e-5)
    np.testing.assert_allclose(at.angular_velocity, turning, atol=1e-4)


def test_uncertainty_grows_with_time_and_way(motion) -> None:
    config, samples = motion
    gap = samples[299 : 300 + BRIDGE]
    made = predictor(config, gap, max_position_std_m=1.0, max_attitude_std_rad=1.0)
    made.measured(truth(gap[1]))
    moving = [made.predict(ns(sample.t)) for sample in gap[1:]]
    resting = HeadPredictor(config.robot)
    for sample in gap:
        resting.joints(ns(sample.t), gap[1].state.phi, np.zeros(config.robot.joints))
    resting.measured(truth(gap[1]))
    still = [resting.predict(ns(sample.t)) for sample in gap[1:]]
    for answers in (moving, still):
        assert all(a.position_std_m < b.position_std_m for a, b in pairwise(answers))
        assert all(a.attitude_std_rad < b.attitude_std_rad for a, b in pairwise(answers))
    assert moving[-1].position_std_m > still[-1].position_std_m
    assert still[-1].way_m < 1e-12 < moving[-1].way_m
    np.testing.assert_allclose(still[-1].estimate.position, gap[1].state.w[:3], atol=1e-12)


def test_it_ends_after_the_time_allowed_and_stays_ended(motion) -> None:
    config, samples = motion
    gap = samples[299:340]
    made = predictor(config, gap, bridge_s=0.3, max_position_std_m=1.0, max_attitude_std_rad=1.0)
    made.measured(truth(gap[1]))
    assert isinstance(made.predict(ns(gap[16].t)), Prediction)
    for asked in (gap[17], gap[30], gap[40]):
        answer = made.predict(ns(asked.t))
        assert isinstance(answer, Ended)
        assert answer.reason is End.TOO_LONG
        assert "0.320 s" in answer.text
    # What lies within the time is still known, for a pose that was measured there and comes late.
    errors(made.predict(ns(gap[10].t)), gap[10])
    made.measured(truth(gap[30]))
    errors(made.predict(ns(gap[40].t)), gap[40])


@pytest.mark.parametrize("name", ["paper_robot", "planar_snake"])
def test_a_singular_shape_is_refused_and_one_near_it_soon(name: str) -> None:
    """All wheels parallel: nothing holds the robot in its forward direction."""
    config = load(config_directory() / f"{name}.yaml")
    robot = config.robot
    straight = np.array(robot.start_joint_angles_rad)
    bend = straight[robot.head_links :].copy()
    ends = []
    for share in (0.0, 1e-6, 0.01, 1.0):
        straight[robot.head_links :] = share * bend
        plant = KinematicPlant(robot)
        state = plant.reset(straight)
        made = HeadPredictor(robot)
        u = np.full(robot.joints, 0.05)
        begin = HeadEstimate(
            0,
            state.w[:3],
            Rotation.from_quat(quaternion_from_rpy(state.w[3:])),
            np.zeros(3),
            np.zeros(3),
        )
        made.measured(begin)
        for step in range(16):
            made.joints(ns(step * DT), straight + u * step * DT, u)
        answer = made.predict()
        if isinstance(answer, Ended):
            assert answer.reason is End.TOO_UNCERTAIN
            ends.append(float(answer.text.split()[1]))
        else:
            ends.append(np.inf)
            assert np.linalg.norm(answer.estimate.position - begin.position) < 0.05
    assert ends[:2] == [DT, DT]
    assert ends == sorted(ends)
    assert ends[-1] == np.inf


def test_missing_poses_and_joint_states_are_named(motion) -> None:
    config, samples = motion
    gap = samples[300:330]
    made = predictor(config, gap)
    answer = made.predict()
    assert isinstance(answer, Ended)
    assert answer.reason is End.NO_POSE

    empty = HeadPredictor(config.robot)
    empty.measured(truth(gap[0]))
    assert empty.newest_ns is None
    assert empty.predict().reason is End.NO_JOINT_STATES

    made.measured(truth(samples[290]))
    assert made.predict().reason is End.NO_JOINT_STATES

    pause = predictor(config, gap[:5] + gap[11:])
    pause.measured(truth(gap[1]))
    errors(pause.predict(ns(gap[4].t)), gap[4])
    answer = pause.predict()
    assert answer.reason is End.NO_JOINT_STATES
    assert "0.140 s" in answer.text
    assert pause.predict(ns(gap[0].t)).reason is End.NO_POSE
    assert pause.predict(ns(gap[-1].t + 0.01)).reason is End.NO_JOINT_STATES


def test_old_joint_states_are_forgotten_and_late_ones_left_out(motion) -> None:
    config, samples = motion
    made = predictor(config, samples)
    assert made.newest_ns == ns(samples[-1].t)
    made.joints(ns(samples[-5].t), np.full(config.robot.joints, 9.0), np.zeros(config.robot.joints))
    gap = samples[-12:]
    made.measured(truth(gap[0]))
    errors(made.predict(), gap[-1])
    made.measured(truth(samples[10]))
    assert made.predict().reason is End.NO_JOINT_STATES
    made.reset()
    assert made.newest_ns is None
    assert made.predict().reason is End.NO_POSE


def test_joint_states_that_are_none_are_refused() -> None:
    made = HeadPredictor(load_case((), 3).robot)
    with pytest.raises(ModelError, match="expected 11 finite numbers"):
        made.joints(0, [0.0] * 10, [0.0] * 11)
    with pytest.raises(ModelError, match="joint velocities"):
        made.joints(0, [0.0] * 11, [0.0] * 10 + [np.nan])
    with pytest.raises(ValueError, match="slip_share"):
        PredictionLimits(slip_share=-0.1)
    with pytest.raises(ValueError, match="smooth_s"):
        PredictionLimits(smooth_s=0.0)


def test_the_filter_goes_on_from_a_prediction_without_a_jump() -> None:
    """The prediction takes the place of the estimate before the first pose after the gap."""
    config = load_case((), 3)
    samples = run(config, 12.0)
    rng = np.random.default_rng(3)
    filter_ = HeadFilter(3.0, 1.0)
    made = HeadPredictor(config.robot)
    estimates = []
    for k, sample in enumerate(samples):
        phi = np.round(sample.state.phi / TICK_RAD) * TICK_RAD
        made.joints(ns(sample.t), phi, sample.state.phi_dot)
        there = truth(sample)
        if 500 <= k < 500 + BRIDGE:
            answer = made.predict()
            assert isinstance(answer, Prediction)
            estimates.append(answer.estimate)
            continue
        if k == 500 + BRIDGE:
            before = made.predict(ns(samples[k - 1].t))
            assert isinstance(before, Prediction)
            filter_.go_on_from(before.estimate)
        noise = rng.normal(0.0, 0.0005, 3)
        estimate = filter_.update(there.stamp_ns, there.position + noise, there.rotation.as_quat())
        assert isinstance(estimate, HeadEstimate)
        made.measured(estimate)
        estimates.append(estimate)
    velocities = np.array([each.velocity for each in estimates])
    jumps = np.linalg.norm(np.diff(velocities, axis=0), axis=1)
    usual = jumps[400:499].max()
    assert jumps[498 : 502 + BRIDGE].max() < 1.5 * usual + 1e-3
    positions = np.array([each.position for each in estimates])
    off = np.linalg.norm(positions - [truth(sample).position for sample in samples], axis=1)
    assert off[500 : 520 + BRIDGE].max() < 4e-3
