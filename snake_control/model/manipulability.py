"""V_h = |det B_tilde|, the manipulability of the head part (29)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from snake_control.model.constraints import contracted_gradient
from snake_control.model.geometry import Geometry
from snake_control.model.redundancy import Kinematics

Array = NDArray[np.float64]


def V_h(g: Geometry, k: Kinematics) -> tuple[float, Array]:
    """Return V_h and its gradient by q.

    B_tilde is block triangular and its base block has l on the diagonal, so
    V_h = |det head block| l^(n_b - m_b - 1), and only head joints and attitude have a part in it.
    That of a planar snake is constant.

    Returns:
        V_h, and its gradient (n + 5,).
    """
    s = g.s
    scale = s.robot.half_length_m ** len(s.theta_b)
    if s.robot.planar:
        return scale, np.zeros(s.n + 5)
    U, sigma, Vt = np.linalg.svd(k.head_block)
    # Cofactors from the singular values hold where the inverse does not exist.
    others = np.array([np.prod(np.delete(sigma, i)) for i in range(4)])
    cofactors = (U * others) @ Vt
    weights = np.zeros_like(k.G)
    # The head block is -G there; |det| has the sign of neither.
    weights[np.ix_(s.head_rows, 6 + s.theta_h)] = -cofactors
    value = float(np.prod(sigma)) * scale
    return value, scale * contracted_gradient(g, weights)
