"""The plant with inertia, against mechanics' own laws and against (20), which it does not use."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from snake_control.errors import ModelError
from snake_control.model.dynamics import Dynamics
from snake_control.model.floor import head_pose_on_floor
from snake_control.model.geometry import geometry, link_centers
from snake_control.model.posture import Posture
from snake_control.model.selection import selection
from snake_control.plant.kinematic import KinematicPlant
from snake_control.plant.torque import TorquePlant
from support.robots import PAPER, ROBOTS, random_q

ALL = pytest.mark.parametrize("robot", list(ROBOTS.values()), ids=list(ROBOTS))


def moving(robot, seed):
    """A plant in motion, and joint torques."""
    plant = TorquePlant(robot)
    phi_dot, tau = np.random.default_rng(seed).uniform(-1, 1, (2, robot.joints))
    state = plant.reset(random_q(robot, seed)[6:], phi_dot=phi_dot)
    return plant, state, 0.05 * tau


def simulate(plant, tau, duration_s, rtol=1e-10):
    """Integrate the plant's accelerations with a method of order 8; return p and v at the end."""
    half = len(plant.p)

    def rate(_, state):
        return np.concatenate(
            (state[half:], plant.acceleration(state[:half], state[half:], tau)[0])
        )

    start = np.concatenate((plant.p, plant.v))
    found = solve_ivp(rate, (0, duration_s), start, method="DOP853", rtol=rtol, atol=1e-3 * rtol)
    return found.y[:half, -1], found.y[half:, -1]


@ALL
def test_reset_stands_where_the_kinematic_plant_does(robot):
    phi = random_q(robot, 3)[6:]
    w = np.array([0.4, -0.3, 9.0, 9.0, 9.0, 0.8])
    state, expected = TorquePlant(robot).reset(phi, w), KinematicPlant(robot).reset(phi, w)
    np.testing.assert_allclose(state.w, expected.w, atol=1e-12)
    assert state.d_min == pytest.approx(expected.d_min, abs=1e-12)
    np.testing.assert_array_equal(state.w_dot, 0.0)
    np.testing.assert_array_equal(state.phi, phi)


@ALL
def test_it_moves_as_the_reduced_dynamics_say(robot):
    """M_tilde w_tilde_ddot + h_tilde = E_tilde tau along the simulation, to 1e-8."""
    plant, _, tau = moving(robot, 5)
    dynamics = Dynamics(robot)
    s = Posture(robot, np.zeros(robot.links + 5)).g.s
    S = selection(s).S
    for _ in range(10):
        state = plant.step(tau, 0.01)
        q, q_dot = (
            np.concatenate(pair) for pair in ((state.w, state.phi), (state.w_dot, state.phi_dot))
        )
        reduced = dynamics.reduced(Posture(robot, q), q_dot)
        inertia = reduced.M_tilde @ np.concatenate((state.w_ddot, state.phi_ddot))[S]
        drive = reduced.E_tilde @ tau
        scale = np.abs((inertia, reduced.h_tilde, drive)).max()
        np.testing.assert_allclose(inertia + reduced.h_tilde, drive, atol=1e-8 * scale)


def test_energy_is_conserved_while_the_head_swings():
    """Over 5 s to 1e-6, at every moment, by the plant's own integration."""
    plant = TorquePlant(PAPER)
    start = plant.reset(PAPER.start_joint_angles_rad).energy
    states = [plant.step(np.zeros(11), 0.05) for _ in range(100)]
    np.testing.assert_allclose([state.energy for state in states], start, rtol=1e-6)
    # It swings: potential energy becomes kinetic and comes back.
    potential = plant.energy(plant.p, 0 * plant.v)
    assert min(potential, states[-1].energy) < start - 0.02
    assert max(np.abs(state.phi_dot).max() for state in states) > 5.0
    assert max(np.abs(state.slip).max() for state in states) < 1e-9


