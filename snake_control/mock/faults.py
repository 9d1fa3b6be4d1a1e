"""Faults on request: what they are, and the injector that brings them about and ends them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Protocol

import numpy as np

from snake_control.errors import SnakeError
from snake_control.mock import disturbance
from snake_control.mock.bus import Bus, Reply
from snake_control.mock.fault_kinds import KINDS, Concerns, Kind
from snake_control.mock.servo import Servo


class FaultError(SnakeError, ValueError):
    """A fault that cannot be had.

    Attributes:
        field: what about it, as in the service and in scenario files.
        value: what was given.
        allowed: what would be accepted, in words.
    """

    def __init__(self, field: str, value: object, allowed: str) -> None:
        self.field, self.value, self.allowed = field, value, allowed
        super().__init__(f"{field} = {value!r}: {allowed}")


def checked(
    kinds: Mapping[str, Kind],
    name: str,
    duration_s: float,
    value: float | None,
    probability: float,
) -> Kind:
    """Return the kind of a fault.

    Raises:
        FaultError: there is none of that name, or what was given does not fit it.
    """
    kind = kinds.get(name)
    if kind is None:
        raise FaultError("fault", name, f"known are {', '.join(kinds)}")
    if not (math.isfinite(duration_s) and duration_s >= 0.0):
        raise FaultError("duration", duration_s, "give 0 (until cleared) or more")
    if not 0.0 < probability <= 1.0:
        raise FaultError("probability", probability, "give more than 0, at most 1")
    if value is not None and not kind.value:
        raise FaultError("value", value, f"{name} has no strength: give none")
    if value is not None and not kind.low <= value <= kind.high:
        raise FaultError("value", value, f"{kind.value}: {kind.low:g} to {kind.high:g}")
    return kind


@dataclasses.dataclass(frozen=True)
class Fault:
    """One fault to come.

    Attributes:
        kind: a name of ``fault_kinds.KINDS``.
        ids: servos concerned; none means all of them.
        duration_s: 0 until cleared [s].
        value: strength; ``None`` for the kind's default.
        probability: share of the packets concerned (faults of replies only).
    """

    kind: str
    ids: tuple[int, ...] = ()
    duration_s: float = 0.0
    value: float | None = None
    probability: float = 1.0

    def __post_init__(self) -> None:
        kind = checked(KINDS, self.kind, self.duration_s, self.value, self.probability)
        if kind.concerns is Concerns.LINE and self.ids:
            raise FaultError("ids", list(self.ids), f"{self.kind} concerns the line: give none")
        if self.probability != 1.0 and kind.concerns is not Concerns.REPLIES:
            raise FaultError("probability", self.probability, f"{self.kind} has none: give 1")

    @property
    def about(self) -> Kind:
        """The row of the table."""
        return KINDS[self.kind]

    @property
    def strength(self) -> float:
        """The value, or the kind's default."""
        return self.about.default if self.value is None else self.value

    def __str__(self) -> str:
        whom = "" if self.about.concerns is Concerns.LINE else "all servos"
        if self.ids:
            whom = f"servo {', '.join(map(str, self.ids))}"
        strength = f"{self.about.value} {self.strength:g}" if self.about.value else ""
        share = f"{self.probability:.3g} of the packets" if self.probability < 1.0 else ""
        time = f"for {self.duration_s:g} s" if self.duration_s else "until cleared"
        return " ".join(filter(None, (self.kind, whom, strength, share, time)))


class Line(Protocol):
    """The adapter between host and servos, as far as faults are concerned."""

    def unplug(self) -> None:
        """Vanish."""

    def replug(self) -> None:
        """Come back."""


@dataclasses.dataclass(eq=False)
class _Active:
    fault: Fault
    servos: tuple[Servo, ...]
    until: float
    undo: Callable[[], None]


