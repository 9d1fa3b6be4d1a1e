"""Finite differences, for checking analytic derivatives in tests only."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def gradient(f: Callable[[np.ndarray], float], q: np.ndarray, h: float = 1e-4) -> np.ndarray:
    """Fourth-order central differences of a scalar function, one entry for each component."""
    result = np.empty(len(q))
    for i in range(len(q)):
        step = np.zeros(len(q))
        step[i] = h
        result[i] = (8 * (f(q + step) - f(q - step)) - (f(q + 2 * step) - f(q - 2 * step))) / (
            12 * h
        )
    return result