def test_friction_takes_and_torques_give_energy():
    robot = dataclasses.replace(PAPER, joint_friction=(0.05,))
    plant, state, tau = moving(robot, 2)
    work, dt = 0.0, 2e-4
    for _ in range(250):
        before = state.phi_dot
        state = plant.step(tau, dt)
        middle = 0.5 * (before + state.phi_dot)
        work += dt * middle @ (tau - 0.05 * middle)
    start = moving(robot, 2)[1].energy
    assert state.energy - start == pytest.approx(work, rel=1e-3)


@ALL
def test_wheels_carry_what_the_centre_of_mass_asks_for(robot):
    """Newton's law seen from above: nothing but the wheels pushes sideways."""
    plant, state, tau = moving(robot, 4)
    p, v = plant.p, plant.v
    a, forces = plant.acceleration(p, v, tau)

    def center_of_mass(t):
        p_t = p + t * v + 0.5 * t * t * a
        w = head_pose_on_floor(robot, p_t[3:], p_t[:3])
        return np.array(robot.link_mass_kg) @ link_centers(
            geometry(robot, np.concatenate((w, p_t[3:])))
        )

    h = 1e-3
    steps = [center_of_mass(k * h) for k in (-2, -1, 0, 1, 2)]
    second = np.array([-1, 16, -30, 16, -1]) @ steps / (12 * h * h)
    g = geometry(robot, np.concatenate((state.w, state.phi)))
    sideways = g.to_world(g.y[g.s.wheeled]) - g.base_origin
    np.testing.assert_allclose((forces @ sideways)[:2], second[:2], atol=1e-6 * abs(forces).max())


@ALL
def test_wheels_never_slip_and_the_head_moves_as_its_rate_says(robot):
    plant, _, tau = moving(robot, 6)
    states = [plant.step(tau, 1e-4) for _ in range(5)]
    for state in states:
        assert np.abs(state.slip).max() < 1e-11
        np.testing.assert_array_equal(state.effort, tau)
    rate = np.array([1, -8, 0, 8, -1]) @ [state.w for state in states] / 12e-4
    np.testing.assert_allclose(rate, states[2].w_dot, atol=1e-7)
    rates = np.array([np.concatenate((state.w_dot, state.phi_dot)) for state in states])
    expected = np.concatenate((states[2].w_ddot, states[2].phi_ddot))
    change = np.array([1, -8, 0, 8, -1]) @ rates / 12e-4
    np.testing.assert_allclose(change, expected, atol=1e-5 * np.abs(expected).max())


def test_the_tolerance_bounds_the_error():
    def final(tolerance):
        plant, _, tau = moving(PAPER, 1)
        plant._tolerance = tolerance
        return plant.step(tau, 0.16).phi

    exact = final(1e-12)
    coarse, fine = (np.abs(final(tolerance) - exact).max() for tolerance in (1e-5, 1e-9))
    assert fine < 1e-8 < coarse < 1e-3


def test_falling_is_remembered():
    plant = TorquePlant(dataclasses.replace(PAPER, link_mass_kg=(0.2,) * 5 + (0.1,) * 7))
    phi = np.array(PAPER.start_joint_angles_rad)
    state = plant.reset(phi)
    assert not state.fallen
    # The neck's yaw joint swings the head aside, the others stand as stiff as this holds them.
    wanted = phi.copy()
    wanted[1] = 2.0

    def hold(q, q_dot, elapsed):
        return 4.0 * (wanted - q[6:]) - 0.1 * q_dot[6:]

    for _ in range(1600):
        state = plant.follow(hold, 5e-4)
        if state.fallen:
            break
    assert state.fallen
    assert np.abs(state.phi).max() < 3.0
    assert not plant.reset(phi).fallen


@pytest.mark.parametrize("command", [np.zeros(10), np.full(11, np.nan)])
def test_bad_commands_are_refused(command):
    with pytest.raises(ModelError, match="11 finite"):
        TorquePlant(PAPER).step(command, 0.01)


def test_a_motion_that_explodes_is_an_error():
    with pytest.raises(ModelError, match="no longer finite"), np.errstate(all="ignore"):
        TorquePlant(PAPER).step(np.full(11, 1e200), 1.0)
