"""Equations (4)-(6): the head stands still while the body moves, and each SCP has its own part."""

from __future__ import annotations

import numpy as np
import pytest

from snake_control.config import RobotConfig
from snake_control.model.floor import head_pose_on_floor
from snake_control.model.geometry import geometry, link_points
from snake_control.model.internal_motion import (
    all_joint_velocities,
    basis_pattern,
    internal_motion_basis,
    internal_motion_of,
    least_joint_velocities,
    scp_velocities_of,
)
from snake_control.model.posture import Posture
from snake_control.model.redundancy import Kinematics, joint_velocities
from snake_control.model.structure import structure
from snake_control.plant.kinematic import KinematicPlant
from support.robots import ROBOTS, random_q

# Fig. 2: wheels off links 7, 9 and 10, as the paper prints it (x: not zero).
FIG_2 = """
    x 0 0 0
    x 0 0 0
    x 0 0 0
    x 0 0 0
    x 0 0 0
    0 x 0 0
    x x 0 0
    0 0 x 0
    0 0 0 x
    x x x x
    x x x x
"""


def random_robot(seed: int) -> RobotConfig:
    """Any robot with a pitch/yaw head, a random set of wheelless links and random H-SCPs."""
    rng = np.random.default_rng(seed)
    n_h = int(rng.integers(4, 8))
    n = int(rng.integers(n_h + 6, 26))
    # The last four head joints stay dependent, alternating: the head block then has full rank.
    axes = ["pitch" if (n_h - 1 - j) % 2 == 0 else "yaw" for j in range(n_h)]
    inner = np.arange(n_h + 2, n)
    wheelless = rng.choice(inner, size=int(rng.integers(1, len(inner) - 3)), replace=False)
    return RobotConfig(
        links=n,
        head_links=n_h,
        wheelless_links=tuple(sorted(int(link) for link in wheelless)),
        head_scp_joints=tuple(range(1, n_h - 3)) or (0,),
        joint_axes=(*axes, *("yaw",) * (n - 1 - n_h)),
        half_length_m=float(rng.uniform(0.02, 0.08)),
        start_joint_angles_rad=(0.0,),
    )


ANY_ROBOT = [*ROBOTS.values(), *(random_robot(seed) for seed in range(12))]


def level_posture(robot: RobotConfig, seed: int) -> np.ndarray:
    """A random posture with the base level on the floor."""
    phi = random_q(robot, seed)[6:]
    return np.concatenate((head_pose_on_floor(robot, phi, [0.3, -0.2, 0.4]), phi))


@pytest.fixture(params=range(len(ANY_ROBOT)))
def robot(request) -> RobotConfig:
    return ANY_ROBOT[request.param]


@pytest.fixture
def k(robot) -> Kinematics:
    return Posture(robot, level_posture(robot, seed=5)).k


def test_fig_2():
    robot = ROBOTS["fig_2"]
    printed = [[cell == "x" for cell in line.split()] for line in FIG_2.strip().splitlines()]
    # The H-SCP's own row is one of the head part; which, the paper leaves open here. Ours: joint 3.
    N = internal_motion_basis(Posture(robot, level_posture(robot, seed=1)).k)
    np.testing.assert_array_equal(N != 0.0, printed)
    np.testing.assert_array_equal(basis_pattern(structure(robot)), printed)


def test_pattern_is_exact_and_full(robot, k):
    N = internal_motion_basis(k)
    s = k.s
    pattern = basis_pattern(s)
    assert (N[~pattern] == 0.0).all()
    assert N[s.theta_h, : s.m_h].any() or not s.m_h
    # N_h does not touch the B-SCPs, nor a B-SCP's column another SCP: a unit matrix there.
    np.testing.assert_array_equal(N[s.scp], np.eye(s.m))
    for column, joint in enumerate(s.scp_b, start=s.m_h):
        assert (N[:joint, column] == 0.0).all()
        assert N[joint + 1 :, column].any()


