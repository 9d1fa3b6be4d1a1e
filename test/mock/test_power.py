"""A servo's supply: what goes with it, what stays, and what the shaft does meanwhile."""

import math

import pytest

from snake_control.mock.bus import Bus
from snake_control.mock.firmware import execute
from snake_control.mock.protocol import BROADCAST_ID, ErrorBit, InstructionPacket
from snake_control.mock.servo import Servo
from support.mock_servo import STEP_S, run
from support.packets import ACTION, PING, READ, REG_WRITE, WRITE, instruction, word

TICK_RAD = math.radians(300 / 1023)


def driven(**values: int) -> Servo:
    servo = Servo(1)
    for name, value in ({"torque_enable": 1} | values).items():
        servo.store(name, value)
    return servo


@pytest.mark.parametrize("to", [1, BROADCAST_ID])
@pytest.mark.parametrize(("code", "data"), [(PING, b""), (READ, b"\x24\x02"), (WRITE, b"\x19\x01")])
def test_without_power_a_servo_neither_answers_nor_obeys(to, code, data):
    servo = driven()
    servo.power_off()

    assert execute(servo, InstructionPacket(to, code, data)) is None
    assert Bus([servo]).receive(instruction(to, code, *data), 0.0, 1_000_000) == []
    assert servo.registers["led"] == 0


def test_without_power_the_shaft_is_free_and_ram_lost():
    servo = driven(goal_position=900, led=1)
    servo.power_off()
    run(servo, 1.0, load_nm=0.5)

    assert not servo.powered
    assert not servo.driven
    assert not servo.moving
    assert servo.motion.output == 0.0
    assert servo.motion.angle_rad < 0
    assert (servo.registers["led"], servo.registers["torque_enable"]) == (0, 0)


def test_with_power_again_it_answers_and_holds_nothing():
    servo = driven(goal_position=900)
    servo.power_off()
    servo.motion.angle_rad = 0.3
    servo.power_on()

    reply = execute(servo, InstructionPacket(1, READ, bytes((30, 2))))
    assert reply is not None
    ticks = int.from_bytes(reply.parameters, "little")
    assert ticks == pytest.approx(512 + 0.3 / TICK_RAD, abs=0.51)
    assert not servo.driven


def test_power_that_is_there_already_changes_nothing():
    servo = driven(goal_position=900)
    servo.power_on()

    assert servo.driven
    assert servo.registers["goal_position"] == 900


def test_a_write_from_outside_does_not_drive_a_servo_without_power():
    servo = Servo(1, eeprom={"cw_angle_limit": 0, "ccw_angle_limit": 0})
    servo.power_off()
    for name in ("torque_enable", "moving_speed"):
        servo.store(name, 1)
    run(servo, 0.1)

    assert not servo.driven
    assert servo.motion.output == 0.0


def test_a_registered_write_is_lost_with_the_power():
    servo = Servo(1)
    execute(servo, InstructionPacket(1, REG_WRITE, bytes((30, *word(500)))))
    assert servo.registers["registered"] == 1
    servo.power_cycle()

    assert servo.registers["registered"] == 0
    status = execute(servo, InstructionPacket(1, ACTION))
    assert status is not None
    assert status.error == ErrorBit.INSTRUCTION


def test_a_lock_is_lost_with_the_power_and_eeprom_is_not():
    servo = Servo(1)
    servo.store("return_delay_time", 3)
    servo.store("lock", 1)
    servo.power_cycle()

    assert (servo.registers["lock"], servo.registers["return_delay_time"]) == (0, 3)


def test_a_servo_without_power_cools():
    servo = driven()
    servo.health.temperature_c = 90.0
    run(servo, STEP_S)
    assert servo.error == ErrorBit.OVERHEATING
    servo.power_off()
    for _ in range(1000):
        servo.step(1.0)
    servo.power_on()
    run(servo, STEP_S)

    assert servo.error == ErrorBit.NONE
    assert servo.health.temperature_c == pytest.approx(
        25.0 + 65.0 * math.exp(-1000 / 300), abs=0.01
    )


def test_warmth_is_not_lost_with_the_power():
    servo = driven()
    servo.health.temperature_c = 90.0
    servo.power_cycle()
    run(servo, STEP_S)

    assert servo.error == ErrorBit.OVERHEATING


def test_in_the_dead_zone_power_on_takes_garbage_for_its_goal():
    servo = Servo(1, angle_rad=math.pi)
    goals = set()
    for _ in range(20):
        servo.power_cycle()
        goals.add(servo.registers["goal_position"])

    assert len(goals) > 3
    assert all(400 <= goal < 600 for goal in goals)
