"""Joint and wheel mode, goals, limits and their changes while a servo runs."""

import math

import pytest

from snake_control.mock.firmware import execute
from snake_control.mock.models import AX_12A, AX_12W
from snake_control.mock.parameters import ServoParameters
from snake_control.mock.protocol import ErrorBit, InstructionPacket
from snake_control.mock.servo import Servo
from snake_control.mock.units import SPEED_UNIT_RAD_S, TICK_RAD, angle_from_ticks
from support.packets import WRITE, word

OK = ErrorBit.NONE
# After a fast move friction holds the shaft a few counts away from its goal.
NEAR_RAD = 3 * TICK_RAD
STEP_S = 0.005
GOAL, SPEED, LIMITS, MAX_TORQUE, TORQUE_LIMIT = 30, 32, 6, 14, 34
WHEEL = (*word(0), *word(0))
JOINT = (*word(0), *word(1023))
RPM = 2 * math.pi / 60


def write(servo: Servo, address: int, *data: int) -> ErrorBit:
    status = execute(servo, InstructionPacket(servo.id, WRITE, bytes((address, *data))))
    assert status is not None
    return status.error


def run(servo: Servo, seconds: float, load_nm: float = 0.0) -> None:
    for _ in range(round(seconds / STEP_S)):
        servo.step(STEP_S, load_nm)


def permissive() -> Servo:
    return Servo(1, ServoParameters(eeprom_needs_torque_off=False))


def test_a_refused_goal_leaves_the_old_one_in_force():
    servo = Servo(1, eeprom={"cw_angle_limit": 300, "ccw_angle_limit": 700})
    servo.store("torque_enable", 1)
    assert write(servo, GOAL, *word(600)) == OK
    assert write(servo, GOAL, *word(701)) == ErrorBit.ANGLE_LIMIT
    run(servo, 2.0)

    assert servo.motion.angle_rad == pytest.approx(angle_from_ticks(600), abs=NEAR_RAD)


def test_narrower_limits_leave_the_goal_and_are_for_the_next_one():
    servo = permissive()
    servo.store("torque_enable", 1)
    assert write(servo, GOAL, *word(800)) == OK
    assert write(servo, LIMITS, *word(400), *word(600)) == OK
    run(servo, 2.0)
    assert servo.motion.angle_rad == pytest.approx(angle_from_ticks(800), abs=NEAR_RAD)

    assert write(servo, GOAL, *word(800)) == ErrorBit.ANGLE_LIMIT
    assert write(servo, GOAL, *word(600)) == OK


def test_a_shaft_outside_its_limits_at_power_on_is_held_where_it_is():
    servo = Servo(1, angle_rad=1.5, eeprom={"cw_angle_limit": 400, "ccw_angle_limit": 600})
    assert write(servo, 24, 1) == OK
    run(servo, 1.0)

    assert servo.motion.angle_rad == pytest.approx(1.5, abs=NEAR_RAD)


def test_limits_the_wrong_way_round_allow_no_goal():
    servo = Servo(1, eeprom={"cw_angle_limit": 700, "ccw_angle_limit": 300})

    goals = (0, 300, 500, 700, 1023)
    assert {write(servo, GOAL, *word(goal)) for goal in goals} == {ErrorBit.ANGLE_LIMIT}


@pytest.mark.parametrize("limits", [(0, 500), (500, 0), (1, 0)])
def test_one_limit_of_0_is_still_joint_mode(limits):
    cw, ccw = limits

    assert not Servo(1, eeprom={"cw_angle_limit": cw, "ccw_angle_limit": ccw}).wheel_mode


def test_torque_on_goes_back_to_a_goal_from_before():
    servo = Servo(1)
    for address, data in ((24, (1,)), (GOAL, word(600))):
        assert write(servo, address, *data) == OK
    run(servo, 1.0)
    write(servo, 24, 0)
    servo.motion.angle_rad = -1.0
    run(servo, 0.5)
    assert servo.motion.angle_rad == -1.0

    write(servo, 24, 1)
    run(servo, 2.0)
    assert servo.motion.angle_rad == pytest.approx(angle_from_ticks(600), abs=NEAR_RAD)


def test_max_torque_counts_from_the_next_power_on_and_torque_limit_at_once():
    servo = permissive()
    servo.store("torque_enable", 1)
    write(servo, GOAL, *word(1023))
    write(servo, MAX_TORQUE, *word(200))
    run(servo, 0.1)
    assert servo.motion.output == 1.0

    write(servo, TORQUE_LIMIT, *word(300))
    run(servo, 0.02)
    assert servo.motion.output == pytest.approx(300 / 1023)
    servo.power_cycle()
    assert servo.registers["torque_limit"] == 200


