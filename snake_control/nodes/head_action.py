"""The action ``follow_head_trajectory``: from a goal's arrival to its result.

Goals are taken one after the other; a newer one takes over from where the reference is, with its
rate. Every goal is accepted: only a result can say why a motion cannot be.
"""

from __future__ import annotations

import dataclasses
import math
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node
from rclpy.task import Future as RosFuture
from snake_interfaces.action import FollowHeadTrajectory
from snake_interfaces.msg import ControllerState

from snake_control.config import Config
from snake_control.control.supervisor import NO_ANSWER
from snake_control.errors import SnakeError
from snake_control.experiment.rehearsal import Rehearsal, rehearse
from snake_control.model.rotation import wrap
from snake_control.nodes import topics
from snake_control.nodes.conversions import MessageError, pose_array, require_frame
from snake_control.trajectory.plan import Plan, course_through
from snake_control.trajectory.sequence import ReferenceSequence

Array = NDArray[np.float64]
Result = FollowHeadTrajectory.Result

_FEEDBACK_PERIOD_S = 0.1
_STOPPED_AFTER_S = 1.0
_STOPS = (
    ControllerState.STATUS_DISABLED,
    ControllerState.STATUS_STALE,
    ControllerState.STATUS_INVALID,
    ControllerState.STATUS_FAULT,
    ControllerState.STATUS_ERROR_TOO_LARGE,
    ControllerState.STATUS_STOPPED,
)
_REHEARSAL_HZ = 25.0
_INPUT_WAIT_S = 1.0
"""How long a goal waits for head pose and joint states that have just gone stale."""


@dataclasses.dataclass(frozen=True)
class Surroundings:
    """What the node knows at one moment.

    Attributes:
        now: time of the steady clock [s].
        head: w of the head, (6,); ``None`` if it is not known.
        phi: joint angles, (n-1,); ``None`` if they are not known.
        controller: its newest state, if it is heard.
    """

    now: float
    head: Array | None
    phi: Array | None
    controller: ControllerState | None


@dataclasses.dataclass
class _Run:
    handle: ServerGoalHandle
    done: RosFuture
    since: float | None = None
    plan: Plan | None = None
    rehearsal: Future[Rehearsal] | None = None
    over: threading.Event = dataclasses.field(default_factory=threading.Event)
    began: float | None = None
    arriving_since: float | None = None
    stopped_since: float | None = None
    stopping: bool = False
    fed_back_at: float = -math.inf


