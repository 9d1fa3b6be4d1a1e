"""A posture that is moved, against one that is worked out from the beginning."""

from __future__ import annotations

import numpy as np
import pytest

from snake_control.errors import ModelError
from snake_control.model.floor import geometry_on_floor, head_pose_on_floor
from snake_control.model.posture import Posture
from support.robots import PAPER, ROBOTS, random_q


def everything(posture: Posture) -> dict[str, np.ndarray]:
    k, g = posture.k, posture.g
    w_dot = np.random.default_rng(5).normal(size=len(k.s.w)).tolist()
    found = {
        "q": g.q,
        "rows": g.rows,
        "origin": g.base_origin,
        "twists": g.twists,
        "G": k.G,
        "F_bar": k.F_bar,
        "u": k.joint_velocities(w_dot, [0.1] * k.s.m),
        "log_V_b1": posture.log_V_b1,
        "V_b1_gradient": posture.log_V_b1_gradient,
        "V_b1_by_base": posture.log_V_b1_by_base,
        "V_h_gradient": posture.V_h_gradient,
        "d_min": posture.support.d_min,
        "d_min_gradient": posture.support.gradient,
        "polygon": posture.support.polygon,
        "nearness": posture.singular_shape.nearness,
    }
    return {name: np.asarray(value) for name, value in found.items()}


@pytest.mark.parametrize("robot", list(ROBOTS.values()), ids=list(ROBOTS))
@pytest.mark.parametrize("known", [True, False], ids=["all known", "nothing known"])
def test_a_moved_posture_is_a_new_one_to_the_last_digit(robot, known) -> None:
    before, q = random_q(robot, 3), random_q(robot, 4)
    q[6:] = before[6:]
    posture = Posture(robot, before)
    if known:
        everything(posture)
    moved, new = everything(posture.moved(q[:6])), everything(Posture(robot, q))
    for name, value in new.items():
        np.testing.assert_array_equal(moved[name], value, err_msg=name)
    # The one it came from stays where it was.
    for name, value in everything(Posture(robot, before)).items():
        np.testing.assert_array_equal(everything(posture)[name], value, err_msg=name)


@pytest.mark.parametrize(
    "w", [np.zeros(5), [0, 0, np.nan, 0, 0, 0], [2e6, 0, 0, 0, 0, 0]], ids=["short", "nan", "far"]
)
def test_it_moves_nowhere_that_is_no_pose(w) -> None:
    with pytest.raises(ModelError, match="q"):
        Posture(PAPER, random_q(PAPER, 1)).moved(w)


@pytest.mark.parametrize("robot", list(ROBOTS.values()), ids=list(ROBOTS))
def test_geometry_on_floor_stands_level_at_the_origin(robot) -> None:
    phi = random_q(robot, 8)[6:]
    g = geometry_on_floor(robot, phi)
    expected = head_pose_on_floor(robot, phi, np.zeros(3))
    np.testing.assert_array_equal(g.q, np.concatenate((expected, phi)))
    np.testing.assert_allclose(g.base_rotation, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(g.base_origin, [0.0, 0.0, robot.wheel_radius_m], atol=1e-12)
    with pytest.raises(ModelError, match="shape"):
        geometry_on_floor(robot, phi[1:])
