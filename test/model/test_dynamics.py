"""(12)-(20) against energies, differences, and the multipliers that they eliminate."""

from __future__ import annotations

import ast
import dataclasses
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from snake_control.errors import ModelError
from snake_control.model.constraint_rates import constraint_rate
from snake_control.model.dynamics import Dynamics
from snake_control.model.posture import Posture
from snake_control.model.selection import selection
from support.derivatives import gradient
from support.mechanics import along, coriolis, inertia_matrix, potential_energy
from support.robots import PAPER, ROBOTS, random_q

ALL = pytest.mark.parametrize("robot", list(ROBOTS.values()), ids=list(ROBOTS))


def consistent(robot, seed):
    """A posture and a velocity that keeps the constraints there."""
    posture = Posture(robot, random_q(robot, seed))
    index = selection(posture.g.s)
    S, S_bar = index.S, index.S_bar
    w_tilde_dot = np.random.default_rng(seed).uniform(-1, 1, len(S))
    q_dot = np.zeros(robot.links + 5)
    q_dot[S] = w_tilde_dot
    q_dot[S_bar] = posture.k.F_bar @ w_tilde_dot
    return posture, q_dot


@ALL
def test_inertia_matrix_is_the_sum_over_links(robot):
    q = random_q(robot, 1)
    M = Dynamics(robot).full(q, np.zeros_like(q)).M
    np.testing.assert_allclose(M, inertia_matrix(robot, q), rtol=1e-11, atol=1e-13)


@ALL
def test_gravity_is_the_gradient_of_the_potential_energy(robot):
    q = random_q(robot, 2)
    expected = gradient(lambda x: potential_energy(robot, x), q)
    np.testing.assert_allclose(Dynamics(robot).full(q, q).g, expected, atol=1e-9)


@ALL
def test_coriolis_term_is_lagranges(robot):
    q = random_q(robot, 3)
    q_dot = np.random.default_rng(3).uniform(-1, 1, len(q))
    q_dot[2:5] *= not robot.planar
    h = Dynamics(robot).full(q, q_dot).h
    np.testing.assert_allclose(h, coriolis(robot, q, q_dot), atol=1e-8 * np.abs(h).max())


def test_friction_is_viscous_and_the_joints_own():
    robot = dataclasses.replace(PAPER, joint_friction=tuple(0.01 * np.arange(11)))
    q, q_dot = random_q(robot, 4), random_q(robot, 5)
    difference = Dynamics(robot).full(q, q_dot).h - Dynamics(PAPER).full(q, q_dot).h
    np.testing.assert_allclose(difference[6:], robot.joint_friction * q_dot[6:], atol=1e-14)
    np.testing.assert_allclose(difference[:6], 0.0, atol=1e-14)
    posture = Posture(robot, q)
    reduced = [Dynamics(r).reduced(posture, q_dot).h_tilde for r in (robot, PAPER)]
    index = selection(posture.g.s)
    S, S_bar = index.S, index.S_bar
    expected = difference[S] + posture.k.F_bar.T @ difference[S_bar]
    np.testing.assert_allclose(reduced[0] - reduced[1], expected, atol=1e-12)


@ALL
def test_selections_make_a_permutation(robot):
    index = selection(Posture(robot, random_q(robot, 1)).g.s)
    S, S_bar = index.S, index.S_bar
    T = np.concatenate((S, S_bar))
    expected = [*robot.controlled, *range(6, robot.links + 5)]
    np.testing.assert_array_equal(np.sort(T), expected)
    np.testing.assert_array_equal(S[len(robot.controlled) :], 5 + np.array(robot.scp_joints))


@ALL
def test_accelerations_are_those_with_the_constraint_forces(robot):
    """(20) against (15) with its multipliers, solved as one system of equations."""
    posture, q_dot = consistent(robot, 6)
    dynamics = Dynamics(robot)
    full, reduced = dynamics.full(posture.g.q, q_dot), dynamics.reduced(posture, q_dot)
    index = selection(posture.g.s)
    S, S_bar = index.S, index.S_bar
    tau = np.random.default_rng(6).uniform(-0.5, 0.5, robot.joints)
    G = posture.k.G
    rows, size = G.shape
    system = np.block([[full.M, G.T], [G, np.zeros((rows, rows))]])
    force = np.concatenate((np.zeros(6), tau)) - full.h - full.g
    right = np.concatenate((force, -constraint_rate(posture.g, q_dot) @ q_dot))
    if robot.planar:
        # The floor holds z, R and P with forces of its own.
        keep = np.concatenate((S, S_bar, range(size, size + rows)))
        system, right = system[np.ix_(keep, keep)], right[keep]
    solution = np.linalg.solve(system, right)[: len(S) + len(S_bar)]
    expected = np.zeros(size)
    expected[np.concatenate((S, S_bar)) if robot.planar else np.arange(size)] = solution

    w_tilde_ddot = np.linalg.solve(reduced.M_tilde, reduced.E_tilde @ tau - reduced.h_tilde)
    theta_bar_ddot = posture.k.F_bar @ w_tilde_ddot + reduced.F_bar_drift
    scale = np.abs(expected).max()
    np.testing.assert_allclose(w_tilde_ddot, expected[S], atol=1e-8 * scale)
    np.testing.assert_allclose(theta_bar_ddot, expected[S_bar], atol=1e-8 * scale)


