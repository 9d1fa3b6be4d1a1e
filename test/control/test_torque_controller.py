"""Torque control (21) on a plant that knows nothing of its elimination."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from snake_control.config import ControllerConfig
from snake_control.control.reference import Reference
from snake_control.control.torque_controller import TorqueController
from snake_control.errors import ConfigError, ModelError
from snake_control.experiment.lockstep import lockstep
from snake_control.model.structure import structure
from snake_control.plant.torque import TorquePlant
from support.robots import PAPER, ROBOTS, random_q

ALL = pytest.mark.parametrize("robot", list(ROBOTS.values()), ids=list(ROBOTS))
CASES = pytest.mark.parametrize("case", [1, 2, 3])


def table_1(t: float) -> Reference:
    w_d = np.array([0.01 * t, 0.0, 0.2, np.pi / 8, np.pi / 8, 0.0])
    return Reference(w_d, np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0]))


def of(state):
    return np.concatenate((state.w, state.phi)), np.concatenate((state.w_dot, state.phi_dot))


def critically_damped(error, error_dot, t):
    """Solution of e_ddot + 4 e_dot + 4 e = 0."""
    return (error + (error_dot + 2 * error) * t) * np.exp(-2 * t)


def off_the_law(plant, controller, state, reference, duration_s, dt):
    """Return how far the error of w ever is from e_ddot + K_v e_dot + K_p e = 0."""
    first, worst = controller.step(*of(state), reference(0.0), 0.0), 0.0
    for step in range(round(duration_s / dt)):
        t = step * dt

        def law(q, q_dot, elapsed, t=t):
            return controller.step(q, q_dot, reference(t + elapsed), t + elapsed).u

        state = plant.follow(law, dt)
        found = controller.step(*of(state), reference(t + dt), t + dt).error
        expected = critically_damped(first.error, first.error_dot, t + dt)
        worst = max(worst, np.abs(found - expected).max())
    return worst


@CASES
def test_error_of_w_obeys_its_equation_in_the_papers_cases(case):
    """Started where the paper starts, far from w_d(0)."""
    plant = TorquePlant(PAPER)
    state = plant.reset(PAPER.start_joint_angles_rad)
    controller = TorqueController(PAPER, ControllerConfig(case=case))
    # Long enough for the nearest edge of the support polygon to change, where Case 3's law jumps.
    assert off_the_law(plant, controller, state, table_1, 4.0, 0.02) < 1e-6


@ALL
def test_error_of_w_obeys_its_equation_for_any_robot(robot):
    """With a reference that accelerates, friction in the joints and a start in motion."""
    robot = dataclasses.replace(robot, joint_friction=(0.002,))
    plant = TorquePlant(robot)
    phi_dot = np.random.default_rng(1).uniform(-0.1, 0.1, robot.joints)
    state = plant.reset(random_q(robot, 5)[6:], phi_dot=phi_dot)
    a = np.array([0.02, 0.01, -0.02, 0.1, 0.1, 0.1])

    def swing(t):
        return Reference(
            state.w + 0.1 * a + a * np.sin(2 * t), 2 * a * np.cos(2 * t), -4 * a * np.sin(2 * t)
        )

    controller = TorqueController(robot, ControllerConfig(case=1))
    assert off_the_law(plant, controller, state, swing, 0.1, 2e-3) < 1e-6


def test_holding_torques_costs_in_proportion_to_the_step():
    """A computer holds its torques for a step: the error's equation then holds to first order."""

    def worst(dt):
        plant = TorquePlant(PAPER)
        state = plant.reset(PAPER.start_joint_angles_rad)
        controller = TorqueController(PAPER, ControllerConfig(case=1))
        samples = list(lockstep(plant, state, controller, table_1, 0.4, dt))
        first = samples[0].result
        return max(
            np.abs(s.result.error - critically_damped(first.error, first.error_dot, s.t)).max()
            for s in samples
        )

    assert worst(2e-3) < 8e-3
    assert worst(4e-3) / worst(2e-3) == pytest.approx(2.0, rel=0.1)


@ALL
def test_scps_get_the_acceleration_of_their_velocity_error(robot):
    """The plant's accelerations are the wanted ones, of the SCPs as of w."""
    plant = TorquePlant(robot)
    phi_dot = np.random.default_rng(2).uniform(-0.2, 0.2, robot.joints)
    state = plant.reset(random_q(robot, 2)[6:], phi_dot=phi_dot)
    s = structure(robot)
    gains = ControllerConfig(
        case=1, K_v=tuple(np.linspace(1.0, 3.0, 6 + s.m)), K_p=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    )
    controller = TorqueController(robot, gains)
    reference = Reference(state.w - 0.05, np.full(6, 0.02), np.full(6, 0.3))
    result = controller.step(*of(state), reference, 0.0)
    a, _ = plant.acceleration(plant.p, plant.v, result.u)
    scp = s.scp
    np.testing.assert_allclose(a[3 + scp], result.w_tilde_ddot[len(s.w) :], atol=1e-7)
    np.testing.assert_allclose(a[3 + scp], -np.array(gains.K_v[6:]) * state.phi_dot[scp], atol=1e-7)
    w_ddot = 0.3 - np.array(gains.K_v[:6]) * (state.w_dot - 0.02) - np.array(gains.K_p) * 0.05
    np.testing.assert_allclose(result.w_tilde_ddot[: len(s.w)], w_ddot[s.w], atol=1e-12)


