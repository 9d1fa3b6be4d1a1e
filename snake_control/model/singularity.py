"""V_b1 = det(E_tilde E_tilde^T), which vanishes in singular postures (30)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from snake_control.model.constraints import contracted_gradient
from snake_control.model.geometry import Geometry
from snake_control.model.redundancy import Kinematics

Array = NDArray[np.float64]


def log_V_b1(
    g: Geometry, k: Kinematics, log_V_h_gradient: Array, V_h: float
) -> tuple[float, Array]:
    """Return log V_b1 and its gradient by q.

    Without E_tilde or F_bar, which lose all digits on long robots, from the identity

        V_b1 = |det K| / V_h^2,   K = [[B_bar B_bar^T, A_bar], [A_bar^T, 0]].

    Args:
        g, k: the posture and its kinematics.
        log_V_h_gradient: gradient of log V_h by q, (n + 5,).
        V_h: manipulability (29), > 0.

    Returns:
        log V_b1 (-inf in a singular posture, with a zero gradient), and its gradient (n + 5,).
    """
    rows, w = len(k.G), k.s.w
    K = np.zeros((rows + len(w), rows + len(w)))
    K[:rows, :rows] = k.B_bar @ k.B_bar.T
    K[:rows, rows:] = k.A_bar
    K[rows:, :rows] = k.A_bar.T
    sign, log_det = np.linalg.slogdet(K)
    if sign == 0.0:
        return -np.inf, np.zeros(len(g.q))
    inverse = np.linalg.inv(K)
    weights = np.zeros_like(k.G)
    # d log|det K| = <inverse, dK>; K is quadratic in B_bar = -G and linear in A_bar = G.
    weights[:, w] = 2.0 * inverse[:rows, rows:]
    weights[:, 6:] = -2.0 * inverse[:rows, :rows] @ k.B_bar
    gradient = contracted_gradient(g, weights) - 2.0 * log_V_h_gradient
    return float(log_det - 2.0 * np.log(V_h)), gradient
