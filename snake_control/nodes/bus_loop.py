"""The bus driver without ROS: one thread that owns the port and runs the bus cycle at a fixed rate.

Other threads only swap the command buffer, raise the emergency stop, or post a request that the
thread carries out between two cycles.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future

from snake_control.config import Config
from snake_control.errors import BusError
from snake_control.nodes.bus_control import HOLD_CYCLES, BusControl
from snake_control.nodes.bus_outbox import Outbox
from snake_control.nodes.bus_requests import RefusedError, Requests
from snake_control.nodes.bus_schedule import Schedule
from snake_control.nodes.bus_snapshot import Snapshot, State

_REQUEST_TIMEOUT_S = 10.0

_PUBLISH_FAILURES = (
    ArithmeticError,
    AssertionError,
    LookupError,
    RuntimeError,  # of which rcl's own errors are
    TypeError,
    ValueError,
)
_LOG_PERIOD_S = 1.0
_LAST_WORDS_S = 1.0


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
            publish: called after each cycle, in a thread of its own: it may block.
            warn, error: take one line for the log, from any thread.
        """
        self._driver = config.bus_driver
        self._control = BusControl(config, self._said_by(warn), self._said_by(error))
        self._publish = publish
        self._error = error
        self._outbox: Outbox | None = None
        self._period = 1.0 / self._driver.rate_hz
        self._schedule = Schedule(self._period)
        self._requests = Requests()
        self._stopping = False
        self._torque_off_at_end = False
        self._mistake = ""
        self._thread: threading.Thread | None = None
        self._publish_logged_at = -_LOG_PERIOD_S

    # For any thread.

    @property
    def emergency(self) -> bool:
        """Whether an emergency stop is latched."""
        return self._control.emergency

    def open(self) -> tuple[float, ...]:
        """Open the port, check all servos, start the thread; return the joints' angles [rad].

        Raises:
            BusError: the port cannot be opened.
            ServoError: everything that is missing or wrong on the bus. Nothing was written.
        """
        self.close()
        angles = self._control.start()
        self._stopping = self._torque_off_at_end = False
        self._requests = Requests()
        self._outbox = Outbox(self._deliver)
        self._thread = threading.Thread(target=self._run, name="bus", daemon=True)
        self._thread.start()
        return angles

    def close(self, torque_off: bool | None = None) -> None:
        """Hold, take the torque, stop the thread, close the port.

        Args:
            torque_off: whether to take the torque, after a lowering if configured; ``None`` for
                what the configuration says about the end.
        """
        if self._thread is not None:
            configured = self._driver.torque_off_on_exit
            self._torque_off_at_end = configured if torque_off is None else torque_off
            self._stopping = True
            self._thread.join()
            self._thread = None
        self._control.session.close()

    def check(self) -> None:
        """Raise ``RefusedError`` if the thread ended by itself, which it must not.

        To be called several times a second by whoever takes commands: it shows that they are taken.
        """
        self._control.commands.alive(time.monotonic())
        thread = self._thread
        if thread is not None and not thread.is_alive() and not self._stopping:
            raise RefusedError(
                f"the bus thread ended unexpectedly, its traceback is above: {self._mistake}"
            )

    def command(self, velocities: Sequence[float], age: float, stamp_ns: int = 0) -> None:
        """Take joint velocities [rad/s] that were computed ``age`` seconds ago."""
        self._control.commands.take(velocities, age, time.monotonic(), stamp_ns)

    def refuse_command(self, why: str) -> None:
        """Say in the coming states that a command was not taken."""
        self._control.commands.refuse(why, time.monotonic())

    def emergency_stop(self) -> None:
        """Hold from the next cycle on and take no command until reset."""
        self._control.emergency = True
        self._control.commands.clear()

    def reset_emergency_stop(self) -> None:
        """Take commands again, from the next one on that is zero."""
        if self._control.emergency:
            now = time.monotonic()
            self._control.commands.wait_for_zero(now, now)
        self._control.emergency = False

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

    def set_torque(self, on: bool) -> str:
        """Free the joints, or hold them where they are now; return what was done.

        If configured, the robot is lowered first; then this returns when the lowering has begun.

        Raises:
            RefusedError: not in this state.
            BusError: the port failed.
            ServoError: a servo refused torque, and none was switched on; or torque off was sent to
                all, but the servos named did not confirm it.
        """
        return self._request(self._torque_on if on else self._control.torque_off)

    def release(self) -> str:
        """Free the joints as ``set_torque(False)`` does; return when a lowering has ended, too.

        Raises:
            NotLoweredError: the lowering was given up or ended by somebody; torque stays on.
            RefusedError, BusError, ServoError: as ``set_torque``.
        """
        done: list[Future[str]] = []

        def begin() -> str:
            done.append(self._control.release())
            return "begun"

        self._request(begin)
        return done[0].result()

    def recover(self) -> str:
        """Open the port anew if it failed, check all servos, forget the fault.

        They are armed unless torque was switched off on purpose.

        Raises:
            RefusedError: not in this state.
            BusError, ServoError: the fault stays; no torque was switched on, and none off.
        """
        return self._request(self._recover)

    # In the thread of the loop.

    def _request(self, action: Callable[[], str]) -> str:
        if self._thread is None:
            raise RefusedError("the driver is not configured")
        return self._requests.carry_out(action, _REQUEST_TIMEOUT_S)

    def _activate(self) -> str:
        done = self._control.activate()
        self._schedule.reset_counts()
        return done

    def _torque_on(self) -> str:
        # No cycle runs while servos are asked and armed: what moves must come to rest before.
        self._burst_of_hold()
        return self._control.torque_on()

    def _recover(self) -> str:
        self._burst_of_hold()
        return self._control.recover()

    def _deactivate(self) -> str:
        self._burst_of_hold()
        return self._control.deactivate()

    def _run(self) -> None:
        try:
            self._schedule.start(time.monotonic())
            while not self._stopping:
                if self._requests.serve():
                    # The time a request took is no lateness of the cycle.
                    self._schedule.start(time.monotonic())
                self._turn()
        except Exception as error:
            self._mistake = repr(error)
            raise
        finally:
            try:
                self._come_to_an_end()
            finally:
                self._control.forsake()
                self._requests.end()
                assert self._outbox is not None
                self._outbox.close(_LAST_WORDS_S)

    def _turn(self) -> None:
        self._schedule.begin(time.monotonic())
        self._cycle()
        time.sleep(self._schedule.end(time.monotonic()))

    def _cycle(self) -> None:
        begin = time.monotonic()
        busy = self._control.busy
        state, text, read_begin = self._control.cycle(begin)
        end = time.monotonic()
        assert self._outbox is not None
        self._outbox.put(self._snapshot(state, text, begin, read_begin, end))
        if busy and not self._control.busy:
            # What ends a lowering takes longer than a cycle.
            self._schedule.start(time.monotonic())

    def _snapshot(
        self, state: State, text: str, begin: float, read_begin: float, end: float
    ) -> Snapshot:
        control, chain = self._control, self._control.session.chain
        moving = state is State.MOVING and chain is not None
        readings = () if chain is None else tuple(chain.readings())
        return Snapshot(
            state=state,
            text=text,
            read_at=0.5 * (read_begin + end),
            oldest_at=end - max((reading.age for reading in readings), default=math.inf),
            readings=readings,
            cycle_time=end - begin,
            cycle_rate=self._schedule.rate,
            command_age=control.commands.age(begin),
            followed=control.commands.followed if moving else None,
            goals_sent_at=read_begin,
            cycles=self._schedule.cycles,
            late_cycles=self._schedule.late_cycles,
            error_rate=0.0 if chain is None else chain.error_rate,
            reconnections=control.session.reconnections,
            emergency=control.emergency,
        )

    def _said_by(self, log: Callable[[str], None]) -> Callable[[str], None]:
        """Return a log that the thread of the loop may use: logging may block, too."""

        def say(text: str) -> None:
            if self._outbox is not None and threading.current_thread() is self._thread:
                self._outbox.say(log, text)
            else:
                log(text)

        return say

    # In the thread of the outbox.

    def _deliver(self, snapshot: Snapshot) -> None:
        try:
            self._publish(snapshot)
        except _PUBLISH_FAILURES as error:
            # The joints must go on being led whoever may hear of it.
            now = time.monotonic()
            if now - self._publish_logged_at >= _LOG_PERIOD_S:
                self._publish_logged_at = now
                self._error(f"the state cannot be published: {error!r}")

    def _come_to_an_end(self) -> None:
        try:
            self._burst_of_hold()
        finally:
            # A mistake that ended the thread may end the burst, too.
            self._control.stop_wheels()
            self._control.end(self._torque_off_at_end, self._turn)

    def _burst_of_hold(self) -> None:
        try:
            for _ in range(HOLD_CYCLES):
                begin = time.monotonic()
                if not self._control.hold_cycle():
                    return
                time.sleep(max(0.0, begin + self._period - time.monotonic()))
        except BusError as error:
            self._control.lose_port(error)
