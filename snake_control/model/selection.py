"""Which components of q make w_tilde and theta_bar: S, S_bar and T of (12), (13)."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray

from snake_control.model.structure import Structure

Indices = NDArray[np.intp]


@dataclasses.dataclass(frozen=True, eq=False)
class Selection:
    """Indices into q, counted from 0.

    The permutation T of (13) is S and S_bar in a row: q[concatenate((S, S_bar))] = [w_tilde,
    theta_bar].

    Attributes:
        S: w_tilde (12): w, H-SCPs, B-SCPs, (6 + m,), or (3 + m,) for a planar snake.
        S_bar: theta_bar (12), (n - m - 1,).
        head_inputs: the part of S that moves the head part: w and H-SCPs.
        head_theta: the part of S_bar that is head joints.
        base_theta: the rest of S_bar, as base joints counted from joint n_h + 1.
    """

    S: Indices
    S_bar: Indices
    head_inputs: Indices
    head_theta: Indices
    base_theta: Indices


@functools.lru_cache(maxsize=64)
def selection(s: Structure) -> Selection:
    """Return the selections of a robot (worked out once for each)."""
    return Selection(
        S=np.concatenate((s.w, 6 + s.scp)),
        S_bar=6 + s.theta,
        head_inputs=np.concatenate((s.w, 6 + s.scp_h)),
        head_theta=6 + s.theta_h,
        base_theta=s.theta_b - s.n_h,
    )