class HeadAction:
    """Serves the action; ``step`` is called with every reference that is sent."""

    def __init__(
        self,
        node: Node,
        config: Config,
        sequence: ReferenceSequence,
        on_path: Callable[[Plan], None],
    ) -> None:
        """Offer the action.

        Args:
            node: where.
            config: robot, controller, supervisor and the generator's own group.
            sequence: what sends references.
            on_path: told of a motion that begins.
        """
        self._node = node
        self._config = config
        self._own = config.trajectory_generator
        self._sequence = sequence
        self._on_path = on_path
        self._run: _Run | None = None
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="rehearsal")
        self._server = ActionServer(
            node,
            topics.FOLLOW_HEAD_TRAJECTORY.type,
            topics.FOLLOW_HEAD_TRAJECTORY.name,
            execute_callback=self._execute,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

    def close(self) -> None:
        """Serve no more; a rehearsal ends at once."""
        if self._run is not None:
            self._run.over.set()
        self._worker.shutdown(wait=False, cancel_futures=True)
        self._server.destroy()

    def take_over(self, by: str) -> None:
        """End a goal because something else gives the reference from now on."""
        if self._run is not None:
            self._end(self._run, Result.PREEMPTED, f"{by} took over")

    def let_stop(self) -> None:
        """End a goal when the head has come to rest: ``~/stop`` was called."""
        if self._run is not None:
            self._run.stopping = True

    async def _execute(self, handle: ServerGoalHandle) -> Result:
        if self._run is not None:
            self._end(self._run, Result.PREEMPTED, "a newer goal took over")
        run = self._run = _Run(handle, RosFuture())
        result: Result = await run.done
        return result

    def step(self, around: Surroundings) -> None:
        """Go on with the goal there is."""
        run = self._run
        if run is None:
            return
        if run.handle.is_cancel_requested and not run.stopping:
            run.stopping = True
            if run.began is not None:
                self._sequence.stop(around.now)
        if run.stopping:
            self._feed_back(run, around, "stopping")
            if run.began is None or self._sequence.idle:
                self._end(run, Result.CANCELED, "canceled", around)
        elif run.began is not None:
            self._watch(run, around)
        elif run.rehearsal is not None:
            self._feed_back(run, around, "rehearsing")
            if run.rehearsal.done():
                self._take_rehearsal(run, around, run.rehearsal)
        else:
            self._plan(run, around)

    # The parts of a goal's life.

    def _plan(self, run: _Run, around: Surroundings) -> None:
        since = run.since = around.now if run.since is None else run.since
        bold = run.handle.request.skip_rehearsal
        missing = around.head is None or (around.phi is None and not bold)
        if missing and around.now - since < _INPUT_WAIT_S:
            return
        plan = self._planned(run, around)
        if plan is None:
            return
        if bold:
            self._begin(run, around)
            return
        if around.phi is None or around.head is None:
            what = "head/odometry" if around.head is None else "joint_states"
            self._end(run, Result.NO_HEAD, f"cannot be rehearsed: no fresh {what}", around)
            return
        quick = dataclasses.replace(self._config.scp_controller, rate_hz=_REHEARSAL_HZ)
        config = dataclasses.replace(self._config, scp_controller=quick)
        run.rehearsal = self._worker.submit(
            rehearse,
            config,
            around.phi,
            around.head,
            plan.made()(0.0).sample,
            plan.duration,
            run.over.is_set,
        )

    def _planned(self, run: _Run, around: Surroundings) -> Plan | None:
        goal = run.handle.request
        start = self._sequence.here(around.now, around.head)
        if start is None:
            self._end(run, Result.NO_HEAD, "no fresh head/odometry", around)
            return None
        try:
            require_frame(goal, self._own.frame_id)
            poses = np.reshape([_pose(i, pose) for i, pose in enumerate(goal.poses)], (-1, 6))
            times = [time.sec + 1e-9 * time.nanosec for time in goal.time_from_start]
            course = course_through(poses, times, goal.speed, goal.turning_speed)
            run.plan = Plan(self._own, course, start)
        except SnakeError as error:
            self._end(run, Result.INVALID, str(error), around)
            return None
        return run.plan

    def _take_rehearsal(
        self, run: _Run, around: Surroundings, rehearsal: Future[Rehearsal]
    ) -> None:
        try:
            found = rehearsal.result()
        except NO_ANSWER as error:
            self._end(run, Result.UNREACHABLE, f"the rehearsal failed: {error}", around)
            return
        if not found.possible:
            self._end(run, Result.UNREACHABLE, found.text, around)
        # It has taken a moment, in which the reference may have gone on.
        elif self._planned(run, around) is not None:
            self._begin(run, around)

    def _begin(self, run: _Run, around: Surroundings) -> None:
        assert run.plan is not None
        run.began = self._sequence.motion_time(around.now)
        self._sequence.follow(run.plan.made(), around.now)
        self._on_path(run.plan)
        self._node.get_logger().info(f"follow_head_trajectory: {run.plan.duration:.1f} s")

    def _watch(self, run: _Run, around: Surroundings) -> None:
        assert run.plan is not None
        assert run.began is not None
        controller = around.controller
        if controller is not None and controller.status in _STOPS:
            since = run.stopped_since = run.stopped_since or around.now
            if around.now - since > _STOPPED_AFTER_S:
                self._sequence.stop(around.now)
                self._end(run, Result.STOPPED, f"the controller: {controller.text}", around)
                return
        else:
            run.stopped_since = None
        if self._sequence.motion_time(around.now) < run.began + run.plan.duration:
            self._feed_back(run, around, "moving")
            return
        since = run.arriving_since = run.arriving_since or around.now
        self._feed_back(run, around, "arriving")
        position, rotation = self._error(around)
        if position <= self._own.arrival_position_m and rotation <= self._own.arrival_rotation_rad:
            run.fed_back_at = -math.inf
            self._feed_back(run, around, "arriving")
            self._end(run, Result.NONE, "arrived", around)
        elif around.now - since > self._own.arrival_timeout_s:
            text = f"the head is still {1e3 * position:.0f} mm and {rotation:.2f} rad away"
            if controller is not None:
                text += f"; the controller: {controller.text}"
            self._end(run, Result.STOPPED, text, around)

    def _error(self, around: Surroundings) -> tuple[float, float]:
        here = self._sequence.here(around.now, None)
        if here is None or around.head is None:
            return math.nan, math.nan
        off = around.head - here.w_d
        return float(np.linalg.norm(off[:3])), float(np.abs(wrap(off[3:])).max())

    def _feed_back(self, run: _Run, around: Surroundings, phase: str) -> None:
        if around.now - run.fed_back_at < _FEEDBACK_PERIOD_S:
            return
        run.fed_back_at = around.now
        feedback = FollowHeadTrajectory.Feedback(phase=phase, time_scale=self._sequence.time_scale)
        if run.began is not None and run.plan is not None:
            elapsed = self._sequence.motion_time(around.now) - run.began
            feedback.progress = min(1.0, elapsed / run.plan.duration)
            feedback.time_left = max(0.0, run.plan.duration - elapsed)
        if around.controller is not None:
            feedback.controller = around.controller.text
        feedback.position_error, feedback.rotation_error = self._error(around)
        run.handle.publish_feedback(feedback)

    def _end(self, run: _Run, code: int, text: str, around: Surroundings | None = None) -> None:
        run.over.set()
        result = Result(code=code, text=text)
        result.position_error, result.rotation_error = (
            (math.nan, math.nan) if around is None else self._error(around)
        )
        if code == Result.NONE:
            run.handle.succeed()
        elif run.handle.is_cancel_requested:
            run.handle.canceled()
        else:
            run.handle.abort()
        self._node.get_logger().info(f"follow_head_trajectory ended: {text}")
        if self._run is run:
            self._run = None
        run.done.set_result(result)


def _pose(number: int, pose: object) -> Array:
    try:
        return pose_array(pose)  # type: ignore[arg-type]
    except MessageError as error:
        raise MessageError(f"pose {number}: {error}") from error
