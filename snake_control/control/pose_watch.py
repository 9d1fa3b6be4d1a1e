"""Watches whether the head moves as the joints say, and names what is wrong if it does not.

The measured motion is cut into segments in each of which something moves. For every hypothesis
(``snake_control.control.pose_hypotheses``) the joints say how the head moved in each; what remains
of the measured motion, weighted with what may be expected (noise of the poses, ticks of the joints,
a share of slip), is the hypothesis' cost. It is a chi-square: with K segments about 6 K for what is
true. The same for a marker that is not where it is thought to be, at d in the frame of the head,
which adds (R_end - R_begin) d to every segment: linear least squares.

A cause is named if what is configured cannot be true (its cost is a multiple of 6 K), the cause
explains nearly all of that, and no other does nearly as well, several times in a row. If nothing
explains the motion, wheels slide. Segments come with motion only: at rest nothing is judged.
"""

from __future__ import annotations

import collections
import dataclasses
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import lapack

from snake_control.config import RobotConfig
from snake_control.control.pose_hypotheses import Cause, HeadPlace, Hypotheses, Hypothesis, Roll
from snake_control.control.pose_watch_limits import WatchLimits
from snake_control.errors import ModelError

Array = NDArray[np.float64]

_AXES = ((0, 1), (2,), (3, 4), (5,))
"""Groups of axes with the same uncertainty: x, y; z; turning about x, y; about z."""


@dataclasses.dataclass(frozen=True)
class Verdict:
    """What the watch thinks.

    Attributes:
        cause: what is wrong, ``NOTHING`` if nothing is known to be.
        joints: the joints that it concerns, from 1.
        marker_offset_m: where the marker is in the frame of the head, relative to where it is
            thought to be, (3,) [m]; 0 for other causes.
        explained: share of the unexpected motion that the cause explains, 0..1.
        residual: root mean square of what remains of the measured motion as configured, in
            standard deviations: about 1 or less if all is well; NaN before there is motion.
        segments: how many pieces of motion this rests on.
        text: in words.
    """

    cause: Cause = Cause.NOTHING
    joints: tuple[int, ...] = ()
    marker_offset_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    explained: float = 0.0
    residual: float = math.nan
    segments: int = 0
    text: str = "too little motion yet to compare pose and joints"


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


@dataclasses.dataclass(frozen=True, eq=False)
class _Segment:
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
class _Costs:
    """What remains of the motion under each hypothesis.

    Attributes:
        each: cost of each hypothesis, the marker's last, (h + 1,).
        suspicion: cost as configured over what is expected, of the worst group of axes, of all
            segments or of those of late.
        offset: of the marker in the frame of the head, (3,) [m].
        offset_seen: how far its direction has turned, root of the mean square [rad].
        beside_offset: cost with that offset over what is expected, of the worst group of axes.
    """

    each: Array
    suspicion: float
    offset: Array
    offset_seen: float
    beside_offset: float

    def explained(self, which: int) -> float:
        """Return the share of the cost as configured that a hypothesis explains, 0..1."""
        return max(0.0, 1.0 - float(self.each[which] / max(self.each[0], 1e-9)))


