"""The thread that serves a bus on a port: waits for bytes, sends replies on time, steps time on."""

from __future__ import annotations

import contextlib
import heapq
import os
import queue
import select
import threading
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path

import numpy as np

from snake_control.errors import BusError, SnakeError
from snake_control.mock.bus import Bus
from snake_control.mock.faults import Fault, Injector
from snake_control.mock.port import PtyPort
from snake_control.mock.simulation import Simulation

_REQUEST_TIMEOUT_S = 5.0


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
        *,
        spin_s: float = 0.0,
        seed: int = 0,
        log: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Prepare to serve; ``start`` begins.

        Args:
            port: where clients are; closing it stays with the caller.
            bus: what answers.
            simulation: what moves the servos of the bus.
            clock: monotonic time [s]; the one that ``simulation`` counts in.
            spin_s: how long before a reply is due to stay awake for it [s]. Waking up takes a tenth
                of a millisecond, a third of what a reply takes; staying awake takes a processor.
            seed: of the faults' random numbers.
            log: takes a line for each fault that begins or ends, in the server's thread.
        """
        self._port = port
        self._bus = bus
        self._simulation = simulation
        self._clock = clock
        self._spin_s = spin_s
        self._faults = Injector(bus, port, np.random.default_rng(seed), log)
        # By time, then in the order of the line: a late reply lets others pass.
        self._replies: list[tuple[float, int, bytes]] = []
        self._replied = 0
        self._requests: queue.SimpleQueue[tuple[Callable[[], object], Future[object]]] = (
            queue.SimpleQueue()
        )
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

    def schedule(self, faults: list[tuple[float, Fault]]) -> None:
        """Have faults begin at given times after the simulation's present time.

        Raises:
            FaultError: ids that are not on the bus.
        """
        start = self._simulation.time
        self._faults.schedule((start + at, fault) for at, fault in faults)

    def inject(self, fault: Fault) -> None:
        """Let a fault begin; return when it is in force.

        Raises:
            FaultError: ids that are not on the bus, or have it already.
            BusError: the server does not run.
        """
        self._ask(lambda: self._faults.inject(fault, self._clock()))

    def clear_faults(self) -> int:
        """End all faults; return how many were in force.

        Raises:
            BusError: the server does not run, or the port does not come back.
        """
        count = self._ask(self._faults.clear)
        assert isinstance(count, int)
        return count

    def _ask(self, action: Callable[[], object]) -> object:
        """Have the server's thread do something between two packets; return what it returned."""
        future: Future[object] = Future()
        self._requests.put((action, future))
        os.write(self._wake_write, b"x")
        try:
            return future.result(_REQUEST_TIMEOUT_S)
        except TimeoutError as error:
            raise BusError("the mock bus does not run") from error

    def _run(self) -> None:
        _wake_punctually()
        try:
            while not self._stop.is_set():
                self._serve()
        except (OSError, SnakeError) as failure:
            self._failure = failure

    def _serve(self) -> None:
        """Sleep until bytes come or something is due, and see to it."""
        port, replies = self._port, self._replies
        watched = [port.fileno(), self._wake_read] if port.plugged else [self._wake_read]
        readable, _, _ = select.select(watched, [], [], self._idle())
        while replies and replies[0][0] <= self._clock():
            port.write(heapq.heappop(replies)[2])
        if self._wake_read in readable:
            self._serve_requests()
        self._faults.advance(self._clock())
        if not port.plugged:
            replies.clear()
        elif port.fileno() in readable:
            now = self._clock()
            for reply in self._bus.receive(port.read(), now, port.baud_rate):
                self._replied += 1
                heapq.heappush(replies, (reply.at, self._replied, reply.data))
        # One step at a time, so that bytes and replies wait for no more than one.
        self._simulation.step_if_due(self._clock())

    def _serve_requests(self) -> None:
        os.read(self._wake_read, 4096)
        while not self._requests.empty():
            action, future = self._requests.get()
            try:
                future.set_result(action())
            except SnakeError as error:
                future.set_exception(error)

    def _idle(self) -> float:
        """Time until a reply, a step or a fault is due [s]."""
        until = min(self._simulation.next_step_at, self._faults.next_change_at)
        if self._replies:
            until = min(until, self._replies[0][0] - self._spin_s)
        return max(0.0, until - self._clock())


def _wake_punctually() -> None:
    """Have Linux wake this thread when it asked for, not up to 50 us later as is usual."""
    with contextlib.suppress(OSError):
        Path(f"/proc/{threading.get_native_id()}/timerslack_ns").write_text("1")
