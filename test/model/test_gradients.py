"""Analytic gradients against finite differences, over robots of several structures."""

from __future__ import annotations

import numpy as np
import pytest

from snake_control.model.geometry import geometry
from snake_control.model.posture import Posture
from snake_control.model.stability import support
from support.derivatives import gradient
from support.robots import ROBOTS, random_q

SEEDS = (1, 2, 3)


@pytest.fixture(params=[(name, seed) for name in ROBOTS for seed in SEEDS], ids=str)
def posture(request):
    name, seed = request.param
    return ROBOTS[name], random_q(ROBOTS[name], seed)


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def test_V_h(posture):
    robot, q = posture

    def value(x):
        return Posture(robot, x).V_h

    found = Posture(robot, q)
    assert found.V_h == pytest.approx(abs(np.linalg.det(found.k.B_tilde)), rel=1e-9)
    if robot.planar:
        np.testing.assert_array_equal(found.V_h_gradient, 0.0)
    else:
        assert relative(found.V_h_gradient, gradient(value, q)) < 1e-6


def test_V_b1(posture):
    robot, q = posture

    def log_value(x):
        return Posture(robot, x).log_V_b1

    found = Posture(robot, q)
    k = found.k
    if robot.links < 20:
        direct = np.linalg.det(k.E_tilde @ k.E_tilde.T)
        assert found.V_b1 == pytest.approx(direct, rel=1e-6)
    # A larger step than elsewhere: on long robots log V_b1 itself carries round-off.
    assert relative(found.log_V_b1_gradient, gradient(log_value, q, h=1e-3)) < 1e-6


def test_d_min(posture):
    robot, q = posture

    def value(x):
        return support(geometry(robot, x)).d_min

    found = support(geometry(robot, q)).gradient
    assert relative(found, gradient(value, q, h=1e-6)) < 1e-6


def test_V_h_gradient_at_a_singular_head_is_exact():
    """All joints straight: the head block has no inverse, its cofactors exist."""
    robot = ROBOTS["paper"]
    q = np.zeros(robot.links + 5)
    found = Posture(robot, q)

    def signed(x):
        return float(np.linalg.det(Posture(robot, x).k.B_tilde))

    assert found.V_h == pytest.approx(0.0, abs=1e-18)
    # |det| has a kink there; its gradient is that of one side.
    expected = gradient(signed, q, h=1e-3)
    np.testing.assert_allclose(np.abs(found.V_h_gradient), np.abs(expected), atol=1e-14)
