"""The thread that serves a bus on a port: waits for bytes, sends replies on time, steps time on."""

from __future__ import annotations

import contextlib
import os
import select
import threading
from collections import deque
from collections.abc import Callable
from pathlib import Path

from snake_control.errors import BusError, SnakeError
from snake_control.mock.bus import Bus, Reply
from snake_control.mock.port import PtyPort
from snake_control.mock.simulation import Simulation


class Server:
    """Serves one bus; a single thread owns servos and plant, so that they need no lock.

    Waiting happens in ``select`` with the time of the next reply or step as its limit: no processor
    time is spent while nothing happens.
    """

    def __init__(
        self,
        port: PtyPort,
        bus: Bus,
        simulation: Simulation,
        clock: Callable[[], float],
    ) -> None:
        """Prepare to serve; ``start`` begins.

        Args:
            port: where clients are; closing it stays with the caller.
            bus: what answers.
            simulation: what moves the servos of the bus.
            clock: monotonic time [s]; the one that ``simulation`` counts in.
        """
        self._port = port
        self._bus = bus
        self._simulation = simulation
        self._clock = clock
        self._replies: deque[Reply] = deque()
        self._stop = threading.Event()
        self._wake_read, self._wake_write = os.pipe()
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="mock bus", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread and wait for its end."""
        self._stop.set()
        os.write(self._wake_write, b"x")
        self._thread.join()
        os.close(self._wake_read)
        os.close(self._wake_write)

    def check(self) -> None:
        """Raise what ended the thread, if something did.

        Raises:
            BusError: the port or the simulation failed.
        """
        if not self._thread.is_alive() and not self._stop.is_set():
            raise BusError(f"the mock bus stopped: {self._failure}") from self._failure

    def _run(self) -> None:
        _wake_punctually()
        try:
            while not self._stop.is_set():
                self._serve()
        except (OSError, SnakeError) as failure:
            self._failure = failure

    def _serve(self) -> None:
        """Sleep until bytes come or something is due, and see to it."""
        readable, _, _ = select.select([self._port.fileno(), self._wake_read], [], [], self._idle())
        while self._replies and self._replies[0].at <= self._clock():
            self._port.write(self._replies.popleft().data)
        if self._port.fileno() in readable:
            now = self._clock()
            self._replies += self._bus.receive(self._port.read(), now, self._port.baud_rate)
        # One step at a time, so that bytes and replies wait for no more than one.
        self._simulation.step_if_due(self._clock())

    def _idle(self) -> float:
        """Time until a reply or a step is due [s]."""
        until = self._simulation.next_step_at
        if self._replies:
            until = min(until, self._replies[0].at)
        return max(0.0, until - self._clock())


def _wake_punctually() -> None:
    """Have Linux wake this thread when it asked for, not up to 50 us later as is usual."""
    with contextlib.suppress(OSError):
        Path(f"/proc/{threading.get_native_id()}/timerslack_ns").write_text("1")
