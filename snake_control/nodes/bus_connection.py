"""From the configuration to servos that were checked: the port and what stands on it."""

from __future__ import annotations

import errno
import threading
import time
from collections.abc import Callable, Collection, Sequence

from snake_control.ax12.bus import Bus
from snake_control.ax12.chain import ServoChain
from snake_control.ax12.driven_joint import Motion
from snake_control.ax12.joint import JointSetup
from snake_control.ax12.port import SerialPort
from snake_control.ax12.startup import cycle_duration, handshake
from snake_control.config import BusDriverConfig
from snake_control.errors import BusError, SnakeError

READ_SHARE = 0.85
"""Part of the period after which reads are left to the next cycle."""

_FIRST_LOOK_S = 1.0


class _Port(SerialPort):
    """A port whose owner can be told to let go; he then fails at his next packet."""

    def __init__(self, driver: BusDriverConfig, given_up: threading.Event | None) -> None:
        super().__init__(driver.port, driver.baud_rate, driver.reply_timeout_s)
        self._given_up = given_up

    def writePort(self, packet: list[int]) -> int:
        if self._given_up is not None and self._given_up.is_set():
            raise OSError(errno.ECANCELED, "given up")
        return super().writePort(packet)


def open_bus(
    driver: BusDriverConfig,
    warn: Callable[[str], None],
    given_up: threading.Event | None = None,
) -> Bus:
    """Open the port.

    Args:
        warn: takes findings about the port.
        given_up: once set, whatever is asked of the bus fails with ``BusError``.

    Raises:
        BusError: it cannot be opened.
    """
    port = _Port(driver, given_up)
    for text in port.warnings:
        warn(text)
    return Bus(port, driver.retries)


def check_servos(
    bus: Bus,
    joints: Sequence[JointSetup],
    models: Collection[int],
    driver: BusDriverConfig,
    warn: Callable[[str], None],
) -> ServoChain:
    """Return the servos, all of them as configured and read once; nothing is written.

    Raises:
        ServoError: everything that is missing or wrong.
        BusError: the port failed.
    """
    period = 1.0 / driver.rate_hz
    motion = Motion(
        period,
        driver.look_ahead_s,
        driver.acceleration_limit_rad_s2,
        driver.lost_after_misses,
        driver.follow_timeout_s,
        unheard_time=driver.unheard_timeout_s,
    )
    bus.reset_counters()
    found = handshake(bus, joints, models)
    chain = ServoChain(bus, joints, found.servos, motion, time.monotonic)
    chain.look_for_torque()
    chain.read(time.monotonic() + _FIRST_LOOK_S)
    bus.reset_counters()
    for text in found.warnings:
        warn(text)
    shortest = cycle_duration(found.servos, driver.baud_rate)
    if shortest > READ_SHARE * period:
        warn(
            f"a bus cycle takes {1e3 * shortest:.1f} ms at least, too long for rate_hz = "
            f"{driver.rate_hz:g}: not every servo is read in every cycle; lower Return Delay "
            "Time or rate_hz, or raise the baud rate"
        )
    return chain


class Attempt:
    """One try to open the port and to check the servos, in a thread of its own.

    It takes seconds when servos do not answer, and the bus thread must not wait. The bus belongs to
    that thread until ``done``; then to whoever takes it.
    """

    def __init__(
        self,
        driver: BusDriverConfig,
        joints: Sequence[JointSetup],
        models: Collection[int],
    ) -> None:
        """Begin."""
        self._driver = driver
        self._joints = joints
        self._models = models
        self._given_up = threading.Event()
        self._lock = threading.Lock()
        self._bus: Bus | None = None
        self._chain: ServoChain | None = None
        self._error: SnakeError | None = None
        self.warnings: list[str] = []
        self._thread = threading.Thread(target=self._run, name="bus opener", daemon=True)
        self._thread.start()

    @property
    def done(self) -> bool:
        """Whether it has ended."""
        return not self._thread.is_alive()

    def take(self) -> tuple[Bus, ServoChain]:
        """Return the outcome.

        Raises:
            BusError, ServoError: why it failed; the port is closed.
        """
        if self._error is not None:
            raise self._error
        if self._bus is None or self._chain is None:
            raise BusError("the attempt ended without an outcome")
        return self._bus, self._chain

    def give_up(self) -> None:
        """End it; the port is closed, by its own thread if a system call there does not return."""
        with self._lock:
            self._given_up.set()
        self._thread.join(_FIRST_LOOK_S)
        if self.done and self._bus is not None:
            self._bus.close()

    def _run(self) -> None:
        bus: Bus | None = None
        kept = False
        try:
            bus = open_bus(self._driver, self.warnings.append, self._given_up)
            chain = check_servos(
                bus, self._joints, self._models, self._driver, self.warnings.append
            )
            with self._lock:
                if not self._given_up.is_set():
                    self._bus, self._chain = bus, chain
                    kept = True
        except SnakeError as error:
            self._error = error
        finally:
            if bus is not None and not kept:
                bus.close()
