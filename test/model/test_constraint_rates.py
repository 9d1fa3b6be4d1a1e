from __future__ import annotations

import numpy as np
import pytest

from snake_control.model.constraint_drift import F_bar_drift
from snake_control.model.constraint_rates import F_bar_rate, constraint_rate
from snake_control.model.posture import Posture
from snake_control.model.selection import selection
from support.mechanics import along
from support.robots import ROBOTS, random_q

ALL = pytest.mark.parametrize("robot", list(ROBOTS.values()), ids=list(ROBOTS))


@ALL
def test_constraint_matrix_changes_as_differences_say(robot):
    q = random_q(robot, 1)
    q_dot = np.random.default_rng(1).uniform(-1, 1, len(q))
    expected = along(lambda x: Posture(robot, x).k.G, q, q_dot)
    np.testing.assert_allclose(constraint_rate(Posture(robot, q).g, q_dot), expected, atol=1e-9)


@ALL
def test_F_bar_changes_as_differences_say(robot):
    q = random_q(robot, 3)
    q_dot = np.random.default_rng(3).uniform(-1, 1, len(q))
    posture = Posture(robot, q)
    found = F_bar_rate(posture.g, posture.k, q_dot)
    expected = along(lambda x: Posture(robot, x).k.F_bar, q, q_dot, 1e-5)
    np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())
    S = selection(posture.g.s).S
    drift = F_bar_drift(posture.g, posture.k, q_dot)
    np.testing.assert_allclose(drift, found @ q_dot[S], atol=1e-10 * np.abs(drift).max())


@ALL
def test_zero_block_of_F_bar_does_not_change(robot):
    """(10): B-SCPs never move the head joints, along no motion."""
    posture = Posture(robot, random_q(robot, 4))
    s = posture.g.s
    rate = F_bar_rate(posture.g, posture.k, np.ones(len(posture.g.q)))
    np.testing.assert_allclose(rate[: len(s.theta_h), len(s.w) + s.m_h :], 0.0, atol=1e-12)
