"""Attitude error by rotation vector: (22) to first order, exact decay, through P = 90 degrees."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snake_control.config import Config, ControllerConfig, RobotConfig
from snake_control.control.reference import Reference
from snake_control.control.scp_controller import ScpController
from snake_control.experiment.cases import load_case
from snake_control.experiment.guided import GuidedRobot
from snake_control.model.posture import Posture
from snake_control.model.rotation import (
    rotation_from_rpy,
    rotation_from_vector,
    rotation_vector,
    rpy_rate_map,
)
from support.robots import PAPER, ROBOTS, random_q

UNEVEN = (0.4, 0.25, 0.5, 0.1, 0.3, 0.2)
EVEN = (0.4, 0.25, 0.5, 0.2, 0.2, 0.2)


def law(error: str, K: tuple[float, ...] = UNEVEN, robot: RobotConfig = PAPER, **more):
    return ScpController(robot, ControllerConfig(K=K, rotation_error=error, **more))


def twist_of(robot: RobotConfig, q: np.ndarray, u: np.ndarray) -> np.ndarray:
    """How the head moves under joint velocities: linear and angular velocity in the world."""
    k = Posture(robot, q).k
    w_dot = np.linalg.lstsq(k.A_bar, k.B_bar @ u, rcond=None)[0]
    return np.concatenate((w_dot[:3], rpy_rate_map(q[3:6]) @ w_dot[3:]))


@pytest.mark.parametrize(
    "vector", np.vstack((np.eye(3), np.random.default_rng(1).normal(size=(4, 3))))
)
@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-7, 1e-3, 1.0, 3.0, np.pi - 1e-6, np.pi - 1e-9])
def test_rotation_vectors_agree_with_scipy(vector: np.ndarray, angle: float) -> None:
    given = angle * vector / np.linalg.norm(vector)
    matrix = Rotation.from_rotvec(given).as_matrix()
    np.testing.assert_allclose(rotation_from_vector(given), matrix, atol=1e-15)
    np.testing.assert_allclose(rotation_vector(matrix), given, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("name", ["paper", "minimal head", "long head, two H-SCPs"])
@pytest.mark.parametrize("scp_law", ["gradient", "projection"])
def test_small_errors_are_answered_as_by_the_paper(name: str, scp_law: str) -> None:
    """The difference falls with the square of the error, also with gains that differ."""
    robot = ROBOTS[name]
    q = random_q(robot, 2)
    away = np.array([0.03, -0.02, 0.01, 0.04, -0.03, 0.05])
    ratios = []
    for size in (1.0, 0.1, 0.01):
        reference = Reference(q[:6] + size * away, np.zeros(6))
        one, other = (
            law(error, robot=robot, scp_law=scp_law).step(q, None, reference, 0.0)
            for error in ("rpy", "rotation_vector")
        )
        difference = np.abs(one.u_unlimited - other.u_unlimited).max()
        ratios.append(difference / size**2)
    assert ratios[2] < 2.0 * ratios[0] + 1e-6
    assert ratios[2] * 1e-4 < 1e-3 * np.abs(one.u_unlimited).max() + 1e-6


def test_without_an_error_a_moving_reference_is_followed_alike() -> None:
    q = random_q(PAPER, 3)
    reference = Reference(q[:6].copy(), np.array([0.01, 0.02, -0.01, 0.1, -0.2, 0.15]))
    one, other = (
        law(error).step(q, None, reference, 0.0).u_unlimited for error in ("rpy", "rotation_vector")
    )
    np.testing.assert_allclose(other, one, rtol=1e-9, atol=1e-12)


def test_any_error_decays_along_its_own_axis() -> None:
    """With R = exp(e) R_d, equal gains give d(exp(e))/dt = -k [e] exp(e): e_dot = -k e exactly."""
    q = random_q(PAPER, 4)
    e = np.array([0.9, -1.2, 0.7])
    wanted = Rotation.from_matrix(rotation_from_vector(e).T @ rotation_from_rpy(q[3:6]))
    Y, P, R = wanted.as_euler("ZYX")
    rates = np.array([0.1, -0.2, 0.15])
    reference = Reference(np.array([*q[:3], R, P, Y]), np.array([0.0, 0.0, 0.0, *rates]))
    result = law("rotation_vector", EVEN).step(q, None, reference, 0.0)
    np.testing.assert_allclose(result.error[3:], e, atol=1e-12)
    omega = twist_of(PAPER, q, result.u_unlimited)[3:]
    omega_d = rpy_rate_map([R, P, Y]) @ rates
    h = 1e-6
    moved = rotation_from_vector(h * omega) @ rotation_from_rpy(q[3:6])
    moved_wanted = rotation_from_vector(h * omega_d) @ wanted.as_matrix()
    slope = (rotation_vector(moved @ moved_wanted.T) - e) / h
    np.testing.assert_allclose(slope, -EVEN[3] * e, atol=1e-5)


@pytest.mark.parametrize("K", [EVEN, UNEVEN])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_wanted_twist_is_continuous_and_bounded_across_90_degrees(
    K: tuple[float, ...], sign: float
) -> None:
    q = random_q(PAPER, 5)
    controller = law("rotation_vector", K)
    w_d = np.array([*q[:3], 0.2, sign * 0.5 * np.pi + 0.1, -0.3])
    reference = Reference(w_d, np.array([0.0, 0.0, 0.0, 0.1, 0.2, -0.1]))

    def twist(roll: float, pitch: float, yaw: float) -> np.ndarray:
        q[3:6] = roll, pitch, yaw
        posture, error = controller.look(q, reference)
        back = controller.feedback(posture, error)
        return np.array(back) + controller.feedforward(reference, error)

    offs = np.linspace(-0.2, 0.2, 401)
    twists = np.array([twist(0.3, sign * 0.5 * np.pi + off, -0.2) for off in offs])
    assert np.abs(twists).max() < 1.0
    assert np.abs(np.diff(twists, axis=0)).max() < 2e-3
    # The same attitude said otherwise is the same attitude.
    for off in (-0.15, -0.01, 0.0, 0.15):
        pitch = sign * 0.5 * np.pi + off
        there, again = twist(0.3, pitch, -0.2), twist(0.3 + np.pi, np.pi - pitch, -0.2 + np.pi)
        np.testing.assert_allclose(again, there, atol=1e-12)


def test_the_default_is_the_paper_and_a_planar_snake_knows_but_one() -> None:
    assert ControllerConfig().rotation_error == "rpy"
    robot = ROBOTS["planar"]
    q = random_q(robot, 1)
    reference = Reference(q[:6] + 0.1, np.full(6, 0.01))
    one, other = (
        law(error, robot=robot).step(q, None, reference, 0.0).u
        for error in ("rpy", "rotation_vector")
    )
    np.testing.assert_array_equal(one, other)


@pytest.fixture(scope="module")
def nose_up() -> Config:
    """The paper's robot with its head at 74 degrees, nose up."""
    config = load_case((), 2)
    start = list(config.robot.start_joint_angles_rad)
    start[:5] = 0.1, 0.1, 0.3, -0.1, 0.9
    robot = dataclasses.replace(config.robot, start_joint_angles_rad=tuple(start))
    return dataclasses.replace(config, robot=robot)


