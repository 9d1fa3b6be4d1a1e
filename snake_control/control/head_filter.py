"""Filters the measured head pose; at constant velocity the estimate does not lag.

Per axis it is a critically damped g-h (alpha-beta) filter: both poles at
``theta = exp(-omega_0 dt)``, hence ``g = 1 - theta^2`` and ``h = (1 - theta)^2``, with ``dt`` the
difference of two stamps. The measured position passes to the estimate as
``(2 omega_0 s + omega_0^2) / (s + omega_0)^2``, whose -3 dB frequency ``cutoff_hz`` fixes
``omega_0``. A constant velocity is followed without a steady error; a constant acceleration ``a``
leaves about ``a / omega_0^2``.

White noise of standard deviation 1 at ``1 / T`` poses per second leaves
``sqrt((2 g^2 + 2 h - 3 g h) / d)`` in the position and ``sqrt(2 h^2 / d) / T`` in the velocity,
with ``d = g (4 - 2 g - h)``. With 3 Hz and 100 poses per second these are 0.30 and 1.05 1/s, so
0.5 mm of noise leaves 0.15 mm and 0.5 mm/s.

The attitude is filtered the same way: the error is the rotation vector, in the world, from
predicted to measured attitude, and the rate is the angular velocity in the world.

The covariance of the estimate follows the filter through each step, whatever gains it had: with
errors ``e_p`` and ``e_v`` of pose and rate before, and ``n`` of the measurement,

    e_p' = (1 - g) (e_p + dt e_v) + g n,    e_v' = e_v + h / dt (n - e_p - dt e_v).

It comes down to the figures above. What the filter lags behind an acceleration is not in it.
"""

from __future__ import annotations

import dataclasses
import enum
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

QUATERNION_TOLERANCE = 0.01
"""How far the length of a measured quaternion may be from 1."""

MAX_DISTANCE_M = 1000.0
"""A pose further from the origin than this is no measurement."""

# |H|^2 = 1/2 at (omega / omega_0)^2 = 3 + sqrt(10).
_CUTOFF_OVER_OMEGA_0 = math.sqrt(3.0 + math.sqrt(10.0))


class Reason(enum.Enum):
    """Why a measured pose was not used."""

    NOT_FINITE = "not finite"
    TOO_FAR = "too far from the origin"
    NOT_A_ROTATION = "its quaternion is not of length 1"
    OUT_OF_ORDER = "not newer than the pose before"
    UNSTAMPED = "no time of capture"
    AHEAD_OF_CLOCK = "stamped ahead of this computer's clock"
    WRONG_FRAME = "of another frame"
    NOT_TRACKED = "the body was not seen"
    REPEATED = "the pose before once more"
    FROZEN = "the same pose for too long"
    JUMP = "further from the last pose than the head can have moved"

    @property
    def is_fault(self) -> bool:
        """Whether it speaks against the source, and not only against this pose."""
        return self not in (Reason.OUT_OF_ORDER, Reason.REPEATED)


@dataclasses.dataclass(frozen=True)
class Rejection:
    """A measured pose that was not used.

    Attributes:
        reason: what kind of fault.
        text: the reason in words, with the value.
    """

    reason: Reason
    text: str


@dataclasses.dataclass(frozen=True)
class HeadEstimate:
    """Filtered motion of the head at one time.

    Attributes:
        stamp_ns: time of capture of the pose that was used last [ns].
        position: of the tip in the world, shape (3,) [m].
        rotation: attitude of the head in the world.
        velocity: of the tip in the world, shape (3,) [m/s].
        angular_velocity: of the head, in the world, shape (3,) [rad/s].
        pose_covariance: of position and small turns about the axes of the world, shape (6, 6)
            [m^2, m rad, rad^2].
        twist_covariance: of velocity and angular velocity in the world, shape (6, 6).
    """

    stamp_ns: int
    position: Array
    rotation: Rotation
    velocity: Array
    angular_velocity: Array
    pose_covariance: Array = dataclasses.field(default_factory=lambda: np.zeros((6, 6)))
    twist_covariance: Array = dataclasses.field(default_factory=lambda: np.zeros((6, 6)))

    @property
    def is_finite(self) -> bool:
        """Whether all of it are numbers."""
        parts = (self.position, self.rotation.as_quat(), self.velocity, self.angular_velocity)
        return bool(np.isfinite(np.concatenate(parts)).all())


def gains(cutoff_hz: float, dt: float) -> tuple[float, float]:
    """Return g and h of the filter for one step.

    Args:
        cutoff_hz: -3 dB frequency from measured to estimated position.
        dt: time since the measurement before [s], above 0.
    """
    omega_0 = 2 * math.pi * cutoff_hz / _CUTOFF_OVER_OMEGA_0
    # expm1 keeps g and h exact for steps much shorter than the filter's memory.
    return -math.expm1(-2 * omega_0 * dt), math.expm1(-omega_0 * dt) ** 2