@pytest.mark.parametrize("case", [2, 3])
def test_scps_serve_the_sub_tasks_of_the_case(case):
    controller = TorqueController(PAPER, ControllerConfig(case=case))
    state = TorquePlant(PAPER).reset(PAPER.start_joint_angles_rad)
    result = controller.step(*of(state), table_1(0.0), 0.0)
    assert np.abs(result.phi_tilde_dot_d).min() > 1e-4
    np.testing.assert_allclose(result.w_tilde_ddot[6:], 4.0 * result.phi_tilde_dot_d)


@ALL
def test_free_torques_move_nothing_and_default_torques_are_the_smallest(robot):
    plant = TorquePlant(robot)
    state = plant.reset(random_q(robot, 3)[6:])
    controller = TorqueController(robot, ControllerConfig(case=1))
    reference = Reference(state.w, np.zeros(6))
    plain = controller.step(*of(state), reference, 0.0)
    free = np.random.default_rng(3).uniform(-1, 1, robot.joints)
    loaded = controller.step(*of(state), reference, 0.0, free_torques=free)
    np.testing.assert_array_equal(plain.tau_ker, 0.0)
    assert np.abs(loaded.tau_ker).max() > 1e-3
    np.testing.assert_allclose(loaded.u - plain.u, loaded.tau_ker, atol=1e-12)
    # What is given of the kernel comes through whole.
    again = controller.step(*of(state), reference, 0.0, free_torques=loaded.tau_ker)
    np.testing.assert_allclose(again.tau_ker, loaded.tau_ker, atol=1e-12)
    accelerations, forces = zip(
        *(plant.acceleration(plant.p, plant.v, r.u) for r in (plain, loaded)), strict=True
    )
    scale = np.abs(loaded.u).max() / 1e-4
    np.testing.assert_allclose(accelerations[0], accelerations[1], atol=1e-10 * scale)
    assert np.abs(forces[0] - forces[1]).max() > 1e-3
    assert plain.u @ loaded.tau_ker == pytest.approx(0.0, abs=1e-10)
    assert np.linalg.norm(plain.u) < np.linalg.norm(loaded.u)


def test_torques_hold_the_robot_up():
    """At rest on its reference the neck's foot carries the head: 0.42 to 0.53 N m at 0.1 kg."""
    state = TorquePlant(PAPER).reset(PAPER.start_joint_angles_rad)
    controller = TorqueController(PAPER, ControllerConfig(case=1))
    result = controller.step(*of(state), Reference(state.w, np.zeros(6)), 0.0)
    assert 0.35 < abs(result.u[4]) < 0.55
    np.testing.assert_allclose(result.u[5:], 0.0, atol=1e-9)
    assert result.torque_exceeded == ()


def test_joints_beyond_their_torque_limit_are_named():
    robot = dataclasses.replace(PAPER, joint_torque_limits_n_m=(0.3,))
    state = TorquePlant(robot).reset(robot.start_joint_angles_rad)
    controller = TorqueController(robot, ControllerConfig(case=1))
    result = controller.step(*of(state), Reference(state.w, np.zeros(6)), 0.0)
    assert 5 in result.torque_exceeded
    assert 11 not in result.torque_exceeded


@pytest.mark.parametrize("angle", [0.0, 0.1], ids=["parallel", "arc"])
def test_torques_stay_small_in_singular_shapes(angle):
    """Fig. 5: all wheel axes parallel, or meeting in one point; no torque pushes the robot on."""
    state = TorquePlant(PAPER).reset((-0.11, 0.0, 0.0, 0.0, 1.1, *[angle] * 6))
    reference = Reference(state.w + [0.1, 0.1, 0.0, 0.0, 0.0, 0.0], np.zeros(6))
    controller = TorqueController(PAPER, ControllerConfig(case=1))
    result = controller.step(*of(state), reference, 0.0)
    assert result.damped
    assert result.sigma_min_E_tilde < 1e-10
    assert np.abs(result.u).max() < 5.0
    # A little off such a shape torques are large, as the law says, and exact.
    bend = angle + 0.02 * np.array([1, 0, -1, 1, 0, 1])
    state = TorquePlant(PAPER).reset((-0.11, 0.0, 0.0, 0.0, 1.1, *bend))
    near = controller.step(*of(state), reference, 0.0)
    assert not near.damped
    assert np.abs(near.u[5:]).max() > 3 * np.abs(result.u[5:]).max()


@pytest.mark.parametrize(
    ("gains", "field"),
    [
        ({"K_v": (4.0,) * 6}, "controller.K_v"),
        ({"K_p": (4.0,) * 10}, "controller.K_p"),
        ({"K_p": (4.0,) * 5}, "controller.K_p"),
    ],
)
def test_gains_that_do_not_fit_are_refused(gains, field):
    with pytest.raises(ConfigError) as refused:
        TorqueController(PAPER, ControllerConfig(**gains))
    assert refused.value.field == field


def test_bad_free_torques_are_refused():
    state = TorquePlant(PAPER).reset(PAPER.start_joint_angles_rad)
    controller = TorqueController(PAPER, ControllerConfig(case=1))
    with pytest.raises(ModelError, match="11 finite"):
        controller.step(*of(state), table_1(0.0), 0.0, free_torques=np.zeros(10))


@pytest.mark.parametrize("name", ["paper", "planar"])
def test_motions_beyond_what_doubles_hold_are_named(name):
    robot = ROBOTS[name]
    q = random_q(robot, 1)
    controller = TorqueController(robot, ControllerConfig(case=1))
    reference = Reference(q[:6], np.zeros(6))
    with (
        pytest.raises(ModelError, match=r"h_tilde is not finite .* rate in q_dot 1e\+200"),
        np.errstate(all="ignore"),
    ):
        controller.step(q, np.full(len(q), 1e200), reference, 0.0)
