"""How the base rolls: one at a time and many at once, and how errors of wheel rows spread."""

from __future__ import annotations

import numpy as np
import pytest

from snake_control.model.constraints import lateral_map, lateral_velocities
from snake_control.model.geometry import planar_base
from snake_control.model.rolling import rolling, rolling_spread, rolling_steps
from snake_control.model.structure import structure
from support.robots import ROBOTS, random_q


@pytest.mark.parametrize("name", ROBOTS)
def test_many_at_once_are_each_of_them(name: str) -> None:
    robot = ROBOTS[name]
    s = structure(robot)
    angles = np.array([random_q(robot, seed)[6 + s.n_h :] for seed in range(6)])
    turning = np.random.default_rng(1).normal(0.0, 1.0, angles.shape)
    together = planar_base(s, angles.reshape(2, 3, -1))
    rows = lateral_map(together)
    by_joints = lateral_velocities(together, turning.reshape(2, 3, -1))
    spread = rolling_spread(together)
    steps = rolling_steps(together, turning.reshape(2, 3, -1))
    for k in range(6):
        g, at = planar_base(s, angles[k]), divmod(k, 3)
        np.testing.assert_allclose(rows[at], lateral_map(g), atol=1e-14)
        np.testing.assert_allclose(by_joints[at], lateral_velocities(g, turning[k]), atol=1e-13)
        planar, slip = rolling(g, turning[k])
        np.testing.assert_allclose(steps[at], planar, rtol=1e-6, atol=1e-7)
        np.testing.assert_allclose(slip, rows[at].dot(planar) + by_joints[at], atol=1e-12)
        # Least squares: nothing of the slip can be had by moving the base.
        np.testing.assert_allclose(rows[at].T.dot(slip), 0.0, atol=1e-11)
        gram = rows[at].T @ rows[at]
        np.testing.assert_allclose(spread[at] @ gram, np.eye(3), atol=1e-6)


def test_a_singular_shape_spreads_without_bounds_and_steps_stay_finite() -> None:
    s = structure(ROBOTS["paper"])
    shapes = planar_base(s, np.array([np.zeros(6), np.array((0.3, 0.5, -0.4, 0.2, -0.6, 0.1))]))
    spread = rolling_spread(shapes)
    assert np.isinf(spread[0]).all()
    assert np.isfinite(spread[1]).all()
    assert np.abs(rolling_steps(shapes, np.full((2, 6), 0.01))).max() < 1.0
