from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from snake_control.config import ControllerConfig
from snake_control.control.limits import JointLimits
from snake_control.control.reference import Reference
from snake_control.control.scp_controller import ScpController
from snake_control.errors import ModelError
from support.robots import PAPER, paper_states

LIMITS = JointLimits(PAPER)


def test_within_limits_nothing_changes():
    u = np.linspace(-5.0, 5.0, 11)
    found = LIMITS.apply(np.zeros(11), u)
    np.testing.assert_array_equal(found.u, u)
    assert (found.speed_scale, found.speed_limited, found.range_limited) == (1.0, (), ())


def test_whole_vector_is_scaled():
    u = np.linspace(-1.0, 11.0, 11)
    found = LIMITS.apply(np.zeros(11), u)
    np.testing.assert_allclose(found.u, u / 2)
    assert found.speed_scale == pytest.approx(0.5)
    assert found.speed_limited == (11,)


def test_no_velocity_out_of_the_range_but_back_into_it():
    phi = np.zeros(11)
    phi[2], phi[6] = 2.4, -2.4
    found = LIMITS.apply(phi, np.ones(11))
    assert found.range_limited == (3,)
    assert found.u[2] == 0.0
    assert found.u[6] == 1.0
    found = LIMITS.apply(phi, -np.ones(11))
    assert found.range_limited == (7,)
    assert found.u[2] == -1.0
    assert found.u[6] == 0.0


def test_joint_that_friction_holds_short_of_the_end_is_at_the_end():
    phi = np.zeros(11)
    phi[10] = 2.383  # where a mock servo with a goal at 2.4 rad stands
    assert LIMITS.apply(phi, np.ones(11)).range_limited == (11,)


def test_asymmetric_range():
    bounds = [-1.0, 2.0] + [-2.4, 2.4] * 10
    robot = dataclasses.replace(PAPER, joint_limits_rad=tuple(bounds))
    phi = np.zeros(11)
    phi[0] = -1.0
    assert JointLimits(robot).apply(phi, -np.ones(11)).range_limited == (1,)
    phi[0] = 1.5
    assert JointLimits(robot).apply(phi, np.ones(11)).range_limited == ()


def still(q):
    return Reference(np.array(q[:6]), np.zeros(6))


def test_outward_joint_of_the_result_is_named():
    """The controller reports the joint whose range ends, and its command has no such velocity."""
    q = np.array(paper_states()[0]["q"])
    free = ScpController(PAPER, ControllerConfig(case=3)).step(q, None, still(q), 0.0)
    joint = int(np.argmax(np.abs(free.u)))
    limits = [2.4] * 11
    limits[joint] = abs(float(q[6 + joint])) + 1e-6
    robot = dataclasses.replace(PAPER, joint_limits_rad=tuple(limits))
    q[6 + joint] = np.copysign(limits[joint], free.u[joint])
    found = ScpController(robot, ControllerConfig(case=3)).step(q, None, still(q), 0.0)
    if found.u_unlimited[joint] * q[6 + joint] > 0:
        assert found.range_limited == (joint + 1,)
        assert found.u[joint] == 0.0
    else:
        pytest.fail("the mirrored posture no longer pushes the joint outwards; choose another")


def test_case_1_keeps_the_scps_still():
    q = paper_states()[1]["q"]
    reference = Reference(np.zeros(6), np.full(6, 0.01))
    found = ScpController(PAPER, ControllerConfig(case=1)).step(q, None, reference, 0.0)
    np.testing.assert_array_equal(found.phi_tilde_dot_d, 0.0)
    np.testing.assert_array_equal(found.u[[2, 5, 7, 9]], 0.0)


def test_error_takes_the_short_way_round():
    q = np.array(paper_states()[1]["q"])
    reference = Reference(q[:6] + np.array([0, 0, 0, 0, 0, 2 * np.pi - 0.2]), np.zeros(6))
    found = ScpController(PAPER, ControllerConfig(case=1)).step(q, None, reference, 0.0)
    assert found.error[5] == pytest.approx(0.2)


def test_posture_that_is_not_finite_is_refused():
    q = np.array(paper_states()[0]["q"])
    q[9] = np.nan
    with pytest.raises(ModelError, match=r"^q\[9\] = nan"):
        ScpController(PAPER, ControllerConfig()).step(q, None, still(np.zeros(17)), 0.0)
