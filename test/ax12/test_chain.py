"""Cycles of several servos: what is sent in one packet, what becomes of misses and misreadings."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Iterator

import pytest

from snake_control.ax12.bus import Bus
from snake_control.ax12.chain import ServoChain
from snake_control.ax12.driven_joint import Motion
from snake_control.ax12.health import HealthLog, Level, Thresholds, judge
from snake_control.ax12.joint import JointSetup
from snake_control.ax12.port import SerialPort
from snake_control.ax12.startup import handshake
from snake_control.ax12.units import RAD_PER_TICK, RAD_S_PER_SPEED_UNIT
from snake_control.errors import BusError, ServoError
from support.scripted_servos import PING, READ, SYNC_WRITE, ScriptedServos, packet
from support.waiting import wait_for

MOTION = Motion(period=0.02, look_ahead=0.15, acceleration=0.0, lost_after_misses=3)
MODES = {1: "joint", 2: "joint", 3: "wheel"}
THRESHOLDS = Thresholds(temperature_c=60.0, voltage_low_v=9.5, voltage_high_v=12.6, age_s=0.1)


def setup(servo_id: int, mode: str) -> JointSetup:
    # Joint 2 is mounted the other way round.
    direction = -1 if servo_id == 2 else 1
    return JointSetup(
        f"joint_{servo_id}", servo_id, direction, 0.0, mode, -2.6, 2.6, 5.5, 1, 32, 32, 1.0
    )


JOINTS = tuple(setup(servo_id, mode) for servo_id, mode in MODES.items())


@pytest.fixture
def servos() -> Iterator[ScriptedServos]:
    with ScriptedServos(MODES) as servos:
        servos.memory[3][6:10] = bytes(4)
        yield servos


@pytest.fixture
def chain(servos: ScriptedServos) -> Iterator[ServoChain]:
    bus = Bus(SerialPort(servos.path, 1000000, reply_timeout_s=0.02), retries=1)
    found = handshake(bus, JOINTS, (12,))
    bus.reset_counters()
    yield ServoChain(bus, JOINTS, found.servos, MOTION, time.monotonic)
    bus.close()


def read(chain: ServoChain, seconds: float = 1.0) -> None:
    chain.read(time.monotonic() + seconds)


def test_goals_and_speeds_of_all_joints_go_out_in_one_packet(
    chain: ServoChain, servos: ScriptedServos
) -> None:
    chain.arm()
    read(chain)
    servos.packets.clear()
    unit = RAD_S_PER_SPEED_UNIT
    chain.write([10 * unit, 10 * unit, 1.0])
    read(chain)
    goals, wheels = servos.instructions(SYNC_WRITE)
    ahead = 33 + 1 + 10 * unit * 0.15 / RAD_PER_TICK
    low = round(512 - ahead)
    high = round(512 + ahead)
    assert goals == packet(0xFE, 14, 0x83, 30, 4, 1, high % 256, 2, 10, 0, 2, low % 256, 1, 10, 0)
    assert wheels[2:9] == bytes((0xFE, 7, 0x83, 32, 2, 3, round(1.0 / 6.178 * 1023)))
    assert [p[4] for p in servos.packets] == [SYNC_WRITE] * 2 + [READ] * 3


def test_readings_are_in_the_joints_frame(chain: ServoChain, servos: ScriptedServos) -> None:
    for servo_id in (1, 2):
        servos.memory[servo_id][36:44] = bytes((0x64, 2, 20, 0, 0, 6, 105, 44))
    read(chain)
    one, two, _ = chain.readings()
    assert one.angle == pytest.approx(100 * RAD_PER_TICK)
    assert one.rate == pytest.approx(20 * RAD_S_PER_SPEED_UNIT)
    assert one.load == pytest.approx(-512 / 1023)
    assert (two.angle, two.rate, two.load) == (-one.angle, -one.rate, -one.load)
    assert (one.voltage, one.temperature) == (10.5, 44.0)
    assert 0.0 <= one.age < 1.0


def test_a_missed_reply_keeps_the_last_reading_and_shows_its_age(
    chain: ServoChain, servos: ScriptedServos
) -> None:
    read(chain)
    servos.answer = lambda i, answer: b"" if i[2] == 2 else answer
    read(chain)
    _, two, three = chain.readings()
    assert two.age > three.age + 0.03
    assert two.online
    assert (two.counters.replies, two.counters.retries, two.counters.misses) == (1, 1, 1)
    assert chain.fault() == ""


def test_a_servo_is_lost_after_misses_in_a_row_and_not_asked_again(
    chain: ServoChain, servos: ScriptedServos
) -> None:
    chain.arm()
    servos.answer = lambda i, answer: b"" if i[2] == 2 else answer
    for _ in range(3):
        assert chain.fault() == ""
        read(chain)
    assert chain.fault() == "no reply 3 times in a row from joint_2 (servo id 2)"
    assert [reading.online for reading in chain.readings()] == [True, False, True]
    servos.packets.clear()
    read(chain)
    assert [p[2] for p in servos.instructions(READ)] == [1, 3]


def test_dead_servos_cannot_keep_a_cycle_from_ending(
    chain: ServoChain, servos: ScriptedServos
) -> None:
    def asked() -> list[int]:
        servos.packets.clear()
        read(chain, 0.0)
        return [p[2] for p in servos.instructions(READ)]

    servos.answer = lambda i, answer: b"" if i[2] == 1 else answer
    # Out of time at once: one servo a cycle, each in turn.
    assert [asked() for _ in range(5)] == [[1], [2], [3], [1], [2]]


def move(chain: ServoChain, seconds: float) -> str:
    """Cycle with a velocity until there is a fault."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        chain.write([0.5, 0.5, 0.0])
        read(chain, 0.015)
        if fault := chain.fault():
            return fault
    return ""


