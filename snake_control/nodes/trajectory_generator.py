"""Node ``trajectory_generator``: sends ``head/reference`` for a trajectory or for ``cmd_vel``.

Nothing is sent before ``~/start`` (or the parameter ``autostart``), ``~/return``, ``cmd_vel``,
``head/path``, ``head/trajectory`` or a goal of the action ``follow_head_trajectory``. ``~/stop``,
or ``cmd_vel`` that ceases, brings the reference to rest; then it is no longer sent, and the
controller reports a stale reference and commands zero. ``cmd_vel`` takes over from whatever is
being followed, unless it is zero: a joystick at rest starts and takes over nothing.

``controller_state`` says how fast the reference may go on (``reference_scale``): near a limit of
the robot it slows down, and it waits while the controller does not follow. Where no controller is
heard it goes on by itself.

Motion follows a steady clock, also under ``use_sim_time``; ROS time only stamps the messages. So a
clock that is set moves nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from nav_msgs.msg import Path
from numpy import float64
from numpy.typing import NDArray
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future
from snake_interfaces.msg import ControllerState
from std_srvs.srv import Trigger

from snake_control.config import Config
from snake_control.control.reference import Reference
from snake_control.errors import ConfigError, ConfigFileError
from snake_control.nodes import topics
from snake_control.nodes.conversions import (
    HEAD_FRAME,
    MessageError,
    head_motion,
    head_velocity_command,
    header,
    joint_motion,
    pose_message,
    reference_message,
    stamp_ns,
)
from snake_control.nodes.endpoints import Endpoints
from snake_control.nodes.head_action import HeadAction
from snake_control.nodes.head_messages import MessageMotion, path_motion, trajectory_motion
from snake_control.nodes.head_motion import HeadMotion, Request
from snake_control.nodes.head_preview import HeadPreviews
from snake_control.nodes.inputs import FUTURE_TOLERANCE_S, Input
from snake_control.nodes.parameters import NodeParameters
from snake_control.nodes.process import run
from snake_control.nodes.rehearsals import Movable, Rehearsals, Surroundings
from snake_control.trajectory.configured import ENDLESS_S, ConfiguredPlan
from snake_control.trajectory.course_text import read_course
from snake_control.trajectory.plan import Plan
from snake_control.trajectory.sequence import Outcome, ReferenceSequence

# How planned paths are drawn.
_PATH_POINTS = 61
_PATH_STEP_S = 0.5
_PATH_POINTS_MOST = 401
_CONTROLLER_SILENT_S = 0.5


class TrajectoryGenerator(Node):
    """Samples a ``ReferenceSequence`` at a fixed rate."""

    def __init__(self, **overrides: Any) -> None:
        super().__init__("trajectory_generator", **overrides)
        self._node_parameters = NodeParameters(self, "trajectory_generator", prepare=_check_file)
        configured = self._node_parameters.config
        self._config = config = configured.trajectory_generator
        self._sequence = ReferenceSequence(config)
        self._autostart = config.autostart
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._origin_ns = self._steady.now().nanoseconds
        self._cmd_vel_stamp_ns = 0
        self._controller: ControllerState | None = None
        self._heard_s = -math.inf
        self._has_path = False
        self._head = Input(
            topics.HEAD_ODOMETRY.name,
            config.head_timeout_s,
            lambda message: head_motion(message, config.frame_id)[0],
        )
        self._joints = Input(
            topics.JOINT_STATES.name,
            config.head_timeout_s,
            lambda message: joint_motion(message, configured.robot.joint_names)[0],
        )
        ends = Endpoints(self)
        self._rehearsals = Rehearsals(configured)
        self._motion = HeadMotion(
            self,
            ends,
            configured.trajectory_generator,
            self._rehearsals,
            self._sequence,
            self._publish_plan,
        )
        self._previews = HeadPreviews(self._rehearsals, self._sequence, self._publish_plan)
        self._action = HeadAction(self, self._motion, config.frame_id, self._steady_s)
        for t, convert in (
            (topics.HEAD_PATH, path_motion),
            (topics.HEAD_TRAJECTORY, trajectory_motion),
        ):
            ends.subscription(t, partial(self._on_motion, t.name, convert))

        self._reference = ends.publisher(topics.HEAD_REFERENCE)
        self._path = ends.publisher(topics.HEAD_PLANNED_PATH)
        for t, take in (
            (topics.HEAD_ODOMETRY, self._head.receive),
            (topics.JOINT_STATES, self._joints.receive),
            (topics.CONTROLLER_STATE, self._on_controller_state),
        ):
            ends.subscription(t, take, t.newest_only)
        t = topics.CMD_VEL if config.cmd_vel_stamped else topics.CMD_VEL_UNSTAMPED
        callback = self._on_cmd_vel if config.cmd_vel_stamped else self._on_unstamped_cmd_vel
        ends.subscription(t, callback, hint=" (see the parameter cmd_vel_stamped)")
        self.create_service(topics.STOP.type, topics.STOP.name, self._on_stop)
        # These wait for a rehearsal, and must not keep the others waiting.
        group = ReentrantCallbackGroup()
        for service, answer in (
            (topics.START, self._on_start),
            (topics.PREVIEW, self._on_preview),
            (topics.RETURN, self._on_return),
        ):
            self.create_service(service.type, service.name, answer, callback_group=group)
        self.create_timer(1.0 / config.rate_hz, self._step, clock=self._steady)

    def _on_controller_state(self, message: ControllerState) -> None:
        self._controller, self._heard_s = message, self._steady_s()

    def _now(self) -> int:
        return self.get_clock().now().nanoseconds

    def _steady_s(self) -> float:
        """Time since the node's start by the steady clock [s], small enough to keep all digits."""
        return (self._steady.now().nanoseconds - self._origin_ns) * 1e-9

    def _head_pose(self, now: int) -> NDArray[float64] | None:
        return None if self._head.problem(now) else self._head.value

    def _step(self) -> None:
        now = self._now()
        if self._autostart and self._head_pose(now) is not None:
            self._start(now)
        steady = self._steady_s()
        heard = steady - self._heard_s <= _CONTROLLER_SILENT_S
        controller = self._controller if heard else None
        scale = 1.0 if controller is None else controller.reference_scale
        self._sequence.time_scale = scale if 0.0 <= scale <= 1.0 else 1.0
        phi = None if self._joints.problem(now) else self._joints.value
        around = Surroundings(steady, self._head_pose(now), phi, controller)
        self._previews.step(around)
        self._motion.step(around)
        reference = self._sequence.sample(steady)
        if reference is not None:
            self._reference.publish(reference_message(reference, now, self._config.frame_id))
            if self._sequence.idle:
                self.get_logger().info("the head is at rest: no more references")

    def _start(self, now: int) -> Future:
        """Start what is configured; the future's result is an ``Outcome``."""
        # A start by hand, or one that cmd_vel made, is not repeated by itself later.
        self._autostart = False
        steady, head = self._steady_s(), self._head_pose(now)
        path = self._node_parameters.config.trajectory_generator.trajectory_file
        if path and self._sequence.idle:
            return self._motion.ask(Request("~/start", lambda _: read_course(path)), steady)
        outcome = self._sequence.start(steady, head)
        if outcome.done:
            self._motion.take_over("~/start")
            begin = self._sequence.here(steady, head)
            assert begin is not None
            self._motion.note_begin(begin.w_d)
            self._publish_path(now)
        self.get_logger().info(f"start: {outcome.text}")
        started = Future()
        started.set_result(outcome)
        return started

    async def _on_start(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return _answer(response, await self._start(self._now()))

    async def _on_return(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._autostart = False
        begun = self._motion.go_back(self._steady_s())
        if begun is None:
            return _answer(response, Outcome(False, "no motion has begun yet"))
        return _answer(response, await begun)

    async def _on_preview(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        config = self._node_parameters.config.trajectory_generator

        def plan(start: Reference) -> Movable:
            if config.follows_file:
                return Plan(config, read_course(config.trajectory_file), start)
            return ConfiguredPlan(config, start.w_d)

        return _answer(response, await self._previews.ask(plan, self._steady_s()))

    def _on_motion(self, source: str, convert: Callable[..., MessageMotion], message: Any) -> None:
        """Ask for the motion in a message of head/path or head/trajectory."""
        self._autostart = False
        now, config = self._steady_s(), self._config
        motion = convert(message, self._now(), config.stamp_tolerance_s, config.frame_id)
        self._motion.ask(
            Request(
                source,
                lambda t: motion.course(t - now),
                is_dated=motion.is_dated,
                begins_at=now + motion.wait_s,
            ),
            now,
        )

    def _on_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        now = self._now()
        self._autostart = False
        self._motion.let_stop()
        outcome = self._sequence.stop(self._steady_s())
        self._publish_path(now)
        self.get_logger().info(f"stop: {outcome.text}")
        return _answer(response, outcome)

    def _on_unstamped_cmd_vel(self, message: Twist) -> None:
        frame = self._config.cmd_vel_frame
        frame = HEAD_FRAME if frame == HEAD_FRAME else self._config.frame_id
        self._on_cmd_vel(TwistStamped(header=header(0, frame), twist=message))

    def _on_cmd_vel(self, message: TwistStamped) -> None:
        now = self._now()
        # What is typed by hand has no stamp, as a rule.
        stamp = stamp_ns(message) or now
        age = (now - stamp) * 1e-9
        limit = self._config.cmd_vel_timeout_s
        try:
            if age < -FUTURE_TOLERANCE_S:
                raise MessageError(f"it is stamped {-age:.3f} s ahead of this computer's clock")
            if age > limit:
                raise MessageError(f"its stamp is {age:.2f} s old (limit {limit:g} s)")
            if stamp < self._cmd_vel_stamp_ns <= now:
                raise MessageError("it is older than the one before it")
            command = head_velocity_command(message, self._config.frame_id)
        except MessageError as error:
            self._ignore_cmd_vel(str(error))
            return
        self._cmd_vel_stamp_ns = stamp
        was_idle = self._sequence.idle
        # A stamp in the future must not lengthen the dead-man time-out.
        outcome = self._sequence.command(
            command, self._steady_s(), self._head_pose(now), max(age, 0.0)
        )
        if not outcome.done:
            self._ignore_cmd_vel(outcome.text)
        if not self._sequence.commanded:
            return
        self._autostart = False
        self._motion.take_over("cmd_vel")
        if was_idle:
            self.get_logger().info(outcome.text)
        self._publish_path(now)

    def _ignore_cmd_vel(self, reason: str) -> None:
        self.get_logger().warning(f"cmd_vel ignored: {reason}", throttle_duration_sec=1.0)

    def _publish_plan(self, plan: Movable) -> None:
        """Show a motion."""
        now, frame = self._now(), self._config.frame_id
        motion = plan.made()(0.0)
        path = Path(header=header(now, frame))
        points = min(max(round(plan.duration / _PATH_STEP_S), _PATH_POINTS), _PATH_POINTS_MOST)
        for t in np.linspace(0.0, plan.duration, points).tolist():
            stamp = header(now + round(t * 1e9), frame)
            path.poses.append(PoseStamped(header=stamp, pose=pose_message(motion.sample(t).w_d)))
        self._has_path = True
        self._path.publish(path)

    def _publish_path(self, now: int) -> None:
        """Show the line, or that there is none any more."""
        line = self._sequence.line
        if line is None and not self._has_path:
            return
        self._has_path = line is not None
        frame = self._config.frame_id
        path = Path(header=header(now, frame))
        if line is not None:
            start_ns = now - round(self._sequence.motion_time(self._steady_s()) * 1e9)
            path.poses = [
                PoseStamped(header=header(start_ns + round(t * 1e9), frame), pose=pose_message(w_d))
                for t, w_d in line.path(_PATH_POINTS, ENDLESS_S)
            ]
        self._path.publish(path)

    def close(self) -> None:
        """References cease, and the controller then commands zero."""
        self._rehearsals.close()
        self._action.close()


def _check_file(config: Config) -> None:
    """Refuse a file that is none; it is read again when it is followed."""
    own = config.trajectory_generator
    if own.follows_file:
        try:
            read_course(own.trajectory_file)
        except ConfigFileError as error:
            raise ConfigError("trajectory_file", own.trajectory_file, str(error)) from error


def _answer(response: Trigger.Response, outcome: Outcome) -> Trigger.Response:
    response.success, response.message = outcome.done, outcome.text
    return response


def main() -> int:
    """Run the node."""
    return run(TrajectoryGenerator, "trajectory_generator")


if __name__ == "__main__":
    raise SystemExit(main())
