"""Nothing in the control path is ever anything but a finite number."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from snake_control.config import ControllerConfig, RobotConfig
from snake_control.config.presets import PRESETS
from snake_control.control.reference import Reference
from snake_control.control.scp_controller import ScpController
from snake_control.plant.kinematic import KinematicPlant
from support.robots import PAPER, ROBOTS, random_q

ALL = pytest.mark.parametrize("robot", list(ROBOTS.values()), ids=list(ROBOTS))
AWAY = np.array([0.3, -0.2, 0.1, 0.4, -0.3, 0.5])


def all_finite(result) -> bool:
    posture = result.posture
    numbers = (
        result.u,
        result.u_unlimited,
        result.phi_tilde_dot_d,
        result.error,
        result.support_polygon,
        result.center_of_mass,
        posture.V_h_gradient,
        posture.log_V_h_gradient,
        posture.V_b1_gradient,
        posture.log_V_b1_gradient,
        posture.support.gradient,
        posture.k.F_bar,
        posture.k.E_tilde,
        [result.V_h, result.V_b1, posture.log_V_b1, result.d_min, result.damping],
        [result.sigma_min_B_tilde, result.sigma_min_A_hat],
    )
    return all(np.isfinite(each).all() for each in numbers)


def command(robot, q, **gains):
    reference = Reference(np.asarray(q[:6]) + AWAY, np.full(6, 0.05))
    controller = ScpController(robot, ControllerConfig(case=3, **gains))
    result = controller.step(q, None, reference, 0.0)
    assert (np.abs(result.u) <= np.array(robot.joint_speed_limits_rad_s) * (1 + 1e-12)).all()
    return result


def straight(robot):
    return np.zeros(robot.links + 5)


def parallel_wheels(robot):
    """A bent head on a straight base: V_b1 = 0."""
    q = random_q(robot, 1)
    q[6 + robot.head_links :] = 0.0
    return q


def arc(robot):
    q = random_q(robot, 1)
    q[6 + robot.head_links :] = 0.25
    return q


def straight_head(robot):
    """V_h = 0 on a wave."""
    q = random_q(robot, 1)
    q[6 : 6 + robot.head_links] = 0.0
    return q


def nose_down(robot):
    """Roll and yaw are one rotation: A_bar loses a rank."""
    q = random_q(robot, 1)
    q[4] = np.pi / 2
    return q


@ALL
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("posture", [straight, parallel_wheels, arc, straight_head, nose_down])
def test_singular_postures(robot, posture):
    q = posture(robot)
    assert all_finite(command(robot, q))
    # And one rounding error away from them.
    assert all_finite(command(robot, q + 1e-16))
    assert all_finite(command(robot, q + 1e-9 * random_q(robot, 2)))


@ALL
@pytest.mark.filterwarnings("error")
def test_largest_weights(robot):
    assert all_finite(
        command(robot, random_q(robot, 3), a_h=1e12, a_b=1e12, a_prime=1e12, b_prime=1e12)
    )


@pytest.mark.filterwarnings("error")
def test_V_b1_beyond_what_doubles_hold():
    """A long robot with every second link wheelless: V_b1 overflows, and the command does not."""
    n = 200
    robot = RobotConfig(
        links=n,
        wheelless_links=tuple(range(7, n, 2)),
        joint_axes=("pitch", "yaw", "pitch", "yaw", "pitch") + ("yaw",) * (n - 6),
        start_joint_angles_rad=(0.0,),
    )
    q = random_q(robot, 4)
    q[11:] *= 0.1
    result = command(robot, q)
    assert result.V_b1 > 1e140
    assert np.isfinite(result.u).all()
    assert np.isfinite(result.posture.V_b1_gradient).all()


def test_damping_is_reported_and_only_then():
    assert command(PAPER, straight(PAPER)).damping == 1.0
    assert command(PAPER, random_q(PAPER, 1)).damping == 0.0


def test_a_controller_leaves_a_straight_posture_by_itself():
    """The damped command is no dead end: after a short while every inverse is exact."""
    robot = dataclasses.replace(PAPER, start_joint_angles_rad=(0.0,))
    plant = KinematicPlant(robot)
    state = plant.reset(np.zeros(11))
    # V_b1 grows without need near a singular head, and its weight fits the paper's postures only.
    controller = ScpController(robot, ControllerConfig(case=3, a_prime=0.0))
    w_d = state.w + np.array([0.0, 0.05, 0.1, 0.2, -0.3, 0.2])
    for step in range(250):
        q = np.concatenate((state.w, state.phi))
        result = controller.step(q, None, Reference(w_d, np.zeros(6)), 0.02 * step)
        assert np.isfinite(result.u).all()
        state = plant.step(result.u, 0.02)
    assert result.damping == 0.0
    assert np.abs(result.error).max() < 0.25


FUZZED = {name: ROBOTS[name] for name in ("paper", "planar", "minimal head")}
ANGLES = np.array([0.0, np.pi / 2, -np.pi / 2, np.pi, -np.pi, np.pi / 4])


def right_angles(robot: RobotConfig, rng: np.random.Generator) -> np.ndarray:
    """Some angles by chance, most of them right ones; often the base folded up on one spot."""
    size = robot.links + 5
    q = np.where(rng.random(size) < 0.1, rng.uniform(-np.pi, np.pi, size), rng.choice(ANGLES, size))
    kind = rng.integers(4)
    if kind == 0:
        q[6 + robot.head_links :] = rng.choice([-np.pi, np.pi], size - 6 - robot.head_links)
    elif kind == 1:
        q[3:5] = 0.0
    return q


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("preset", list(PRESETS))
@pytest.mark.parametrize("case", [1, 2, 3])
@pytest.mark.parametrize("robot", list(FUZZED.values()), ids=list(FUZZED))
def test_right_angles_and_folded_up_bases(robot, case, preset):
    controller = ScpController(robot, ControllerConfig(case=case, preset=preset))
    rng = np.random.default_rng(7)
    limits = np.array(robot.joint_speed_limits_rad_s)
    for _ in range(60):
        q = right_angles(robot, rng)
        result = controller.step(q, None, Reference(q[:6] + AWAY, np.full(6, 0.05)), 0.0)
        assert all_finite(result), q.tolist()
        assert np.isfinite(result.singular_shape.nearness), q.tolist()
        assert (np.abs(result.u) <= limits * (1 + 1e-12)).all(), q.tolist()
