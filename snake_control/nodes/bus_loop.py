"""The bus driver without ROS: one thread that owns the port and runs the bus cycle at a fixed rate.

Other threads only swap the command buffer, raise the emergency stop, or post a request that the
thread carries out between two cycles.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from snake_control.ax12.arming import disarm_confirmed, require_off
from snake_control.ax12.bus import Bus
from snake_control.ax12.chain import ServoChain
from snake_control.ax12.joint import JointSetup, joint_setups
from snake_control.config import Config
from snake_control.errors import BusError, ServoError, SnakeError
from snake_control.nodes.bus_command import CommandBuffer
from snake_control.nodes.bus_connection import READ_SHARE, check_servos, open_bus
from snake_control.nodes.bus_requests import RefusedError, Requests
from snake_control.nodes.bus_schedule import Schedule
from snake_control.nodes.bus_snapshot import Snapshot, State

_REQUEST_TIMEOUT_S = 10.0

_HOLD_BURST = 5
"""Cycles of hold before the driver lets go: SYNC_WRITE is not acknowledged."""

_PUBLISH_FAILURES = (
    ArithmeticError,
    AssertionError,
    LookupError,
    RuntimeError,  # of which rcl's own errors are
    TypeError,
    ValueError,
)
_LOG_PERIOD_S = 1.0


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
        self._requests = Requests()
        self._commands = CommandBuffer(self._driver.command_timeout_s)
        self._emergency = False
        self._stopping = False
        self._thread: threading.Thread | None = None
        self._bus: Bus | None = None
        self._chain: ServoChain | None = None
        self._active = False
        self._torque_wanted = False
        self._fault = ""
        self._publish_logged_at = -_LOG_PERIOD_S

    # For any thread.

    def open(self) -> None:
        """Open the port, check all servos, start the thread.

        Raises:
            BusError: the port cannot be opened.
            ServoError: everything that is missing or wrong on the bus. Nothing was written.
        """
        try:
            self._connect()
        except SnakeError:
            self._close_port()
            raise
        self._stopping = False
        self._fault = ""
        self._requests = Requests()
        self._thread = threading.Thread(target=self._run, name="bus", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Hold, take the torque if configured, stop the thread, close the port."""
        if self._thread is not None:
            self._stopping = True
            self._thread.join()
            self._thread = None
        self._close_port()

    def check(self) -> None:
        """Raise ``RefusedError`` if the thread ended by itself, which it must not."""
        if self._thread is not None and not self._thread.is_alive():
            raise RefusedError("the bus thread ended unexpectedly; its traceback is above")

    def command(self, velocities: Sequence[float], age: float) -> None:
        """Take joint velocities [rad/s] that were computed ``age`` seconds ago."""
        self._commands.take(velocities, age, time.monotonic())

    def refuse_command(self, why: str) -> None:
        """Say in the coming states that a command was not taken."""
        self._commands.refuse(why, time.monotonic())

    def emergency_stop(self) -> None:
        """Hold from the next cycle on and take no command until reset."""
        self._emergency = True
        self._commands.clear()

    def reset_emergency_stop(self) -> None:
        """Take commands again, from the next one on that is zero."""
        if self._emergency:
            now = time.monotonic()
            self._commands.wait_for_zero(now, now)
        self._emergency = False

    def activate(self) -> None:
        """Seed, write the RAM settings, switch torque on (if configured).

        Raises:
            BusError: the port failed.
            ServoError: a servo refused; no torque was switched on.
        """
        self._request(self._activate)

    def deactivate(self) -> None:
        """Come to rest and leave the servos holding; commands are refused."""
        self._request(self._deactivate)

    def set_torque(self, on: bool) -> None:
        """Free the joints, or hold them where they are now.

        Raises:
            RefusedError: not in this state.
            BusError: the port failed.
            ServoError: a servo refused torque, and none was switched on; or torque off was sent to
                all, but the servos named did not confirm it.
        """
        self._request(self._torque_on if on else self._torque_off)

    def recover(self) -> None:
        """Open the port anew if it failed, check all servos, forget the fault.

        They are armed unless torque was switched off on purpose.

        Raises:
            RefusedError: not in this state.
            BusError, ServoError: the fault stays; no torque was switched on, and none off.
        """
        self._request(self._recover)

    # In the thread of the loop.

    def _request(self, action: Callable[[], None]) -> None:
        if self._thread is None:
            raise RefusedError("the driver is not configured")
        self._requests.carry_out(action, _REQUEST_TIMEOUT_S)

    def _run(self) -> None:
        try:
            self._schedule.start(time.monotonic())
            while not self._stopping:
                if self._requests.serve():
                    # The time a request took is no lateness of the cycle.
                    self._schedule.start(time.monotonic())
                self._schedule.begin(time.monotonic())
                self._cycle()
                time.sleep(self._schedule.end(time.monotonic()))
        finally:
            try:
                self._let_go()
            finally:
                self._requests.end()

    def _cycle(self) -> None:
        begin = read_begin = time.monotonic()
        state, text, velocities = self._decide(begin)
        if self._chain is not None:
            try:
                if self._active and self._chain.armed:
                    self._chain.write(velocities)
                read_begin = time.monotonic()
                self._chain.read(begin + READ_SHARE * self._period)
            except BusError as error:
                self._lose_port(error)
            self._look_for_faults()
        end = time.monotonic()
        chain = self._chain
        readings = tuple(chain.readings()) if chain is not None else ()
        snapshot = Snapshot(
            state=state,
            text=text,
            read_at=0.5 * (read_begin + end),
            oldest_at=end - max((reading.age for reading in readings), default=math.inf),
            readings=readings,
            cycle_time=end - begin,
            cycle_rate=self._schedule.rate,
            command_age=self._commands.age(begin),
            cycles=self._schedule.cycles,
            late_cycles=self._schedule.late_cycles,
        )
        try:
            self._publish(snapshot)
        except _PUBLISH_FAILURES as error:
            # The joints must go on being led whoever may hear of it.
            if end - self._publish_logged_at >= _LOG_PERIOD_S:
                self._publish_logged_at = end
                self._error(f"the state cannot be published: {error!r}")

    def _decide(self, now: float) -> tuple[State, str, tuple[float, ...] | None]:
        """State, text and velocities (None: hold) of this cycle."""
        state, text, velocities = State.HOLDING, "", None
        if not self._active:
            state, text = State.INACTIVE, self._fault or "not activated"
        elif self._emergency:
            state, text = State.EMERGENCY_STOP, "emergency stop: needs ~/reset_emergency_stop"
            text += f"; {self._fault}" if self._fault else ""
        elif self._fault:
            state, text = State.STOPPED, f"{self._fault}; needs ~/recover"
        elif self._chain is None or not self._chain.armed:
            state, text = self._not_armed(() if self._chain is None else self._chain.torque_on)
        else:
            velocities, text = self._commands.newest(now)
            if velocities is not None:
                state = State.MOVING
        return state, text + self._commands.refusal(now), velocities

    def _not_armed(self, torque_on: Sequence[JointSetup]) -> tuple[State, str]:
        if not torque_on:
            return State.TORQUE_OFF, "torque is off"
        holds = len(torque_on) == len(self._joints)
        return (
            State.HOLDING if holds else State.TORQUE_OFF,
            f"torque is still on at {_named(torque_on)}; no command is taken before ~/set_torque",
        )

    def _look_for_faults(self) -> None:
        if self._chain is None or self._fault or not self._active:
            return
        fault = self._chain.fault()
        if fault:
            self._stop(fault)

    def _stop(self, why: str) -> None:
        self._fault = why
        self._commands.clear()
        self._error(f"stopped: {why}; the other joints hold; call ~/recover when it is put right")

    def _lose_port(self, error: BusError) -> None:
        self._close_port()
        self._stop(str(error))

    @contextmanager
    def _watching_the_port(self) -> Iterator[None]:
        try:
            yield
        except BusError as error:
            if self._active:
                self._lose_port(error)
            else:
                self._close_port()
                self._fault = str(error)
            raise

    def _close_port(self) -> None:
        if self._bus is not None:
            self._bus.close()
        self._bus = self._chain = None

    def _connect(self) -> None:
        """Open the port unless it is open, and check all servos.

        Raises:
            ServoError: the port stays open, and what was known of the servos stays.
            BusError: the port is closed.
        """
        if self._bus is None:
            self._bus = open_bus(self._driver, self._warn)
        with self._watching_the_port():
            self._chain = check_servos(
                self._bus, self._joints, self._models, self._driver, self._warn
            )

    def _activate(self) -> None:
        self._commands.clear()
        if self._chain is None:
            self._connect()
        assert self._bus is not None
        assert self._chain is not None
        self._bus.reset_counters()
        self._torque_wanted = self._driver.torque_on_activate
        if self._torque_wanted:
            self._arm(self._chain)
        elif self._chain.torque_on:
            self._warn(f"torque is on already at {_named(self._chain.torque_on)}")
        self._fault = ""
        self._schedule.reset_counts()
        self._active = True

    def _deactivate(self) -> None:
        self._burst_of_hold()
        self._active = False
        self._commands.clear()

    def _torque_on(self) -> None:
        self._refuse_unless_ready()
        if self._fault or self._chain is None:
            raise RefusedError(f"stopped: {self._fault}; call ~/recover")
        asked_at = time.monotonic()
        self._commands.clear()
        self._torque_wanted = True
        self._arm(self._chain)
        self._commands.wait_for_zero(asked_at, time.monotonic())

    def _torque_off(self) -> None:
        self._commands.clear()
        self._torque_wanted = False
        if self._bus is None:
            raise RefusedError(self._fault or "the port is not open")
        with self._watching_the_port():
            self._disarm(self._bus)

    def _recover(self) -> None:
        self._refuse_unless_ready()
        asked_at = time.monotonic()
        self._commands.clear()
        try:
            self._connect()
            assert self._chain is not None
            if self._torque_wanted:
                self._arm(self._chain)
        except SnakeError as error:
            self._fault = f"recovery failed: {error}"
            raise
        self._fault = ""
        self._commands.wait_for_zero(asked_at, time.monotonic())

    def _refuse_unless_ready(self) -> None:
        if not self._active:
            raise RefusedError("not active")
        if self._emergency:
            raise RefusedError("emergency stop: call ~/reset_emergency_stop first")

    def _arm(self, chain: ServoChain) -> None:
        try:
            with self._watching_the_port():
                chain.arm()
        except ServoError as error:
            if self._active:
                self._fault = str(error)
            raise

    def _disarm(self, bus: Bus) -> None:
        # A recovery that failed may leave the port open and the servos unknown.
        if self._chain is not None:
            self._chain.disarm()
        else:
            require_off(self._joints, disarm_confirmed(bus, self._joints))

    def _burst_of_hold(self) -> None:
        if not self._active or self._chain is None or not self._chain.armed:
            return
        try:
            for _ in range(_HOLD_BURST):
                begin = time.monotonic()
                self._chain.write(None)
                self._chain.read(begin + READ_SHARE * self._period)
                time.sleep(max(0.0, begin + self._period - time.monotonic()))
        except BusError as error:
            self._lose_port(error)

    def _let_go(self) -> None:
        try:
            self._burst_of_hold()
        finally:
            self._active = False
            if self._driver.torque_off_on_exit and self._bus is not None:
                try:
                    self._disarm(self._bus)
                except SnakeError as error:
                    self._error(f"torque off at the end: {error}")


def _named(joints: Sequence[JointSetup]) -> str:
    return ", ".join(map(str, joints))