def test_replies_that_nobody_believes_stop_the_robot(
    chain: ServoChain, servos: ScriptedServos
) -> None:
    begin = time.monotonic()
    chain.arm()
    servos.memory[1][36:38] = (2047).to_bytes(2, "little")
    assert move(chain, 20.0) == "no believable reading for 0.5 s from joint_1 (servo id 1)"
    assert time.monotonic() - begin >= 0.5
    goal = int.from_bytes(servos.memory[1][30:32], "little")
    assert abs(goal - 512) <= 4, "it was never seen to move"


def test_a_silent_bus_stops_the_robot_long_before_every_servo_is_lost(
    servos: ScriptedServos,
) -> None:
    bus = Bus(SerialPort(servos.path, 1000000, reply_timeout_s=0.005), retries=1)
    patient = dataclasses.replace(MOTION, lost_after_misses=1000)
    info = handshake(bus, JOINTS, (12,)).servos
    chain = ServoChain(bus, JOINTS, info, patient, time.monotonic)
    chain.arm()
    servos.answer = lambda _, answer: b""
    assert move(chain, 20.0).startswith("no believable reading for 0.5 s from joint_")
    bus.close()


def test_a_pause_of_this_process_is_no_fault(servos: ScriptedServos) -> None:
    now = 100.0
    bus = Bus(SerialPort(servos.path, 1000000, reply_timeout_s=0.02), retries=1)
    chain = ServoChain(bus, JOINTS, handshake(bus, JOINTS, (12,)).servos, MOTION, lambda: now)
    chain.arm()
    chain.read(now + 1.0)
    now += 5.0
    assert chain.fault() == ""
    bus.close()


def test_torque_off_is_verified(chain: ServoChain, servos: ScriptedServos) -> None:
    chain.arm()
    assert [joint.servo_id for joint in chain.torque_on] == [1, 2, 3]
    servos.answer = lambda i, answer: b"" if i[2] == 2 else answer
    with pytest.raises(ServoError) as caught:
        chain.disarm()
    assert caught.value.findings == ["joint_2 (servo id 2): torque off is not confirmed"]
    assert not chain.armed
    assert [reading.torque_on for reading in chain.readings()] == [False, True, False]
    servos.answer = None
    chain.disarm()
    assert chain.torque_on == ()


def test_torque_that_is_on_already_is_seen(chain: ServoChain, servos: ScriptedServos) -> None:
    servos.memory[2][24] = 1
    chain.look_for_torque()
    assert [joint.servo_id for joint in chain.torque_on] == [2]
    assert not chain.armed


