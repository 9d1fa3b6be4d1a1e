"""Every kind of fault at byte level, in simulated time."""

import math

import numpy as np
import pytest

from snake_control.mock.bus import Bus
from snake_control.mock.fault_kinds import KINDS, Concerns
from snake_control.mock.faults import Fault, FaultError, Injector
from snake_control.mock.models import AX_18A
from snake_control.mock.servo import Servo
from support.packets import BROADCAST, PING, READ, SYNC_WRITE, WRITE, instruction, status, word

MBAUD = 1_000_000
OVERLOAD, OVERHEATING, VOLTAGE = 0x20, 0x04, 0x01


class Adapter:
    """What happened to the adapter."""

    def __init__(self) -> None:
        self.plugged = True

    def unplug(self) -> None:
        self.plugged = False

    def replug(self) -> None:
        self.plugged = True


class Rig:
    """Three servos on a disturbed line, and a clock that only this moves."""

    def __init__(self) -> None:
        self.servos = [Servo(i) for i in (1, 2, 3)]
        self.bus = Bus(self.servos)
        self.line = Adapter()
        self.log: list[str] = []
        self.now = 10.0
        self.faults = Injector(self.bus, self.line, np.random.default_rng(4), self.log.append)

    def inject(self, kind: str, *ids: int, **more: float) -> None:
        self.faults.inject(Fault(kind, ids, **more), self.now)

    def pass_time(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.01)):
            self.now += 0.01
            self.faults.advance(self.now)
            for servo in self.servos:
                servo.step(0.01)

    def send(self, data: bytes) -> list[tuple[float, bytes]]:
        self.now += 0.1
        self.faults.advance(self.now)
        return [(r.at - self.now, r.data) for r in self.bus.receive(data, self.now, MBAUD)]

    def answer(self, data: bytes) -> bytes:
        return b"".join(reply for _, reply in self.send(data))

    def ping(self, servo_id: int) -> bytes:
        return self.answer(instruction(servo_id, PING))

    def hold(self, servo_id: int) -> Servo:
        self.answer(instruction(servo_id, WRITE, 24, 1))
        return self.servos[servo_id - 1]


@pytest.fixture
def rig():
    return Rig()


def test_without_faults_nothing_looks_for_them(rig):
    assert rig.bus.filter is None
    rig.inject("echo", duration_s=0.5)
    assert rig.bus.filter is rig.faults
    rig.pass_time(0.6)
    assert rig.bus.filter is None


def test_a_servo_without_signal_neither_hears_nor_answers(rig):
    rig.inject("no_reply", 2)
    assert rig.ping(2) == b""
    rig.answer(instruction(BROADCAST, SYNC_WRITE, 32, 2, 1, *word(40), 2, *word(50)))
    assert [s.registers["moving_speed"] for s in rig.servos] == [40, 0, 0]
    assert rig.ping(1) == status(1)
    rig.faults.clear()
    assert rig.ping(2) == status(2)


def test_a_share_of_the_replies_is_lost(rig):
    rig.inject("no_reply", 1, probability=0.3)
    lost = sum(not rig.ping(1) for _ in range(1000))
    # Binomial: 300 +- 14.5.
    assert 235 < lost < 365


def test_a_late_reply_lets_others_pass(rig):
    rig.inject("late_reply", 1, value=0.05)
    (late, first), (soon, second) = rig.send(instruction(1, PING) + instruction(2, PING))
    assert (first, second) == (status(1), status(2))
    assert late - soon == pytest.approx(0.05, abs=0.001)


def test_a_corrupt_reply_has_one_wrong_bit_and_never_a_good_checksum(rig):
    rig.inject("corrupt_checksum", 1)
    good = status(1)
    for _ in range(200):
        bad = rig.ping(1)
        assert sum((a ^ b).bit_count() for a, b in zip(bad, good, strict=True)) == 1
        assert bad[:2] == good[:2]
    assert rig.ping(2) == status(2)


def test_a_truncated_reply_lacks_its_end(rig):
    rig.inject("truncated_reply", 1, value=2)
    assert rig.ping(1) == status(1)[:-2]
    rig.faults.clear()
    rig.inject("truncated_reply", 1, value=6)
    assert rig.send(instruction(1, PING)) == []


def test_noise_stands_around_a_reply(rig):
    rig.inject("extra_bytes", 1, value=5)
    noisy = rig.ping(1)
    assert (len(noisy), noisy[5:-5]) == (16, status(1))


def test_an_echo_comes_first_and_of_everything(rig):
    rig.inject("echo")
    ping = instruction(1, PING)
    assert rig.answer(ping) == ping + status(1)
    assert rig.answer(instruction(9, PING)) == instruction(9, PING)


