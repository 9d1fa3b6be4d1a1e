"""The arc's rate is the derivative of its pose, and its shape is an arc."""

import numpy as np
import pytest

from snake_control.trajectory.arc import Arc

START = np.array([0.3, -0.2, 0.2, 0.4, -0.1, 0.7])


@pytest.mark.parametrize("radius", [0.5, -0.3])
def test_rate_and_shape(radius):
    arc = Arc(START, 0.02, radius)
    np.testing.assert_allclose(arc.sample(0.0).w_d, START, atol=1e-15)
    side = np.array([-np.sin(START[5]), np.cos(START[5])])
    center = START[:2] + radius * side
    for t in (0.0, 3.0, 40.0):
        before, now, after = (arc.sample(t + h) for h in (-1e-4, 0.0, 1e-4))
        np.testing.assert_allclose(now.w_d_dot, (after.w_d - before.w_d) / 2e-4, atol=1e-9)
        assert np.linalg.norm(now.w_d[:2] - center) == pytest.approx(abs(radius))
        assert np.linalg.norm(now.w_d_dot[:2]) == pytest.approx(0.02)
        # The head looks along its path.
        assert np.arctan2(now.w_d_dot[1], now.w_d_dot[0]) == pytest.approx(
            np.angle(np.exp(1j * now.w_d[5]))
        )
        np.testing.assert_array_equal(now.w_d[2:5], START[2:5])
