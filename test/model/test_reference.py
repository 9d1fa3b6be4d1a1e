"""Agreement with an independent implementation (automatic differentiation) at two postures."""

from __future__ import annotations

import numpy as np
import pytest

from snake_control.config import ControllerConfig
from snake_control.control.reference import Reference
from snake_control.control.scp_controller import ScpController
from snake_control.control.sub_tasks import Composition
from snake_control.model.posture import Posture
from support.robots import PAPER, paper_states

STATES = paper_states()


@pytest.fixture(params=range(len(STATES)))
def state(request):
    return STATES[request.param]


@pytest.fixture
def posture(state):
    return Posture(PAPER, state["q"])


def test_F_bar(state, posture):
    expected = np.array(state["F_bar"])
    np.testing.assert_allclose(
        posture.k.F_bar, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max()
    )


def test_E_tilde(state, posture):
    sigma = np.linalg.svd(posture.k.E_tilde, compute_uv=False)
    np.testing.assert_allclose(sigma, state["E_tilde_singular_values"], rtol=1e-9)


def test_costs(state, posture):
    assert posture.V_h == pytest.approx(state["V_h"], rel=1e-9)
    assert posture.V_b1 == pytest.approx(state["V_b1"], rel=1e-9)
    assert posture.support.d_min == pytest.approx(state["d_min"], rel=1e-9)


@pytest.mark.parametrize("case", [2, 3])
def test_scp_velocities(state, posture, case):
    gains = ControllerConfig(case=case)
    found = Composition(PAPER, gains).velocities(posture, np.zeros(6))
    np.testing.assert_allclose(found[:1], state["phi_dot_hd"], rtol=1e-6)
    np.testing.assert_allclose(found[1:], state[f"phi_dot_bd_case{case}"], rtol=1e-6)


def test_control_law(state):
    t = state["u_case2_at_t"]["t"]
    reference = Reference(
        np.array([0.01 * t, 0.0, 0.2, np.pi / 8, np.pi / 8, 0.0]),
        np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0]),
    )
    result = ScpController(PAPER, ControllerConfig(case=2)).step(state["q"], None, reference, t)
    np.testing.assert_allclose(result.u_unlimited, state["u_case2_at_t"]["u"], rtol=1e-6, atol=1e-9)


def test_table_1_start():
    """Rounded figures of the same independent implementation at phi(0) of Table 1."""
    posture = Posture(PAPER, STATES[0]["q"])
    assert STATES[0]["q"][2] - PAPER.wheel_radius_m == pytest.approx(0.2993, abs=5e-5)
    assert posture.V_h == pytest.approx(5.8775e-7, rel=1e-4)
    assert posture.V_b1 == pytest.approx(2.4757e8, rel=1e-4)
    assert posture.support.d_min == pytest.approx(0.034238, rel=1e-4)
