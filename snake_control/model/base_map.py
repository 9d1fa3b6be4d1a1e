"""How the base part follows its first link: substitution along the body (6), (8).

The wheels of a driven link decide the joint in front of it, so the motion of the whole base part
follows from that of its first link and from the B-SCPs. This matrix N is all of F_bar that belongs
to base joints, and with it V_b1. All here is in the plane of the base; link k turns with joint k in
front of it, counted from 0, and the first link counts as one that turns about its own front end.

Substitution is BLAS's ``trsm``. LAPACK's ``trtrs`` does the same, but OpenBLAS gives it to all
cores however little there is to do, and then waits for them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import blas

from snake_control.model.geometry import PlanarBase, in_plane

Array = NDArray[np.float64]


class BaseMap:
    """N, and its derivatives by the base joint angles.

    Attributes:
        turns: velocity of each joint per column, (n_b, 2 + m_b), or 3 + m_b columns for a planar
            snake; row 0: turning of the first base link. Columns: see ``BaseStructure``.
        N: the same without row 0, (n_b - 1, 2 + m_b). The rows of B-SCPs are unit vectors.
    """

    N: Array

    def __init__(self, g: PlanarBase) -> None:
        """Substitute along the body.

        Sideways velocity of link k is its own speed sideways plus, for each joint in front of it,
        the joint's velocity times its arm x_k . (c_k - h_joint), which is -l for joint k.
        """
        base = g.s.base
        self._g = g
        along = in_plane(g.forward).dot(in_plane(g.fronts).T)
        reach = along.diagonal() - g.s.robot.half_length_m
        arms = reach[:, None] - along
        arms *= base.driven
        arms += base.given
        # Lower triangular, in LAPACK's order its transpose; what lies above it is never read.
        self._arms: Array = arms.T
        right = base.known.copy()
        # Against the speeds sideways of all links moving forward, and moving to the left, at l m/s.
        self._rightward = g.forward * base.rightward
        right[0], right[1] = self._rightward.real, self._rightward.imag
        right[base.entries - 1, 0] = 1.0
        # Substitution keeps every row to full precision, however fast rows grow along the body.
        self.turns: Array = blas.dtrsm(1.0, self._arms, right.T, trans_a=1, overwrite_b=1)
        self.N = self.turns[1:]

    def answer(self, sideways: Array) -> Array:
        """Return the velocities of joints that cancel what moves links sideways, (n_b - 1,).

        Or accelerations that cancel accelerations. Those of B-SCPs are 0.

        Args:
            sideways: speed of each base link to its left, (n_b,) [m/s]; only those of driven links
                count.
        """
        right = sideways * -self._g.s.base.driven[:, 0]
        found: Array = blas.dtrsv(self._arms, right, trans=1, overwrite_x=1)
        return found[1:]

    def gradient(self, weights: Array, factor: float = 1.0) -> Array:
        """Return factor times the gradient of sum(weights * N) by the base joint angles.

        With the adjoint solution lambda of the substitution it is -sum(lambda * d(sideways
        velocity)). When joint a turns what lies behind it, the velocity of link k as that link sees
        it changes by the velocity of the joint's hitch alone: -x_k . v_a. So everything is a
        running sum along the body.

        Args:
            weights: held constant, shape of N; those of B-SCP rows count for nothing.
            factor: of the result.

        Returns:
            Shape (n_b - 1,).
        """
        adjoint = blas.dtrsm(1.0, self._arms[1:, 1:], weights)
        # Forces across the driven links (times l, to the right), and all of those behind a joint.
        force = self._rightward[1:, None] * adjoint
        behind = np.add.accumulate(force[::-1])[::-1]
        behind *= self._turned_hitch_velocities().conj()
        gradient: Array = np.add.reduce(behind.real, axis=1)
        gradient *= -factor / self._g.s.robot.half_length_m
        return gradient

    def _turned_hitch_velocities(self) -> NDArray[np.complex128]:
        """Return i (v_x + i v_y) of each joint's hitch for each column, shape of N.

        A link that turns about its front end moves its rear end sideways, by -i times its length.
        """
        turning = np.add.accumulate(self.turns[:-1])
        changes = self._g.links[:-1, None] * turning
        changes[0] += self._g.s.base.turned_entry_velocity
        return np.add.accumulate(changes)
