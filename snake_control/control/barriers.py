"""Limits as numbers that must stay above 0, and whether a motion respects them.

Each limit is a function h of the joint angles, positive where all is well. A motion is allowed if,
followed for a time T, it leaves h(phi + u T) >= (1 - gamma T) h(phi): the nearer the limit, the
slower it may be approached, and it is never passed (a control barrier function, in the discrete
form of Agrawal and Sreenath, Robotics: Science and Systems 2017). Where h is negative already, no
motion may make it worse.

Ranges and speeds of the joints are linear in u and give bounds for it. The margin against falling,
the height of the raised links above the floor, the nearness of a singular shape and the regularity
of the head's posture are worked out at phi + u T, with the base level on the floor: exact also
where the nearest edge of the support polygon changes, which a derivative is not.
"""

from __future__ import annotations

import dataclasses
import enum

import numpy as np
from numpy.typing import NDArray

from snake_control.config import RobotConfig, SupervisorConfig
from snake_control.control.limits import RANGE_MARGIN_RAD
from snake_control.model.floor import geometry_on_floor
from snake_control.model.floor_clearance import floor_clearance
from snake_control.model.geometry import Geometry
from snake_control.model.head_block import HeadBlock
from snake_control.model.singular_shape import singular_shape
from snake_control.model.stability import support

Array = NDArray[np.float64]

_NO_WORSE = 1e-9


class Limit(enum.Enum):
    """What a motion can run into."""

    JOINT_SPEED = "joint speed"
    JOINT_RANGE = "joint range"
    FALL = "falling"
    FLOOR = "the floor"
    SINGULAR_BODY = "singular shape of the body"
    SINGULAR_HEAD = "singular posture of the head"


@dataclasses.dataclass(frozen=True)
class Bound:
    """The limit that a motion runs into first.

    Attributes:
        limit: which.
        joints: of whose speed or range it is, counted from 1; empty if of the whole body.
    """

    limit: Limit
    joints: tuple[int, ...] = ()


class Barriers:
    """The limits of one robot."""

    def __init__(self, robot: RobotConfig, config: SupervisorConfig) -> None:
        self._robot = robot
        self._config = config
        self._speed = np.array(robot.joint_speed_limits_rad_s)
        bounds = np.array(robot.joint_limits_rad).reshape(-1, 2)
        self.lower = bounds[:, 0] + RANGE_MARGIN_RAD
        self.upper = bounds[:, 1] - RANGE_MARGIN_RAD

    def at(self, phi: Array, on_floor: Geometry | None = None) -> BarriersAt:
        """Return the limits as they are seen from joint angles, (n-1,) [rad].

        Args:
            phi: joint angles, (n-1,) [rad].
            on_floor: their ``geometry_on_floor``, if that is known already.

        Raises:
            ModelError: phi is not finite.
        """
        return BarriersAt(self, phi, self._margins(on_floor or self.on_floor(phi)))

    def on_floor(self, phi: Array) -> Geometry:
        """Return ``geometry_on_floor`` of this robot."""
        return geometry_on_floor(self._robot, phi)

    @property
    def widths(self) -> dict[Limit, float]:
        """How far each margin is from its stop threshold to its warning threshold."""
        c = self._config
        return {
            Limit.FALL: c.d_min_warn_m - c.d_min_stop_m,
            Limit.FLOOR: c.floor_warn_m - c.floor_stop_m,
            Limit.SINGULAR_BODY: c.nearness_stop - c.nearness_warn,
            Limit.SINGULAR_HEAD: c.regularity_warn - c.regularity_stop,
            Limit.JOINT_RANGE: c.range_warn_rad,
        }

    def bounds(self, phi: Array) -> tuple[Array, Array, NDArray[np.bool_], NDArray[np.bool_]]:
        """Return lowest and highest joint velocities, and where these are due to the ranges."""
        rate = self._config.approach_rate_per_s
        up = rate * np.maximum(self.upper - phi, 0.0)
        down = -rate * np.maximum(phi - self.lower, 0.0)
        return (
            np.maximum(down, -self._speed),
            np.minimum(up, self._speed),
            down > -self._speed,
            up < self._speed,
        )

    def margins(self, phi: Array) -> dict[Limit, float]:
        """Return what is left of the limits of the whole body, the base level on the floor.

        d_min less its stop threshold [m]; height of the lowest raised link above the floor less
        its stop threshold [m]; its stop threshold less the nearness of a singular shape; and the
        regularity of the head block less its stop threshold.
        """
        return self._margins(self.on_floor(phi))

    def _margins(self, g: Geometry) -> dict[Limit, float]:
        c = self._config
        margins = {Limit.FALL: support(g).d_min - c.d_min_stop_m}
        if c.nearness_stop < 1.0:
            margins[Limit.SINGULAR_BODY] = c.nearness_stop - singular_shape(g).nearness
        if not self._robot.planar:
            margins[Limit.FLOOR] = floor_clearance(g).height - c.floor_stop_m
            margins[Limit.SINGULAR_HEAD] = HeadBlock(g).regularity - c.regularity_stop
        return margins

    @property
    def horizon_s(self) -> float:
        """How far ahead motions are looked at [s]."""
        return self._config.horizon_s

    @property
    def left_after_horizon(self) -> float:
        """Share of a margin that a motion must leave: 1 - gamma T."""
        return 1.0 - self._config.approach_rate_per_s * self._config.horizon_s


