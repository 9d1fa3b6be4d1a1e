"""What could be wrong with a robot's joints, and how its head would then have moved.

Each hypothesis says which joint angles there really are when certain ones are read: as configured;
one joint turning the wrong way; two joints of the same axis with their ids exchanged. All of them
are followed at once, as the wheels make each roll (``snake_control.model.rolling``).
"""

from __future__ import annotations

import dataclasses
import enum
import math

import numpy as np
from numpy.typing import NDArray

from snake_control.config import RobotConfig
from snake_control.model.constraints import lateral_velocities
from snake_control.model.geometry import planar_base
from snake_control.model.head_chain import head_chain
from snake_control.model.rolling import point_spread, rolling_by_joint, rolling_steps
from snake_control.model.structure import Structure, structure
from snake_control.model.vector import Vector

Array = NDArray[np.float64]

MOST_PAIRS = 120
"""Pairs of joints that are looked at; on long robots those nearest to each other."""


class Cause(enum.Enum):
    """Why the head moves otherwise than the joints say."""

    NOTHING = "nothing"
    WRONG_DIRECTION = "wrong_direction"
    SWAPPED_JOINTS = "swapped_joints"
    WRONG_MARKER_OFFSET = "wrong_marker_offset"
    WHEEL_SLIP = "wheel_slip"


@dataclasses.dataclass(frozen=True)
class Hypothesis:
    """A cause, and the joints that it concerns, counted from 1."""

    cause: Cause
    joints: tuple[int, ...] = ()


@dataclasses.dataclass(frozen=True, eq=False)
class HeadPlace:
    """Where the head is in base coordinates, for each hypothesis.

    Attributes:
        tips: (h, 3) [m].
        axes: forward, left and up of the head as rows, (h, 3, 3).
        tip: as configured [m].
        misread_m, misread_rad: what misreading each head joint by 1 rad does to tip and attitude
            (root of the sum of squares), as configured.
    """

    tips: Array
    axes: Array
    tip: Vector
    misread_m: float
    misread_rad: float


class Hypotheses:
    """All hypotheses about the joints of one robot.

    Attributes:
        each: the hypotheses; the first is that nothing is wrong.
    """

    def __init__(self, robot: RobotConfig) -> None:
        """List the hypotheses for a robot."""
        self._s: Structure = structure(robot)
        joints, axes = robot.joints, robot.joint_axes
        pairs = [(a, b) for a in range(joints) for b in range(a + 1, joints) if axes[a] == axes[b]]
        pairs = sorted(pairs, key=lambda pair: (pair[1] - pair[0], pair))[:MOST_PAIRS]
        self.each = [Hypothesis(Cause.NOTHING)]
        self.each += [Hypothesis(Cause.WRONG_DIRECTION, (a + 1,)) for a in range(joints)]
        self.each += [Hypothesis(Cause.SWAPPED_JOINTS, (a + 1, b + 1)) for a, b in pairs]
        self._read = np.tile(np.arange(joints), (len(self.each), 1))
        self._sign = np.ones(self._read.shape)
        for row, hypothesis in enumerate(self.each):
            which = [joint - 1 for joint in hypothesis.joints]
            self._read[row, which] = which[::-1]
            if hypothesis.cause is Cause.WRONG_DIRECTION:
                self._sign[row, which] = -1.0
        # Many hypotheses leave the head joints alone, and share their chain.
        n_h = self._s.n_h
        heads = np.hstack((self._read[:, :n_h], self._sign[:, :n_h]))
        _, self._one_of, self._chain_of = np.unique(
            heads, axis=0, return_index=True, return_inverse=True
        )
        self._chain_of = self._chain_of.ravel()

    def __len__(self) -> int:
        return len(self.each)

    def angles(self, phi: Array) -> Array:
        """Return the true joint angles if ``phi`` are read, (h, n-1) [rad]."""
        true: Array = phi[self._read] * self._sign
        return true

    def head(self, phi: Array) -> HeadPlace:
        """Return where the head is if ``phi`` are read, (n-1,) [rad]."""
        angles = self.angles(phi)[self._one_of, : self._s.n_h].tolist()
        chains = [head_chain(self._s, each) for each in angles]
        own = chains[self._chain_of[0]]
        return HeadPlace(
            np.array([chain.tip for chain in chains])[self._chain_of],
            np.array([chain.frame for chain in chains])[self._chain_of],
            own.tip,
            math.sqrt(sum(math.dist(own.tip, pivot) ** 2 for pivot in own.pivots)),
            math.sqrt(self._s.n_h),
        )


class Roll:
    """How the base has rolled since a moment, for each hypothesis.

    Attributes:
        planar: x, y and heading in the base frame of that moment, (h, 3) [m, m, rad].
        row_m: way that the joints alone would have pushed a wheel sideways (root of the mean
            square over the wheels, added up), as configured [m].
        by_joint: what misreading each base joint by 1 rad does to tip, per axis, and heading, as
            configured and of late [m, rad].
    """

    def __init__(self, hypotheses: Hypotheses, robot: RobotConfig) -> None:
        """Begin at rest."""
        self._hypotheses = hypotheses
        self._s = structure(robot)
        self.planar: Array = np.zeros((len(hypotheses), 3))
        self.row_m = 0.0
        self._weighted = [0.0, 0.0]
        self._by_row = self.by_joint = (0.0, 0.0)

    @property
    def by_row(self) -> tuple[float, float]:
        """What an error of 1 m of each wheel row does to tip [m] and heading [rad]."""
        if not self.row_m > 0.0:
            return self._by_row
        return self._weighted[0] / self.row_m, self._weighted[1] / self.row_m

    def turn(self, before: Array, after: Array, tip: Vector) -> None:
        """Go on as the angles that are read change, (n-1,) each [rad]; ``tip`` as configured."""
        n_h, planar = self._s.n_h, self.planar
        begin = self._hypotheses.angles(before)[:, n_h:]
        turned = self._hypotheses.angles(after)[:, n_h:] - begin
        middle = begin + 0.5 * turned
        step = rolling_steps(planar_base(self._s, middle), turned)
        heading = planar[:, 2] + 0.5 * step[:, 2]
        c, s = np.cos(heading), np.sin(heading)
        planar[:, 0] += c * step[:, 0] - s * step[:, 1]
        planar[:, 1] += s * step[:, 0] + c * step[:, 1]
        planar[:, 2] += step[:, 2]
        own = planar_base(self._s, middle[0])
        pushed = lateral_velocities(own, turned[0])
        row = math.sqrt(float(pushed.dot(pushed)) / len(pushed))
        self._by_row = point_spread(own, tip)
        self.by_joint = rolling_by_joint(own, tip)
        self.row_m += row
        self._weighted = [w + row * by for w, by in zip(self._weighted, self._by_row, strict=True)]
