"""Inverses are exact above their threshold, continuous there, and bounded below it."""

from __future__ import annotations

import numpy as np
import pytest

from snake_control.model.damping import EPSILON, damped_reciprocals, damping_of
from snake_control.model.posture import Posture
from snake_control.model.vector import adjugate
from support.robots import PAPER, ROBOTS, random_q


def test_law():
    sigma = np.array([10.0, 1.0, EPSILON, 0.5 * EPSILON, 0.0])
    found = damped_reciprocals(sigma)
    np.testing.assert_allclose(found[:3], 1.0 / sigma[:3], rtol=1e-15)
    assert found[3] == pytest.approx(0.5 / EPSILON)
    assert found[4] == 0.0
    assert [damping_of(s) for s in (1.0, EPSILON, 0.0)] == [0.0, 0.0, 1.0]


def test_adjugate():
    matrix = np.random.default_rng(3).normal(size=(4, 4))
    determinant, rows = adjugate(*matrix.tolist())
    assert determinant == pytest.approx(np.linalg.det(matrix))
    np.testing.assert_allclose(np.array(rows) / determinant, np.linalg.inv(matrix), rtol=1e-12)


def towards_singular(robot, share):
    """A straight head (share 0) that is bent ever more."""
    q = np.zeros(robot.links + 5)
    q[6 : 6 + robot.head_links] = share * random_q(robot, 1)[6 : 6 + robot.head_links]
    q[6 + robot.head_links :] = random_q(robot, 1)[6 + robot.head_links :]
    return Posture(robot, q)


RAISED = [robot for robot in ROBOTS.values() if not robot.planar]


@pytest.mark.parametrize("robot", RAISED)
def test_F_bar_is_exact_or_bounded(robot):
    seen = set()
    last = None
    for share in np.geomspace(1e-6, 1.0, 400):
        k = towards_singular(robot, share).k
        exact = k.head.damping == 0.0
        seen.add(exact)
        inverse = np.array(k.head.inverse)
        if exact:
            np.testing.assert_allclose(
                k.B_tilde @ k.F_bar, k.A_tilde, atol=1e-9 * np.abs(k.F_bar).max()
            )
        assert np.linalg.norm(inverse, 2) <= 1.0000001 / EPSILON
        if last is not None and last[0] != exact:
            # Both sides of the threshold give nearly the same.
            assert np.linalg.norm(inverse - last[1], 2) < 0.1 / EPSILON
        last = exact, inverse
    assert seen == {True, False}


@pytest.mark.parametrize("robot", RAISED)
def test_determinant_and_its_gradient_do_not_feel_the_damping(robot):
    posture = towards_singular(robot, 1e-5)
    assert posture.k.damping > 0.5
    assert posture.V_h == pytest.approx(abs(np.linalg.det(posture.k.B_tilde)), rel=1e-6, abs=1e-30)


def test_log_gradients_are_bounded_in_singular_postures():
    straight = Posture(PAPER, np.zeros(17))
    assert straight.V_h == pytest.approx(0.0, abs=1e-18)
    assert np.abs(straight.log_V_h_gradient).max() < 100.0 / EPSILON
    assert np.abs(straight.log_V_b1_gradient).max() < 1000.0 / EPSILON
    assert np.isfinite(straight.log_V_b1)
