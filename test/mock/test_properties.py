"""What holds for mock servos after any sequence of instructions, time and power cycles."""

from __future__ import annotations

import copy
import dataclasses

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from snake_control.mock.control_table import BY_NAME, RAM_START, TABLE, TABLE_SIZE, RegisterFile
from snake_control.mock.firmware import execute
from snake_control.mock.models import MODELS, Model
from snake_control.mock.parameters import ServoParameters, Shutdown
from snake_control.mock.protocol import CONDITIONS, ErrorBit, InstructionPacket, StatusPacket
from snake_control.mock.servo import Servo
from support.packets import ACTION, BROADCAST, PING, READ, REG_WRITE, SYNC_WRITE, WRITE

TORQUE_LIMIT, TORQUE_ENABLE = BY_NAME["torque_limit"], BY_NAME["torque_enable"]
MEASURED = range(36, 44)
FIXED = [r.name for r in TABLE if not r.writable and r.address not in (*MEASURED, 44, 46)]


@dataclasses.dataclass(frozen=True)
class Step:
    """Time passes under a load."""

    dt: float
    load_nm: float


@dataclasses.dataclass(frozen=True)
class PowerCycle:
    """Off and on."""


Event = InstructionPacket | Step | PowerCycle
# Those that rule the motor come up more often than all the others.
_OFTEN = ("torque_enable", "moving_speed", "goal_position", "torque_limit", "return_delay_time")
WRITABLE = [register for register in TABLE if register.writable]
WRITABLE += [BY_NAME[name] for name in _OFTEN] * 4
IDS = st.sampled_from([1, 1, 1, 1, 2, 0, BROADCAST])


