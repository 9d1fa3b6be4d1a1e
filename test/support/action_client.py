"""Sends goals of one action and keeps the feedback.

All of it in the thread of the test's node: rclpy's action client does not know the reply to a
request that comes while another thread still sends it.
"""

from __future__ import annotations

from typing import Any

from rclpy.action import ActionClient

from snake_control.nodes.topics import Action
from support.graph import Graph


class Goals:
    """A client of an action.

    Attributes:
        feedback: of all goals, oldest first.
    """

    def __init__(self, graph: Graph, action: Action) -> None:
        self._graph = graph
        self._goal = action.type.Goal
        self._client = ActionClient(graph.node, action.type, action.name)
        graph.wait_for(self._client.server_is_ready, 30.0, f"the action {action.name}")
        self.feedback: list[Any] = []
        self._last: Sent | None = None

    def send(self, **goal: Any) -> Sent:
        """Send a goal, which has to be accepted."""
        message = self._goal(**goal)
        sent = self._graph.in_its_thread(
            lambda: self._client.send_goal_async(
                message, feedback_callback=lambda m: self.feedback.append(m.feedback)
            )
        )
        self._graph.wait_for(sent.done, 20.0, "acceptance")
        handle = sent.result()
        assert handle.accepted
        self._last = Sent(self._graph, handle)
        return self._last

    def cancel_last(self) -> None:
        """Cancel the goal that was sent last, unless it is over; wait for its end."""
        if self._last is not None and not self._last.over:
            self._last.cancel()
            self._last.result()

    def do(self, timeout_s: float = 60.0, **goal: Any) -> tuple[int, Any]:
        """Send a goal and wait for its status and result."""
        return self.send(**goal).result(timeout_s)


class Sent:
    """A goal that was accepted."""

    def __init__(self, graph: Graph, handle: Any) -> None:
        self._graph = graph
        self._handle = handle
        self._result = graph.in_its_thread(handle.get_result_async)

    @property
    def over(self) -> bool:
        """Whether there is a result."""
        return self._result.done()

    def result(self, timeout_s: float = 60.0) -> tuple[int, Any]:
        """Wait for status and result."""
        self._graph.wait_for(self._result.done, timeout_s, "the result")
        got = self._result.result()
        return got.status, got.result

    def cancel(self) -> None:
        """Cancel it."""
        canceled = self._graph.in_its_thread(self._handle.cancel_goal_async)
        self._graph.wait_for(canceled.done, 10.0, "the answer to the cancellation")