def test_a_joint_pushed_beyond_its_servos_limits_is_held_at_the_limit(
    servos: ScriptedServos,
) -> None:
    def reads(position: int) -> None:
        nonlocal now
        now += 0.05
        servos.memory[1][36:38] = position.to_bytes(2, "little")
        chain.read(now + 1.0)

    now = 100.0
    bus = Bus(SerialPort(servos.path, 1000000, reply_timeout_s=0.02), retries=1)
    servos.memory[1][6:10] = bytes((*(300).to_bytes(2, "little"), *(700).to_bytes(2, "little")))
    servos.memory[1][36:38] = (695).to_bytes(2, "little")
    chain = ServoChain(bus, JOINTS, handshake(bus, JOINTS, (12,)).servos, MOTION, lambda: now)
    chain.arm()
    reads(720)
    chain.write([-0.5, 0.0, 0.0])
    reads(720)
    chain.write(None)
    reads(720)
    assert int.from_bytes(servos.memory[1][30:32], "little") == 700
    bus.close()


def test_an_alarm_that_switches_torque_off_is_a_fault(
    chain: ServoChain, servos: ScriptedServos
) -> None:
    chain.arm()
    servos.error_bits[1] = 1  # voltage: not among the shut-down bits of these servos
    read(chain)
    read(chain)
    assert chain.fault() == ""
    servos.error_bits[1] = 32
    read(chain)
    assert chain.fault() == ""
    read(chain)
    assert chain.fault() == "joint_1 (servo id 1) shut down: overload"


def test_a_servo_that_lost_power_for_a_moment_is_found(
    chain: ServoChain, servos: ScriptedServos
) -> None:
    chain.arm()
    servos.memory[2][24] = 0

    def found() -> str:
        read(chain)
        return chain.fault()

    wait_for(found, 10.0, "a fault")
    assert chain.fault().startswith("joint_2 (servo id 2): torque is off")
    assert not chain.readings()[1].torque_on


def test_an_unplugged_port_is_a_bus_error(chain: ServoChain, servos: ScriptedServos) -> None:
    chain.arm()
    servos.unplug()
    with pytest.raises(BusError):
        chain.write(None)


def test_judgement_and_its_log(chain: ServoChain, servos: ScriptedServos) -> None:
    log = HealthLog()

    def look() -> tuple[list[Level], list[tuple[Level, str]]]:
        # Voltage and temperature of one servo a cycle.
        for _ in JOINTS:
            read(chain)
        readings = chain.readings()
        verdicts = [judge(reading, THRESHOLDS) for reading in readings]
        return [verdict.level for verdict in verdicts], log.changes(readings, verdicts)

    assert judge(chain.readings()[0], THRESHOLDS).level is Level.STALE
    assert math.isnan(chain.readings()[0].angle)
    assert look() == ([Level.OK] * 3, [])
    servos.memory[1][43] = 65
    servos.memory[2][42] = 80
    servos.error_bits[3] = 0x24
    levels, lines = look()
    assert levels == [Level.WARN, Level.WARN, Level.ERROR]
    assert lines == [
        (Level.WARN, "joint_1 (servo id 1): 65 degC"),
        (Level.WARN, "joint_2 (servo id 2): 8.0 V"),
        (Level.ERROR, "joint_3 (servo id 3): reports overheating, overload"),
    ]
    assert look()[1] == []
    # Numbers are no change, another reason is one though the level stays.
    servos.memory[1][43] = 66
    assert look()[1] == []
    servos.memory[1][42] = 80
    assert look()[1] == [(Level.WARN, "joint_1 (servo id 1): 66 degC; 8.0 V")]
    servos.memory[1][42:44] = bytes((111, 40))
    assert look()[1] == [(Level.OK, "joint_1 (servo id 1): OK")]


