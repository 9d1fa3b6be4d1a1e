from __future__ import annotations

import numpy as np
import pytest

from snake_control.control.reference import Reference
from snake_control.trajectory.approach import Approach
from snake_control.trajectory.line import Line

HEAD = np.array([0.1, 0.0, 0.3, 0.0, -1.0, 3.0])
LINE = Line([0.0, 0.0, 0.2, 0.4, 0.4, -3.0], [0.01, 0.0, 0.0, 0.0, 0.0, 0.0], 2.0)


class Swing:
    """A goal that accelerates."""

    def sample(self, t: float) -> Reference:
        a = np.linspace(0.1, 0.6, 6)
        return Reference(a * np.sin(t), a * np.cos(t), -a * np.sin(t))


def test_it_begins_at_the_head_at_rest_and_ends_on_the_goal():
    approach = Approach(LINE, HEAD, 2.0, 5.0)
    for t in (0.0, 2.0):
        found = approach.sample(t)
        np.testing.assert_allclose(found.w_d[:5], HEAD[:5], atol=1e-15)
        # The same attitude, by the shorter way round.
        assert found.w_d[5] == pytest.approx(HEAD[5] - 2 * np.pi)
        np.testing.assert_allclose(found.w_d_dot, 0.0)
        np.testing.assert_allclose(found.w_d_ddot, 0.0)
    for t in (7.0, 11.0):
        found, goal = approach.sample(t), LINE.sample(t)
        np.testing.assert_allclose(found.w_d, goal.w_d)
        np.testing.assert_allclose(found.w_d_dot, goal.w_d_dot)
        np.testing.assert_allclose(found.w_d_ddot, 0.0, atol=1e-15)


def test_rates_are_derivatives():
    approach, h = Approach(Swing(), HEAD, 1.0, 3.0), 1e-4
    for t in np.linspace(1.1, 5.0, 12):
        before, now, after = (approach.sample(t + d) for d in (-h, 0.0, h))
        np.testing.assert_allclose((after.w_d - before.w_d) / (2 * h), now.w_d_dot, atol=1e-7)
        rate = (after.w_d_dot - before.w_d_dot) / (2 * h)
        np.testing.assert_allclose(rate, now.w_d_ddot, atol=1e-6)