@ALL
def test_power_balance(robot):
    """The kinetic energy of (20) changes by what h_tilde says, up to the power of gravity."""
    posture, q_dot = consistent(robot, 7)
    S = selection(posture.g.s).S
    w_tilde_dot = q_dot[S]
    dynamics = Dynamics(robot)

    def kinetic(q):
        M_tilde = dynamics.reduced(Posture(robot, q), np.zeros_like(q)).M_tilde
        return 0.5 * w_tilde_dot @ M_tilde @ w_tilde_dot

    rate = along(kinetic, posture.g.q, q_dot, 1e-4 / np.abs(q_dot).max())
    gravity = dynamics.full(posture.g.q, q_dot).g @ q_dot
    reduced = dynamics.reduced(posture, q_dot)
    scale = abs(w_tilde_dot) @ abs(reduced.h_tilde)
    assert w_tilde_dot @ reduced.h_tilde - gravity == pytest.approx(rate, abs=1e-7 * scale)


@ALL
def test_bar_and_tilde_agree(robot):
    posture, q_dot = consistent(robot, 8)
    dynamics = Dynamics(robot)
    bar, reduced = dynamics.bar(posture, q_dot), dynamics.reduced(posture, q_dot)
    index = selection(posture.g.s)
    S, S_bar = index.S, index.S_bar
    M_tilde = bar.M_bar[:, S] + bar.M_bar[:, S_bar] @ posture.k.F_bar
    h_tilde = bar.h_bar + bar.M_bar[:, S_bar] @ reduced.F_bar_drift
    np.testing.assert_allclose(reduced.M_tilde, M_tilde, atol=1e-12 * np.abs(M_tilde).max())
    np.testing.assert_allclose(reduced.h_tilde, h_tilde, atol=1e-11 * np.abs(h_tilde).max())
    np.testing.assert_array_equal(bar.E_bar, reduced.E_tilde)
    np.testing.assert_allclose(reduced.M_tilde, reduced.M_tilde.T, atol=1e-12)
    assert np.linalg.eigvalsh(reduced.M_tilde)[0] > 0


def test_singular_head_postures_give_finite_numbers():
    """With a straight neck B_tilde has no inverse; F_bar is damped, and all that follows."""
    posture = Posture(PAPER, np.zeros(17))
    reduced = Dynamics(PAPER).reduced(posture, np.ones(17))
    for value in (reduced.M_tilde, reduced.h_tilde, reduced.E_tilde, reduced.F_bar_drift):
        assert np.isfinite(value).all()


def test_planar_snakes_ignore_what_they_have_no_coordinate_for():
    robot = ROBOTS["planar"]
    posture, q_dot = consistent(robot, 9)
    off = posture.g.q.copy()
    off[2:5] = 0.3
    odd = q_dot.copy()
    odd[2:5] = 1.0
    found = Dynamics(robot).reduced(Posture(robot, off), odd)
    expected = Dynamics(robot).reduced(posture, q_dot)
    np.testing.assert_array_equal(found.M_tilde, expected.M_tilde)
    np.testing.assert_array_equal(found.h_tilde, expected.h_tilde)
    # Nothing to lift: no gravity in the plane.
    still = Dynamics(robot).reduced(posture, np.zeros_like(q_dot))
    np.testing.assert_allclose(still.h_tilde, 0.0, atol=1e-12)


@pytest.mark.parametrize("q_dot", [np.zeros(16), np.full(17, np.nan)])
def test_bad_velocities_are_refused(q_dot):
    posture = Posture(PAPER, random_q(PAPER, 1))
    with pytest.raises(ModelError, match="17 finite"):
        Dynamics(PAPER).reduced(posture, q_dot)


def test_the_velocity_path_does_without_pinocchio():
    code = (
        "import sys, snake_control.control.scp_controller, snake_control.plant.kinematic\n"
        "sys.exit('pinocchio' in sys.modules)"
    )
    root = Path(__file__).parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    found = subprocess.run([sys.executable, "-c", code], env=environment, check=False)
    assert found.returncode == 0


def test_only_two_modules_import_pinocchio():
    package = Path(__file__).parents[2] / "snake_control"
    found = {
        str(path.relative_to(package))
        for path in package.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if (isinstance(node, ast.Import) and "pinocchio" in {a.name for a in node.names})
        or (isinstance(node, ast.ImportFrom) and node.module == "pinocchio")
    }
    assert found == {"model/dynamics.py", "model/rigid_body.py"}