class Injector:
    """Brings faults about on a bus, and ends them when their time is over.

    It is the bus's ``filter``. For the thread that serves the bus; reads no clock.
    """

    def __init__(
        self,
        bus: Bus,
        line: Line,
        rng: np.random.Generator,
        log: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Attach to a bus.

        Args:
            bus: whose replies and servos may be disturbed.
            line: what can be unplugged.
            rng: which packets, which bits.
            log: takes a line for every fault that begins or ends.
        """
        self._bus, self._line, self._rng, self._log = bus, line, rng, log
        self._active: list[_Active] = []
        self._coming: list[tuple[float, Fault]] = []
        self._by_servo: dict[int, list[Fault]] = {}

    @property
    def active(self) -> tuple[Fault, ...]:
        """Faults in force."""
        return tuple(entry.fault for entry in self._active)

    @property
    def next_change_at(self) -> float:
        """When the next fault begins or ends; infinite if none does."""
        ends = (entry.until for entry in self._active)
        begins = (at for at, _ in self._coming[:1])
        return min((*ends, *begins), default=math.inf)

    def schedule(self, faults: Iterable[tuple[float, Fault]]) -> None:
        """Have faults begin at given times.

        Raises:
            FaultError: ids that are not on the bus.
        """
        faults = list(faults)
        for _, fault in faults:
            self._servos(fault)
        self._coming = sorted([*self._coming, *faults], key=lambda entry: entry[0])

    def inject(self, fault: Fault, now: float) -> None:
        """Let a fault begin.

        Raises:
            FaultError: ids that are not on the bus, or have this very fault already.
        """
        servos = self._servos(fault)
        self._refuse_twice(fault, servos)
        until = now + fault.duration_s if fault.duration_s else math.inf
        undo = self._begin(fault, servos)
        self._active.append(_Active(fault, tuple(servos), until, undo))
        self._took_effect()
        self._log(f"fault: {fault}")

    def clear(self) -> int:
        """End all faults and forget those to come; return how many were in force."""
        self._coming.clear()
        count = len(self._active)
        while self._active:
            self._end(self._active[-1])
        return count

    def advance(self, now: float) -> None:
        """Begin and end what is due."""
        if now < self.next_change_at:
            return
        for entry in [entry for entry in self._active if entry.until <= now]:
            self._end(entry)
        while self._coming and self._coming[0][0] <= now:
            at, fault = self._coming.pop(0)
            try:
                # Its time counts from when it should have begun: the next may begin at its end.
                self.inject(fault, at)
            except FaultError as error:
                # Somebody has brought it about already, or given a servo another id.
                self._log(f"no fault: {error}")
        if self._active and self.next_change_at <= now:
            self.advance(now)

    # What the bus asks.

    def passes(self, servo: Servo) -> bool:
        """Whether an instruction reaches a servo."""
        return not any(f.kind == "no_reply" and self._hits(f) for f in self._of(servo))

    def spoil(self, servo: Servo, reply: bytes) -> tuple[bytes, float]:
        """Return what becomes of a servo's reply, and by how much it is late [s]."""
        late = 0.0
        for fault in self._of(servo):
            if fault.kind == "no_reply" or not self._hits(fault):
                continue
            count = round(fault.strength)
            if fault.kind == "late_reply":
                late = max(late, fault.strength)
            elif fault.kind == "corrupt_checksum" and reply:
                # Not in the header: without it there would be no packet at all.
                spoilt = bytearray(reply)
                at = int(self._rng.integers(min(2, len(reply) - 1), len(reply)))
                spoilt[at] ^= 1 << int(self._rng.integers(8))
                reply = bytes(spoilt)
            elif fault.kind == "truncated_reply":
                reply = reply[: max(0, len(reply) - count)]
            elif fault.kind == "extra_bytes":
                reply = self._rng.bytes(count) + reply + self._rng.bytes(count)
        return reply, late

    def echo(self, sent: bytes, at: float) -> Reply | None:
        """Return what the adapter sends back of the host's own bytes."""
        return Reply(at, sent) if self._echoes else None

    @property
    def frozen(self) -> bool:
        """Whether nothing passes the line."""
        return self._is_frozen

    # Causes.

    def _begin(self, fault: Fault, servos: Sequence[Servo]) -> Callable[[], None]:
        if fault.kind == "unplug":
            self._line.unplug()
            return self._line.replug
        if fault.kind == "duplicate_id":
            return self._duplicate(servos)
        cause = _CAUSES.get(fault.kind)
        if cause is None:
            return _nothing
        undone = [cause(servo, fault.strength) for servo in servos]

        def undo() -> None:
            for end in undone:
                end()

        return undo

    def _duplicate(self, servos: Sequence[Servo]) -> Callable[[], None]:
        twins = tuple(_twin(servo) for servo in servos)
        self._bus.servos += twins

        def undo() -> None:
            self._bus.servos = tuple(s for s in self._bus.servos if s not in twins)

        return undo

    def _end(self, entry: _Active) -> None:
        self._active.remove(entry)
        entry.undo()
        self._took_effect()
        self._log(f"fault over: {entry.fault}")

    def _took_effect(self) -> None:
        kinds = {entry.fault.kind for entry in self._active}
        self._echoes, self._is_frozen = "echo" in kinds, "frozen_bus" in kinds
        self._by_servo = {}
        for entry in self._active:
            if entry.fault.about.concerns is Concerns.REPLIES:
                for servo in entry.servos:
                    self._by_servo.setdefault(id(servo), []).append(entry.fault)
        # A bus without faults is not to be slowed down by looking for them.
        self._bus.filter = self if self._active else None

    def _refuse_twice(self, fault: Fault, servos: Sequence[Servo]) -> None:
        # What a fault of a servo or of the line changes is put back at its end; once.
        if fault.about.concerns is Concerns.REPLIES:
            return
        for other in self._active:
            if other.fault.kind != fault.kind:
                continue
            if not servos or {id(s) for s in other.servos} & {id(s) for s in servos}:
                raise FaultError(
                    "fault", fault.kind, f"in force already ({other.fault}): clear it first"
                )

    def _servos(self, fault: Fault) -> list[Servo]:
        present = {servo.id for servo in self._bus.servos}
        missing = sorted(set(fault.ids) - present)
        if missing:
            raise FaultError("ids", missing, f"on the bus are {sorted(present)}")
        if fault.about.concerns is Concerns.LINE:
            return []
        return [s for s in self._bus.servos if not fault.ids or s.id in fault.ids]

    def _of(self, servo: Servo) -> list[Fault]:
        return self._by_servo.get(id(servo), [])

    def _hits(self, fault: Fault) -> bool:
        return fault.probability >= 1.0 or self._rng.random() < fault.probability


def _nothing() -> None:
    pass


def _disturbed(servo: Servo, **changes: object) -> Callable[[], None]:
    """Disturb a servo; return what takes these changes back, and no others."""
    before = {name: getattr(disturbance.NONE, name) for name in changes}
    servo.disturbance = dataclasses.replace(servo.disturbance, **changes)  # type: ignore[arg-type]

    def undo() -> None:
        servo.disturbance = dataclasses.replace(servo.disturbance, **before)

    return undo


def _overload(servo: Servo, torque: float) -> Callable[[], None]:
    return _disturbed(servo, shaft_blocked=True, extra_load_nm=torque)


def _overheat(servo: Servo, temperature: float) -> Callable[[], None]:
    before = servo.health.temperature_c
    end = _disturbed(servo, temperature_c=temperature)

    def undo() -> None:
        end()
        servo.health.temperature_c = before

    return undo


def _under_voltage(servo: Servo, voltage: float) -> Callable[[], None]:
    servo.supply_voltage_v = voltage

    def undo() -> None:
        servo.supply_voltage_v = servo.parameters.supply_voltage_v

    return undo


def _power_cycle(servo: Servo, _: float) -> Callable[[], None]:
    servo.power_off()
    return servo.power_on


def _wrong_model(servo: Servo, number: float) -> Callable[[], None]:
    return _register(servo, "model_number", round(number))


def _baud_change(servo: Servo, rate: float) -> Callable[[], None]:
    return _register(servo, "baud_rate", max(0, round(2_000_000 / rate) - 1))


def _register(servo: Servo, name: str, value: int) -> Callable[[], None]:
    before = servo.registers[name]
    servo.store(name, value)
    return lambda: servo.store(name, before)


_CAUSES: dict[str, Callable[[Servo, float], Callable[[], None]]] = {
    "stuck_position": lambda servo, _: _disturbed(servo, frozen_sensor=True),
    "blocked_shaft": lambda servo, _: _disturbed(servo, shaft_blocked=True),
    "overload": _overload,
    "overheat": _overheat,
    "under_voltage": _under_voltage,
    "power_cycle": _power_cycle,
    "wrong_model": _wrong_model,
    "baud_change": _baud_change,
}


def _twin(servo: Servo) -> Servo:
    """Return a second servo as it comes from the bench: same id and rate, its own shaft."""
    names = ("baud_rate", "return_delay_time", "status_return_level")
    eeprom = {name: servo.registers[name] for name in names}
    return Servo(servo.id, servo.parameters, model=servo.model, angle_rad=0.3, eeprom=eeprom)
