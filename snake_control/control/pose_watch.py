"""Watches whether the head moves as the joints say, and names what is wrong if it does not.

The measured motion is cut into segments in each of which something moves (``pose_segments``), and
what the joints say of them under every hypothesis is weighed against it (``pose_costs``).

A cause is named if what is configured cannot be true (its cost is a multiple of what is expected),
the cause explains nearly all of that, and no other does nearly as well, several times in a row. If
nothing explains the motion, wheels slide. Segments come with motion only: at rest nothing is
judged.
"""

from __future__ import annotations

import collections
import dataclasses
import math

import numpy as np
from numpy.typing import ArrayLike

from snake_control.config import RobotConfig
from snake_control.control.pose_costs import Costs, weighed
from snake_control.control.pose_hypotheses import Cause, Hypotheses, Hypothesis
from snake_control.control.pose_segments import PoseSegments, Segment
from snake_control.control.pose_watch_limits import WatchLimits

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
        self._motion = PoseSegments(self._robot, self._hypotheses, self._limits)
        self._segments: collections.deque[Segment] = collections.deque(
            maxlen=self._limits.window_segments
        )
        self._in_a_row: tuple[Hypothesis, int] = (Hypothesis(Cause.NOTHING), 0)
        self.verdict = Verdict()

    def joints(self, stamp_ns: int, phi: ArrayLike) -> None:
        """Take one joint state: when it was read [ns], and the angles, (n-1,) [rad].

        Raises:
            ModelError: wrong shape or not finite.
        """
        for segment in self._motion.joints(stamp_ns, phi):
            self._judge(segment)

    def pose(self, stamp_ns: int, position: ArrayLike, quaternion: ArrayLike) -> None:
        """Take one pose: when it was captured [ns], position (3,) [m], quaternion [x, y, z, w]."""
        for segment in self._motion.pose(stamp_ns, position, quaternion):
            self._judge(segment)

    def _judge(self, newest: Segment) -> None:
        limits, segments = self._limits, self._segments
        segments.append(newest)
        while newest.end_ns - segments[0].end_ns > 1e9 * limits.window_s:
            segments.popleft()
        if len(segments) < limits.least_segments:
            return
        costs = weighed(list(segments), limits.recent_segments)
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

    def _found(self, costs: Costs, segments: int) -> Hypothesis | None:
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

    def _verdict(self, name: Hypothesis, costs: Costs) -> Verdict:
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
