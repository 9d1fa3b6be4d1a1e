"""Predicts pose and twist of the head from the joints, to bridge short gaps of motion capture.

From a pose that was measured, the base part rolls on as the wheels make it roll
(``snake_control.model.rolling``, the kinematic plant's own mathematics), the floor keeps its
attitude, and the head stands on it as the head joints say. The pose follows from the joint
*angles*: errors of reading them do not add up. The twist begins as measured and goes over, with
the time constant ``smooth_s``, to that of the joint velocities, which are coarse numbers.

Uncertainty, one standard deviation of the position of the tip (its length) and of the attitude:

* at first ``position_std_m`` and ``attitude_std_rad`` of the measured pose, and what misreading
  each joint by ``joint_std_rad`` makes of the base's motion and of the head's place on it;
* growing with the way that the joints make the wheels slide or roll: each wheel row (1) may err by
  ``slip_share`` of the way sideways that the joints alone would push it (root of the mean square
  over the wheels), all the time in the same sense;
* growing with time: each wheel row may err by ``creep_m_s``.

Errors of wheel rows pass to the base through the inverse of their Gram matrix, which grows beyond
all bounds towards a singular shape (Fig. 5): the prediction ends there by itself.
"""

from __future__ import annotations

import bisect
import dataclasses
import enum
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from snake_control.config import RobotConfig
from snake_control.control.head_filter import HeadEstimate
from snake_control.errors import ModelError
from snake_control.model.constraints import lateral_velocities
from snake_control.model.floor import tip_twist
from snake_control.model.geometry import planar_base
from snake_control.model.head_chain import HeadChain, head_chain
from snake_control.model.rolling import point_spread, rolling, rolling_by_joint, rolling_steps
from snake_control.model.structure import structure

Array = NDArray[np.float64]

_KEPT_NS = 2_000_000_000
_MAX_SAMPLES = 1000
_BOTH_ENDS = math.sqrt(2.0)
"""Joints are misread at the beginning and at the end."""


@dataclasses.dataclass(frozen=True)
class PredictionLimits:
    """How long and how uncertain a prediction may be, and how its uncertainty grows.

    Attributes:
        bridge_s: longest time since the measured pose [s].
        max_position_std_m: largest standard deviation of the position [m].
        max_attitude_std_rad: largest standard deviation of the attitude [rad].
        joint_gap_s: longest time between two joint states that are believed in [s].
        smooth_s: time constant with which the twist goes over to that of the joints [s].
        position_std_m, attitude_std_rad: of the measured (filtered) pose [m, rad].
        joint_std_rad: of a joint angle read; a tick of an AX-12 is 5.1 mrad [rad].
        slip_share: error of a wheel row, as a share of what the joints do to it.
        creep_m_s: error of a wheel row whatever the joints do [m/s].
    """

    bridge_s: float = 0.3
    max_position_std_m: float = 0.01
    max_attitude_std_rad: float = 0.05
    joint_gap_s: float = 0.1
    smooth_s: float = 0.1
    position_std_m: float = 0.0005
    attitude_std_rad: float = 0.002
    joint_std_rad: float = 0.0015
    slip_share: float = 0.1
    creep_m_s: float = 0.0005

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{field.name} = {value}: give a finite number, at least 0")
        if not self.smooth_s > 0.0:
            raise ValueError(f"smooth_s = {self.smooth_s}: must be above 0")


class End(enum.Enum):
    """Why there is no prediction."""

    NO_POSE = "no pose to begin with"
    NO_JOINT_STATES = "joint states are missing"
    TOO_LONG = "the measured pose is too old"
    TOO_UNCERTAIN = "too uncertain"


@dataclasses.dataclass(frozen=True)
class Ended:
    """No prediction, and why.

    Attributes:
        reason: what kind of end.
        text: the reason in words, with the value and the limit.
    """

    reason: End
    text: str


@dataclasses.dataclass(frozen=True)
class Prediction:
    """Pose and twist of the head as the joints say.

    Attributes:
        estimate: pose and twist, as the filter gives them.
        age_s: time since the measured pose [s].
        way_m: how far the tip has moved since [m].
        position_std_m, attitude_std_rad: standard deviations [m, rad].
    """

    estimate: HeadEstimate
    age_s: float
    way_m: float
    position_std_m: float
    attitude_std_rad: float


