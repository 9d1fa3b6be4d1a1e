"""What the bus thread does with the servos: its states, requests and faults, without thread or ROS.

Everything here runs in the one thread that owns the port, but for the emergency stop and commands.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager

from snake_control.ax12.arming import disarm_confirmed, require_off
from snake_control.ax12.chain import ServoChain
from snake_control.ax12.joint import WHEEL_MODE, joint_setups
from snake_control.ax12.lowering import Phase
from snake_control.config import Config
from snake_control.errors import BusError, ServoError, SnakeError
from snake_control.nodes.bus_command import CommandBuffer
from snake_control.nodes.bus_connection import READ_SHARE
from snake_control.nodes.bus_decision import Situation, Velocities, decide, named
from snake_control.nodes.bus_descent import Descent
from snake_control.nodes.bus_requests import NotLoweredError, RefusedError
from snake_control.nodes.bus_session import Session
from snake_control.nodes.bus_snapshot import State

HOLD_CYCLES = 5
"""Cycles of hold before the driver lets go: SYNC_WRITE is not acknowledged."""


class BusControl:
    """The servos of a robot and what is to be done with them.

    Attributes:
        session: port and servos.
        commands: the newest velocity command; any thread may put one in.
        emergency: whether an emergency stop is latched; outlives every other state.
    """

    def __init__(
        self, config: Config, warn: Callable[[str], None], error: Callable[[str], None]
    ) -> None:
        """Prepare; nothing is opened yet.

        Args:
            warn, error: take one line for the log.
        """
        self._driver = config.bus_driver
        self._joints = joint_setups(config.robot, config.servos)
        self._warn, self._error = warn, error
        self._period = 1.0 / self._driver.rate_hz
        self.session = Session(self._driver, self._joints, config.servos.accepted_models, warn)
        self.commands = CommandBuffer(self._driver.command_timeout_s)
        self.emergency = False
        self._active = False
        self._torque_wanted = False
        self._fault = ""
        self._note = ""
        self._descent: Descent | None = None
        self._descended: Future[str] | None = None
        self._hold_left = 0

    @property
    def busy(self) -> bool:
        """Whether a lowering is under way."""
        return self._descent is not None

    def start(self) -> tuple[float, ...]:
        """Open the port and check all servos; return their joints' angles [rad].

        Raises:
            BusError, ServoError: why not. Nothing was written.
        """
        self.session.start()
        self._fault = self._note = ""
        chain = self.session.chain
        assert chain is not None
        return tuple(reading.angle for reading in chain.readings())

    def cycle(self, begin: float) -> tuple[State, str, float]:
        """Do one bus cycle; return state, text, and when reading began [s]."""
        if self._descent is not None and (self.emergency or self._fault):
            self._abandon_descent(self._fault or "emergency stop")
        if self.session.poll(begin):
            self._warn(f"{self._driver.port} works again; {self._what_next()}")
        state, text, velocities = decide(self._situation(), self.commands, begin)
        chain = self.session.chain
        read_begin = begin
        if chain is not None:
            try:
                self._write(chain, velocities, begin)
                read_begin = time.monotonic()
                chain.read(begin + READ_SHARE * self._period)
            except BusError as error:
                self.lose_port(error)
            self._look_for_faults()
            self._follow_descent()
        return state, text, read_begin

    def hold_cycle(self) -> bool:
        """Send all joints to hold and read them; return whether they were led until now.

        Raises:
            BusError: the port failed.
        """
        chain = self.session.chain
        led = self._active or self._descent is not None
        if not led or chain is None or not chain.armed or self._driver.dry_run:
            return False
        begin = time.monotonic()
        chain.write(None)
        chain.read(begin + READ_SHARE * self._period)
        return True

    def stop_wheels(self) -> None:
        """Tell servos in wheel mode to stop, and nothing to the others; a lost port is no error."""
        chain = self.session.chain
        if chain is None or self._driver.dry_run or not self._active:
            return
        try:
            chain.stop_wheels()
        except BusError as error:
            self.lose_port(error)

    def end(self, torque_off: bool, turn: Callable[[], None]) -> None:
        """Let go of the servos; they hold by themselves unless torque is to go off.

        Args:
            torque_off: whether to take the torque, after a lowering if configured.
            turn: does one cycle in its time; a lowering takes several.
        """
        if not torque_off or self._driver.dry_run:
            self._active = False
            return
        lowered = True
        if self._driver.lower_before_torque_off:
            obstacle = self._why_no_descent()
            if obstacle:
                self._warn(f"the robot is not lowered: {obstacle}")
            else:
                if self._descent is None:
                    self._begin_descent()
                while self._descent is not None or self._hold_left:
                    turn()
                lowered = not self._note
        self._active = False
        if lowered and self.session.bus is not None:
            try:
                self._take_torque()
            except SnakeError as error:
                self._error(f"torque off at the end: {error}")

    def forsake(self) -> None:
        """Tell whoever waits for the end of a lowering that nobody goes on with it."""
        self._abandon_descent("the driver ends")

    # Requests; each returns what it did, in words.

    def activate(self) -> str:
        """Seed, write the RAM settings, switch torque on (if configured)."""
        self.commands.wait_for_start(time.monotonic())
        if self.session.chain is None:
            self.session.connect()
        bus, chain = self.session.bus, self.session.chain
        assert bus is not None
        assert chain is not None
        bus.reset_counters()
        self._torque_wanted = self._driver.torque_on_activate and not self._driver.dry_run
        if self._torque_wanted:
            self._arm(chain)
        elif chain.torque_on:
            self._warn(f"torque is on already at {named(chain.torque_on)}")
        self._fault = self._note = ""
        self._active = True
        return "active"

    def deactivate(self) -> str:
        """Leave the servos holding; commands are refused. Hold them before."""
        self._abandon_descent("deactivated")
        self._active = False
        self.commands.clear()
        return "inactive"

    def torque_on(self) -> str:
        """Hold the joints where they are now."""
        self._refuse_unless_ready()
        self._abandon_descent("torque was asked for")
        chain = self.session.chain
        if self._fault or chain is None:
            raise RefusedError(f"stopped: {self._fault}; call ~/recover")
        asked_at = time.monotonic()
        self.commands.clear()
        self._torque_wanted = True
        self._arm(chain)
        self._note = ""
        self.commands.wait_for_zero(asked_at, time.monotonic())
        return "torque is on, holding"

    def release(self) -> Future[str]:
        """Free the joints as ``torque_off`` does; the future tells the end of a lowering, too."""
        done: Future[str] = Future()
        # One that is under way already will do.
        text = self.torque_off() if self._descent is None else ""
        if self._descent is None:
            done.set_result(text)
        else:
            self._descended = done
        return done

    def torque_off(self) -> str:
        """Free the joints, or begin the lowering after which they are freed."""
        self._refuse_in_a_dry_run()
        if self._descent is not None:
            raise RefusedError(f"{self._descent.text}; ~/emergency_stop ends that")
        self.commands.clear()
        if self.session.bus is None:
            raise RefusedError(self._fault or "the port is not open")
        if not self._driver.lower_before_torque_off:
            self._take_torque()
            return "torque is off"
        obstacle = self._why_no_descent()
        if not obstacle:
            self._begin_descent()
            return "lowering; torque goes off at its end, bus_state tells when"
        self._take_torque()
        return f"torque is off; the robot was not lowered: {obstacle}"

    def _take_torque(self) -> None:
        self._torque_wanted = False
        bus, chain = self.session.bus, self.session.chain
        if bus is None:
            raise RefusedError("the port is not open")
        with self._watching_the_port():
            # A recovery that failed may leave the port open and the servos unknown.
            if chain is not None:
                chain.disarm()
            else:
                require_off(self._joints, disarm_confirmed(bus, self._joints))

    def recover(self) -> str:
        """Check all servos, forget the fault, arm unless torque was switched off on purpose."""
        if not self._active:
            raise RefusedError("not active")
        if self.emergency:
            raise RefusedError("emergency stop: call ~/reset_emergency_stop first")
        self._abandon_descent("recovering")
        asked_at = time.monotonic()
        self.commands.clear()
        try:
            self.session.connect()
            chain = self.session.chain
            assert chain is not None
            if self.emergency:
                raise RefusedError("emergency stop in the meantime")
            if self._torque_wanted:
                self._arm(chain)
        except SnakeError as error:
            self._fault = f"recovery failed: {error}"
            raise
        self._fault = self._note = ""
        self.commands.wait_for_zero(asked_at, time.monotonic())
        return "all servos answer" + ("" if self._torque_wanted else "; torque stays off")

    def _refuse_unless_ready(self) -> None:
        self._refuse_in_a_dry_run()
        if not self._active:
            raise RefusedError("not active")
        if self.emergency:
            raise RefusedError("emergency stop: call ~/reset_emergency_stop first")

    def _refuse_in_a_dry_run(self) -> None:
        if self._driver.dry_run:
            raise RefusedError("dry run: nothing is written to the servos")

    @contextmanager
    def _watching_the_port(self) -> Iterator[None]:
        try:
            yield
        except BusError as error:
            self.lose_port(error)
            raise

    def _arm(self, chain: ServoChain) -> None:
        try:
            with self._watching_the_port():
                chain.arm()
        except ServoError as error:
            if self._active:
                self._fault = str(error)
            raise

    # Lowering.

    def _why_no_descent(self) -> str:
        chain = self.session.chain
        if chain is None or not chain.armed:
            return "the joints are not held"
        if self.emergency:
            return "emergency stop"
        if self._fault:
            return self._fault
        # An old reading is no obstacle: its joint waits for a new one, or soon stops the robot.
        unknown = [
            reading.joint
            for reading in chain.readings()
            if reading.joint.mode != WHEEL_MODE and not math.isfinite(reading.angle)
        ]
        return f"no reading of {named(unknown)}" if unknown else ""

    def _begin_descent(self) -> None:
        self._note = ""
        self._descent = Descent(self._driver, self._joints, time.monotonic())

    def _follow_descent(self) -> None:
        """End a lowering that is done, given up or overtaken by something worse."""
        descent = self._descent
        if descent is None:
            return
        if descent.phase is Phase.GIVEN_UP:
            self._end_descent(descent.text)
        elif descent.phase is Phase.DONE:
            self._descent = None
            try:
                self._take_torque()
            except SnakeError as error:
                self._note = f"lowered, but torque is not off: {error}"
                self._error(self._note)
            self._tell_descent()

    def _abandon_descent(self, why: str) -> None:
        if self._descent is not None:
            self._end_descent(f"lowering ended, torque stays on: {why}")

    def _end_descent(self, note: str) -> None:
        self._descent = None
        self._note = note
        self._error(note)
        # Also where no command is executed: the last goal of a lowering lies ahead of the joint.
        self._hold_left = HOLD_CYCLES
        self._tell_descent()
        # Whoever asked for motion meanwhile must not get it all at once.
        now = time.monotonic()
        self.commands.wait_for_zero(now, now)

    def _tell_descent(self) -> None:
        if self._descended is not None:
            waiting, self._descended = self._descended, None
            if self._note:
                waiting.set_exception(NotLoweredError(self._note))
            else:
                waiting.set_result("torque is off, after a lowering")

    # One cycle.

    def _situation(self) -> Situation:
        session, chain = self.session, self.session.chain
        port = ""
        if session.lost:
            port = session.trouble or "opening it again"
            if not self._fault:
                port = f"{session.lost}; {port}"
        elif self._fault and session.reconnections and chain is not None and not chain.armed:
            port = "the port works again"
        return Situation(
            active=self._active,
            emergency=self.emergency,
            fault=self._fault,
            port=port,
            dry_run=self._driver.dry_run,
            armed=chain is not None and chain.armed,
            torque_on=() if chain is None else chain.torque_on,
            joints=len(self._joints),
            lowering="" if self._descent is None else self._descent.text,
            note=self._note,
        )

    def _write(self, chain: ServoChain, velocities: Velocities, now: float) -> None:
        if self._descent is not None:
            velocities = self._descent.step(chain.readings(), now)
        elif self._hold_left:
            self._hold_left -= 1
            velocities = None
        elif not self._active:
            return
        if self._driver.dry_run:
            chain.rehearse(velocities)
        elif chain.armed:
            chain.write(velocities)
        else:
            chain.stop_wheels()

    def _look_for_faults(self) -> None:
        chain = self.session.chain
        if chain is None or self._fault or not (self._active or self._descent):
            return
        fault = chain.fault()
        if fault:
            self._stop(fault)

    def _stop(self, why: str) -> None:
        self._fault = why
        self.commands.clear()
        self._error(f"stopped: {why}; the other joints hold; {self._what_next()}")

    def _what_next(self) -> str:
        if self._driver.dry_run:
            return "dry run"
        return "call ~/recover when it is put right" if self._active else "not active"

    def lose_port(self, error: BusError) -> None:
        """Note that the port failed; it is opened again by itself, torque comes with recovery."""
        self.session.lose(str(error), time.monotonic())
        self._abandon_descent(str(error))
        self._hold_left = 0
        if self._active and not self._driver.dry_run:
            self._stop(str(error))
        else:
            self._warn(f"port lost: {error}")