def test_pattern_needs_no_mask(k):
    """The zeros come out of the model itself, not of the mask that keeps them exact."""
    s = k.s
    F = k.F_bar[:, k.F_bar.shape[1] - s.m :]
    assert np.abs(F[~basis_pattern(s)[s.theta]]).max(initial=0.0) < 1e-12


def test_basis_spans_the_null_space(k):
    N = internal_motion_basis(k)
    residual = np.abs(k.B_bar @ N).max()
    assert residual < 1e-10 * max(1.0, np.abs(N).max())
    assert np.linalg.matrix_rank(N) == k.s.m == N.shape[0] - np.linalg.matrix_rank(k.B_bar)


def test_all_solutions_of_the_constraints(k):
    rng = np.random.default_rng(3)
    w_dot, eta = rng.normal(size=k.A_bar.shape[1]), rng.normal(size=k.s.m)
    phi_dot = all_joint_velocities(k, w_dot, eta)
    scale = np.abs(phi_dot).max()
    np.testing.assert_allclose(k.B_bar @ phi_dot, k.A_bar @ w_dot, atol=1e-10 * scale)
    least = least_joint_velocities(k, w_dot)
    np.testing.assert_allclose(least, np.linalg.pinv(k.B_bar) @ k.A_bar @ w_dot, atol=1e-9 * scale)
    # The smallest solution has no part in the null space.
    np.testing.assert_allclose(internal_motion_basis(k).T @ least, 0.0, atol=1e-9 * scale)


def test_eta_and_scp_velocities_say_the_same(k):
    rng = np.random.default_rng(4)
    w_dot, scp = rng.normal(size=k.A_bar.shape[1]), rng.normal(size=k.s.m)
    eta = internal_motion_of(k, w_dot, scp)
    expected = joint_velocities(k, w_dot, scp)
    np.testing.assert_allclose(
        all_joint_velocities(k, w_dot, eta), expected, atol=1e-9 * np.abs(expected).max()
    )
    np.testing.assert_allclose(scp_velocities_of(k, w_dot, eta), scp, atol=1e-12)
    np.testing.assert_array_equal(internal_motion_of(k, np.zeros_like(w_dot), scp), scp)


def test_head_stands_still_while_the_body_moves(robot):
    """Moved by the plant, which knows nothing of N: central differences, extrapolated."""
    q = level_posture(robot, seed=5)
    N = internal_motion_basis(Posture(robot, q).k)
    plant = KinematicPlant(robot)

    def moved(phi_dot, h):
        plant.reset(q[6:], q[:6])
        return plant.step(phi_dot, h)

    def head_velocity(phi_dot, h):
        return (moved(phi_dot, h).w - moved(phi_dot, -h).w) / (2 * h)

    for column in N.T:
        # The fastest joint turns at 1 rad/s.
        phi_dot = column / np.abs(column).max()
        fine, coarse = head_velocity(phi_dot, 5e-4), head_velocity(phi_dot, 1e-3)
        assert np.abs((4 * fine - coarse) / 3).max() < 1e-10
        # What slips within a step is of the step's own order.
        assert np.abs(moved(phi_dot, 1e-6).slip).max() < 1e-7
        after = moved(phi_dot, 1e-3)
        before, now = (link_points(robot, p) for p in (q, np.concatenate((after.w, after.phi))))
        assert np.abs(now - before).max() > 1e-6


def test_b_scps_leave_all_links_before_them_where_they_are(robot):
    q = level_posture(robot, seed=6)
    N = internal_motion_basis(Posture(robot, q).k)
    s = structure(robot)
    for column, joint in enumerate(s.scp_b, start=s.m_h):
        shifted = q.copy()
        shifted[6:] += 0.1 * N[:, column]
        before, after = link_points(robot, q), link_points(robot, shifted)
        # Joint j (from 0) turns link j + 2: points up to the front end of that link stay.
        np.testing.assert_allclose(after[: joint + 2], before[: joint + 2], atol=1e-15)
        assert np.abs(after[joint + 2] - before[joint + 2]).max() > 1e-4
        np.testing.assert_array_equal(
            geometry(robot, shifted).base_rotation, geometry(robot, q).base_rotation
        )