def test_a_torque_limit_of_0_is_free_run():
    servo = Servo(1)
    servo.store("torque_enable", 1)
    assert write(servo, TORQUE_LIMIT, *word(0)) == OK
    run(servo, 0.3, load_nm=0.5)

    assert servo.motion.output == 0.0
    assert servo.motion.angle_rad < -0.1
    assert not servo.shut_down


def test_in_wheel_mode_goal_and_speed_in_one_packet_are_refused_together():
    servo = Servo(1, eeprom={"cw_angle_limit": 0, "ccw_angle_limit": 0})

    assert write(servo, GOAL, *word(512), *word(300)) == ErrorBit.ANGLE_LIMIT
    assert (servo.registers["moving_speed"], servo.driven) == (0, False)


def test_a_goal_is_ignored_in_wheel_mode():
    servo = Servo(1, eeprom={"cw_angle_limit": 0, "ccw_angle_limit": 0})
    write(servo, SPEED, *word(400))
    servo.store("goal_position", 0)
    run(servo, 0.5)

    assert servo.motion.angle_rad > 0
    assert not servo.moving


def test_wheel_mode_needs_no_new_power_on():
    servo = Servo(1)
    assert write(servo, LIMITS, *WHEEL) == OK
    assert write(servo, SPEED, *word(1024 + 400)) == OK
    run(servo, 0.5)

    assert servo.driven
    assert servo.motion.speed_rad_s < -1.0


def test_torque_on_in_wheel_mode_turns_at_a_speed_from_before():
    servo = Servo(1)
    write(servo, SPEED, *word(400))
    write(servo, LIMITS, *WHEEL)
    run(servo, 0.5)
    assert servo.motion.speed_rad_s == 0.0

    write(servo, 24, 1)
    run(servo, 0.5)
    assert servo.motion.speed_rad_s > 1.0


@pytest.mark.parametrize("raw", [100, 1024 + 100])
def test_back_in_joint_mode_a_wheels_speed_has_no_direction(raw):
    servo = Servo(1, eeprom={"cw_angle_limit": 0, "ccw_angle_limit": 0})
    write(servo, SPEED, *word(raw))
    write(servo, 24, 0)
    assert write(servo, LIMITS, *JOINT) == OK
    assert write(servo, GOAL, *word(900)) == OK
    write(servo, 24, 1)
    run(servo, 0.5)

    assert servo.registers["moving_speed"] == raw
    assert servo.motion.speed_rad_s == pytest.approx(100 * SPEED_UNIT_RAD_S)


def test_a_wheel_that_turns_refuses_to_become_a_joint_until_torque_is_off():
    servo = Servo(1, eeprom={"cw_angle_limit": 0, "ccw_angle_limit": 0})
    write(servo, SPEED, *word(400))

    assert servo.registers["torque_enable"] == 0
    assert write(servo, LIMITS, *JOINT) == ErrorBit.RANGE
    write(servo, 24, 0)
    assert write(servo, LIMITS, *JOINT) == OK


@pytest.mark.parametrize(
    ("model", "joint_rpm", "wheel_rpm"), [(AX_12A, 59.0, 59.0), (AX_12W, 54.0, 470.0)]
)
@pytest.mark.parametrize("raw", [0, 1023])
def test_each_model_has_the_speeds_that_its_manual_says(model, joint_rpm, wheel_rpm, raw):
    parameters = ServoParameters(motor=model.motor, supply_voltage_v=12.0)
    joint = Servo(1, parameters, model=model, angle_rad=angle_from_ticks(0))
    joint.store("torque_enable", 1)
    write(joint, SPEED, *word(raw))
    write(joint, GOAL, *word(1023))
    run(joint, 0.3)
    assert joint.motion.speed_rad_s == pytest.approx(joint_rpm * RPM, rel=2e-3)

    wheel = Servo(1, parameters, model=model, eeprom={"cw_angle_limit": 0, "ccw_angle_limit": 0})
    write(wheel, SPEED, *word(1023))
    run(wheel, 2.0)
    assert wheel.motion.speed_rad_s == pytest.approx(wheel_rpm * RPM, rel=2e-3)


@pytest.mark.parametrize("punch", [32, 200])
def test_the_punch_is_the_least_that_moves_a_joint_outside_its_margin(punch):
    servo = Servo(1)
    for name, value in {"torque_enable": 1, "cw_compliance_slope": 128, "punch": punch}.items():
        servo.store(name, value)
    servo.store("ccw_compliance_slope", 128)
    servo.store("goal_position", 514)
    run(servo, 0.5)

    # At two counts of 128 the slope alone gives next to nothing; friction needs 7 %.
    moved = servo.motion.angle_rad > 0.5 * TICK_RAD
    assert moved is (punch / 1023 * 1.5 * 11.1 / 12 > 0.1)
