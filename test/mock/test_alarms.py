"""Alarm LED and Alarm Shutdown: what sets them off, what a shutdown does, how it ends."""

from collections.abc import Callable

import pytest

from snake_control.mock.disturbance import Disturbance
from snake_control.mock.firmware import execute
from snake_control.mock.parameters import ServoParameters, Shutdown
from snake_control.mock.protocol import BROADCAST_ID, ErrorBit, InstructionPacket
from snake_control.mock.servo import Servo
from support.mock_servo import STEP_S, holding, run
from support.packets import ACTION, PING, SYNC_WRITE, WRITE, word

OK = ErrorBit.NONE
WHEEL = {"cw_angle_limit": 0, "ccw_angle_limit": 0}
BLOCKED = Disturbance(shaft_blocked=True)
# Torque of the full output at the default supply, and the gear's friction.
STALL_NM, FRICTION_NM = 1.5 * 11.1 / 12.0, 0.1


def tell(servo: Servo, code: int, *parameters: int, to: int = 1) -> ErrorBit | None:
    status = execute(servo, InstructionPacket(to, code, bytes(parameters)))
    return None if status is None else status.error


def low_voltage(servo: Servo) -> None:
    servo.supply_voltage_v = 5.0
    run(servo, STEP_S)
    servo.supply_voltage_v = 11.1


def warmth(servo: Servo) -> None:
    servo.health.temperature_c = 71.0
    run(servo, STEP_S)
    servo.health.temperature_c = 25.0


def too_much_load(servo: Servo) -> None:
    run(servo, 2.1, load_nm=2.0)


def bad_checksum(servo: Servo) -> None:
    execute(servo, InstructionPacket(1, PING, checksum_ok=False))


CAUSES: dict[ErrorBit, Callable[[Servo], object]] = {
    ErrorBit.INPUT_VOLTAGE: low_voltage,
    ErrorBit.ANGLE_LIMIT: lambda servo: tell(servo, WRITE, 30, *word(900)),
    ErrorBit.OVERHEATING: warmth,
    ErrorBit.RANGE: lambda servo: tell(servo, WRITE, 30, *word(4000)),
    ErrorBit.CHECKSUM: bad_checksum,
    ErrorBit.OVERLOAD: too_much_load,
    ErrorBit.INSTRUCTION: lambda servo: tell(servo, ACTION),
}
LASTING = ErrorBit.INPUT_VOLTAGE | ErrorBit.OVERHEATING | ErrorBit.OVERLOAD


@pytest.mark.parametrize("bit", CAUSES)
def test_each_error_shuts_down_where_its_bit_asks_for_that(bit):
    servo = holding(alarm_shutdown=bit, ccw_angle_limit=800)
    CAUSES[bit](servo)
    run(servo, STEP_S)

    assert (servo.shut_down, servo.registers["torque_limit"]) == (True, 0)
    assert servo.error == bit & LASTING
    assert tell(servo, WRITE, 34, *word(1023)) == OK
    assert (servo.shut_down, servo.error) == (False, OK)


@pytest.mark.parametrize("bit", CAUSES)
def test_no_error_shuts_down_whose_bit_is_not_set(bit):
    servo = holding(alarm_shutdown=0x7F & ~bit, ccw_angle_limit=800)
    CAUSES[bit](servo)
    run(servo, STEP_S)

    assert (servo.shut_down, servo.registers["torque_limit"]) == (False, 1023)


@pytest.mark.parametrize("bit", CAUSES)
def test_the_led_blinks_for_its_errors_and_2_s_longer(bit):
    servo = holding(alarm_led=bit, alarm_shutdown=0, ccw_angle_limit=800)
    other = holding(alarm_led=0x7F & ~bit, alarm_shutdown=0, ccw_angle_limit=800)
    for each in (servo, other):
        CAUSES[bit](each)
    assert (servo.led_blinks, other.led_blinks) == (True, False)

    run(servo, 1.9)
    assert servo.led_blinks
    run(servo, 0.2)
    assert not servo.led_blinks


def test_errors_in_what_goes_to_all_count_although_nobody_answers():
    servo = holding(alarm_shutdown=ErrorBit.RANGE)
    assert tell(servo, SYNC_WRITE, 30, 2, 1, *word(4000), to=BROADCAST_ID) is None

    assert servo.shut_down


def test_an_error_in_somebody_elses_packet_does_not_count():
    servo = holding(alarm_shutdown=0x7F)
    tell(servo, WRITE, 30, *word(4000), to=2)
    tell(servo, SYNC_WRITE, 30, 2, 2, *word(4000), to=BROADCAST_ID)

    assert not servo.shut_down


@pytest.mark.parametrize("clears", [Shutdown.TORQUE_LIMIT, Shutdown.TORQUE_ENABLE, Shutdown.BOTH])
def test_a_shutdown_stops_a_wheel_and_no_speed_starts_it_again(clears):
    servo = Servo(1, ServoParameters(shutdown_clears=clears), eeprom=WHEEL)
    servo.store("moving_speed", 600)
    run(servo, 0.5)
    assert servo.motion.speed_rad_s > 1.0

    servo.health.temperature_c = 90.0
    run(servo, 0.5)
    assert (servo.motion.output, servo.motion.speed_rad_s) == (0.0, 0.0)
    servo.health.temperature_c = 25.0
    assert tell(servo, WRITE, 32, *word(700)) == ErrorBit.OVERHEATING
    run(servo, 0.5)
    assert (servo.motion.output, servo.motion.speed_rad_s) == (0.0, 0.0)

    servo.store("torque_limit", 1023)
    servo.store("torque_enable", 1)
    run(servo, 0.5)
    assert servo.motion.speed_rad_s > 1.0


