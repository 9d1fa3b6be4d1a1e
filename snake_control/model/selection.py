"""Which components of q make w_tilde and theta_bar: S, S_bar and T of (12), (13)."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from snake_control.model.structure import Structure

Indices = NDArray[np.intp]


@functools.lru_cache(maxsize=64)
def selection(s: Structure) -> tuple[Indices, Indices]:
    """Return S and S_bar as indices: w_tilde = q[S], theta_bar = q[S_bar] (12).

    The permutation T of (13) is the two in a row: q[concatenate((S, S_bar))] = [w_tilde,
    theta_bar].

    Returns:
        Indices into q, counted from 0: w, H-SCPs, B-SCPs (6 + m, or 3 + m of a planar snake); the
        other joints (n - m - 1).
    """
    return np.concatenate((s.w, 6 + s.scp)), 6 + s.theta
