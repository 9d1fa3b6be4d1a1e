"""SCP velocities from sub-tasks: (25)-(28), and the projection law."""

from __future__ import annotations

import dataclasses
import sys
import types

import numpy as np
import pytest

from snake_control.config import ControllerConfig
from snake_control.control.sub_tasks import Composition, SubTask
from snake_control.model.posture import Posture
from snake_control.model.redundancy import joint_velocities
from support.robots import PAPER, ROBOTS, random_q

ALL = pytest.mark.parametrize("robot", list(ROBOTS.values()), ids=list(ROBOTS))
GAINS = ControllerConfig(a_h=2.0, a_b=3.0, a_prime=0.0, b_prime=5.0)
NONE = ControllerConfig(head_sub_tasks=("none",), base_sub_tasks=("none",))


def posture_of(robot):
    return Posture(robot, random_q(robot, 6))


def still_head(posture):
    return np.zeros(len(posture.k.s.w))


def scp_velocities(posture, gains, w_dot=None):
    w_dot = still_head(posture) if w_dot is None else w_dot
    found = Composition(posture.robot, gains).velocities(posture, w_dot)
    assert found.shape == (posture.k.s.m,)
    m_h = posture.k.s.m_h
    return found[:m_h], found[m_h:]


def rate(cost_gradient, u):
    """Time derivative of a cost for joint velocities u and a head at rest."""
    return float(cost_gradient[6:] @ u)


@ALL
def test_26_head_cost_rises_by_its_own_scps(robot):
    posture = posture_of(robot)
    k = posture.k
    phi_dot_hd, _ = scp_velocities(posture, GAINS)
    u = joint_velocities(k, still_head(posture), np.concatenate((phi_dot_hd, np.zeros(k.s.m_b))))
    expected = phi_dot_hd @ phi_dot_hd / GAINS.a_h
    assert rate(posture.V_h_gradient, u) == pytest.approx(expected, rel=1e-9)


@ALL
@pytest.mark.parametrize(("a_prime", "b_prime"), [(0.0, 5.0), (1e-11, 0.0), (1e-11, 3.0)])
def test_28_base_cost_rises_by_its_own_scps(robot, a_prime, b_prime):
    gains = ControllerConfig(a_h=0.0, a_b=3.0, a_prime=a_prime, b_prime=b_prime)
    posture = posture_of(robot)
    k = posture.k
    _, phi_dot_bd = scp_velocities(posture, gains)
    u = joint_velocities(k, still_head(posture), np.concatenate((np.zeros(k.s.m_h), phi_dot_bd)))
    gradient = a_prime * posture.V_b1_gradient + b_prime * posture.support.gradient
    assert rate(gradient, u) == pytest.approx(phi_dot_bd @ phi_dot_bd / gains.a_b, rel=1e-7)
    assert rate(gradient, u) > 0


@ALL
@pytest.mark.parametrize("law", ["gradient", "projection"])
def test_base_scps_leave_the_head_alone(robot, law):
    """Fig. 3: the two sub-tasks need no trade-off in this direction."""
    posture = posture_of(robot)
    k = posture.k
    _, phi_dot_bd = scp_velocities(posture, dataclasses.replace(GAINS, scp_law=law))
    u = joint_velocities(k, still_head(posture), np.concatenate((np.zeros(k.s.m_h), phi_dot_bd)))
    np.testing.assert_array_equal(u[: k.s.n_h], 0.0)
    assert rate(posture.V_h_gradient, u) == pytest.approx(0.0, abs=1e-15)


@ALL
def test_weights_add_up(robot):
    posture = posture_of(robot)

    def base(names, weights, a_b):
        gains = ControllerConfig(base_sub_tasks=names, base_weights=weights, a_b=a_b)
        return scp_velocities(posture, gains)[1]

    fall = base(("fall",), (1.0,), 1.0)
    axes = base(("wheel_axes",), (1.0,), 1.0)
    both = base(("fall", "wheel_axes"), (7.0, 0.5), 2.0)
    np.testing.assert_allclose(both, 2.0 * (7.0 * fall + 0.5 * axes), rtol=1e-9, atol=1e-12)


