"""The error that torque control promises."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from snake_control.experiment.facts import second_order


@pytest.mark.parametrize(
    ("K_p", "K_v"), [(4.0, 4.0), (4.0, 1.0), (1.0, 9.0), (0.0, 2.0), (0.0, 0.0)]
)
def test_second_order_solution(K_p, K_v):
    t = np.linspace(0.0, 5.0, 21)
    start, rate = np.array([0.7, -0.2]), np.array([-0.1, 0.4])

    def field(_, x):
        return np.concatenate((x[2:], -K_v * x[2:] - K_p * x[:2]))

    exact = solve_ivp(field, (0, 5), [*start, *rate], t_eval=t, rtol=1e-10, atol=1e-12).y[:2].T
    found = second_order(t, start, rate, np.full(2, K_p), np.full(2, K_v))
    np.testing.assert_allclose(found, exact, atol=1e-8)