def test_a_frozen_bus_swallows_bytes_and_servos_go_on(rig):
    servo = rig.hold(1)
    rig.answer(instruction(1, WRITE, 30, *word(600), *word(50)))
    rig.inject("frozen_bus", duration_s=1.0)
    before = servo.motion.angle_rad
    assert rig.answer(instruction(1, WRITE, 30, *word(400), *word(50))) == b""
    rig.pass_time(0.5)
    assert servo.motion.angle_rad > before + 0.1
    rig.pass_time(0.6)
    assert rig.ping(1) == status(1)
    assert servo.registers["goal_position"] == 600


def test_a_stuck_position_is_reported_while_the_shaft_turns(rig):
    servo = rig.hold(1)
    rig.inject("stuck_position", 1)
    first = rig.answer(instruction(1, READ, 36, 4))
    rig.answer(instruction(1, WRITE, 30, *word(600), *word(100)))
    rig.pass_time(0.5)
    assert servo.motion.angle_rad > 0.2
    assert rig.answer(instruction(1, READ, 36, 4)) == first
    rig.faults.clear()
    assert rig.answer(instruction(1, READ, 36, 4)) != first


def test_a_blocked_shaft_stays_and_overloads_the_servo(rig):
    servo = rig.hold(1)
    rig.inject("blocked_shaft", 1)
    rig.answer(instruction(1, WRITE, 30, *word(600), *word(0)))
    rig.pass_time(1.8)
    assert rig.ping(1) == status(1)
    # It gives all it has, counter-clockwise.
    assert rig.answer(instruction(1, READ, 40, 2)) == status(1, 0, *word(1023))
    rig.pass_time(0.4)
    assert rig.ping(1) == status(1, OVERLOAD)
    assert (servo.motion.angle_rad, servo.registers["torque_limit"]) == (0.0, 0)


def test_an_overload_shuts_down_by_the_servos_own_logic_and_stays_latched(rig):
    servo = rig.hold(1)
    rig.inject("overload", 1)
    assert rig.ping(1) == status(1)
    rig.pass_time(2.2)
    assert rig.ping(1) == status(1, OVERLOAD)
    rig.faults.clear()
    rig.pass_time(0.1)
    assert servo.registers["torque_limit"] == 0
    rig.answer(instruction(1, WRITE, 34, *word(1023)))
    rig.pass_time(0.1)
    assert rig.ping(1) == status(1)


def test_heat_and_low_voltage_are_reported_while_they_last(rig):
    temperature = rig.servos[0].health.temperature_c
    rig.inject("overheat", 1, value=90, duration_s=1.0)
    rig.inject("under_voltage", 2, value=5.0, duration_s=1.0)
    rig.pass_time(0.1)
    assert rig.answer(instruction(1, READ, 42, 2))[4:7] == bytes((OVERHEATING, 111, 90))
    assert rig.answer(instruction(2, READ, 42, 2))[4:6] == bytes((VOLTAGE, 50))
    rig.pass_time(1.1)
    assert rig.servos[0].health.temperature_c == pytest.approx(temperature, abs=0.1)
    # The heat had shut it down: its servo remembers, the voltage did not.
    assert (rig.ping(1), rig.ping(2)) == (status(1, OVERHEATING), status(2))


def test_without_power_a_servo_is_silent_limp_and_forgets(rig):
    servo = rig.hold(1)
    rig.answer(instruction(1, WRITE, 26, 3, 3, 64, 64))
    rig.inject("power_cycle", 1, duration_s=0.5)
    assert rig.ping(1) == b""
    for _ in range(20):
        servo.step(0.01, load_nm=0.5)
    assert servo.motion.angle_rad < -0.05
    rig.pass_time(0.6)
    assert rig.ping(1) == status(1)
    assert servo.registers.read(24, 6) == bytes((0, 0, 1, 1, 32, 32))
    sunk = round(512 + servo.motion.angle_rad / math.radians(300 / 1023))
    assert servo.registers["goal_position"] == sunk


def test_model_and_rate_return_at_the_end(rig):
    rig.inject("wrong_model", 1, value=18, duration_s=0.5)
    rig.inject("baud_change", 2, duration_s=0.5)
    assert rig.answer(instruction(1, READ, 0, 2)) == status(1, 0, 18, 0)
    assert rig.ping(2) == b""
    rig.pass_time(0.6)
    assert rig.answer(instruction(1, READ, 0, 2)) == status(1, 0, 12, 0)
    assert rig.ping(2) == status(2)


def test_two_servos_with_one_id_garble_each_other(rig):
    rig.inject("duplicate_id", 3)
    assert rig.answer(instruction(3, READ, 36, 8)) != b""
    assert rig.answer(instruction(3, READ, 36, 8))[4:] != status(3, 0, *([0] * 8))[4:]
    good = len(rig.bus.servos)
    rig.faults.clear()
    assert (good, len(rig.bus.servos)) == (4, 3)
    assert rig.ping(3) == status(3)


