"""What a motion capture system reports of a pose: noisy, at its own rate, and late."""

from __future__ import annotations

import dataclasses
from collections import deque

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.mock.pose_faults import PoseFaults

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Noise:
    """Standard deviations of independent Gaussian errors, per axis.

    Attributes:
        position_m: of the position [m].
        rotation_rad: of a small rotation vector in the world [rad].
    """

    position_m: float = 0.0
    rotation_rad: float = 0.0

    def __post_init__(self) -> None:
        if not (self.position_m >= 0 and self.rotation_rad >= 0):
            raise ValueError(f"noise must not be negative: {self}")


@dataclasses.dataclass(frozen=True)
class CapturedPose:
    """One measurement.

    Attributes:
        time: when the pose was as measured [s].
        position: shape (3,) [m].
        quaternion: [x, y, z, w], of length 1 without faults.
        elsewhere: whether it says to be of another frame: a fault.
        due: when it is reported [s].
    """

    time: float
    position: Array
    quaternion: Array
    elsewhere: bool = False
    due: float = 0.0


class MotionCapture:
    """Measures poses and hands each out after a delay, in order.

    Attributes:
        faults: what may be made to go wrong.
    """

    def __init__(self, noise: Noise, delay_s: float, rng: np.random.Generator) -> None:
        """Set up the cameras.

        Args:
            noise: errors of each measurement.
            delay_s: from the capture to the report [s].
            rng: source of the errors.
        """
        self._noise = noise
        self._delay_s = delay_s
        self._rng = rng
        # Numbers of their own: faults leave the noise of the other poses as it is.
        self.faults = PoseFaults(rng.spawn(1)[0])
        self._waiting: deque[CapturedPose] = deque()

    def capture(self, time: float, position: ArrayLike, quaternion: ArrayLike) -> None:
        """Measure a pose: position (3,) [m], quaternion [x, y, z, w]."""
        noise = self._noise
        turn = self._rng.normal(0.0, 1.0, 3) * noise.rotation_rad
        offset = self._rng.normal(0.0, 1.0, 3) * noise.position_m
        sent = self.faults.spoil(
            time,
            np.asarray(position, dtype=float) + offset,
            _product(_from_rotation_vector(turn), np.asarray(quaternion, dtype=float)),
        )
        if sent is None:
            return
        due = time + self._delay_s + sent.later_s
        self._waiting.append(
            CapturedPose(time, sent.position, sent.quaternion, sent.elsewhere, due)
        )

    @property
    def next_report_at(self) -> float:
        """Time of the next report [s]; infinite if none is waiting."""
        return self._waiting[0].due if self._waiting else float("inf")

    def report(self, now: float) -> list[CapturedPose]:
        """Return the poses whose delay has passed, oldest first."""
        due = []
        while self.next_report_at <= now:
            due.append(self._waiting.popleft())
        return due


def _from_rotation_vector(vector: Array) -> Array:
    angle = float(np.linalg.norm(vector))
    # sinc keeps the division by a vanishing angle out.
    scaled = 0.5 * np.sinc(0.5 * angle / np.pi) * vector
    return np.array([*scaled, np.cos(0.5 * angle)])


def _product(a: Array, b: Array) -> Array:
    """Hamilton product of quaternions [x, y, z, w]: first ``b``, then ``a``."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return np.array(
        [
            aw * bx + bw * ax + ay * bz - az * by,
            aw * by + bw * ay + az * bx - ax * bz,
            aw * bz + bw * az + ax * by - ay * bx,
            aw * bw - ax * bx - ay * by - az * bz,
        ]
    )
