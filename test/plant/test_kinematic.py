from __future__ import annotations

import numpy as np
import pytest

from snake_control.errors import ModelError
from snake_control.model.constraints import constraint_matrix
from snake_control.model.geometry import geometry
from snake_control.model.redundancy import joint_velocities, kinematics
from snake_control.plant.kinematic import KinematicPlant
from support.robots import PAPER, ROBOTS, random_q

ALL = pytest.mark.parametrize("robot", list(ROBOTS.values()), ids=list(ROBOTS))


def q_of(state):
    return np.concatenate((state.w, state.phi))


@ALL
def test_reset_stands_level_where_asked(robot):
    phi = random_q(robot, 3)[6:]
    w = np.array([0.4, -0.3, 9.0, 9.0, 9.0, 0.8])
    state = KinematicPlant(robot).reset(phi, w)
    np.testing.assert_allclose(state.w[[0, 1, 5]], w[[0, 1, 5]], atol=1e-12)
    g = geometry(robot, q_of(state))
    np.testing.assert_allclose(g.base_rotation[:, 2], [0, 0, 1], atol=1e-12)
    assert g.base_origin[2] == pytest.approx(robot.wheel_radius_m)


@ALL
def test_consistent_velocities_move_the_head_as_wanted_without_slip(robot):
    """Joint velocities from the model's own inverse: the plant gives the head velocity back."""
    plant = KinematicPlant(robot)
    before = plant.reset(random_q(robot, 3)[6:])
    k = kinematics(geometry(robot, q_of(before)))
    w_dot = np.array([0.02, -0.01, 0.01, 0.05, -0.04, 0.03])
    if robot.planar:
        w_dot[2:5] = 0.0
    u = joint_velocities(k, w_dot[k.s.w], np.full(k.s.m, 0.1))
    dt = 1e-5 / max(1.0, np.abs(u).max())
    after = plant.step(u, dt)
    # The slip left over is that of the step's midpoint, where the constraints have moved on a bit.
    np.testing.assert_allclose((after.w - before.w) / dt, w_dot, atol=1e-3)
    np.testing.assert_allclose(after.w_dot, w_dot, atol=1e-3)
    assert np.abs(after.slip).max() < 1e-3
    np.testing.assert_allclose(after.phi, before.phi + dt * u)


@ALL
def test_inconsistent_velocities_slip_as_least_squares_say(robot):
    plant = KinematicPlant(robot)
    before = plant.reset(random_q(robot, 8)[6:])
    u = np.random.default_rng(2).uniform(-1, 1, robot.joints)
    G = constraint_matrix(geometry(robot, q_of(before)))
    wheels = len(robot.wheeled_links)
    # The independent way: over head velocities, with the floor rows held by their null space.
    floor_basis = np.linalg.svd(G[wheels:, :6])[2][3:].T
    if robot.planar:
        floor_basis = np.eye(6)[:, [0, 1, 5]]
    particular = np.zeros(6)
    if not robot.planar:
        particular = np.linalg.lstsq(G[wheels:, :6], -G[wheels:, 6:] @ u, rcond=None)[0]
    rest = -G[:wheels, :6] @ particular - G[:wheels, 6:] @ u
    eta = np.linalg.lstsq(G[:wheels, :6] @ floor_basis, rest, rcond=None)[0]
    w_dot = particular + floor_basis @ eta
    dt = 1e-6
    after = plant.step(u, dt)
    np.testing.assert_allclose((after.w - before.w) / dt, w_dot, rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(after.slip, G[:wheels] @ np.concatenate((w_dot, u)), atol=1e-4)
    assert np.abs(after.slip).max() > 1e-4


def test_second_order_in_the_step():
    """Halving the step quarters the error of the base's path."""

    def final(steps):
        plant = KinematicPlant(PAPER)
        plant.reset(PAPER.start_joint_angles_rad)
        for _ in range(steps):
            state = plant.step(np.linspace(-0.5, 0.5, 11), 1.0 / steps)
        return state.w

    exact = final(640)
    ratio = np.linalg.norm(final(10) - exact) / np.linalg.norm(final(20) - exact)
    assert ratio == pytest.approx(4.0, rel=0.2)


def test_falling_is_remembered():
    robot = PAPER.__class__(link_mass_kg=(1.0,) * 5 + (0.01,) * 7)
    plant = KinematicPlant(robot)
    assert not plant.reset((0.0, 0.0, 0.0, 0.0, 2.0, 0.3, -0.6, 0.6, -0.6, 0.6, -0.3)).fallen
    lower = np.zeros(11)
    lower[4] = -1.0
    for _ in range(140):
        state = plant.step(lower, 0.01)
    assert state.d_min < 0
    assert state.fallen
    for _ in range(140):
        state = plant.step(-lower, 0.01)
    assert state.d_min > 0
    assert state.fallen


@pytest.mark.parametrize("command", [np.zeros(10), np.full(11, np.nan)])
def test_bad_commands_are_refused(command):
    with pytest.raises(ModelError, match="11 finite"):
        KinematicPlant(PAPER).step(command, 0.01)


def test_substeps_of_a_step_are_steps():
    phi_dot = 0.5 * np.cos(np.arange(PAPER.joints))
    whole, parts = KinematicPlant(PAPER, max_substep_s=0.006), KinematicPlant(PAPER)
    for _ in range(4):
        expected = parts.step(phi_dot, 0.005)
    found = whole.step(phi_dot, 0.02)
    np.testing.assert_allclose(found.w, expected.w, atol=1e-14)
    np.testing.assert_allclose(found.slip, expected.slip, atol=1e-14)
    assert np.abs(KinematicPlant(PAPER).step(phi_dot, 0.02).w - expected.w).max() > 1e-9
