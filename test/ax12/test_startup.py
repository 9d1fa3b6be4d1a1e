"""The handshake and the way to torque, on servos that are set up wrongly in every way."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import pytest

from snake_control.ax12.arming import arm, check_armed, disarm
from snake_control.ax12.bus import Bus
from snake_control.ax12.eeprom import ServoInfo
from snake_control.ax12.joint import JointSetup
from snake_control.ax12.port import SerialPort
from snake_control.ax12.startup import cycle_duration, handshake, inspect
from snake_control.ax12.units import RAD_PER_TICK, ticks_to_rad
from snake_control.errors import ServoError
from support.scripted_servos import READ, SYNC_WRITE, WRITE, ScriptedServos, packet

MODELS = (12, 18, 300)


def joint(servo_id: int, **changes: object) -> JointSetup:
    setup = JointSetup(
        name=f"joint_{servo_id}",
        servo_id=servo_id,
        direction=1,
        zero_offset=0.0,
        mode="joint",
        lower=-2.6,
        upper=2.6,
        speed_limit=5.5,
        margin_ticks=2,
        slope_raw=16,
        punch_raw=40,
        torque_limit=0.5,
    )
    return dataclasses.replace(setup, **changes)  # type: ignore[arg-type]


JOINTS = tuple(joint(i) for i in (1, 2, 3))


@pytest.fixture
def servos() -> Iterator[ScriptedServos]:
    with ScriptedServos([1, 2, 3]) as servos:
        yield servos


@pytest.fixture
def bus(servos: ScriptedServos) -> Iterator[Bus]:
    bus = Bus(SerialPort(servos.path, 1000000, reply_timeout_s=0.02), retries=1)
    yield bus
    bus.close()


def test_a_good_bus_gives_what_the_servos_say(bus: Bus, servos: ScriptedServos) -> None:
    servos.memory[2][0:2] = (300).to_bytes(2, "little")
    servos.memory[3][5] = 0
    found = handshake(bus, JOINTS, MODELS)
    assert [servo.model for servo in found.servos] == [12, 300, 12]
    assert [servo.return_delay for servo in found.servos] == [5e-4, 5e-4, 0.0]
    assert (found.servos[0].lower_ticks, found.servos[0].upper_ticks) == (5, 1019)
    assert found.warnings == ()
    assert servos.instructions(WRITE) == []
    assert servos.instructions(SYNC_WRITE) == []


def test_one_message_lists_everything(bus: Bus, servos: ScriptedServos) -> None:
    del servos.memory[1]
    servos.memory[2][0] = 29
    servos.memory[2][16] = 1
    servos.memory[3][6:10] = bytes(4)
    with pytest.raises(ServoError) as caught:
        handshake(bus, JOINTS, MODELS)
    assert caught.value.findings == [
        "joint_1 (servo id 1): does not answer",
        "joint_2 (servo id 2): is model 29, accepted are 12, 18, 300",
        "joint_2 (servo id 2): does not acknowledge writes: Status Return Level (address 16) is 1, "
        "set it to 2",
        "joint_3 (servo id 3): is in wheel mode but configured as joint: set CW Angle Limit "
        "(address 6) and CCW Angle Limit (address 8) to 0 and 1023 with torque off, or change "
        "servos.velocity_modes",
    ]
    assert all(finding in str(caught.value) for finding in caught.value.findings)
    assert servos.instructions(WRITE) == []
    assert servos.instructions(SYNC_WRITE) == []


def test_a_silent_bus_gets_a_hint(bus: Bus, servos: ScriptedServos) -> None:
    servos.memory.clear()
    with pytest.raises(ServoError, match=r"none of the servos answers.*baud rate"):
        handshake(bus, JOINTS, MODELS)


def test_an_echoing_adapter_is_named(bus: Bus, servos: ScriptedServos) -> None:
    servos.memory.clear()
    servos.answer = lambda instruction, _: instruction
    with pytest.raises(ServoError, match=r"\(echo\)"):
        handshake(bus, JOINTS, MODELS)


def test_two_servos_with_one_id_are_suspected(bus: Bus, servos: ScriptedServos) -> None:
    servos.answer = lambda i, answer: answer[:5] + b"\x55" if i[2] == 2 else answer
    with pytest.raises(ServoError, match=r"joint_2 .*two servos"):
        handshake(bus, JOINTS, MODELS)


def test_a_servo_that_answers_only_pings_is_told_apart(bus: Bus, servos: ScriptedServos) -> None:
    servos.answer = lambda i, answer: b"" if i[2] == 2 and i[4] != 1 else answer
    with pytest.raises(ServoError, match=r"joint_2 .*answers pings but not reads.*address 16"):
        handshake(bus, JOINTS, MODELS)


def test_a_joint_configured_as_wheel_but_set_up_as_joint(bus: Bus) -> None:
    joints = (joint(1, mode="wheel"), *JOINTS[1:])
    with pytest.raises(ServoError, match=r"joint_1 .*in joint mode but configured as wheel"):
        handshake(bus, joints, MODELS)


def test_no_torque_allowed_is_a_finding(bus: Bus, servos: ScriptedServos) -> None:
    servos.memory[1][14:16] = bytes(2)
    with pytest.raises(ServoError, match="Max Torque"):
        handshake(bus, JOINTS, MODELS)


def test_angle_limits_narrow_the_range_and_say_so(bus: Bus, servos: ScriptedServos) -> None:
    servos.memory[1][6:10] = bytes((*(300).to_bytes(2, "little"), *(800).to_bytes(2, "little")))
    found = handshake(bus, JOINTS, MODELS)
    assert (found.servos[0].lower_ticks, found.servos[0].upper_ticks) == (300, 800)
    assert len(found.warnings) == 1
    assert found.warnings[0].startswith("joint_1 (servo id 1): the servo's angle limits narrow")
    assert f"{ticks_to_rad(300):.3f}..{ticks_to_rad(800):.3f} rad" in found.warnings[0]


def test_limits_with_nothing_in_common_are_a_finding(bus: Bus, servos: ScriptedServos) -> None:
    servos.memory[1][6:10] = bytes((*(900).to_bytes(2, "little"), *(1000).to_bytes(2, "little")))
    joints = (joint(1, upper=1.0), *JOINTS[1:])
    with pytest.raises(ServoError, match="nothing in common"):
        handshake(bus, joints, MODELS)


def test_direction_and_offset_turn_the_range_over() -> None:
    turned = joint(1, direction=-1, zero_offset=0.5, lower=-1.0, upper=0.2)
    assert turned.range_ticks[0] == 512 + -(-0.3 // RAD_PER_TICK)
    assert turned.range_ticks[1] == 512 + 1.5 // RAD_PER_TICK
    assert turned.to_joint(turned.to_servo(0.123)) == pytest.approx(0.123)


def test_the_bus_time_of_eleven_servos_is_the_manuals() -> None:
    servo = ServoInfo(12, 24, 5e-4, (0, 1023), 0, 1023, 1023, 36)
    assert cycle_duration([servo] * 11, 1000000) == pytest.approx(8.55e-3, abs=1e-5)


def armed(bus: Bus, joints: tuple[JointSetup, ...] = JOINTS) -> tuple[int, ...]:
    seeds = arm(bus, joints, handshake(bus, joints, MODELS).servos)
    return tuple(seed.goal_ticks for seed in seeds)


def stand_at(servos: ScriptedServos, servo_id: int, ticks: int) -> None:
    servos.memory[servo_id][36:38] = ticks.to_bytes(2, "little")


def test_torque_comes_last_and_goals_are_where_the_joints_are(
    bus: Bus, servos: ScriptedServos
) -> None:
    for servo_id, ticks in ((1, 100), (2, 512), (3, 900)):
        stand_at(servos, servo_id, ticks)
    assert armed(bus) == (100, 512, 900)
    writes = servos.instructions(WRITE)
    torque = [i for i, write in enumerate(writes) if write[5] == 24]
    assert torque == list(range(len(writes) - 3, len(writes)))
    for servo_id, ticks in ((1, 100), (2, 512), (3, 900)):
        memory = servos.memory[servo_id]
        assert memory[24] == 1
        assert tuple(memory[26:30]) == (2, 2, 16, 16)
        assert int.from_bytes(memory[30:32], "little") == ticks
        assert 1 <= int.from_bytes(memory[32:34], "little") <= 30
        assert int.from_bytes(memory[34:36], "little") == 512
        assert int.from_bytes(memory[48:50], "little") == 40
    assert all(write[5] >= 24 for write in writes), "EEPROM was written"


def test_a_servo_that_holds_already_keeps_its_goal(bus: Bus, servos: ScriptedServos) -> None:
    """A restarted driver must not let a loaded joint sag by its droop once more."""
    servos.memory[1][39] = 4  # clockwise, at speed 0
    for servo_id in (1, 2):
        servos.memory[servo_id][26:30] = bytes((2, 2, 16, 16))
        servos.memory[servo_id][34:36] = (512).to_bytes(2, "little")
        servos.memory[servo_id][48:50] = (40).to_bytes(2, "little")
        servos.memory[servo_id][24] = 1
        servos.memory[servo_id][30:32] = (520).to_bytes(2, "little")
    servos.memory[2][38] = 5  # moving: its goal is a look-ahead of a driver that died
    assert armed(bus) == (520, 512, 512)


@pytest.mark.parametrize("sign", ["torque limit", "error bit"])
def test_a_joint_that_went_limp_is_not_lifted_to_its_old_goal(
    bus: Bus, servos: ScriptedServos, sign: str
) -> None:
    servos.memory[1][24] = 1
    servos.memory[1][30:32] = (520).to_bytes(2, "little")
    if sign == "torque limit":
        servos.memory[1][34:36] = bytes(2)
    else:
        servos.error_bits[1] = 32
    assert armed(bus) == (512, 512, 512)
    # Torque comes back with that of the others, not with the torque limit.
    first = servos.instructions(WRITE)[0]
    assert (first[2], first[5], first[6]) == (1, 24, 0)
    assert servos.memory[1][24] == 1


def test_a_servo_outside_its_angle_limits_is_not_armed(bus: Bus, servos: ScriptedServos) -> None:
    servos.memory[2][6:10] = bytes((*(300).to_bytes(2, "little"), *(800).to_bytes(2, "little")))
    stand_at(servos, 2, 900)
    with pytest.raises(ServoError, match=r"joint_2 .*outside its servo's angle limits"):
        armed(bus)
    assert [memory[24] for memory in servos.memory.values()] == [0, 0, 0]


def test_when_one_refuses_torque_the_others_lose_theirs(bus: Bus, servos: ScriptedServos) -> None:
    def refuse(instruction: bytes, answer: bytes) -> bytes:
        if instruction[2] == 3 and instruction[4] == WRITE and instruction[5] == 24:
            return packet(3, 2, 64)
        return answer

    servos.answer = refuse
    with pytest.raises(ServoError, match=r"joint_3 .*no torque.*instruction error"):
        armed(bus)
    assert bus.ping(1) is not None
    assert [memory[24] for memory in servos.memory.values()] == [0, 0, 0]


def test_when_one_refuses_torque_those_that_held_go_on_holding(
    bus: Bus, servos: ScriptedServos
) -> None:
    servos.memory[1][24] = 1
    servos.answer = lambda i, answer: packet(3, 2, 64) if tuple(i[2:6]) == (3, 5, 3, 24) else answer
    with pytest.raises(ServoError, match=r"joint_3 .*no torque"):
        armed(bus)
    assert bus.ping(1) is not None
    assert [memory[24] for memory in servos.memory.values()] == [1, 0, 0]


def test_wheels_get_no_goal_and_stand_still(bus: Bus, servos: ScriptedServos) -> None:
    servos.memory[1][6:10] = bytes(4)
    servos.memory[1][32:34] = b"\x64\x00"
    joints = (joint(1, mode="wheel"), *JOINTS[1:])
    armed(bus, joints)
    assert servos.memory[1][24] == 1
    assert servos.memory[1][32:34] == b"\x00\x00"
    goals = [w for w in servos.instructions(WRITE) if w[2] == 1 and w[5] <= 30 < w[5] + w[3] - 3]
    assert goals == []


def test_disarm_needs_no_replies(bus: Bus, servos: ScriptedServos) -> None:
    armed(bus)
    servos.answer = lambda _, answer: b""
    disarm(bus, JOINTS)
    servos.answer = None
    assert bus.ping(1) is not None
    assert [memory[24] for memory in servos.memory.values()] == [0, 0, 0]


@pytest.mark.parametrize(
    ("address", "value", "words"),
    [
        (34, 0, "torque limit is 0"),
        (24, 0, "torque is off"),
        (28, 32, "settings are gone"),
        (25, 0, "settings are gone"),
        (35, 1, "settings are gone"),
    ],
)
def test_a_servo_that_lost_its_settings_is_found(
    address: int, value: int, words: str, bus: Bus, servos: ScriptedServos
) -> None:
    infos = handshake(bus, JOINTS, MODELS).servos
    arm(bus, JOINTS, infos)
    assert check_armed(bus, JOINTS[0], infos[0]) == (True, False, "")
    servos.memory[1][address] = value
    if address == 34:
        servos.memory[1][35] = 0
    found = check_armed(bus, JOINTS[0], infos[0])
    assert found is not None
    assert found.torque_on is (address != 24)
    assert found.shut_down is (address == 34)
    assert words in found.wrong


@pytest.mark.parametrize(
    ("address", "value", "text"),
    [
        (18, 4, "does not shut down by itself at: overload; set Alarm Shutdown (address 18) to 36"),
        (11, 99, "Temperature Limit (address 11) is 99 degC"),
        (11, 40, "Temperature Limit (address 11) is 40 degC"),
        (12, 120, "its voltage limits 12.0 to 14.0 V do not hold the 11.1 V"),
        (15, 1, "Max Torque (address 14) allows 50 % of its torque, less than the 80 % configured"),
    ],
)
def test_settings_that_are_no_error_are_warned_of(
    address: int, value: int, text: str, bus: Bus, servos: ScriptedServos
) -> None:
    servos.memory[2][address] = value
    joints = (JOINTS[0], joint(2, torque_limit=0.8), JOINTS[2])
    (warning,) = handshake(bus, joints, MODELS).warnings
    assert warning.startswith(f"joint_2 (servo id 2): {text}")


def moving(servos: ScriptedServos, servo_id: int, by: int, times: int) -> None:
    """Let a free joint move on at each of its first looks at its position."""

    def answer(instruction: bytes, answer: bytes) -> bytes:
        nonlocal times
        if instruction[2] == servo_id and instruction[4] == READ and instruction[5] == 36 and times:
            times -= 1
            position = int.from_bytes(servos.memory[servo_id][36:38], "little") + by
            stand_at(servos, servo_id, position)
            return packet(servo_id, 4, 0, *position.to_bytes(2, "little"))
        return answer

    servos.answer = answer


def test_a_joint_that_sank_meanwhile_is_held_where_it_is_by_then(
    bus: Bus, servos: ScriptedServos
) -> None:
    moving(servos, 2, -50, 1)
    assert armed(bus) == (512, 462, 512)
    assert int.from_bytes(servos.memory[2][30:32], "little") == 462
    writes = [w for w in servos.instructions(WRITE) if w[2] == 2]
    assert [w[5] for w in writes[-2:]] == [30, 24], "goal, then torque"


def test_a_joint_that_does_not_stand_still_gets_no_torque(bus: Bus, servos: ScriptedServos) -> None:
    moving(servos, 2, 40, 99)
    with pytest.raises(ServoError, match=r"joint_2 .*no torque: it does not stand still"):
        armed(bus)
    assert bus.ping(1) is not None
    assert [memory[24] for memory in servos.memory.values()] == [0, 0, 0]


def test_servos_that_take_a_goal_for_torque_lose_it_when_another_fails(
    bus: Bus, servos: ScriptedServos
) -> None:
    def answer(instruction: bytes, answer: bytes) -> bytes:
        if instruction[2] == 1 and instruction[4] == WRITE:
            servos.memory[1][24] = 1
        return b"" if instruction[2] == 3 and instruction[4] == READ else answer

    joints, infos = JOINTS, handshake(bus, JOINTS, MODELS).servos
    servos.memory[2][24] = 1
    servos.answer = answer
    with pytest.raises(ServoError, match=r"joint_3 .*does not answer"):
        arm(bus, joints, infos)
    assert bus.ping(1) is not None
    assert [memory[24] for memory in servos.memory.values()] == [0, 1, 0]


def test_long_return_delays_are_advice_and_no_warning(bus: Bus, servos: ScriptedServos) -> None:
    (found,) = inspect(bus, JOINTS, MODELS).findings
    assert (found.error, found.advice, found.joint) == (False, True, None)
    assert str(found).startswith("the servos wait 1.5 ms in each cycle")
    assert "Return Delay Time (address 5) to 0" in found.text
    for memory in servos.memory.values():
        memory[5] = 0
    assert inspect(bus, JOINTS, MODELS).findings == ()