def test_a_servo_that_answers_again_is_looked_at_before_the_next_goals(
    chain: ServoChain, servos: ScriptedServos
) -> None:
    chain.arm()
    read(chain)
    servos.answer = lambda i, answer: b"" if i[2] == 2 and i[4] == READ else answer
    read(chain)
    servos.answer = None
    # A firmware that takes a goal for a reason to give torque; all but the LED is as before.
    servos.memory[2][24:26] = bytes((1, 0))
    read(chain)
    read(chain)
    assert chain.fault().startswith("joint_2 (servo id 2): its settings are gone")
    before = len(servos.packets)
    chain.write([0.3, 0.3, 0.3])
    read(chain)
    goals, _ = [p for p in servos.packets[before:] if p[4] == SYNC_WRITE]
    assert list(goals[7:-1:5]) == [1], "joint 2 is left alone until it is armed again"
    servos.memory[2][25] = 1
    chain.arm()
    chain.write([0.3, 0.3, 0.3])
    read(chain)
    assert chain.fault() == ""
    assert list(servos.instructions(SYNC_WRITE)[-2][7:-1:5]) == [1, 2]


def test_a_wheel_that_shut_itself_down_is_told_to_stop(
    chain: ServoChain, servos: ScriptedServos
) -> None:
    chain.arm()
    chain.write([0.0, 0.0, 2.0])
    read(chain)
    assert int.from_bytes(servos.memory[3][32:34], "little") & 0x3FF > 0
    servos.error_bits[3] = 32
    read(chain)
    read(chain)
    chain.write([0.0, 0.0, 2.0])
    read(chain)
    assert int.from_bytes(servos.memory[3][32:34], "little") == 0


def test_goals_and_speeds_are_shown_in_the_joints_frame(
    chain: ServoChain, servos: ScriptedServos
) -> None:
    assert math.isnan(chain.readings()[0].goal)
    chain.arm()
    read(chain)
    unit = RAD_S_PER_SPEED_UNIT
    chain.write([10 * unit, 10 * unit, -1.0])
    one, two, three = chain.readings()
    ahead = (33 + 1) * RAD_PER_TICK + 10 * unit * 0.15
    assert (one.goal, two.goal) == pytest.approx((ahead, ahead), abs=RAD_PER_TICK)
    assert (one.goal_speed, two.goal_speed) == pytest.approx((10 * unit, 10 * unit))
    assert math.isnan(three.goal)
    assert three.goal_speed == pytest.approx(-1.0, rel=0.01)


def test_a_rehearsal_works_everything_out_and_sends_nothing(
    chain: ServoChain, servos: ScriptedServos
) -> None:
    servos.memory[1][36:38] = (600).to_bytes(2, "little")
    before = {i: bytes(memory) for i, memory in servos.memory.items()}
    chain.rehearse([0.5, 0.0, 0.0])
    assert math.isnan(chain.readings()[0].goal), "where it stands is not known yet"
    read(chain)
    for _ in range(3):
        chain.rehearse([0.5, 0.0, 0.5])
        read(chain)
    one, two, three = chain.readings()
    assert one.goal == pytest.approx(one.angle + 34 * RAD_PER_TICK + 0.075, abs=2 * RAD_PER_TICK)
    assert one.goal_speed == pytest.approx(0.5, rel=0.02)
    assert two.goal == two.angle
    assert three.goal_speed == pytest.approx(0.5, rel=0.02)
    chain.rehearse(None)
    assert chain.readings()[0].goal == one.angle
    assert {p[4] for p in servos.packets} <= {PING, READ}
    assert {i: bytes(memory) for i, memory in servos.memory.items()} == before


def test_the_share_of_failed_first_tries_is_counted(
    chain: ServoChain, servos: ScriptedServos
) -> None:
    for _ in range(3):
        read(chain)
    assert chain.error_rate == 0.0
    servos.answer = lambda i, answer: answer[:-1] + b"\0" if i[2] == 2 else answer
    read(chain)
    one, two, _ = chain.readings()
    assert (one.error_rate, two.error_rate) == (0.0, pytest.approx(0.01))
    assert chain.error_rate == pytest.approx(0.01 / 3)
    read(chain)
    assert chain.readings()[1].error_rate == pytest.approx(0.01 + 0.99 * 0.01)


