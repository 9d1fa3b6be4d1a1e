"""Pieces of the head's motion, and how each differs from what the joints say.

Poses and joint states come in order of their stamps, each as late as it likes. Poses of a short
while are averaged to a view; a segment goes from one view to the next between which something has
moved. For every hypothesis (``snake_control.control.pose_hypotheses``) the joints say how the head
moved in it.
"""

from __future__ import annotations

import collections
import dataclasses
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import RobotConfig
from snake_control.control.pose_hypotheses import HeadPlace, Hypotheses, Roll
from snake_control.control.pose_watch_limits import WatchLimits
from snake_control.errors import ModelError

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class Segment:
    """A piece of motion.

    Attributes:
        end_ns: when it ended.
        joined: whether it began where the one before ended.
        residuals: measured minus predicted motion in the world, of tip and attitude, (h, 6).
        turned: R_end - R_begin, (3, 3).
        own: variance of the motion itself for each group of axes, (4,).
        begin, end: variance of the views there, (4,).
    """

    end_ns: int
    joined: bool
    residuals: Array
    turned: Array
    own: Array
    begin: Array
    end: Array


@dataclasses.dataclass(frozen=True, eq=False)
class _Pose:
    stamp_ns: int
    position: Array
    quaternion: Array


@dataclasses.dataclass(frozen=True, eq=False)
class _View:
    """Poses and joint angles of a moment, averaged."""

    stamp_ns: int
    position: Array
    rotation: Array
    phi: Array
    position_variance: float
    attitude_variance: float


@dataclasses.dataclass(frozen=True, eq=False)
class _Border:
    """A view at which one segment ends and the next begins."""

    view: _View
    head: HeadPlace