def test_a_servo_of_the_same_id_is_of_the_same_model(rig):
    rig.bus.servos = (Servo(1, model=AX_18A),)
    rig.inject("duplicate_id", 1)
    assert [s.registers["model_number"] for s in rig.bus.servos] == [18, 18]


def test_the_adapter_is_pulled_out_for_a_time(rig):
    rig.inject("unplug", duration_s=0.3)
    assert not rig.line.plugged
    rig.pass_time(0.4)
    assert rig.line.plugged
    assert rig.log == ["fault: unplug for 0.3 s", "fault over: unplug for 0.3 s"]


def test_scheduled_faults_come_when_their_time_has_come(rig):
    rig.faults.schedule([(11.0, Fault("echo", duration_s=1.0)), (10.5, Fault("no_reply", (1,)))])
    assert rig.faults.next_change_at == 10.5
    rig.pass_time(0.4)
    assert rig.faults.active == ()
    rig.pass_time(0.7)
    assert {f.kind for f in rig.faults.active} == {"echo", "no_reply"}
    rig.pass_time(1.0)
    assert {f.kind for f in rig.faults.active} == {"no_reply"}
    assert rig.faults.next_change_at == math.inf


def test_faults_that_overlap_end_each_for_itself(rig):
    rig.inject("overload", 1, duration_s=0.2)
    rig.inject("stuck_position", 1, duration_s=0.4)
    rig.pass_time(0.3)
    outside = rig.servos[0].disturbance
    assert (outside.shaft_blocked, outside.extra_load_nm, outside.frozen_sensor) == (False, 0, True)


def test_scheduled_faults_of_one_kind_follow_each_other(rig):
    follow = [(10.5 + i, Fault("overload", (1,), duration_s=1.0)) for i in range(3)]
    rig.faults.schedule(follow)
    for _ in range(400):
        rig.now += 0.0173
        rig.faults.advance(rig.now)
    assert [line.partition(":")[0] for line in rig.log] == ["fault", "fault over"] * 3


def test_a_scheduled_fault_that_is_in_force_already_is_told_and_left_out(rig):
    rig.faults.schedule([(10.5, Fault("overload", (1,))), (10.6, Fault("no_reply", (2,)))])
    rig.inject("overload", 1)
    rig.pass_time(1.0)
    assert {f.kind for f in rig.faults.active} == {"overload", "no_reply"}
    assert rig.log[1].startswith("no fault: fault = 'overload': in force already")


def test_a_servo_that_gets_another_id_keeps_its_faults(rig):
    rig.inject("no_reply", 2)
    rig.servos[1].store("id", 9)
    assert rig.ping(9) == b""
    rig.inject("echo", duration_s=0.1)
    rig.pass_time(0.3)
    assert rig.ping(9) == b""
    rig.faults.clear()
    assert rig.ping(9)


@pytest.mark.parametrize(
    ("given", "field"),
    [
        ({"kind": "gremlins"}, "fault = 'gremlins': known are no_reply"),
        ({"kind": "echo", "ids": (1,)}, "ids"),
        ({"kind": "no_reply", "duration_s": -1.0}, "duration"),
        ({"kind": "no_reply", "duration_s": math.nan}, "duration"),
        ({"kind": "no_reply", "probability": 0.0}, "probability"),
        ({"kind": "no_reply", "probability": 1.1}, "probability"),
        ({"kind": "overload", "probability": 0.5}, "probability"),
        ({"kind": "no_reply", "value": 1.0}, "value"),
        ({"kind": "late_reply", "value": 11.0}, "value"),
        ({"kind": "late_reply", "value": math.nan}, "value"),
    ],
)
def test_a_fault_that_cannot_be_is_refused(given, field):
    with pytest.raises(FaultError, match=f"^{field}"):
        Fault(**given)


def test_ids_that_are_not_there_and_a_second_time_are_refused(rig):
    with pytest.raises(FaultError, match=r"ids = \[7\]: on the bus are \[1, 2, 3\]"):
        rig.inject("no_reply", 1, 7)
    rig.inject("overload", 1)
    with pytest.raises(FaultError, match="in force already"):
        rig.inject("overload")
    rig.inject("overload", 2)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_begins_ends_and_leaves_a_line_that_works(rig, kind):
    concerns = KINDS[kind].concerns
    rig.inject(kind, *(() if concerns is Concerns.LINE else (1, 3)), duration_s=0.5)
    rig.pass_time(0.2)
    rig.answer(instruction(1, READ, 36, 8))
    rig.pass_time(0.6)
    assert rig.faults.active == ()
    assert rig.line.plugged
    rig.servos[0].power_cycle()
    assert rig.ping(1) == status(1)
