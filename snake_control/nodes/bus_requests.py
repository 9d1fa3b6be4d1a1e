"""What other threads want of the bus thread, carried out by it between two cycles."""

from __future__ import annotations

import queue
from collections.abc import Callable
from concurrent.futures import Future

from snake_control.errors import SnakeError


class RefusedError(SnakeError, RuntimeError):
    """A request that does not fit the state of the driver."""


class NotLoweredError(RefusedError):
    """A lowering that did not reach its pose; torque stays on."""


class Requests:
    """Queue of actions whose callers wait for the outcome."""

    def __init__(self) -> None:
        self._waiting: queue.SimpleQueue[tuple[Callable[[], str], Future[str]]] = (
            queue.SimpleQueue()
        )
        self._ended = False

    def carry_out(self, action: Callable[[], str], timeout: float) -> str:
        """Let the other thread carry out ``action``; return what it says that it did.

        Raises:
            RefusedError: not within ``timeout`` seconds (it is then not begun any more), or the
                other thread has ended.
            SnakeError: what ``action`` raised.
        """
        future: Future[str] = Future()
        self._waiting.put((action, future))
        if self._ended:
            self.end()
        try:
            return future.result(timeout)
        except TimeoutError as error:
            begun = not future.cancel()
            raise RefusedError(
                f"not {'finished; it goes on' if begun else 'carried out'} after {timeout:g} s"
            ) from error

    def serve(self) -> bool:
        """Carry out what waits; return whether there was anything."""
        served = False
        while not self._waiting.empty():
            action, future = self._waiting.get()
            if not future.set_running_or_notify_cancel():
                continue
            served = True
            try:
                done = action()
            except SnakeError as error:
                future.set_exception(error)
            else:
                future.set_result(done)
            finally:
                if not future.done():
                    future.set_exception(RefusedError("the bus thread failed"))
        return served

    def end(self) -> None:
        """Refuse what waits and what comes."""
        self._ended = True
        while not self._waiting.empty():
            _, future = self._waiting.get()
            if future.set_running_or_notify_cancel():
                future.set_exception(RefusedError("the bus thread has ended"))
