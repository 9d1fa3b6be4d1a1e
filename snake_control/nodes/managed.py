"""A lifecycle node whose executor goes on answering while a transition or a request takes its time.

Such work is done in one thread of its own, one after the other; the service that asked for it is
answered when it is done. Meanwhile the executor takes messages, and above all the emergency stop.

Two things that rclpy leaves to others: a transition that the node's state does not have is answered
with "no" (rclpy lets the exception end the process, and with it the hold of the robot), and an
exception in a transition is logged (rclpy passes it over in silence).
"""

from __future__ import annotations

import functools
import traceback
from collections.abc import Callable, Generator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Any, TypeVar

from lifecycle_msgs.srv import ChangeState
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from snake_control.errors import SnakeError
from snake_control.nodes.topics import Service

_Result = TypeVar("_Result")
_Transition = Callable[[Any, LifecycleState], TransitionCallbackReturn]

_SOON_S = 0.3
_TURN_S = 0.05


def logged(transition: _Transition) -> _Transition:
    """Log what a transition's callback raises; rclpy then goes on with ``on_error``."""

    @functools.wraps(transition)
    def wrapper(self: LifecycleNode, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            return transition(self, state)
        except Exception:
            name = transition.__name__.removeprefix("on_")
            self.get_logger().error(f"{name} failed unexpectedly:\n{traceback.format_exc()}")
            raise

    return wrapper


class ManagedNode(LifecycleNode):
    """``LifecycleNode`` with a thread for what takes longer than a callback should."""

    def __init__(self, name: str, **overrides: Any) -> None:
        """Make the node; arguments as ``LifecycleNode`` takes them."""
        super().__init__(name, **overrides)
        # Reentrant: a request that is being waited for must not keep others from being taken.
        self._slow = ReentrantCallbackGroup()
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="requests")
        for service in self.services:
            if service.srv_type is ChangeState:
                self._change_state = service.callback
                service.callback = self._in_background(self._change_state_if_possible)
                # rclpy.lifecycle.LifecycleNode does not take the group that its mixin takes.
                service.callback_group = self._slow
                self._slow.add_entity(service)

    def serve_slowly(self, service: Service, callback: Callable[[Any, Any], Any]) -> None:
        """Offer a service whose callback may take seconds; it runs in the thread for that."""
        self.create_service(
            service.type, service.name, self._in_background(callback), callback_group=self._slow
        )

    def begin(self, action: Callable[[], _Result]) -> Future[_Result]:
        """Do something in the thread for what takes its time, after what is under way there."""
        return self._worker.submit(action)

    def finish(self, action: Callable[[], None]) -> None:
        """Do the last work of the node after what is under way, and answer requests meanwhile."""
        done = self.begin(action)
        wait([done], _SOON_S)
        try:
            while not done.done() and self.executor is not None and self.context.ok():
                try:
                    self.executor.spin_once(timeout_sec=_TURN_S)
                except SnakeError as error:
                    self.get_logger().error(str(error))
        finally:
            # Also when a callback failed: the robot has to be brought to rest in any case.
            done.result()
            self._worker.shutdown()

    def _in_background(self, callback: Callable[[Any, Any], _Result]) -> Callable[[Any, Any], Any]:
        async def answer(request: Any, response: Any) -> _Result:
            outcome = self._worker.submit(callback, request, response)
            outcome.add_done_callback(self._wake)
            return await _Awaited(outcome)

        return answer

    def _wake(self, _: Future[Any]) -> None:
        executor = self.executor
        if executor is not None:
            executor.wake()

    def _change_state_if_possible(
        self, request: ChangeState.Request, response: ChangeState.Response
    ) -> ChangeState.Response:
        try:
            return self._change_state(request, response)
        except rclpy_implementation.RCLError as error:
            self.get_logger().warning(f"transition {request.transition.id} refused: {error}")
            response.success = False
            return response


class _Awaited:
    """Lets an rclpy callback await another thread's future: rclpy asks again at each turn."""

    def __init__(self, future: Future[Any]) -> None:
        self._future = future

    def __await__(self) -> Generator[None, None, Any]:
        while not self._future.done():
            yield
        return self._future.result()
