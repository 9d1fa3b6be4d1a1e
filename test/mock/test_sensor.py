import math

import pytest

from snake_control.mock.firmware import execute
from snake_control.mock.protocol import InstructionPacket
from snake_control.mock.servo import Servo
from snake_control.mock.units import angle_from_ticks, signed_magnitude, ticks_from_angle
from support.packets import READ

TICK_DEG = 300 / 1023


def telemetry(servo: Servo) -> tuple[int, int, int]:
    """Position, speed and load as one READ of eight bytes shows them."""
    status = execute(servo, InstructionPacket(servo.id, READ, bytes((36, 8))))
    assert status is not None
    assert len(status.parameters) == 8
    data = status.parameters
    position, speed, load = (int.from_bytes(data[i : i + 2], "little") for i in (0, 2, 4))
    return position, speed, load


def position_at(degrees: float) -> int:
    return telemetry(Servo(1, angle_rad=math.radians(degrees)))[0]


@pytest.mark.parametrize(
    ("degrees", "ticks"),
    [(0.0, 512), (TICK_DEG, 513), (-90.0, 205), (149.85, 1023), (-150.14, 0), (360.0, 512)],
)
def test_position_counts_in_steps_of_0_29_degrees_from_512(degrees, ticks):
    assert position_at(degrees) == ticks


def test_position_is_quantised_to_the_nearest_tick():
    assert {position_at(x * TICK_DEG) for x in (9.51, 9.9, 10.0, 10.2, 10.49)} == {522}


def test_ticks_and_angles_convert_both_ways():
    assert ticks_from_angle(angle_from_ticks(77)) == pytest.approx(77)
    assert angle_from_ticks(1023) - angle_from_ticks(0) == pytest.approx(math.radians(300))


@pytest.mark.parametrize("degrees", [151.0, 180.0, -179.0, -151.0, 200.0])
def test_in_the_dead_zone_position_is_garbage(degrees):
    servo = Servo(1, angle_rad=math.radians(degrees))
    readings = {telemetry(servo)[0] for _ in range(50)}

    assert len(readings) > 5
    assert all(400 <= reading < 600 for reading in readings)


def test_in_and_shortly_after_the_dead_zone_speed_is_garbage():
    servo = Servo(1, angle_rad=math.radians(180))
    servo.step(0.01)
    inside = {telemetry(servo)[1] for _ in range(50)}
    servo.motion.angle_rad = 0.0
    servo.step(0.01)
    shortly_after = {telemetry(servo)[1] for _ in range(50)}
    servo.step(0.1)

    assert max(inside) > 2047
    assert len(shortly_after) > 5
    assert telemetry(servo)[1] == 0


def test_the_garbage_of_two_servos_differs_and_is_the_same_again():
    def readings(servo_id: int) -> list[int]:
        servo = Servo(servo_id, angle_rad=math.pi)
        return [telemetry(servo)[0] for _ in range(20)]

    assert readings(1) == readings(1) != readings(2)


@pytest.mark.parametrize(("goal", "direction_bit"), [(1023, 0), (0, 1024)])
def test_speed_and_load_carry_the_direction_in_bit_10(goal, direction_bit):
    servo = Servo(1)
    for name, value in (("torque_enable", 1), ("moving_speed", 137), ("goal_position", goal)):
        servo.store(name, value)
    for _ in range(100):
        servo.step(0.005)
    _, speed, load = telemetry(servo)

    assert speed == 137 | direction_bit
    assert load & 1024 == direction_bit
    assert 0 < load & 1023 < 1023


@pytest.mark.parametrize(("command", "direction_bit"), [(900, 0), (900 | 1024, 1024)])
def test_in_wheel_mode_speed_counts_in_shares_of_the_speed_without_load(command, direction_bit):
    servo = Servo(1, eeprom={"cw_angle_limit": 0, "ccw_angle_limit": 0})
    servo.store("moving_speed", command)
    for _ in range(200):
        servo.step(0.005)
    servo.motion.angle_rad = 0.0
    servo.step(0.1)
    servo.motion.angle_rad = 0.0
    share = servo.motion.speed_rad_s / servo.parameters.motor.no_load_speed_rad_s

    assert telemetry(servo)[1] == round(abs(share) * 1023) | direction_bit


def test_load_is_the_output_and_not_the_torque():
    servo = Servo(1)
    for name, value in (("torque_enable", 1), ("goal_position", 512)):
        servo.store(name, value)
    for _ in range(400):
        servo.step(0.005, load_nm=0.6)

    # Friction carries 0.1 of the 0.6 N m.
    assert telemetry(servo)[2] == pytest.approx(0.5 / 1.5 / (11.1 / 12) * 1023, abs=2)
    servo.store("torque_enable", 0)
    servo.step(0.005, load_nm=0.6)
    assert telemetry(servo)[2] == 0


@pytest.mark.parametrize(
    ("value", "raw"), [(0.4, 0), (-0.4, 0), (0.6, 1), (-0.6, 1025), (5000.0, 1023), (-5000.0, 2047)]
)
def test_magnitude_and_direction_share_a_register(value, raw):
    assert signed_magnitude(value) == raw


def test_moving_lasts_from_the_goal_to_the_arrival():
    servo = Servo(1)
    for name, value in (("torque_enable", 1), ("moving_speed", 100), ("goal_position", 562)):
        servo.store(name, value)
    moving = [servo.moving]
    for _ in range(200):
        servo.step(0.005)
        moving.append(servo.moving)

    assert moving[0]
    assert moving == sorted(moving, reverse=True)
    at_full_speed_s = 50 * TICK_DEG / (100 * 0.666)
    assert at_full_speed_s < moving.count(True) * 0.005 < at_full_speed_s + 0.4


def test_moving_ends_where_a_load_stops_the_servo_short_of_its_goal():
    servo = Servo(1)
    for name, value in (("torque_enable", 1), ("goal_position", 522)):
        servo.store(name, value)
    for _ in range(400):
        servo.step(0.005, load_nm=0.8)

    assert not servo.moving
    assert telemetry(servo)[0] < 520
