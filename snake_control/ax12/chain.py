"""All servos of the robot as one thing: velocities in, readings out, one bus cycle at a time.

A cycle is: write (one SYNC_WRITE for goals and speeds, one more if there are wheel-mode servos),
then read the servos in the order of ``telemetry``. Reading ends when the cycle's time is up, so
that servos that do not answer cannot keep the others from their commands.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from snake_control.ax12 import control_table as ct
from snake_control.ax12.arming import (
    arm,
    check_armed,
    disarm_confirmed,
    read_torque,
    require_off,
)
from snake_control.ax12.bus import Bus, Counters
from snake_control.ax12.driven_joint import DrivenJoint, JointReading, Motion
from snake_control.ax12.eeprom import ServoInfo, effective_range
from snake_control.ax12.joint import JointSetup
from snake_control.ax12.telemetry import Request, TelemetrySchedule
from snake_control.errors import ServoError

_RETRY_SHARE = 0.25
_AT_REST = ct.MOVING_SPEED.encode(0)


class ServoChain:
    """All servos in joint order. For the one thread that owns the bus."""

    def __init__(
        self,
        bus: Bus,
        joints: Sequence[JointSetup],
        servos: Sequence[ServoInfo],
        motion: Motion,
        clock: Callable[[], float],
    ) -> None:
        """Join what the configuration and the servos themselves say.

        Args:
            clock: monotonic time [s]; readings are stamped with it.
        """
        self._bus = bus
        self._servos = [DrivenJoint(j, i, motion) for j, i in zip(joints, servos, strict=True)]
        self._clock = clock
        self._lost_after = motion.lost_after_misses
        self._armed = False
        self._written_at = -math.inf
        self._period = motion.period
        self._unheard_time = motion.unheard_time
        self._telemetry = TelemetrySchedule(len(self._servos), motion.period, motion.slow_period)
        self._finding = ""
        self._suspects: set[int] = set()

    @property
    def armed(self) -> bool:
        """Whether the last ``arm`` succeeded and torque was not taken since: goals may be sent.

        It says nothing about servos that nobody armed here; ``torque_on`` does.
        """
        return self._armed

    @property
    def torque_on(self) -> tuple[JointSetup, ...]:
        """Joints with torque, as last read from the servos."""
        return tuple(servo.joint for servo in self._servos if servo.torque_on)

    @property
    def joints(self) -> tuple[JointSetup, ...]:
        """The setup of every joint."""
        return tuple(servo.joint for servo in self._servos)

    @property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        """Range of each joint [rad]: the configured one within its servo's own angle limits."""
        return tuple(effective_range(servo.joint, servo.info) for servo in self._servos)

    @property
    def error_rate(self) -> float:
        """Share of the last requests to all servos without a good reply at the first try."""
        rates = [self._counters(servo).error_rate for servo in self._servos]
        return sum(rates) / len(rates)

    def arm(self) -> None:
        """Switch torque on where the joints are.

        Raises:
            ServoError: a servo refused; no torque was switched on, but servos that had it hold, now
                by themselves.
            BusError: the port failed (so do all methods).
        """
        # Until all are seeded anew, what was sent before is no place to return to.
        self._armed = False
        try:
            seeds = arm(self._bus, self.joints, [servo.info for servo in self._servos])
        except ServoError:
            self.look_for_torque()
            raise
        self._armed = True
        self._finding = ""
        self._suspects.clear()
        self._written_at = self._clock()
        for servo, seed in zip(self._servos, seeds, strict=True):
            servo.armed(seed, self._written_at)

    def disarm(self) -> None:
        """Switch torque off: the joints are free.

        Raises:
            ServoError: it was sent to all, but some servos did not confirm it.
        """
        found = disarm_confirmed(self._bus, self.joints)
        self._armed = False
        self._note_torque(found)
        require_off(self.joints, found)

    def look_for_torque(self) -> None:
        """Read from all servos whether torque is on; one that does not answer keeps its state."""
        self._note_torque([read_torque(self._bus, servo.joint) for servo in self._servos])

    def _note_torque(self, found: Sequence[bool | None]) -> None:
        for servo, on in zip(self._servos, found, strict=True):
            if on is not None:
                servo.torque_on = on

    def write(self, velocities: Sequence[float] | None) -> None:
        """Send one cycle's goals and speeds.

        Args:
            velocities: joint velocities [rad/s]; ``None`` to come to rest at once and hold.
        """
        now = self._clock()
        dt = now - self._written_at
        self._written_at = now
        goals: dict[int, bytes] = {}
        wheels: dict[int, bytes] = {}
        for i, servo in enumerate(self._servos):
            sent = servo.step(None if velocities is None else velocities[i], dt, now)
            if servo.limp:
                # There are firmwares to which a goal is a reason to switch torque on again.
                if servo.wheel:
                    wheels[servo.joint.servo_id] = _AT_REST
                continue
            speed = ct.MOVING_SPEED.encode(sent.speed_raw)
            if sent.goal_ticks is None:
                wheels[servo.joint.servo_id] = speed
            else:
                goals[servo.joint.servo_id] = ct.GOAL_POSITION.encode(sent.goal_ticks) + speed
        if goals:
            self._bus.sync_write(ct.GOAL_POSITION.address, goals)
        if wheels:
            self._bus.sync_write(ct.MOVING_SPEED.address, wheels)

    def stop_wheels(self) -> None:
        """Tell servos in wheel mode to stop, whoever set them going; joints need no such word.

        A wheel turns by its last Moving Speed until somebody says otherwise: through an unplugged
        adapter, and after a driver that died.
        """
        wheels = [servo.joint.servo_id for servo in self._servos if servo.wheel]
        if wheels:
            self._bus.sync_write(ct.MOVING_SPEED.address, dict.fromkeys(wheels, _AT_REST))

    def rehearse(self, velocities: Sequence[float] | None) -> None:
        """Work out one cycle's goals and speeds as ``write`` does, and send nothing.

        ``readings`` shows them. A joint that nobody holds rests wherever it is moved to.
        """
        now = self._clock()
        dt = now - self._written_at
        self._written_at = now
        for i, servo in enumerate(self._servos):
            servo.rehearse(None if velocities is None else velocities[i], dt, now)

    def read(self, until: float) -> None:
        """Read the servos, all of them if they answer in time.

        Args:
            until: time at which to leave the rest to the next cycle.
        """
        begin = self._clock()
        lost = frozenset(i for i, servo in enumerate(self._servos) if self._is_lost(servo))
        asked = self._check_suspects(until)
        asked = self._check(self._telemetry.check(lost, begin, spare=False)) or asked
        for request in self._telemetry.cycle(lost, begin):
            if asked and self._clock() >= until:
                return
            answered = self._read_one(self._servos[request.servo], request, until)
            self._telemetry.asked(request, begin, answered)
            asked = True
        now = self._clock()
        if now < until:
            self._check(self._telemetry.check(lost, now, spare=True))

    def _check_suspects(self, until: float) -> bool:
        """Look at the settings of servos that answer again: their power may have failed."""
        asked = False
        for index in sorted(self._suspects):
            if asked and self._clock() >= until:
                break
            self._suspects.discard(index)
            asked = self._check(index)
        return asked

    def _check(self, index: int | None) -> bool:
        """Look at the settings of a servo; return whether any was asked."""
        if index is None:
            return False
        servo = self._servos[index]
        found = check_armed(self._bus, servo.joint, servo.info)
        if found is not None:
            servo.torque_on, servo.shut_down = found.torque_on, found.shut_down
            if found.wrong and self._armed:
                servo.unset = True
                self._finding = f"{servo.joint}: {found.wrong}"
        return True

    def readings(self) -> list[JointReading]:
        """Return every joint as last seen."""
        now = self._clock()
        return [
            servo.reading(now, self._counters(servo), not self._is_lost(servo))
            for servo in self._servos
        ]

    def fault(self) -> str:
        """Return why the robot must not go on moving; empty if it may."""
        lost = [servo.joint for servo in self._servos if self._is_lost(servo)]
        if lost:
            return f"no reply {self._lost_after} times in a row from " + ", ".join(map(str, lost))
        if not self._armed:
            return ""
        alarms = [f"{s.joint} shut down: {', '.join(s.alarms)}" for s in self._servos if s.alarms]
        if alarms:
            return "; ".join(alarms)
        now = self._clock()
        unheard = [servo.joint for servo in self._servos if servo.unheard(now)]
        if unheard:
            return f"no believable reading for {self._unheard_time:g} s from " + ", ".join(
                map(str, unheard)
            )
        stuck = [f"{s.joint} ({s.not_following})" for s in self._servos if s.not_following]
        if stuck:
            return "told to move and not seen moving: " + ", ".join(stuck)
        return self._finding

    def _read_one(self, servo: DrivenJoint, request: Request, until: float) -> bool:
        """Read a servo; return whether it answered."""
        begin = self._clock()
        # A servo that missed before gets one try: time for retries belongs to the others. So does
        # one at the end of the time: a retry would delay the next cycle's goals.
        missed = self._counters(servo).misses_in_row > 0
        retries = 0 if missed or begin >= until - _RETRY_SHARE * self._period else None
        reply = self._bus.read(
            servo.joint.servo_id, ct.PRESENT_POSITION.address, request.length, retries
        )
        servo.asked_in_vain += 1
        if reply is None:
            return False
        if missed and self._armed:
            self._suspects.add(request.servo)
        servo.take(reply, 0.5 * (begin + self._clock()))
        return True

    def _counters(self, servo: DrivenJoint) -> Counters:
        return self._bus.counters.get(servo.joint.servo_id) or Counters()

    def _is_lost(self, servo: DrivenJoint) -> bool:
        return self._counters(servo).misses_in_row >= self._lost_after