def test_a_lost_servo_that_answers_again_is_seen(chain: ServoChain, servos: ScriptedServos) -> None:
    servos.answer = lambda i, answer: b"" if i[2] == 2 else answer
    for _ in range(3):
        read(chain)
    assert not chain.readings()[1].online
    servos.answer = None

    def back() -> bool:
        read(chain)
        return chain.readings()[1].online

    wait_for(back, 10.0, "the lost servo")


def test_a_joint_that_does_not_follow_stops_the_robot(
    chain: ServoChain, servos: ScriptedServos
) -> None:
    chain.arm()
    # Positions of scripted servos stay what they are, whatever their goals.
    servos.memory[2][40:42] = (0x400 + 700).to_bytes(2, "little")
    chain.write([0.5, 0.5, 0.0])
    doubts = set()
    fault = ""
    end = time.monotonic() + 20.0
    while not fault and time.monotonic() < end:
        chain.write([0.5, 0.5, 0.0])
        read(chain, 0.015)
        fault = chain.fault()
        doubts.add(judge(chain.readings()[1], THRESHOLDS, math.nan).text)
    assert fault == (
        "told to move and not seen moving: joint_1 (servo id 1) (its position does not change: "
        "blocked, no drive, or its sensor is stuck?), joint_2 (servo id 2) (blocked? load 68 %)"
    )
    assert "does not follow: blocked? load 68 %" in doubts
    chain.arm()
    assert chain.readings()[1].doubt == ""


def test_what_a_joint_can_reach_is_what_both_allow(servos: ScriptedServos) -> None:
    servos.memory[2][6:10] = bytes((*(300).to_bytes(2, "little"), *(800).to_bytes(2, "little")))
    bus = Bus(SerialPort(servos.path, 1000000, reply_timeout_s=0.02), retries=1)
    chain = ServoChain(bus, JOINTS, handshake(bus, JOINTS, (12,)).servos, MOTION, time.monotonic)
    one, two, three = chain.ranges
    assert one == pytest.approx((-2.6, 2.6), abs=RAD_PER_TICK)
    # Joint 2 is mounted the other way round.
    assert two == pytest.approx((-288 * RAD_PER_TICK, 212 * RAD_PER_TICK))
    assert three == (-math.inf, math.inf)
    bus.close()


def test_settings_are_looked_at_even_if_reading_takes_all_the_time(
    chain: ServoChain, servos: ScriptedServos
) -> None:
    chain.arm()
    servos.memory[2][34:36] = bytes(2)

    def found() -> str:
        chain.read(time.monotonic())
        return chain.fault()

    wait_for(found, 10.0, "the torque limit of 0")
    assert chain.fault().startswith("joint_2 (servo id 2): torque limit is 0")


def test_a_servo_that_holds_its_torque_back_is_judged_so(
    chain: ServoChain, servos: ScriptedServos
) -> None:
    chain.arm()
    servos.memory[1][34:36] = bytes(2)

    def found() -> bool:
        read(chain)
        return chain.readings()[0].shut_down

    wait_for(found, 10.0, "the torque limit of 0")
    verdict = judge(chain.readings()[0], THRESHOLDS)
    assert verdict.level is Level.ERROR
    assert "shut down" in verdict.text


@pytest.mark.parametrize(
    ("changes", "torque", "text"),
    [
        ({"load": -0.95}, 0.0, "load 95 %"),
        ({"error_rate": 0.08}, 0.0, "8 % of its replies fail at the first try"),
        ({}, -0.44, "carries 0.44 N m, should carry 0.3 N m for long"),
        ({"age": 0.2}, math.nan, "its reading is old"),
        ({"voltage": 13.0}, 0.1, "13.0 V"),
        ({"voltage": math.nan, "temperature": math.nan}, 0.0, "OK"),
        ({"load": 0.95, "temperature": 66.0}, 0.0, "66 degC; load 95 %"),
    ],
)
def test_every_threshold_warns(
    chain: ServoChain, changes: dict[str, float], torque: float, text: str
) -> None:
    read(chain)
    reading = dataclasses.replace(chain.readings()[0], **{"load": 0.0} | changes)  # type: ignore[arg-type]
    verdict = judge(reading, THRESHOLDS, torque)
    level = Level.OK if text == "OK" else Level.WARN
    assert (verdict.level, verdict.text) == (level, text)