@st.composite
def good_writes(draw: st.DrawFn) -> bytes:
    """Return address and bytes of one register, mostly within its range."""
    register = draw(st.sampled_from(WRITABLE))
    edge = st.sampled_from([register.low, register.high, register.high // 2])
    value = draw(edge | st.integers(register.low, register.high) | st.just(register.high + 1))
    largest = 256**register.size - 1
    data = min(max(value, 0), largest).to_bytes(register.size, "little")
    return bytes((register.address,)) + data


WRITES = good_writes() | st.binary(max_size=8)
PACKETS = st.one_of(
    st.builds(InstructionPacket, IDS, st.sampled_from([WRITE, WRITE, WRITE, REG_WRITE]), WRITES),
    st.builds(InstructionPacket, IDS, st.just(READ), st.binary(min_size=2, max_size=2)),
    st.builds(InstructionPacket, IDS, st.sampled_from([PING, ACTION])),
    st.builds(
        lambda write: InstructionPacket(
            BROADCAST, SYNC_WRITE, bytes((*write[:1], len(write) - 1, 1)) + write[1:]
        ),
        good_writes(),
    ),
    st.builds(InstructionPacket, IDS, st.integers(0, 255), st.binary(max_size=12), st.booleans()),
)
STEPS = st.builds(Step, st.sampled_from([0.002, 0.05, 2.1]), st.sampled_from([0.0, 0.3, -0.8, 2.5]))
EVENTS = st.lists(PACKETS | PACKETS | PACKETS | STEPS | st.builds(PowerCycle), max_size=40)
PARAMETERS = st.builds(
    ServoParameters,
    eeprom_needs_torque_off=st.booleans(),
    goal_enables_torque=st.booleans(),
    shutdown_clears=st.sampled_from([Shutdown.TORQUE_LIMIT, Shutdown.TORQUE_ENABLE, Shutdown.BOTH]),
    has_factory_reset=st.booleans(),
    answers_broadcast_ping=st.booleans(),
)


def _servo(
    parameters: ServoParameters, model: Model, wheel: bool, angle: float, alarm: int, level: int
) -> Servo:
    return Servo(
        1,
        dataclasses.replace(parameters, motor=model.motor),
        model=model,
        angle_rad=angle,
        eeprom={
            "alarm_shutdown": alarm,
            "ccw_angle_limit": 0 if wheel else 1023,
            "status_return_level": level,
        },
    )


def _switched(servo: Servo, name: str) -> Servo:
    servo.store(name, 1)
    return servo


SERVOS = st.builds(
    _switched,
    st.builds(
        _servo,
        PARAMETERS,
        st.sampled_from(list(MODELS.values())),
        st.booleans(),
        st.floats(-3.0, 3.0),
        st.sampled_from([0, 4, 36, 127]),
        st.sampled_from([2, 2, 1, 0]),
    ),
    st.sampled_from(["torque_enable", "moving_speed", "led"]),
)


def do(servo: Servo, event: Event) -> StatusPacket | None:
    if isinstance(event, InstructionPacket):
        return execute(servo, event)
    if isinstance(event, Step):
        servo.step(event.dt, event.load_nm)
    else:
        servo.power_cycle()
    return None


def eeprom(servo: Servo) -> bytes:
    return servo.registers.read(0, RAM_START)


def table(servo: Servo) -> bytes:
    return servo.registers.read(0, TABLE_SIZE)


@given(SERVOS, EVENTS)
def test_registers_stay_in_range_and_what_is_fixed_stays(servo, events):
    fixed = {name: servo.registers[name] for name in FIXED}
    for event in events:
        do(servo, event)
        for register in TABLE:
            value = servo.registers[register.name]
            low = 0 if register.name == "lock" else register.low
            assert low <= value <= register.high, register.name
        assert {name: servo.registers[name] for name in FIXED} == fixed


@given(SERVOS, EVENTS)
def test_a_write_changes_nothing_that_is_measured(servo, events):
    for event in events:
        before = servo.registers.read(MEASURED.start, len(MEASURED))
        do(servo, event)
        writes = isinstance(event, InstructionPacket) and event.instruction != READ
        # A reset of the whole table is no write; neither is a power cycle.
        if writes and event.instruction != 0x06:
            assert servo.registers.read(MEASURED.start, len(MEASURED)) == before


@given(SERVOS, EVENTS)
def test_the_eeprom_does_not_change_while_a_strict_servo_is_driven(servo, events):
    for event in events:
        before, driven = eeprom(servo), servo.driven
        do(servo, event)
        if driven and servo.parameters.eeprom_needs_torque_off:
            assert eeprom(servo) == before


@given(SERVOS, EVENTS)
def test_a_lock_keeps_the_eeprom_and_itself_until_the_power_goes(servo, events):
    servo.store("lock", 1)
    before = eeprom(servo)
    for event in events:
        if not isinstance(event, PowerCycle):
            do(servo, event)
            assert (eeprom(servo), servo.registers["lock"]) == (before, 1)


@given(SERVOS, EVENTS)
def test_replies_come_only_from_who_was_asked_and_as_far_as_the_level_says(servo, events):
    for event in events:
        servo_id, level = servo.id, servo.registers["status_return_level"]
        reply = do(servo, event)
        if not isinstance(event, InstructionPacket):
            continue
        least = {PING: 0, READ: 1}.get(event.instruction, 2)
        expected = event.id == servo_id and level >= least
        if event.id == BROADCAST and event.instruction == PING:
            expected = servo.parameters.answers_broadcast_ping
        assert (reply is not None) is expected
        if reply is None:
            continue
        assert reply.id == servo_id
        assert reply.to_bytes()[3] == len(reply.parameters) + 2
        refused = reply.error & ~CONDITIONS
        if event.instruction == READ and not refused:
            assert len(reply.parameters) == event.parameters[1]
        else:
            assert reply.parameters == b""


@given(SERVOS, EVENTS)
def test_what_is_refused_changes_nothing_but_what_its_alarm_clears(servo, events):
    for event in events:
        before = table(servo)
        reply = do(servo, event)
        if reply is None or not reply.error & ~CONDITIONS:
            continue
        after = RegisterFile()
        after.write(0, before)
        if servo.shut_down:
            # An alarm that had been raised before has cleared the same already.
            for register in (TORQUE_LIMIT, TORQUE_ENABLE):
                after[register.name] = servo.registers[register.name]
        if isinstance(event, InstructionPacket) and event.instruction == ACTION:
            after["registered"] = 0
        assert table(servo) == after.read(0, TABLE_SIZE)


@given(SERVOS, EVENTS, WRITES)
def test_a_registered_write_does_what_a_write_does(servo, events, data):
    for event in events:
        do(servo, event)
    servo.waiting = None
    other = copy.deepcopy(servo)

    written = execute(servo, InstructionPacket(servo.id, WRITE, data))
    registered = execute(other, InstructionPacket(other.id, REG_WRITE, data))
    assert registered == written
    if other.waiting is not None:
        assert other.registers["registered"] == 1
        execute(other, InstructionPacket(other.id, ACTION))
    assert table(other) == table(servo)
    assert (other.id, other.driven, other.error) == (servo.id, servo.driven, servo.error)


@given(SERVOS, EVENTS)
def test_a_servo_that_is_shut_down_or_not_driven_gives_no_torque(servo, events):
    for event in events:
        do(servo, event)
        limp = servo.shut_down or not servo.driven
        if isinstance(event, Step) and limp:
            # The alarm may have come with this very step: the next one is limp.
            servo.step(0.002)
            assert servo.motion.output == 0.0
        elif isinstance(event, Step):
            assert abs(servo.motion.output) <= 1.0


@given(SERVOS, EVENTS)
def test_a_power_cycle_keeps_the_eeprom_and_gives_ram_its_defaults(servo, events):
    servo.power_cycle()
    fresh = {r.name: servo.registers[r.name] for r in TABLE if not r.eeprom}
    for event in events:
        do(servo, event)
    before = eeprom(servo)
    servo.power_cycle()

    r = servo.registers
    assert eeprom(servo) == before
    assert r["torque_limit"] == r["max_torque"]
    changing = {"torque_limit", "goal_position"}
    assert {n: r[n] for n in fresh if n not in changing} == {
        n: v for n, v in fresh.items() if n not in changing
    }
    assert (servo.driven, servo.shut_down, servo.waiting, servo.error) == (
        False,
        False,
        None,
        ErrorBit.NONE,
    )


@pytest.mark.parametrize("clears", [Shutdown.TORQUE_LIMIT, Shutdown.TORQUE_ENABLE, Shutdown.BOTH])
@given(events=EVENTS)
@settings(max_examples=50)
def test_every_shutdown_ends_once_its_cause_is_gone(clears, events):
    servo = _switched(Servo(1, ServoParameters(shutdown_clears=clears)), "torque_enable")
    do(servo, Step(2.1, 2.5))
    assert servo.shut_down
    for event in events:
        do(servo, event)
    servo.health.temperature_c = 25.0
    servo.store("torque_limit", 1023)
    servo.store("torque_enable", 1)
    cold = servo.registers["temperature_limit"] < 30
    voltages = servo.registers["min_voltage_limit"], servo.registers["max_voltage_limit"]
    if cold or not voltages[0] <= 111 <= voltages[1]:
        return
    assert not servo.shut_down
    servo.step(0.002)
    assert (servo.shut_down, servo.error) == (False, ErrorBit.NONE)