class PoseWatch:
    """Compares measured poses with joint angles.

    Give it every joint state (``joints``) and every pose that was accepted, unfiltered (``pose``);
    read ``verdict`` at any time. Both may come late, each in order of its stamps.
    """

    def __init__(self, robot: RobotConfig, limits: WatchLimits | None = None) -> None:
        """Begin to watch; the default limits for none given."""
        self._robot = robot
        self._limits = WatchLimits() if limits is None else limits
        self._hypotheses = Hypotheses(robot)
        self.reset()

    def reset(self) -> None:
        """Forget everything: after a change of the configuration, or of the clock."""
        limits = self._limits
        self._joints: collections.deque[tuple[int, Array]] = collections.deque(maxlen=500)
        self._poses: collections.deque[_Pose] = collections.deque(maxlen=1000)
        self._last_poses: list[_Pose] = []
        self._noise = [limits.position_std_m**2, limits.attitude_std_rad**2]
        self._noise_count = 0
        self._gathered: list[tuple[_Pose, Array]] = []
        self._segments: collections.deque[_Segment] = collections.deque(
            maxlen=limits.window_segments
        )
        self._last: _View | None = None
        self._roll = Roll(self._hypotheses, self._robot)
        self._rolled_to: Array = np.zeros(self._robot.joints)
        self._interrupt()
        self._in_a_row: tuple[Hypothesis, int] = (Hypothesis(Cause.NOTHING), 0)
        self.verdict = Verdict()

    def _interrupt(self) -> None:
        """Begin a new segment with the next view."""
        self._gathered = []
        self._border: _Border | None = None
        self._joined = False

    def joints(self, stamp_ns: int, phi: ArrayLike) -> None:
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
            return
        self._joints.append((stamp_ns, angles))
        self._align()

    def pose(self, stamp_ns: int, position: ArrayLike, quaternion: ArrayLike) -> None:
        """Take one pose: when it was captured [ns], position (3,) [m], quaternion [x, y, z, w]."""
        xyzw = np.array(quaternion, dtype=float)
        if self._poses and stamp_ns <= self._poses[-1].stamp_ns:
            return
        if self._last_poses:
            if stamp_ns <= self._last_poses[-1].stamp_ns:
                return
            # q and -q are the same attitude.
            xyzw = math.copysign(1.0, xyzw.dot(self._last_poses[-1].quaternion)) * xyzw
        pose = _Pose(stamp_ns, np.array(position, dtype=float), xyzw)
        self._learn_noise(pose)
        self._poses.append(pose)
        self._align()

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

    def _align(self) -> None:
        """Give every pose the joint angles of its time, as soon as they are known."""
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
            self._segments.append(self._segment(border, end, way, turn))
            self._begin(end, joined=True)
            self._judge(view.stamp_ns)

    def _begin(self, border: _Border, joined: bool) -> None:
        self._border = border
        self._joined = joined
        self._roll = Roll(self._hypotheses, self._robot)
        self._rolled_to = border.view.phi

    def _segment(self, begin: _Border, end: _Border, way: float, turn: float) -> _Segment:
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
        return _Segment(
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

    def _judge(self, now_ns: int) -> None:
        limits, segments = self._limits, self._segments
        while now_ns - segments[0].end_ns > 1e9 * limits.window_s:
            segments.popleft()
        if len(segments) < limits.least_segments:
            return
        costs = self._costs(list(segments))
        found = self._found(costs, len(segments))
        name = Hypothesis(self.verdict.cause, self.verdict.joints)
        if found is None:
            self._in_a_row = (Hypothesis(Cause.NOTHING), 0)
        else:
            count = self._in_a_row[1] + 1 if self._in_a_row[0] == found else 1
            self._in_a_row = (found, count)
            needed = {
                Cause.NOTHING: limits.clear,
                Cause.WRONG_MARKER_OFFSET: limits.confirm_offset,
                Cause.WHEEL_SLIP: limits.confirm_slip,
            }
            if count >= needed.get(found.cause, limits.confirm):
                name = found
        self.verdict = self._verdict(name, costs)

    def _found(self, costs: _Costs, segments: int) -> Hypothesis | None:
        """Return what these costs alone speak for; ``None`` if they speak for nothing yet."""
        limits, each = self._limits, self._hypotheses.each
        as_it_is, marker = costs.each[0], costs.each[-1]
        best, second = (costs.each[1:].argsort()[:2] + 1).tolist()
        expected = 6.0 * segments
        clear_cut = costs.each[second] >= max(
            limits.factor * costs.each[best], costs.each[best] + limits.margin
        )
        if best == len(each):
            # Weights may be too large or too small: the offset is judged by what remains.
            gain = (as_it_is - marker) / (3.0 * max(costs.beside_offset, 1e-9))
            far = float(np.linalg.norm(costs.offset)) >= limits.least_offset_m
            turned = costs.offset_seen >= limits.offset_seen
            if (
                far
                and turned
                and gain >= limits.offset_gain
                and marker <= limits.plausible * expected
            ):
                return Hypothesis(Cause.WRONG_MARKER_OFFSET)
        if costs.suspicion <= limits.suspicious:
            return Hypothesis(Cause.NOTHING)
        explained = costs.explained(best)
        plausible = costs.each[best] <= limits.plausible * expected
        if best < len(each) and clear_cut and plausible and explained >= limits.explained:
            return each[best]
        if explained < limits.unexplained or not plausible:
            return Hypothesis(Cause.WHEEL_SLIP)
        return None

    def _verdict(self, name: Hypothesis, costs: _Costs) -> Verdict:
        marker, explained = (0.0, 0.0, 0.0), 0.0
        if name.cause is Cause.WRONG_MARKER_OFFSET:
            x, y, z = costs.offset.tolist()
            marker, explained = (x, y, z), costs.explained(-1)
        elif name.joints:
            explained = costs.explained(self._hypotheses.each.index(name))
        residual = math.sqrt(costs.suspicion)
        return Verdict(
            name.cause,
            name.joints,
            marker,
            explained,
            residual,
            len(self._segments),
            _TEXTS[name.cause].format(
                joints=" and ".join(map(str, name.joints)),
                offset=", ".join(f"{1e3 * value:.0f}" for value in marker),
                share=100.0 * explained,
                residual=residual,
            ),
        )

    def _costs(self, segments: list[_Segment]) -> _Costs:
        """Weigh all segments together.

        Noise of a view enters the two segments that meet there with opposite signs, so the
        covariance of one axis of all segments is tridiagonal.
        """
        count, h = len(segments), len(self._hypotheses)
        residuals = np.array([segment.residuals for segment in segments])
        turned = np.array([segment.turned for segment in segments])
        own = np.array([segment.own + segment.begin + segment.end for segment in segments])
        between = np.array([-b.begin if b.joined else np.zeros(4) for b in segments[1:]])
        costs = np.zeros(h + 1)
        information, right = np.zeros((4, 3, 3)), np.zeros((4, 3))
        suspicion, own_costs = 0.0, []
        for group, axes in enumerate(_AXES):
            r = residuals[:, :, axes].reshape(count, -1)
            both = np.hstack((r, *(turned[:, axis] for axis in axes if axis < 3)))
            _, _, weighted, info = lapack.dptsv(own[:, group], between[:, group], both)
            if info:
                raise ModelError(f"the covariance of {count} segments is not positive definite")
            products = r * weighted[:, : r.shape[1]]
            costs[:h] += products.sum(axis=0).reshape(h, -1).sum(axis=1)
            by_segment = products[:, : len(axes)].sum(axis=1) / len(axes)
            recent = by_segment[-self._limits.recent_segments :].mean()
            suspicion = max(suspicion, float(by_segment.mean()), float(recent))
            own_costs.append(float(by_segment.sum()) * len(axes))
            for k, axis in enumerate(axis for axis in axes if axis < 3):
                of_offset = weighted[:, r.shape[1] + 3 * k : r.shape[1] + 3 * k + 3]
                information[group] += turned[:, axis].T @ of_offset
                right[group] += of_offset.T @ residuals[:, 0, axis]
        # The weights may be too small or too large, what is known beforehand must not be.
        known = np.eye(3) * ((costs[0] / (6.0 * count) + 1e-9) / _OFFSET_STD_M**2)
        offset = np.linalg.solve(information.sum(axis=0) + known, right.sum(axis=0))
        gains = (2.0 * right - information @ offset) @ offset
        costs[h] = costs[0] - gains.sum()
        beside = [
            (own_cost - gain) / (count * len(axes))
            for own_cost, gain, axes in zip(own_costs, gains.tolist(), _AXES, strict=True)
        ]
        # What is chosen among many, or fitted, is better by chance.
        costs[1:h] += 2.0 * math.log(h)
        costs[h] += 3.0 * math.log(6.0 * count)
        turning = np.cumsum(turned, axis=0) @ (offset / max(float(np.linalg.norm(offset)), 1e-9))
        seen = math.sqrt(float(turning.var(axis=0).sum()))
        return _Costs(costs, suspicion, offset, seen, max(beside))


_OFFSET_STD_M = 0.03
"""How far off a marker may be expected to be, per axis, where motion does not tell."""

_TEXTS = {
    Cause.NOTHING: "pose and joints agree (residual {residual:.1f} of what is expected)",
    Cause.WRONG_DIRECTION: "joint {joints} seems to turn the wrong way (servos.directions): that "
    "explains {share:.0f} % of the difference between pose and joints",
    Cause.SWAPPED_JOINTS: "joints {joints} seem to be swapped (servos.ids): that explains "
    "{share:.0f} % of the difference between pose and joints",
    Cause.WRONG_MARKER_OFFSET: "the measured point seems to be off the tip by ({offset}) mm in the "
    "head's frame: that explains {share:.0f} % of the difference between pose and joints",
    Cause.WHEEL_SLIP: "the head moves otherwise than the joints say (residual {residual:.1f} of "
    "what is expected) and no single cause explains it: wheels slide, or the robot is pushed",
}


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
