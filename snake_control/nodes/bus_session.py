"""The port and the servos on it: open or lost, and opened again by itself.

A port that failed is closed, and opened anew with growing pauses, each time with the whole
handshake: after an unplugged adapter or a lost supply nothing that was known of the servos holds.
What then stands on the bus has no torque from here before somebody arms it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager

from snake_control.ax12.bus import Bus
from snake_control.ax12.chain import ServoChain
from snake_control.ax12.joint import JointSetup
from snake_control.config import BusDriverConfig
from snake_control.errors import BusError, SnakeError
from snake_control.nodes.bus_connection import Attempt, check_servos, open_bus


class Session:
    """Port and servos, for one thread at a time.

    Attributes:
        bus: ``None`` while the port is closed.
        chain: the servos as last checked; ``None`` without a port, and before the first check.
        lost: why the port was lost; empty while it is open, or was never.
        trouble: why it could not be opened again so far; empty before the first try failed.
        reconnections: how often it was opened again.
    """

    def __init__(
        self,
        driver: BusDriverConfig,
        joints: Sequence[JointSetup],
        models: Collection[int],
        warn: Callable[[str], None],
    ) -> None:
        self._driver = driver
        self._joints = joints
        self._models = models
        self._warn = warn
        self.bus: Bus | None = None
        self.chain: ServoChain | None = None
        self.lost = ""
        self.trouble = ""
        self.reconnections = 0
        self._attempt: Attempt | None = None
        self._next_at = math.inf
        self._pause = driver.reconnect_first_s

    def start(self) -> None:
        """Open the port and check all servos for the first time.

        Raises:
            BusError, ServoError: why not; the port is closed.
        """
        self.close()
        self.reconnections = 0
        try:
            self.connect()
        except SnakeError:
            self.close()
            raise

    def connect(self) -> None:
        """Open the port unless it is open, and check all servos, now; may take seconds.

        Raises:
            ServoError: a port that was open stays so, and what was known of the servos stays.
            BusError: the port is closed, and lost if it was in use.
        """
        self._end_attempt()
        try:
            if self.bus is None:
                self.bus = open_bus(self._driver, self._warn)
            with self.watched():
                self.chain = check_servos(
                    self.bus, self._joints, self._models, self._driver, self._warn
                )
        except SnakeError:
            if self.lost:
                self._close_port()
                self._next_at = time.monotonic() + self._pause
            raise
        self._found_again()

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Close the port if it fails inside; passes ``BusError`` on."""
        try:
            yield
        except BusError as error:
            self.lose(str(error), time.monotonic())
            raise

    def lose(self, why: str, now: float) -> None:
        """Close a port that failed; ``poll`` opens it again."""
        self._close_port()
        if not self.lost:
            self.lost = why
            self.trouble = ""
            self._pause = self._driver.reconnect_first_s
            self._next_at = now + self._pause

    def poll(self, now: float) -> bool:
        """While the port is lost: look after it, without waiting.

        Returns:
            Whether it just came back; ``chain`` is there then, with no torque from here.
        """
        if not self.lost:
            return False
        if self._attempt is None:
            if now >= self._next_at:
                self._attempt = Attempt(self._driver, self._joints, self._models)
            return False
        if not self._attempt.done:
            return False
        attempt, self._attempt = self._attempt, None
        try:
            self.bus, self.chain = attempt.take()
        except SnakeError as error:
            self._pause = min(2.0 * self._pause, self._driver.reconnect_longest_s)
            self._next_at = now + self._pause
            if str(error) != self.trouble:
                self.trouble = str(error)
                self._warn(f"the port is not back yet: {error}")
            return False
        for text in attempt.warnings:
            self._warn(text)
        self._found_again()
        return True

    def close(self) -> None:
        """Close the port on purpose."""
        self._end_attempt()
        self._close_port()
        self.lost = self.trouble = ""

    def _found_again(self) -> None:
        if self.lost:
            self.lost = self.trouble = ""
            self.reconnections += 1
            self._next_at = math.inf

    def _end_attempt(self) -> None:
        if self._attempt is not None:
            self._attempt.give_up()
            self._attempt = None

    def _close_port(self) -> None:
        if self.bus is not None:
            self.bus.close()
        self.bus = self.chain = None
