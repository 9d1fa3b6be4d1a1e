"""The bus driver without ROS: one thread that owns the port and runs the bus cycle at a fixed rate.

Other threads only swap the command buffer, raise the emergency stop, or post a request that the
thread carries out between two cycles.
"""

from __future__ import annotations

import dataclasses
import math
import queue
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future

from snake_control.ax12.bus import Bus
from snake_control.ax12.chain import Motion, ServoChain
from snake_control.ax12.joint import joint_setups
from snake_control.ax12.port import SerialPort
from snake_control.ax12.startup import cycle_duration, handshake
from snake_control.config import Config
from snake_control.errors import BusError, ServoError, SnakeError
from snake_control.nodes.bus_schedule import Schedule
from snake_control.nodes.bus_snapshot import Snapshot, State

_READ_SHARE = 0.85
"""Part of the period after which reads are left to the next cycle."""

_REQUEST_TIMEOUT_S = 10.0

_HOLD_BURST = 5
"""Cycles of hold before the driver lets go: SYNC_WRITE is not acknowledged."""


@dataclasses.dataclass(frozen=True)
class _Command:
    velocities: tuple[float, ...]
    computed_at: float


class RefusedError(SnakeError, RuntimeError):
    """A request that does not fit the state of the driver."""


class BusLoop:
    """Owner of the port and of the servos on it."""

    def __init__(
        self,
        config: Config,
        publish: Callable[[Snapshot], None],
        warn: Callable[[str], None],
        error: Callable[[str], None],
    ) -> None:
        """Prepare; nothing is opened yet.

        Args:
            publish: called after each cycle, in the thread of the loop.
            warn, error: take one line for the log, from any thread.
        """
        self._driver = config.bus_driver
        self._models = config.servos.accepted_models
        self._joints = joint_setups(config.robot, config.servos)
        self._publish = publish
        self._warn = warn
        self._error = error
        self._period = 1.0 / self._driver.rate_hz
        self._schedule = Schedule(self._period)
        self._requests: queue.SimpleQueue[tuple[Callable[[], None], Future[None]]] = (
            queue.SimpleQueue()
        )
        self._command: _Command | None = None
        self._emergency = False
        self._stopping = False
        self._thread: threading.Thread | None = None
        self._bus: Bus | None = None
        self._chain: ServoChain | None = None
        self._active = False
        self._fault = ""
        self._refused: tuple[float, str] = (-math.inf, "")

    # For any thread.

    def open(self) -> None:
        """Open the port, check all servos, start the thread.

        Raises:
            BusError: the port cannot be opened.
            ServoError: everything that is missing or wrong on the bus. Nothing was written.
        """
        self._connect()
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="bus", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Hold, take the torque if configured, stop the thread, close the port."""
        if self._thread is not None:
            self._stopping = True
            self._thread.join()
            self._thread = None
        if self._bus is not None:
            self._bus.close()
        self._bus = self._chain = None

    def check(self) -> None:
        """Raise ``RefusedError`` if the thread ended by itself, which it must not."""
        if self._thread is not None and not self._thread.is_alive():
            raise RefusedError("the bus thread ended unexpectedly; its traceback is above")

    def command(self, velocities: Sequence[float], age: float) -> None:
        """Take joint velocities [rad/s] that were computed ``age`` seconds ago."""
        self._command = _Command(tuple(velocities), time.monotonic() - age)

    def refuse_command(self, why: str) -> None:
        """Say in the coming states that a command was not taken."""
        self._refused = (time.monotonic(), why)

    def emergency_stop(self) -> None:
        """Hold from the next cycle on and take no command until reset."""
        self._emergency = True
        self._command = None

    def reset_emergency_stop(self) -> None:
        """Take commands again, new ones."""
        self._command = None
        self._emergency = False

    def activate(self) -> None:
        """Seed, write the RAM settings, switch torque on (if configured).

        Raises:
            BusError: the port failed.
            ServoError: a servo refused; no torque is on.
        """
        self._request(self._activate)

    def deactivate(self) -> None:
        """Come to rest and leave the servos holding; commands are refused."""
        self._request(self._deactivate)

    def set_torque(self, on: bool) -> None:
        """Free the joints, or hold them where they are now.

        Raises:
            RefusedError: not in this state.
            BusError, ServoError: as ``activate``.
        """
        self._request(self._torque_on if on else self._torque_off)

    def recover(self) -> None:
        """Open the port anew if it failed, check and arm all servos, forget the fault.

        Raises:
            RefusedError, BusError, ServoError: as ``set_torque``; the fault stays.
        """
        self._request(self._recover)

    # In the thread of the loop.

    def _request(self, action: Callable[[], None]) -> None:
        if self._thread is None:
            raise RefusedError("the driver is not configured")
        future: Future[None] = Future()
        self._requests.put((action, future))
        try:
            future.result(_REQUEST_TIMEOUT_S)
        except TimeoutError as error:
            raise RefusedError(f"not carried out within {_REQUEST_TIMEOUT_S:g} s") from error

    def _run(self) -> None:
        self._schedule.start(time.monotonic())
        while not self._stopping:
            self._serve_requests()
            self._schedule.begin(time.monotonic())
            self._cycle()
            time.sleep(self._schedule.end(time.monotonic()))
        self._serve_requests()
        self._let_go()

    def _serve_requests(self) -> None:
        served = False
        while not self._requests.empty():
            action, future = self._requests.get()
            try:
                action()
            except SnakeError as error:
                future.set_exception(error)
            else:
                future.set_result(None)
            served = True
        if served:
            # The time a request took is no lateness of the cycle.
            self._schedule.start(time.monotonic())

    def _cycle(self) -> None:
        begin = read_begin = time.monotonic()
        state, text, velocities = self._decide(begin)
        if self._chain is not None:
            try:
                if self._active and self._chain.armed:
                    self._chain.write(velocities)
                read_begin = time.monotonic()
                self._chain.read(begin + _READ_SHARE * self._period)
            except BusError as error:
                self._lose_port(error)
            self._look_for_faults()
        end = time.monotonic()
        chain = self._chain
        self._publish(
            Snapshot(
                state=state,
                text=text,
                read_at=0.5 * (read_begin + end),
                readings=tuple(chain.readings()) if chain is not None else (),
                armed=chain is not None and chain.armed,
                cycle_time=end - begin,
                cycle_rate=self._schedule.rate,
                command_age=self._command_age(begin),
                cycles=self._schedule.cycles,
                late_cycles=self._schedule.late_cycles,
            )
        )

    def _decide(self, now: float) -> tuple[State, str, tuple[float, ...] | None]:
        """State, text and velocities (None: hold) of this cycle."""
        state, text, velocities = State.HOLDING, "", None
        timeout = self._driver.command_timeout_s
        command = self._command
        if not self._active:
            state, text = State.INACTIVE, self._fault or "not activated"
        elif self._emergency:
            state, text = State.EMERGENCY_STOP, "emergency stop: needs ~/reset_emergency_stop"
            text += f"; {self._fault}" if self._fault else ""
        elif self._fault:
            state, text = State.STOPPED, f"{self._fault}; needs ~/recover"
        elif self._chain is None or not self._chain.armed:
            state, text = State.TORQUE_OFF, "torque is off"
        elif command is None:
            text = "holding: no command yet"
        elif now - command.computed_at > timeout:
            text = f"holding: no command for {timeout:.2f} s"
        else:
            state, text, velocities = State.MOVING, "moving", command.velocities
        refused_at, why = self._refused
        if now - refused_at < 1.0:
            text += f"; command ignored: {why}"
        return state, text, velocities

    def _command_age(self, now: float) -> float:
        command = self._command
        return math.inf if command is None else now - command.computed_at

    def _look_for_faults(self) -> None:
        if self._chain is None or self._fault or not self._active:
            return
        fault = self._chain.fault()
        if fault:
            self._stop(fault)

    def _stop(self, why: str) -> None:
        self._fault = why
        self._command = None
        self._error(f"stopped: {why}; the other joints hold; call ~/recover when it is put right")

    def _lose_port(self, error: BusError) -> None:
        if self._bus is not None:
            self._bus.close()
        self._bus = self._chain = None
        self._stop(str(error))

    def _connect(self) -> None:
        driver = self._driver
        port = SerialPort(driver.port, driver.baud_rate, driver.reply_timeout_s)
        try:
            bus = Bus(port, driver.retries)
            found = handshake(bus, self._joints, self._models)
        except SnakeError:
            port.close()
            raise
        for text in (*port.warnings, *found.warnings):
            self._warn(text)
        shortest = cycle_duration(found.servos, driver.baud_rate)
        if shortest > _READ_SHARE * self._period:
            self._warn(
                f"a bus cycle takes {1e3 * shortest:.1f} ms at least, too long for rate_hz = "
                f"{driver.rate_hz:g}: not every servo is read in every cycle; lower Return Delay "
                "Time or rate_hz, or raise the baud rate"
            )
        bus.reset_counters()
        motion = Motion(
            self._period,
            driver.look_ahead_s,
            driver.acceleration_limit_rad_s2,
            driver.lost_after_misses,
        )
        self._bus = bus
        self._chain = ServoChain(bus, self._joints, found.servos, motion, time.monotonic)

    def _activate(self) -> None:
        self._command = None
        if self._bus is None or self._chain is None:
            self._connect()
        assert self._bus is not None
        assert self._chain is not None
        self._bus.reset_counters()
        if self._driver.torque_on_activate:
            self._arm(self._chain)
        self._fault = ""
        self._schedule.reset_counts()
        self._active = True

    def _deactivate(self) -> None:
        self._burst_of_hold()
        self._active = False
        self._command = None

    def _torque_on(self) -> None:
        if not self._active:
            raise RefusedError("not active")
        if self._emergency:
            raise RefusedError("emergency stop: call ~/reset_emergency_stop first")
        if self._fault or self._chain is None:
            raise RefusedError(f"stopped: {self._fault}; call ~/recover")
        self._command = None
        self._arm(self._chain)

    def _torque_off(self) -> None:
        if self._chain is None:
            raise RefusedError(self._fault or "the port is not open")
        self._command = None
        try:
            self._chain.disarm()
        except BusError as error:
            self._lose_port(error)
            raise

    def _recover(self) -> None:
        if not self._active:
            raise RefusedError("not active")
        self._command = None
        if self._bus is not None:
            self._bus.close()
        self._bus = self._chain = None
        try:
            self._connect()
            assert self._chain is not None
            self._arm(self._chain)
        except SnakeError as error:
            self._fault = f"recovery failed: {error}"
            raise
        self._fault = ""

    def _arm(self, chain: ServoChain) -> None:
        try:
            chain.arm()
        except BusError as error:
            self._lose_port(error)
            raise
        except ServoError as error:
            if self._active:
                self._fault = str(error)
            raise

    def _burst_of_hold(self) -> None:
        if not self._active or self._chain is None or not self._chain.armed:
            return
        try:
            for _ in range(_HOLD_BURST):
                begin = time.monotonic()
                self._chain.write(None)
                self._chain.read(begin + _READ_SHARE * self._period)
                time.sleep(max(0.0, begin + self._period - time.monotonic()))
        except BusError as error:
            self._lose_port(error)

    def _let_go(self) -> None:
        self._burst_of_hold()
        if self._driver.torque_off_on_exit and self._chain is not None and self._chain.armed:
            try:
                self._chain.disarm()
            except BusError as error:
                self._lose_port(error)
        self._active = False