class BarriersAt:
    """The limits seen from one set of joint angles.

    Attributes:
        lowest, highest: bounds of the joint velocities, (n-1,) [rad/s].
        margins: what is left of the limits of the whole body (``Barriers.margins``).
        lifted: limits that do not count at present.
    """

    def __init__(self, barriers: Barriers, phi: Array, margins: dict[Limit, float]) -> None:
        self._barriers = barriers
        self._phi = phi
        self.lowest, self.highest, self._by_lower, self._by_upper = barriers.bounds(phi)
        self.margins = margins
        self.lifted: frozenset[Limit] = frozenset()

    def largest_share(self, start: Array, way: Array) -> tuple[float, Bound | None]:
        """Return the largest t of 0..1 with start + t way allowed, and what ends it.

        Args:
            start, way: joint velocities, (n-1,) [rad/s].

        Returns:
            t, negative if ``start`` itself is not allowed; and the limit met, ``None`` if t is 1.
        """
        t, bound = self._linear_share(start, way)
        if t < 0.0:
            return t, bound
        limit = self._met(start + t * way)
        if limit is None:
            return t, bound
        if self._met(start) is not None:
            return -1.0, Bound(limit)
        good, bad = 0.0, t
        for _ in range(_HALVINGS):
            middle = 0.5 * (good + bad)
            met = self._met(start + middle * way)
            if met is None:
                good = middle
            else:
                bad, limit = middle, met
        return good, Bound(limit)

    def allows(self, u: Array) -> bool:
        """Return whether a motion respects all limits."""
        inside = bool(((u >= self.lowest - _NO_WORSE) & (u <= self.highest + _NO_WORSE)).all())
        return inside and self._met(u) is None

    def _linear_share(self, start: Array, way: Array) -> tuple[float, Bound | None]:
        outside = (start > self.highest + _NO_WORSE) | (start < self.lowest - _NO_WORSE)
        if outside.any():
            return -1.0, self._bound(outside, start)
        room = np.where(way > 0.0, self.highest - start, start - self.lowest)
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = np.where(way == 0.0, np.inf, np.maximum(room, 0.0) / np.abs(way))
        t = float(shares.min(initial=np.inf))
        if t >= 1.0:
            return 1.0, None
        return t, self._bound(shares <= t, way)

    def _bound(self, joints: NDArray[np.bool_], direction: Array) -> Bound:
        by_range = np.where(direction > 0.0, self._by_upper, self._by_lower) & joints
        chosen = by_range if by_range.any() else joints
        limit = Limit.JOINT_RANGE if by_range.any() else Limit.JOINT_SPEED
        return Bound(limit, tuple((chosen.nonzero()[0] + 1).tolist()))

    def _met(self, u: Array) -> Limit | None:
        """Return the limit of the whole body that a motion does not respect."""
        ahead = self._barriers.margins(self._phi + self._barriers.horizon_s * u)
        for limit, margin in self.margins.items():
            if limit not in self.lifted and ahead[limit] < self._least(margin):
                return limit
        return None

    def _least(self, margin: float) -> float:
        return (self._barriers.left_after_horizon * margin if margin > 0.0 else margin) - _NO_WORSE


_HALVINGS = 8
