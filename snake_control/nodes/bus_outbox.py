"""What the bus thread has to tell, told by another thread.

Messages take time to be made and lines may block, of a terminal that nobody reads for instance. The
joints must go on being led, and stopped, meanwhile. That is not enough against a middleware that
blocks, since rclpy keeps the interpreter's lock while it publishes: see ``transport``.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

from snake_control.nodes.bus_snapshot import Snapshot

_KEPT_SNAPSHOTS, _KEPT_LINES = 10, 1000


class Outbox:
    """A thread that delivers in order: lines for the log first, then states."""

    def __init__(self, deliver: Callable[[Snapshot], None]) -> None:
        """Start; ``deliver`` is called with every state, or with the newest ones after a delay."""
        self._deliver = deliver
        self._snapshots: deque[Snapshot] = deque(maxlen=_KEPT_SNAPSHOTS)
        self._lines: deque[tuple[Callable[[str], None], str]] = deque(maxlen=_KEPT_LINES)
        self._changed = threading.Condition()
        self._closed = False
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="outbox", daemon=True)
        self._thread.start()

    def put(self, snapshot: Snapshot) -> None:
        """Have a state delivered; raises what an earlier delivery raised."""
        with self._changed:
            if self._failure is not None:
                raise self._failure
            self._snapshots.append(snapshot)
            self._changed.notify()

    def say(self, log: Callable[[str], None], text: str) -> None:
        """Have a line logged."""
        with self._changed:
            self._lines.append((log, text))
            self._changed.notify()

    def close(self, timeout: float) -> None:
        """Deliver what there is, and end; no later than after ``timeout`` seconds."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        self._thread.join(timeout)

    def _run(self) -> None:
        while True:
            with self._changed:
                while not (self._lines or self._snapshots or self._closed):
                    self._changed.wait()
                if not (self._lines or self._snapshots):
                    return
                lines, snapshots = list(self._lines), list(self._snapshots)
                self._lines.clear()
                self._snapshots.clear()
            try:
                for log, text in lines:
                    log(text)
                for snapshot in snapshots:
                    self._deliver(snapshot)
            except BaseException as failure:
                with self._changed:
                    self._failure = failure
                raise