@pytest.mark.parametrize("supervised", [True, False])
@pytest.mark.parametrize("K", [(0.5,) * 6, (0.4, 0.25, 0.5, 0.4, 0.6, 0.5)])
def test_the_head_pitches_over_90_degrees(
    nose_up: Config, K: tuple[float, ...], supervised: bool
) -> None:
    config = dataclasses.replace(
        nose_up,
        controller=dataclasses.replace(nose_up.controller, rotation_error="rotation_vector", K=K),
        supervisor=dataclasses.replace(nose_up.supervisor, enabled=supervised),
    )
    robot = GuidedRobot(config)
    start = robot.state.w.copy()

    def reference(t: float) -> Reference:
        w_d = start + np.array([0.01, 0.0, 0.0, 0.0, -0.05, 0.0]) * min(t, 11.0)
        return Reference(w_d, np.array([0.01, 0.0, 0.0, 0.0, -0.05, 0.0]) * (t < 11.0))

    worst, fastest = 0.0, 0.0
    for sample in robot.follow(reference, 14.0, 30.0):
        result = sample.result
        assert np.isfinite(result.u).all()
        if sample.t > 2.0:
            worst = max(worst, float(np.linalg.norm(result.error[3:])))
            fastest = max(fastest, float(np.abs(result.u).max()))
    assert reference(14.0).w_d[4] < -0.5 * np.pi - 0.2
    assert worst < 0.02
    assert fastest < 2.0
    # Over the top: what was left is right now.
    forward = rotation_from_rpy(robot.state.w[3:])[:, 0]
    assert forward[0] < -0.2
