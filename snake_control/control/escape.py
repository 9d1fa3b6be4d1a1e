"""The SCPs get the robot away from a limit while the head goes on as it should.

Moving the SCPs with the head at rest is the paper's internal motion. Here they follow the gradient
of the margin that is in danger, as they follow that of a sub-task in (25) and (27), but at a speed
that grows with the danger and not with the gradient.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np
from numpy.typing import NDArray

from snake_control.config import RobotConfig, SupervisorConfig
from snake_control.control.barriers import Barriers, BarriersAt, Limit
from snake_control.model.floor_clearance import floor_clearance, floor_clearance_by_head
from snake_control.model.posture import Posture
from snake_control.model.vector import sumprod
from snake_control.model.wheel_axes import axis_spread

Array = NDArray[np.float64]

_OVER = 1.2
_NOTHING_TO_GAIN = 1e-9
"""A gradient as small as this, by the SCPs, is none."""


class Escape:
    """Which way the SCPs shall move, and how urgent it is."""

    def __init__(self, robot: RobotConfig, config: SupervisorConfig, barriers: Barriers) -> None:
        self._robot = robot
        self._config = config
        self._barriers = barriers
        self._widths = barriers.widths
        self._rest = [0.0] * len(robot.controlled)

    def dangers(
        self, at: BarriersAt, phi: Array, known: Collection[Limit] = ()
    ) -> dict[Limit, float]:
        """Return what is in danger: 0 at the warning threshold, 1 at the stop.

        Args:
            at: the limits, seen from
            phi: joint angles, (n-1,) [rad].
            known: what was in danger before; it stays in the list until it is a fifth beyond the
                threshold, with 0.
        """
        margins = at.margins | {Limit.JOINT_RANGE: float(self._range_margins(phi).min())}
        found = {}
        for limit, margin in margins.items():
            width = self._widths[limit]
            over = width * (_OVER if limit in known else 1.0)
            if margin < max(over, 0.0):
                found[limit] = min(max(1.0 - margin / width, 0.0), 1.0) if width > 0.0 else 1.0
        return found

    def velocities(self, posture: Posture, dangers: dict[Limit, float]) -> Array:
        """Return the SCP velocities that lead away, H-SCPs first, (m,) [rad/s].

        The fastest joint then moves at ``escape_speed_rad_s`` times the danger.
        """
        total = np.zeros(posture.k.s.m)
        for limit, danger in dangers.items():
            if danger == 0.0:
                continue
            by_head, by_base = self._gradient(limit, posture)
            way = np.array(list(_by_scps(posture, by_head, by_base)))
            motion = posture.k.joint_velocities(self._rest, way.tolist())
            fastest = float(np.abs(motion).max(initial=0.0))
            if fastest > _NOTHING_TO_GAIN and np.isfinite(fastest):
                total += (self._config.escape_speed_rad_s * danger / fastest) * way
        return total

    def _gradient(self, limit: Limit, posture: Posture) -> tuple[Array, Array]:
        """Return the derivative of a margin by the joints of head and base."""
        n_h = posture.k.s.n_h
        if limit is Limit.FALL:
            return posture.support.gradient[6 : 6 + n_h], posture.support.by_base
        if limit is Limit.FLOOR:
            by_head = floor_clearance_by_head(posture.g, floor_clearance(posture.g))
            return np.array(by_head), np.zeros(len(posture.g.q) - 6 - n_h)
        if limit is Limit.SINGULAR_HEAD:
            return np.array(posture.head_determinant_by_head), np.zeros(len(posture.g.q) - 6 - n_h)
        if limit is Limit.SINGULAR_BODY:
            _, by_q = axis_spread(posture.g)
            return by_q[6 : 6 + n_h], by_q[6 + n_h :]
        phi = posture.g.q[6:]
        # Each joint near an end counts by how near it is.
        excess = np.maximum(1.0 - self._range_margins(phi) / self._config.range_warn_rad, 0.0)
        away = np.where(phi - self._barriers.lower < self._barriers.upper - phi, 1.0, -1.0)
        gradient = excess * away
        return gradient[:n_h], gradient[n_h:]

    def _range_margins(self, phi: Array) -> Array:
        return np.minimum(phi - self._barriers.lower, self._barriers.upper - phi)


def _by_scps(posture: Posture, by_head: Array, by_base: Array) -> Iterator[float]:
    """Yield the derivative by each SCP, the head at rest: what (25) and (27) put after the gain."""
    k = posture.k
    head = by_head.tolist()
    yield from (sumprod(head, motion) for motion in k.head_scp_motion)
    yield from by_base.dot(k.base_scp_motion).tolist()
