"""Command ``head_trajectory``: takes the head through the trajectory of a file, and waits.

    ros2 run snake_control head_trajectory FILE

It sends the file's text as a goal of ``follow_head_trajectory`` and shows how it goes on. Ctrl-C
cancels the goal and waits until the head is at rest; a second one ends the waiting alone. Exit code
0: the head has arrived; 1: it has not, with the reason; 2: the file or the command line is wrong.
"""

from __future__ import annotations

import argparse
import signal
import sys
import time
from collections.abc import Callable, Sequence
from types import FrameType
from typing import Any

import rclpy
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from snake_interfaces.action import FollowHeadTrajectory

from snake_control.config.yaml_file import read_text
from snake_control.errors import SnakeError
from snake_control.nodes import topics
from snake_control.nodes.conversions import HEAD_FRAME
from snake_control.nodes.process import EXIT_BAD_CONFIG, EXIT_FAILED, end_soon
from snake_control.nodes.transport import without_shared_memory
from snake_control.trajectory.course_text import parse_course

_SETTLE_S = 0.5
"""The server must have discovered this client, too, or its answer is lost."""
_ANSWER_S = 10.0
_GONE_S = 3.0
_LINE_S = 2.0


class _Interrupts:
    """Counts signals that ask for the end."""

    def __init__(self) -> None:
        self.count = 0
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._on_signal)

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self.count += 1


class _GoalError(SnakeError, RuntimeError):
    """The goal could not be sent, or nobody says what became of it."""


class _Client:
    """Sends one goal and shows how it goes on."""

    def __init__(self, node: Node, interrupts: _Interrupts) -> None:
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)
        self._interrupts = interrupts
        action = topics.FOLLOW_HEAD_TRAJECTORY
        self._client = ActionClient(node, action.type, action.name)
        self._shown_at = 0.0
        self._phase = ""

    def follow(self, goal: Any, wait_s: float) -> int:
        """Send the goal, wait for its end, and return the exit code.

        Raises:
            _GoalError: nobody answers.
        """
        is_there = self._spin_until(self._client.server_is_ready, wait_s)
        if is_there:
            self._spin_until(lambda: False, _SETTLE_S)
        if self._interrupts.count:
            raise _GoalError("interrupted; nothing was sent")
        if not is_there:
            raise _GoalError(
                f"no {topics.FOLLOW_HEAD_TRAJECTORY.name} within {wait_s:g} s: is "
                "trajectory_generator running?"
            )
        sent = self._client.send_goal_async(goal, feedback_callback=self._show)
        if not self._spin_until(sent.done, _ANSWER_S, also_when_interrupted=True):
            raise _GoalError("trajectory_generator does not answer; call its ~/stop")
        handle = sent.result()
        got = handle.get_result_async()
        self._spin_until(got.done)
        if not got.done():
            print("\ncanceling; the head slows down to rest", flush=True)
            handle.cancel_goal_async()
            canceled = self._interrupts.count
            self._spin_until(lambda: got.done() or self._interrupts.count > canceled, forced=True)
        if not got.done():
            raise _GoalError("not waiting any more; the head may still move: call ~/stop")
        result = got.result().result
        print(
            f"\n{result.text}; the head is {1e3 * result.position_error:.0f} mm and "
            f"{result.rotation_error:.2f} rad off",
            flush=True,
        )
        return 0 if result.code == FollowHeadTrajectory.Result.NONE else EXIT_FAILED

    def destroy(self) -> None:
        """Take the client out of the graph, before its node."""
        self._client.destroy()

    def _spin_until(
        self,
        condition: Callable[[], bool],
        timeout_s: float = float("inf"),
        also_when_interrupted: bool = False,
        forced: bool = False,
    ) -> bool:
        """Serve callbacks until a condition holds; return whether it does.

        Raises:
            _GoalError: the server was there and is gone.
        """
        deadline = time.monotonic() + timeout_s
        heard = time.monotonic()
        while not condition():
            now = time.monotonic()
            if self._client.server_is_ready():
                heard = now
            elif timeout_s == float("inf") and now - heard > _GONE_S:
                raise _GoalError("trajectory_generator is gone")
            if now > deadline or (self._interrupts.count and not (also_when_interrupted or forced)):
                return False
            self._executor.spin_once(timeout_sec=0.05)
        return True

    def _show(self, message: Any) -> None:
        feedback, now = message.feedback, time.monotonic()
        is_terminal = sys.stdout.isatty()
        if feedback.phase == self._phase and not is_terminal and now - self._shown_at < _LINE_S:
            return
        self._phase, self._shown_at = feedback.phase, now
        text = f"{feedback.phase}  "
        if feedback.phase != "rehearsing":
            text += (
                f"{100 * feedback.progress:3.0f} %, {feedback.time_left:.0f} s left, at "
                f"{feedback.time_scale:.2f} of the speed, {1e3 * feedback.position_error:.0f} mm "
                f"off  {feedback.controller}"
            )
        start, end = ("\r\x1b[K", "") if is_terminal else ("", "\n")
        print(f"{start}{text}", end=end, flush=True)


def _parsed(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="head_trajectory",
        description="Takes the head through the trajectory of a file (docs/drive.md).",
    )
    parser.add_argument("file", help="a trajectory, .yaml or .csv")
    parser.add_argument(
        "--frame",
        default="world",
        help="what the poses of a .csv are relative to: world (default), or "
        f"{HEAD_FRAME} for where the head is",
    )
    parser.add_argument(
        "--speed", type=float, default=0.0, help="of the tip, where the file says none [m/s]"
    )
    parser.add_argument(
        "--turning-speed",
        type=float,
        default=0.0,
        help="of roll, pitch and yaw, where the file says none [rad/s]",
    )
    parser.add_argument(
        "--skip-rehearsal", action="store_true", help="start without trying it on the model first"
    )
    parser.add_argument(
        "--wait", type=float, default=10.0, help="how long to wait for the action server [s]"
    )
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code."""
    arguments = list(sys.argv if arguments is None else arguments)
    given = _parsed(remove_ros_args(arguments)[1:])
    try:
        text = read_text(given.file)
        parse_course(text, given.file, given.file.lower().endswith(".csv"))
    except SnakeError as error:
        print(f"head_trajectory: {error}", file=sys.stderr)
        return EXIT_BAD_CONFIG
    goal = FollowHeadTrajectory.Goal(
        trajectory=text,
        speed=given.speed,
        turning_speed=given.turning_speed,
        skip_rehearsal=given.skip_rehearsal,
    )
    goal.header.frame_id = given.frame
    interrupts = _Interrupts()
    try:
        with without_shared_memory():
            rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
            node = rclpy.create_node("head_trajectory")
    except (
        SnakeError,
        rclpy_implementation.RCLError,
        rclpy_implementation.UnknownROSArgsError,
    ) as error:
        print(f"head_trajectory: {error}", file=sys.stderr)
        return EXIT_BAD_CONFIG
    client = _Client(node, interrupts)
    try:
        return client.follow(goal, given.wait)
    except _GoalError as error:
        print(f"head_trajectory: {error}", file=sys.stderr)
        return EXIT_FAILED
    finally:
        end_soon()
        client.destroy()
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    sys.exit(main())
