"""V_b1 = det(E_tilde E_tilde^T), which vanishes in singular postures (30).

Neither E_tilde nor F_bar is needed, which lose all digits on long robots. Changing variables from
w and the H-SCPs to head joint velocities and the motion of the first base link turns (17) into a
block of units and ``BaseMap``'s N, so that

    V_b1 = (cos P up_z^2)^2 det(N^T N) / (l^3 det head block)^2

with up_z = cos of the base's tilt (1 on the floor), N and head block free of units as ``BaseMap``
and ``HeadBlock`` have them. det(N^T N) depends on the base joints alone, the rest on the head
joints and the attitude. For a planar snake V_b1 = det(N^T N) / l^4.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import blas, lapack

from snake_control.model.damping import EPSILON, damped_reciprocals
from snake_control.model.geometry import Geometry

Array = NDArray[np.float64]

_TINY = 1e-12
_SMALLEST = 1e-300


class GramDeterminant:
    """det(N^T N) by the triangular factor of N.

    Attributes:
        log: its logarithm; far below any other value in a singular posture, but finite.
    """

    log: float

    def __init__(self, N: Array) -> None:
        self._N = N
        self._qr, self._tau, _, _ = lapack.dgeqrf(N)
        diagonal = np.abs(self._qr.diagonal()) + _SMALLEST
        self.log = 2.0 * sum(np.log(diagonal).tolist())

    def transposed_pseudo_inverse(self) -> Array:
        """Return (N^+)^T, half the derivative of ``log`` by N; damped near a singular posture."""
        Q, _, _ = lapack.dorgqr(self._qr, self._tau)
        inverse: Array = blas.dtrsm(1.0, self._qr[: len(Q.T)], Q.T)
        # While this bound holds, no singular value lies below the threshold. It does not hold for
        # what a zero on the diagonal leaves.
        if np.vdot(inverse, inverse) < EPSILON**-2:
            return inverse.T
        U, sigma, Vt = np.linalg.svd(self._N, full_matrices=False)
        return (U * damped_reciprocals(sigma)) @ Vt


def attitude_log(g: Geometry) -> float:
    """Return log (cos P up_z^2)^2, the part of the attitude in log V_b1."""
    cos_pitch, up_z = abs(math.cos(g.pitch)), abs(g.rows[2][2])
    return 2.0 * math.log(max(cos_pitch, _TINY)) + 4.0 * math.log(max(up_z, _TINY))


def attitude_log_gradient(g: Geometry) -> list[float]:
    """Return the gradient of ``attitude_log`` by R, P, Y, phi_1 .. phi_(n_h)."""
    x, y, z = g.rows[2]
    # The floor's "up" turns against the base frame.
    tilt = 4.0 / math.copysign(max(abs(z), _TINY), z)
    axes = (*g.attitude_axes, *(axis for _, axis in g.chain.twists))
    gradient = [tilt * (x * axis[1] - y * axis[0]) for axis in axes]
    gradient[1] -= 2.0 * math.tan(g.pitch)
    return gradient
