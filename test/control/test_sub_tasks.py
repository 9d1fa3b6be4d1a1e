"""The SCP velocities do what (26) and (28) say: with the head still, the costs rise."""

from __future__ import annotations

import numpy as np
import pytest

from snake_control.config import ControllerConfig
from snake_control.control.sub_tasks import base_scp_velocities, head_scp_velocities
from snake_control.model.posture import Posture
from snake_control.model.redundancy import joint_velocities
from support.robots import ROBOTS, random_q

ALL = pytest.mark.parametrize("robot", list(ROBOTS.values()), ids=list(ROBOTS))
GAINS = ControllerConfig(a_h=2.0, a_b=3.0, a_prime=0.0, b_prime=5.0)


def rate(cost_gradient, u):
    """Time derivative of a cost for joint velocities u and a head at rest."""
    return float(cost_gradient[6:] @ u)


@ALL
def test_26_head_cost_rises_by_its_own_scps(robot):
    posture = Posture(robot, random_q(robot, 6))
    k = posture.k
    phi_dot_hd = head_scp_velocities(posture, GAINS)
    assert phi_dot_hd.shape == (k.s.m_h,)
    u = joint_velocities(k, np.zeros(len(k.s.w)), np.concatenate((phi_dot_hd, np.zeros(k.s.m_b))))
    expected = phi_dot_hd @ phi_dot_hd / GAINS.a_h
    assert rate(posture.V_h_gradient, u) == pytest.approx(expected, rel=1e-9)


@ALL
@pytest.mark.parametrize(("a_prime", "b_prime"), [(0.0, 5.0), (1e-11, 0.0), (1e-11, 3.0)])
def test_28_base_cost_rises_by_its_own_scps(robot, a_prime, b_prime):
    gains = ControllerConfig(a_h=0.0, a_b=3.0, a_prime=a_prime, b_prime=b_prime)
    posture = Posture(robot, random_q(robot, 6))
    k = posture.k
    phi_dot_bd = base_scp_velocities(posture, gains)
    assert phi_dot_bd.shape == (k.s.m_b,)
    u = joint_velocities(k, np.zeros(len(k.s.w)), np.concatenate((np.zeros(k.s.m_h), phi_dot_bd)))
    gradient = a_prime * posture.V_b1_gradient + b_prime * posture.support.gradient
    assert rate(gradient, u) == pytest.approx(phi_dot_bd @ phi_dot_bd / gains.a_b, rel=1e-7)
    assert rate(gradient, u) > 0


@ALL
def test_base_scps_leave_the_head_cost_alone(robot):
    """Fig. 3: the two sub-tasks need no trade-off in this direction."""
    posture = Posture(robot, random_q(robot, 6))
    k = posture.k
    phi_dot_bd = base_scp_velocities(posture, GAINS)
    u = joint_velocities(k, np.zeros(len(k.s.w)), np.concatenate((np.zeros(k.s.m_h), phi_dot_bd)))
    np.testing.assert_array_equal(u[: k.s.n_h], 0.0)
    assert rate(posture.V_h_gradient, u) == pytest.approx(0.0, abs=1e-15)


def test_zero_gain_is_still():
    robot = ROBOTS["paper"]
    posture = Posture(robot, random_q(robot, 6))
    still = ControllerConfig(case=1)
    np.testing.assert_array_equal(head_scp_velocities(posture, still), 0.0)
    np.testing.assert_array_equal(base_scp_velocities(posture, still), 0.0)