@dataclasses.dataclass(frozen=True, eq=False)
class _Joints:
    stamp_ns: int
    phi: Array
    phi_dot: Array


@dataclasses.dataclass(frozen=True, eq=False)
class _Knot:
    """What was predicted at one time: the base frame, and what has added up on the way."""

    joints: _Joints
    origin: Array
    base: Array
    tip: Array
    twist: Array
    way_m: float
    position_growth_m: float
    attitude_growth_rad: float
    reading_m: float
    reading_rad: float


class HeadPredictor:
    """Goes on from the last measured pose as the joints say.

    Give it every joint state (``joints``) and every pose that was accepted (``measured``), in any
    order of arrival; both cost next to nothing. Ask ``predict`` during a gap.
    """

    def __init__(self, robot: RobotConfig, limits: PredictionLimits | None = None) -> None:
        """Create it without a pose; the default limits for none given."""
        self._s = structure(robot)
        self._limits = PredictionLimits() if limits is None else limits
        self._samples: list[_Joints] = []
        self._measured: HeadEstimate | None = None
        self._knots: list[_Knot] = []
        self._ended: Ended | None = None

    def reset(self) -> None:
        """Forget everything, for a clock that was set back."""
        self._samples.clear()
        self._measured = None
        self._restart()

    def joints(self, stamp_ns: int, phi: ArrayLike, phi_dot: ArrayLike) -> None:
        """Take one joint state; one that is not newer than the last is left out.

        Args:
            stamp_ns: when the joints were read [ns].
            phi, phi_dot: angles and velocities of all joints, (n-1,) [rad, rad/s].

        Raises:
            ModelError: wrong shape or not finite.
        """
        sample = _Joints(stamp_ns, np.array(phi, dtype=float), np.array(phi_dot, dtype=float))
        for what, values in (("joint angles", sample.phi), ("joint velocities", sample.phi_dot)):
            if values.shape != (self._s.n - 1,) or not np.isfinite(values).all():
                raise ModelError(f"{what}: expected {self._s.n - 1} finite numbers, got {values}")
        if self._samples and stamp_ns <= self._samples[-1].stamp_ns:
            return
        self._samples.append(sample)
        oldest = self._samples[0].stamp_ns
        if stamp_ns - oldest > 2 * _KEPT_NS or len(self._samples) > _MAX_SAMPLES:
            keep = self._before(stamp_ns - _KEPT_NS)
            self._samples = self._samples[max(keep, len(self._samples) - _MAX_SAMPLES // 2, 0) :]

    def measured(self, estimate: HeadEstimate) -> None:
        """Take a pose that is believed in: predictions begin here from now on."""
        self._measured = estimate
        self._restart()

    def _restart(self) -> None:
        self._knots = []
        self._ended = None

    @property
    def newest_ns(self) -> int | None:
        """Time of the newest joint state: up to here there can be a prediction [ns]."""
        return self._samples[-1].stamp_ns if self._samples else None

    def predict(self, stamp_ns: int | None = None) -> Prediction | Ended:
        """Return the prediction for one time since the measured pose.

        Args:
            stamp_ns: time, by default that of the newest joint state [ns].

        Returns:
            The prediction; or why there is none. Once a prediction has ended because it went on for
            too long or became too uncertain, there is none for later times until a pose is
            measured again; for earlier ones there still is.
        """
        start = self._measured
        if start is None:
            return Ended(End.NO_POSE, "no pose has been measured yet")
        if stamp_ns is None:
            if not self._samples:
                return Ended(End.NO_JOINT_STATES, "no joint states received yet")
            stamp_ns = max(self._samples[-1].stamp_ns, start.stamp_ns)
        if not self._knots:
            first = self._at(start.stamp_ns)
            if isinstance(first, Ended):
                return first
            self._knots = [self._first_knot(first, start)]
        while self._knots[-1].joints.stamp_ns < stamp_ns and self._ended is None:
            following = self._before(self._knots[-1].joints.stamp_ns) + 1
            if following == len(self._samples):
                break
            knot = self._moved(self._knots[-1], self._samples[following])
            self._ended = knot if isinstance(knot, Ended) else None
            if not isinstance(knot, Ended):
                self._knots.append(knot)
        return self._answer(start, stamp_ns)

    def _answer(self, start: HeadEstimate, stamp_ns: int) -> Prediction | Ended:
        stamps = [knot.joints.stamp_ns for knot in self._knots]
        knot = self._knots[max(bisect.bisect_right(stamps, stamp_ns) - 1, 0)]
        if stamp_ns < stamps[0]:
            return Ended(
                End.NO_POSE,
                f"{(stamps[0] - stamp_ns) * 1e-9:.3f} s before the pose that was measured last",
            )
        if knot.joints.stamp_ns < stamp_ns:
            if knot is self._knots[-1] and self._ended is not None:
                return self._ended
            at = self._at(stamp_ns)
            if isinstance(at, Ended):
                return at
            moved = self._moved(knot, at)
            if isinstance(moved, Ended):
                return moved
            knot = moved
        return self._prediction(start, knot)

    def _before(self, stamp_ns: int) -> int:
        """Return the index of the newest joint state not after a time, -1 for none."""
        return bisect.bisect_right(self._samples, stamp_ns, key=lambda each: each.stamp_ns) - 1

    def _at(self, stamp_ns: int) -> _Joints | Ended:
        """Return the joints at a time between two joint states."""
        at = self._before(stamp_ns)
        if at >= 0 and self._samples[at].stamp_ns == stamp_ns:
            return self._samples[at]
        if at < 0 or at + 1 == len(self._samples):
            where = "before the first" if at < 0 else "after the newest"
            return Ended(End.NO_JOINT_STATES, f"the time asked for is {where} joint state")
        before, after = self._samples[at], self._samples[at + 1]
        gap = self._gap(before, after)
        if gap is not None:
            return gap
        share = (stamp_ns - before.stamp_ns) / (after.stamp_ns - before.stamp_ns)
        return _Joints(
            stamp_ns,
            before.phi + share * (after.phi - before.phi),
            before.phi_dot + share * (after.phi_dot - before.phi_dot),
        )

    def _gap(self, before: _Joints, after: _Joints) -> Ended | None:
        gap_s = (after.stamp_ns - before.stamp_ns) * 1e-9
        if gap_s <= self._limits.joint_gap_s:
            return None
        return Ended(
            End.NO_JOINT_STATES,
            f"no joint states for {gap_s:.3f} s (limit {self._limits.joint_gap_s:g} s)",
        )

    def _chain(self, phi: Array) -> HeadChain:
        return head_chain(self._s, phi[: self._s.n_h].tolist())

    def _first_knot(self, joints: _Joints, start: HeadEstimate) -> _Knot:
        chain = self._chain(joints.phi)
        # Columns of the transpose are the head's axes in base coordinates.
        base = start.rotation.as_matrix() @ np.array(chain.frame)
        tip = np.array(start.position, dtype=float)
        twist = np.concatenate((start.velocity, start.angular_velocity))
        origin = tip - base @ np.array(chain.tip)
        return _Knot(joints, origin, base, tip, twist, 0.0, 0.0, 0.0, 0.0, 0.0)

    def _moved(self, knot: _Knot, joints: _Joints) -> _Knot | Ended:
        """Return what follows from ``knot`` as the joints turn on to ``joints``."""
        limits, n_h = self._limits, self._s.n_h
        gap = self._gap(knot.joints, joints)
        if gap is not None:
            return gap
        age_s = (joints.stamp_ns - self._knots[0].joints.stamp_ns) * 1e-9
        if age_s > limits.bridge_s + 1e-9:
            text = f"no pose for {age_s:.3f} s (bridged for {limits.bridge_s:g} s)"
            return Ended(End.TOO_LONG, text)
        dt = (joints.stamp_ns - knot.joints.stamp_ns) * 1e-9
        turned = joints.phi - knot.joints.phi
        middle = planar_base(self._s, knot.joints.phi[n_h:] + 0.5 * turned[n_h:])
        x, y, turn = rolling_steps(middle, turned[n_h:]).tolist()
        c, s = math.cos(0.5 * turn), math.sin(0.5 * turn)
        origin = knot.origin + knot.base @ np.array((c * x - s * y, s * x + c * y, 0.0))
        c, s = math.cos(turn), math.sin(turn)
        base = knot.base @ np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))
        chain = self._chain(joints.phi)
        tip_in_base = np.array(chain.tip)
        tip = origin + base @ tip_in_base

        twist = self._twist(joints, chain, base)
        kept = math.exp(-dt / limits.smooth_s)
        by_row, by_row_rad = point_spread(middle, chain.tip)
        by_joint, by_joint_rad = rolling_by_joint(middle, chain.tip)
        pushed = lateral_velocities(middle, turned[n_h:])
        row = limits.slip_share * math.sqrt(float(pushed.dot(pushed)) / len(pushed))
        row += limits.creep_m_s * dt
        # Misread base joints move the base; misread head joints the head on it.
        head_m, head_rad = self._misreading(chain)
        reading_m = (
            _BOTH_ENDS * limits.joint_std_rad * math.hypot(math.sqrt(2.0) * by_joint, head_m)
        )
        reading_rad = _BOTH_ENDS * limits.joint_std_rad * math.hypot(by_joint_rad, head_rad)
        moved = _Knot(
            joints,
            origin,
            base,
            tip,
            twist + kept * (knot.twist - twist),
            knot.way_m + float(np.linalg.norm(tip - knot.tip)),
            knot.position_growth_m + row * math.sqrt(2.0) * by_row,
            knot.attitude_growth_rad + row * by_row_rad,
            max(knot.reading_m, reading_m),
            max(knot.reading_rad, reading_rad),
        )
        position, attitude = self._std(moved)
        # Written so that it also ends what is not a number.
        if not (position <= limits.max_position_std_m and attitude <= limits.max_attitude_std_rad):
            return Ended(
                End.TOO_UNCERTAIN,
                f"after {age_s:.3f} s the head is known to {1e3 * position:.3g} mm and "
                f"{attitude:.3g} rad (limits {1e3 * limits.max_position_std_m:g} mm, "
                f"{limits.max_attitude_std_rad:g} rad)",
            )
        return moved

    def _misreading(self, chain: HeadChain) -> tuple[float, float]:
        """Return what misreading each head joint by 1 rad does to tip [m] and attitude [rad]."""
        arms = sum(math.dist(chain.tip, pivot) ** 2 for pivot in chain.pivots)
        return math.sqrt(arms), math.sqrt(self._s.n_h)

    def _std(self, knot: _Knot) -> tuple[float, float]:
        limits = self._limits
        return (
            math.hypot(limits.position_std_m, knot.reading_m) + knot.position_growth_m,
            math.hypot(limits.attitude_std_rad, knot.reading_rad) + knot.attitude_growth_rad,
        )

    def _twist(self, joints: _Joints, chain: HeadChain, base: Array) -> Array:
        """Return velocity of the tip and angular velocity of the head in the world, (6,)."""
        n_h = self._s.n_h
        (x, y, turn), _ = rolling(planar_base(self._s, joints.phi[n_h:]), joints.phi_dot[n_h:])
        of_base = (x, y, 0.0), (0.0, 0.0, turn)
        linear, angular = tip_twist(chain, of_base, joints.phi_dot[:n_h].tolist())
        return np.concatenate((base @ np.array(linear), base @ np.array(angular)))

    def _prediction(self, start: HeadEstimate, knot: _Knot) -> Prediction:
        rotation = knot.base @ np.array(self._chain(knot.joints.phi).frame).T
        position_std, attitude_std = self._std(knot)
        return Prediction(
            estimate=HeadEstimate(
                stamp_ns=knot.joints.stamp_ns,
                position=knot.tip,
                rotation=Rotation.from_matrix(rotation),
                velocity=knot.twist[:3],
                angular_velocity=knot.twist[3:],
            ),
            age_s=(knot.joints.stamp_ns - start.stamp_ns) * 1e-9,
            way_m=knot.way_m,
            position_std_m=position_std,
            attitude_std_rad=attitude_std,
        )
