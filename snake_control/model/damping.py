"""Inverses that stay bounded where a matrix turns singular.

A singular value sigma inverts to 1 / sigma, as it must, down to a threshold epsilon, and to
sigma / epsilon^2 below it: damped least squares with the damping epsilon^2 - sigma^2. So nothing
changes above the threshold, the inverse is continuous there, no entry exceeds 1 / epsilon, and what
the matrix cannot do at all is not tried.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

EPSILON = 1e-3
"""Threshold for matrices of which both sides are joint velocities or l per second."""


def damped_reciprocals(sigma: Array) -> Array:
    """Return 1 / sigma above the threshold and sigma / EPSILON^2 below it."""
    return sigma / np.maximum(sigma, EPSILON) ** 2


def damping_of(sigma_min: float) -> float:
    """Return which share of a motion in the weakest direction is given up, 0 (none) .. 1 (all)."""
    return max(0.0, 1.0 - (sigma_min / EPSILON) ** 2)