class PoseSegments:
    """Cuts what is measured into segments.

    Give it every joint state (``joints``) and every pose that was accepted, unfiltered (``pose``);
    each returns the segments that end with it.
    """

    def __init__(self, robot: RobotConfig, hypotheses: Hypotheses, limits: WatchLimits) -> None:
        """Begin."""
        self._robot = robot
        self._limits = limits
        self._hypotheses = hypotheses
        self._joints: collections.deque[tuple[int, Array]] = collections.deque(maxlen=500)
        self._poses: collections.deque[_Pose] = collections.deque(maxlen=1000)
        self._last_poses: list[_Pose] = []
        self._noise = [limits.position_std_m**2, limits.attitude_std_rad**2]
        self._noise_count = 0
        self._gathered: list[tuple[_Pose, Array]] = []
        self._found: list[Segment] = []
        self._last: _View | None = None
        self._roll = Roll(hypotheses, robot)
        self._rolled_to: Array = np.zeros(robot.joints)
        self._interrupt()

    def _interrupt(self) -> None:
        """Begin a new segment with the next view."""
        self._gathered = []
        self._border: _Border | None = None
        self._joined = False

    def joints(self, stamp_ns: int, phi: ArrayLike) -> list[Segment]:
        """Take one joint state: when it was read [ns], and the angles, (n-1,) [rad].

        Raises:
            ModelError: wrong shape or not finite.
        """
        angles = np.array(phi, dtype=float)
        if angles.shape != (self._robot.joints,) or not np.isfinite(angles).all():
            raise ModelError(
                f"joint angles: expected {self._robot.joints} finite numbers, got {angles}"
            )
        if self._joints and stamp_ns <= self._joints[-1][0]:
            return []
        self._joints.append((stamp_ns, angles))
        return self._align()

    def pose(self, stamp_ns: int, position: ArrayLike, quaternion: ArrayLike) -> list[Segment]:
        """Take one pose: when it was captured [ns], position (3,) [m], quaternion [x, y, z, w]."""
        xyzw = np.array(quaternion, dtype=float)
        if self._poses and stamp_ns <= self._poses[-1].stamp_ns:
            return []
        if self._last_poses:
            if stamp_ns <= self._last_poses[-1].stamp_ns:
                return []
            # q and -q are the same attitude.
            xyzw = math.copysign(1.0, xyzw.dot(self._last_poses[-1].quaternion)) * xyzw
        pose = _Pose(stamp_ns, np.array(position, dtype=float), xyzw)
        self._learn_noise(pose)
        self._poses.append(pose)
        return self._align()

    def _learn_noise(self, pose: _Pose) -> None:
        """Learn the noise of single poses from second differences, which hardly see motion."""
        last = [*self._last_poses[-2:], pose]
        self._last_poses = last
        if len(last) < 3 or last[2].stamp_ns - last[0].stamp_ns > 1e9 * self._limits.gap_s:
            return
        self._noise_count += 1
        gain = max(0.02, 1.0 / self._noise_count)
        for k, scale in enumerate((1.0, 4.0)):
            values = [each.quaternion if k else each.position for each in last]
            second = values[2] - 2.0 * values[1] + values[0]
            # Three axes, 1 + 4 + 1 times the variance of one pose; a quaternion has half angles.
            measured = scale * float(second.dot(second)) / 18.0
            self._noise[k] += gain * (measured - self._noise[k])

    def _align(self) -> list[Segment]:
        """Give every pose the joint angles of its time, as soon as they are known."""
        self._found = []
        joints, gap_ns = self._joints, round(1e9 * self._limits.gap_s)
        while self._poses and joints and joints[-1][0] >= self._poses[0].stamp_ns:
            pose = self._poses.popleft()
            # From the newest: the delay of the poses is a few joint states.
            at = len(joints) - 1
            while at >= 0 and joints[at][0] > pose.stamp_ns:
                at -= 1
            if at < 0:
                continue
            begin_ns, phi = joints[at]
            if begin_ns < pose.stamp_ns:
                end_ns, after = joints[at + 1]
                if end_ns - begin_ns > gap_ns:
                    self._interrupt()
                    continue
                phi = phi + (pose.stamp_ns - begin_ns) / (end_ns - begin_ns) * (after - phi)
            self._gather(pose, phi, gap_ns)
        return self._found

    def _gather(self, pose: _Pose, phi: Array, gap_ns: int) -> None:
        gathered = self._gathered
        if gathered:
            if pose.stamp_ns - gathered[-1][0].stamp_ns > gap_ns:
                self._interrupt()
            elif pose.stamp_ns - gathered[0][0].stamp_ns >= 1e9 * self._limits.view_s:
                self._see(self._view(gathered), gap_ns)
                self._gathered = []
        self._gathered.append((pose, phi))

    def _view(self, gathered: list[tuple[_Pose, Array]]) -> _View:
        limits, count = self._limits, len(gathered)
        first_ns = gathered[0][0].stamp_ns
        ahead = sum(pose.stamp_ns - first_ns for pose, _ in gathered)
        x, y, z, w = sum((pose.quaternion for pose, _ in gathered), np.zeros(4)).tolist()
        n = x * x + y * y + z * z + w * w or 1.0
        rotation = np.array(
            (
                (1 - 2 * (y * y + z * z) / n, 2 * (x * y - z * w) / n, 2 * (x * z + y * w) / n),
                (2 * (x * y + z * w) / n, 1 - 2 * (x * x + z * z) / n, 2 * (y * z - x * w) / n),
                (2 * (x * z - y * w) / n, 2 * (y * z + x * w) / n, 1 - 2 * (x * x + y * y) / n),
            )
        )
        return _View(
            first_ns + ahead // count,
            sum((pose.position for pose, _ in gathered), np.zeros(3)) / count,
            rotation,
            sum((phi for _, phi in gathered), np.zeros(self._robot.joints)) / count,
            max(limits.position_std_m**2, self._noise[0]) / count,
            max(limits.attitude_std_rad**2, self._noise[1]) / count,
        )

    def _see(self, view: _View, gap_ns: int) -> None:
        limits, border = self._limits, self._border
        last, self._last = self._last, view
        if last is not None and view.stamp_ns - last.stamp_ns > gap_ns:
            self._interrupt()
            border = None
        if border is None:
            self._begin(_Border(view, self._hypotheses.head(view.phi)), joined=False)
            return
        joint = float(np.abs(view.phi - border.view.phi).max())
        way = math.dist(view.position, border.view.position)
        turn = _angle(view.rotation @ border.view.rotation.T)
        noise_m = 6.0 * math.sqrt(view.position_variance + border.view.position_variance)
        noise_rad = 6.0 * math.sqrt(view.attitude_variance + border.view.attitude_variance)
        enough = (
            joint >= limits.segment_rad
            or way >= max(limits.segment_m, noise_m)
            or turn >= max(limits.segment_rad, noise_rad)
        )
        enough &= view.stamp_ns - border.view.stamp_ns >= 1e9 * limits.segment_s
        tip = border.head.tip
        if enough or np.abs(view.phi - self._rolled_to).max() > 0.3 * limits.segment_rad:
            self._roll.turn(self._rolled_to, view.phi, tip)
            self._rolled_to = view.phi
        if enough:
            end = _Border(view, self._hypotheses.head(view.phi))
            self._found.append(self._segment(border, end, way, turn))
            self._begin(end, joined=True)

    def _begin(self, border: _Border, joined: bool) -> None:
        self._border = border
        self._joined = joined
        self._roll = Roll(self._hypotheses, self._robot)
        self._rolled_to = border.view.phi

    def _segment(self, begin: _Border, end: _Border, way: float, turn: float) -> Segment:
        limits, roll = self._limits, self._roll
        c, s = np.cos(roll.planar[:, 2]), np.sin(roll.planar[:, 2])
        turning = np.zeros((len(c), 3, 3))
        turning[:, 0, 0] = turning[:, 1, 1] = c
        turning[:, 1, 0], turning[:, 0, 1] = s, -s
        turning[:, 2, 2] = 1.0
        moved = np.einsum("hij,hj->hi", turning, end.head.tips) - begin.head.tips
        moved[:, :2] += roll.planar[:, :2]
        base = begin.view.rotation @ begin.head.axes
        predicted = np.einsum("hij,hj->hi", base, moved)
        attitude = base @ turning @ np.swapaxes(end.head.axes, 1, 2)
        residuals = np.empty((len(c), 6))
        residuals[:, :3] = end.view.position - begin.view.position - predicted
        residuals[:, 3:] = _rotation_vectors(end.view.rotation @ np.swapaxes(attitude, 1, 2))

        duration_s = (end.view.stamp_ns - begin.view.stamp_ns) * 1e-9
        row = limits.slip_share * roll.row_m + limits.creep_m_s * duration_s
        share_m = limits.model_share * max(way, float(np.linalg.norm(predicted[0])))
        share_rad = limits.model_share * max(turn, _angle(attitude[0] @ begin.view.rotation.T))
        by_row_m, by_row_rad = roll.by_row
        rise = max(abs(float(residuals[0, 2] + predicted[0, 2])), abs(float(predicted[0, 2])))
        own = (
            (row * by_row_m) ** 2 + share_m**2,
            (limits.model_share * rise) ** 2 + (limits.floor_share * way) ** 2,
            share_rad**2,
            (row * by_row_rad) ** 2 + share_rad**2,
        )
        return Segment(
            end.view.stamp_ns,
            self._joined,
            residuals,
            end.view.rotation - begin.view.rotation,
            np.array(own),
            self._seen(begin, roll),
            self._seen(end, roll),
        )

    def _seen(self, border: _Border, roll: Roll) -> Array:
        """Return the variance of a view, with that of the joints' ticks, for each group of axes."""
        joint = self._limits.joint_std_rad**2
        by_joint_m, by_joint_rad = roll.by_joint
        position = border.view.position_variance + joint * border.head.misread_m**2
        attitude = border.view.attitude_variance + joint * border.head.misread_rad**2
        return np.array(
            (
                position + joint * by_joint_m**2,
                position,
                attitude,
                attitude + joint * by_joint_rad**2,
            )
        )


def _angle(rotation: Array) -> float:
    """Return the angle of a rotation matrix [rad]."""
    return math.acos(min(1.0, max(-1.0, 0.5 * (float(np.trace(rotation)) - 1.0))))


def _rotation_vectors(rotations: Array) -> Array:
    """Return the rotation vectors of (h, 3, 3) rotations, to first order; sines of large angles."""
    return 0.5 * np.stack(
        (
            rotations[:, 2, 1] - rotations[:, 1, 2],
            rotations[:, 0, 2] - rotations[:, 2, 0],
            rotations[:, 1, 0] - rotations[:, 0, 1],
        ),
        axis=1,
    )