class HeadFilter:
    """Estimates pose and velocity of the head from stamped, noisy, possibly faulty poses."""

    def __init__(
        self,
        cutoff_hz: float,
        timeout_s: float,
        max_speed_m_s: float = 0.0,
        max_turning_rad_s: float = 0.0,
    ) -> None:
        """Create the filter without an estimate.

        Args:
            cutoff_hz: -3 dB frequency from measured to estimated position.
            timeout_s: after a gap longer than this the motion before it says nothing any more:
                the estimate starts anew from the next pose, at rest.
            max_speed_m_s, max_turning_rad_s: what it may in truth be doing then; twice the
                standard deviation of the rate that it starts with.
        """
        self._cutoff_hz = cutoff_hz
        self._timeout_ns = round(timeout_s * 1e9)
        self._start_twist = np.diag(
            np.square(np.repeat([0.5 * max_speed_m_s, 0.5 * max_turning_rad_s], 3))
        )
        self._estimate: HeadEstimate | None = None
        # Covariance of the errors of pose and rate with each other.
        self._cross = np.zeros((6, 6))

    @property
    def estimate(self) -> HeadEstimate | None:
        """The newest estimate, ``None`` before the first good pose."""
        return self._estimate

    def reset(self) -> None:
        """Forget everything, for a clock that was set back."""
        self._estimate = None

    def go_on_from(self, estimate: HeadEstimate) -> None:
        """Put an estimate from elsewhere in the place of its own, such as one of a prediction.

        The next pose is filtered from there; errors of its pose and of its rate are taken for
        independent.
        """
        self._estimate = estimate
        self._cross = np.zeros((6, 6))

    def update(
        self,
        stamp_ns: int,
        position: ArrayLike,
        quaternion: ArrayLike,
        covariance: Array | None = None,
    ) -> HeadEstimate | Rejection:
        """Take one measured pose.

        Args:
            stamp_ns: time of capture [ns].
            position: of the tip in the world, shape (3,) [m].
            quaternion: attitude of the head in the world, [x, y, z, w].
            covariance: of position and small turns about the axes of the world, shape (6, 6)
                [m^2, m rad, rad^2]; none for a measurement without noise.

        Returns:
            The estimate at ``stamp_ns``, or why the pose was not used (the estimate then stays).
        """
        z = np.asarray(position, dtype=float)
        xyzw = np.asarray(quaternion, dtype=float)
        if rejection := unusable(z, xyzw):
            return rejection
        measured = Rotation.from_quat(xyzw)
        noise = np.zeros((6, 6)) if covariance is None else covariance
        before = self._estimate
        if before is None or stamp_ns - before.stamp_ns > self._timeout_ns:
            self._cross = np.zeros((6, 6))
            self._estimate = HeadEstimate(
                stamp_ns, z.copy(), measured, np.zeros(3), np.zeros(3), noise, self._start_twist
            )
            return self._estimate
        dt = (stamp_ns - before.stamp_ns) * 1e-9
        if dt <= 0:
            return Rejection(
                Reason.OUT_OF_ORDER, f"pose was captured {-dt:.4f} s before the one before it"
            )
        g, h = gains(self._cutoff_hz, dt)
        predicted = before.position + before.velocity * dt
        residual = z - predicted
        predicted_rotation = Rotation.from_rotvec(before.angular_velocity * dt) * before.rotation
        rotation_residual = (measured * predicted_rotation.inv()).as_rotvec()
        of_pose, cross, of_twist = self._covariances(before, g, h, dt, noise)
        estimate = HeadEstimate(
            stamp_ns=stamp_ns,
            position=predicted + g * residual,
            rotation=Rotation.from_rotvec(g * rotation_residual) * predicted_rotation,
            velocity=before.velocity + h / dt * residual,
            angular_velocity=before.angular_velocity + h / dt * rotation_residual,
            pose_covariance=of_pose,
            twist_covariance=of_twist,
        )
        if not estimate.is_finite:
            self.reset()
            return Rejection(Reason.NOT_FINITE, "the filter lost its numbers and starts anew")
        self._estimate, self._cross = estimate, cross
        return estimate

    def _covariances(
        self, before: HeadEstimate, g: float, h: float, dt: float, noise: Array
    ) -> tuple[Array, Array, Array]:
        """Covariances after a step: of the pose, of pose and rate with each other, of the rate."""
        pp, pv, vv = before.pose_covariance, self._cross, before.twist_covariance
        vp = pv.T
        a, b = 1 - g, (1 - g) * dt
        c, d = -h / dt, 1 - h
        k = h / dt
        return (
            a * a * pp + a * b * (pv + vp) + b * b * vv + g * g * noise,
            a * c * pp + a * d * pv + b * c * vp + b * d * vv + g * k * noise,
            c * c * pp + c * d * (pv + vp) + d * d * vv + k * k * noise,
        )


def unusable(position: Array, quaternion: Array) -> Rejection | None:
    """Return why these seven numbers are no pose, ``None`` if they are one.

    Args:
        position: shape (3,) [m].
        quaternion: [x, y, z, w].
    """
    if not (np.isfinite(position).all() and np.isfinite(quaternion).all()):
        return Rejection(
            Reason.NOT_FINITE, f"pose is not finite: position {position}, quaternion {quaternion}"
        )
    if np.abs(position).max() > MAX_DISTANCE_M:
        return Rejection(
            Reason.TOO_FAR, f"position {position} is beyond {MAX_DISTANCE_M:g} m from the origin"
        )
    norm = float(np.linalg.norm(quaternion))
    if abs(norm - 1.0) > QUATERNION_TOLERANCE:
        return Rejection(Reason.NOT_A_ROTATION, f"quaternion has length {norm:.3g}, it must be 1")
    return None