@pytest.mark.parametrize(
    ("clears", "left", "ended_by_limit", "ended_by_enable"),
    [
        (Shutdown.TORQUE_LIMIT, (0, 1), True, False),
        (Shutdown.TORQUE_ENABLE, (1023, 0), False, True),
        (Shutdown.BOTH, (0, 0), False, False),
    ],
)
def test_a_shutdown_ends_when_what_it_cleared_is_written(
    clears, left, ended_by_limit, ended_by_enable
):
    for address, data, ends in ((34, word(1023), ended_by_limit), (24, (1,), ended_by_enable)):
        servo = holding(ServoParameters(shutdown_clears=clears))
        too_much_load(servo)
        r = servo.registers
        assert (r["torque_limit"], r["torque_enable"]) == left

        tell(servo, WRITE, address, *data)
        assert servo.shut_down is not ends
        assert servo.error == (OK if ends else ErrorBit.OVERLOAD)
        tell(servo, WRITE, 34, *word(1023))
        tell(servo, WRITE, 24, 1)
        assert (servo.shut_down, servo.driven, servo.error) == (False, True, OK)


def test_a_torque_limit_of_0_written_again_ends_nothing():
    servo = holding()
    too_much_load(servo)

    assert tell(servo, WRITE, 34, *word(0)) == ErrorBit.OVERLOAD
    assert servo.shut_down


def test_a_load_that_is_still_there_shuts_down_again_after_its_time():
    servo = holding()
    too_much_load(servo)
    tell(servo, WRITE, 34, *word(1023))
    run(servo, 1.9, load_nm=2.0)
    assert (servo.shut_down, servo.error) == (False, OK)

    run(servo, 0.2, load_nm=2.0)
    assert (servo.shut_down, servo.error) == (True, ErrorBit.OVERLOAD)


def test_warmth_that_is_still_there_shuts_down_again_at_once():
    servo = holding()
    servo.health.temperature_c = 80.0
    for _ in range(3):
        run(servo, STEP_S)
        assert servo.shut_down
        tell(servo, WRITE, 34, *word(1023))


def test_a_servo_that_is_held_fast_warms_up_until_it_gives_up_and_can_go_on_when_cool():
    # Only overheating counts, as on the AX-12 of 2006.
    servo = holding(alarm_shutdown=4)
    servo.store("goal_position", 900)
    servo.disturbance = BLOCKED
    seconds = 0
    while not servo.shut_down:
        servo.step(1.0)
        seconds += 1
    # From 25 to 70 degrees, of the 105 at full output for ever: 300 s * ln(80 / 35).
    assert 248 <= seconds <= 249

    for _ in range(60):
        servo.step(1.0)
    assert servo.health.temperature_c < 70.0
    tell(servo, WRITE, 34, *word(1023))
    servo.step(1.0)
    assert not servo.shut_down


@pytest.mark.parametrize("limit", [1023, 409])
@pytest.mark.parametrize(("beyond", "overloaded"), [(0.5, True), (-1.5, False)])
def test_a_joint_that_cannot_lift_its_load_is_overloaded_although_friction_holds_it(
    limit, beyond, overloaded
):
    servo = holding()
    servo.store("torque_limit", limit)
    servo.store("goal_position", 900)
    run(servo, 2.1, load_nm=limit / 1023 * STALL_NM + beyond * FRICTION_NM)

    assert servo.error == (ErrorBit.OVERLOAD if overloaded else OK)
    assert (servo.motion.angle_rad > 0.0) is not overloaded


def test_a_joint_within_its_strength_reaches_its_goal_without_alarm():
    servo = holding()
    servo.store("torque_limit", 400)
    servo.store("goal_position", 700)
    servo.store("moving_speed", 5)
    run(servo, 25.0, load_nm=0.3)

    assert servo.error == OK
    assert servo.motion.angle_rad > 0.8


@pytest.mark.parametrize(("speed", "overloaded"), [(1023, True), (300, False)])
def test_a_wheel_that_is_held_fast_is_overloaded_if_it_is_driven_at_its_limit(speed, overloaded):
    servo = Servo(1, eeprom=WHEEL)
    servo.store("moving_speed", speed)
    servo.disturbance = BLOCKED
    run(servo, 3.0)

    assert servo.shut_down is overloaded
    assert servo.error == (ErrorBit.OVERLOAD if overloaded else OK)


def test_a_lower_torque_limit_makes_the_same_wheel_overloaded():
    servo = Servo(1, eeprom=WHEEL)
    servo.store("moving_speed", 300)
    servo.store("torque_limit", 200)
    servo.disturbance = BLOCKED
    run(servo, 3.0)

    assert servo.error == ErrorBit.OVERLOAD


def test_without_power_no_time_counts_and_no_alarm_stays():
    servo = holding()
    too_much_load(servo)
    servo.power_off()
    run(servo, 5.0, load_nm=2.0)
    assert (servo.shut_down, servo.error, servo.led_blinks) == (False, OK, False)

    servo.power_on()
    assert (servo.error, servo.registers["torque_limit"]) == (OK, 1023)


def test_a_shutdown_that_clears_nothing_is_refused():
    with pytest.raises(ValueError, match="shutdown_clears"):
        ServoParameters(shutdown_clears=Shutdown(0))