def part_of(posture, phi_tilde_dot, w_dot, part):
    """Joint velocities of head or base for SCP velocities, and the gradients that were wanted."""
    u = joint_velocities(posture.k, w_dot, phi_tilde_dot)
    n_h = posture.k.s.n_h
    return u[:n_h] if part == "head" else u[n_h:]


@ALL
@pytest.mark.parametrize("part", ["head", "base"])
def test_projection_brings_all_joints_of_a_part_closest_to_the_gradient(robot, part):
    posture = posture_of(robot)
    s = posture.k.s
    w_dot = np.random.default_rng(8).uniform(-0.1, 0.1, len(s.w))
    gains = ControllerConfig(
        head_sub_tasks=("log_manipulability",),
        head_weights=(0.3,),
        base_sub_tasks=("relative_fall",),
        base_weights=(0.7,),
        a_h=2.0,
        a_b=1.0,
        scp_law="projection",
    )
    found = Composition(robot, gains).velocities(posture, w_dot)
    if part == "head":
        own = range(s.m_h)
        wanted = 0.6 * posture.V_h_gradient[6 : 6 + s.n_h] / posture.V_h if s.m_h else 0.0
    else:
        own = range(s.m_h, s.m)
        wanted = 0.7 * posture.support.gradient[6 + s.n_h :] / robot.half_length_m
    best = np.sum((part_of(posture, found, w_dot, part) - wanted) ** 2)
    for i in own:
        for step in (1e-3, -1e-3):
            other = found.copy()
            other[i] += step
            assert np.sum((part_of(posture, other, w_dot, part) - wanted) ** 2) > best


def test_projection_without_sub_tasks_moves_the_base_least():
    """Every second link wheelless: still SCPs would need joint speeds that grow along the body."""
    robot = dataclasses.replace(ROBOTS["many links"], wheelless_links=tuple(range(7, 30, 2)))
    posture = posture_of(robot)
    w_dot = np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0])
    least = Composition(robot, dataclasses.replace(NONE, scp_law="projection")).velocities(
        posture, w_dot
    )
    still = Composition(robot, NONE).velocities(posture, w_dot)
    np.testing.assert_array_equal(still, 0.0)
    k = posture.k
    assert np.abs(joint_velocities(k, w_dot, still)).max() > 10.0
    assert np.abs(joint_velocities(k, w_dot, least)[k.s.n_h :]).max() < 1.0


class Undefined(SubTask):
    """Knows nothing of any posture."""

    def value(self, posture):
        return np.nan

    def gradient(self, posture):
        return np.full(len(posture.g.q), np.nan)


@pytest.fixture
def undefined(monkeypatch):
    """Name of a sub-task; pytest's import mode gives this module none to import it by."""
    module = types.ModuleType("own_sub_tasks")
    module.Undefined = Undefined
    monkeypatch.setitem(sys.modules, module.__name__, module)
    return "own_sub_tasks:Undefined"


def test_nothing_is_worked_out_for_what_weighs_nothing():
    posture = posture_of(PAPER)
    gains = ControllerConfig(case=1)
    np.testing.assert_array_equal(Composition(PAPER, gains).velocities(posture, np.zeros(6)), 0.0)
    # Neither gradients nor the inverse of B_tilde.
    assert set(vars(posture)) <= {"robot", "g", "k"}
    gains = ControllerConfig(case=2)
    Composition(PAPER, gains).velocities(posture, np.zeros(6))
    assert "support" not in vars(posture)


def test_a_sub_task_without_a_finite_gradient_is_left_out(undefined):
    posture = posture_of(PAPER)
    gains = ControllerConfig(base_sub_tasks=("fall", undefined), base_weights=(3.0, 1.0))
    alone = ControllerConfig(base_sub_tasks=("fall",), base_weights=(3.0,))
    for found, expected in zip(
        scp_velocities(posture, gains), scp_velocities(posture, alone), strict=True
    ):
        np.testing.assert_array_equal(found, expected)


def test_zero_gain_is_still():
    for velocities in scp_velocities(posture_of(PAPER), ControllerConfig(case=1)):
        np.testing.assert_array_equal(velocities, 0.0)
