"""The action ``follow_head_trajectory``: goals become requests, and their status feedback.

Every goal is accepted: only a result can say why a motion cannot be.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node
from rclpy.task import Future
from snake_interfaces.action import FollowHeadTrajectory

from snake_control.nodes import topics
from snake_control.nodes.conversions import frame_of_poses, poses_array
from snake_control.nodes.head_motion import HeadMotion, Request, Status
from snake_control.trajectory.course_text import parse_course
from snake_control.trajectory.plan import Course, at_speed, course_through

Result = FollowHeadTrajectory.Result

_SAME_FIELDS = ("progress", "time_left", "time_scale", "controller")
_ERRORS = ("position_error", "rotation_error")


class HeadAction:
    """Serves the action."""

    def __init__(
        self, node: Node, motion: HeadMotion, frame_id: str, now: Callable[[], float]
    ) -> None:
        """Offer the action.

        Args:
            node: where.
            motion: what carries out requests.
            frame_id: name of the world.
            now: the steady clock [s].
        """
        self._motion = motion
        self._frame_id = frame_id
        self._now = now
        self._server = ActionServer(
            node,
            topics.FOLLOW_HEAD_TRAJECTORY.type,
            topics.FOLLOW_HEAD_TRAJECTORY.name,
            execute_callback=self._execute,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

    def close(self) -> None:
        """Serve no more."""
        self._server.destroy()

    async def _execute(self, handle: ServerGoalHandle) -> Any:
        done = Future()

        def on_status(status: Status) -> None:
            if status.phase == "ended":
                done.set_result(_ended(handle, status))
                return
            feedback = FollowHeadTrajectory.Feedback(phase=status.phase)
            _copy(status, feedback, (*_SAME_FIELDS, *_ERRORS))
            handle.publish_feedback(feedback)

        self._motion.ask(
            Request(
                topics.FOLLOW_HEAD_TRAJECTORY.name,
                lambda _: self._course(handle.request),
                skip_rehearsal=handle.request.skip_rehearsal,
                on_status=on_status,
                is_canceled=lambda: handle.is_cancel_requested,
            ),
            self._now(),
        )
        return await done

    def _course(self, goal: Any) -> Course:
        frame = frame_of_poses(goal, self._frame_id)
        if goal.trajectory:
            course = parse_course(goal.trajectory, "trajectory", frame=frame)
        else:
            times = [time.sec + 1e-9 * time.nanosec for time in goal.time_from_start]
            course = course_through(poses_array(goal.poses), times, frame)
        return at_speed(course, goal.speed, goal.turning_speed)


def _ended(handle: ServerGoalHandle, status: Status) -> Any:
    result = Result(code=status.code, text=status.text)
    _copy(status, result, _ERRORS)
    if status.code == Result.NONE:
        handle.succeed()
    elif handle.is_cancel_requested:
        handle.canceled()
    else:
        handle.abort()
    return result


def _copy(source: Any, target: Any, fields: tuple[str, ...]) -> None:
    for field in fields:
        setattr(target, field, getattr(source, field))
