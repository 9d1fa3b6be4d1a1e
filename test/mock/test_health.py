import pytest

from snake_control.mock.firmware import execute
from snake_control.mock.health import Health, HealthParameters
from snake_control.mock.parameters import ServoParameters, Shutdown
from snake_control.mock.protocol import ErrorBit, InstructionPacket
from snake_control.mock.servo import Servo
from support.mock_servo import STEP_S, holding, run
from support.packets import WRITE, word

OK = ErrorBit.NONE


def write(servo: Servo, address: int, *data: int) -> None:
    status = execute(servo, InstructionPacket(servo.id, WRITE, bytes((address, *data))))
    assert status is not None
    assert not status.error & ErrorBit.RANGE


def test_a_load_that_the_output_carries_is_no_overload():
    servo = holding()
    run(servo, 5.0, load_nm=1.2)

    assert servo.error == OK


def test_an_overload_of_more_than_2_s_shuts_the_servo_down():
    servo = holding()
    run(servo, 1.9, load_nm=2.0)
    assert (servo.error, servo.registers["torque_limit"]) == (OK, 1023)

    run(servo, 0.2, load_nm=2.0)
    assert (servo.error, servo.registers["torque_limit"]) == (ErrorBit.OVERLOAD, 0)


def test_a_pause_of_the_overload_starts_the_time_anew():
    servo = holding()
    for _ in range(3):
        run(servo, 1.5, load_nm=2.0)
        run(servo, 0.1)

    assert servo.error == OK


def test_a_shut_down_servo_is_limp_and_says_so_until_it_gets_a_torque_limit():
    servo = holding()
    run(servo, 2.1, load_nm=2.0)
    sunk = servo.motion.angle_rad
    run(servo, 0.2, load_nm=0.5)
    assert servo.motion.angle_rad < sunk
    assert servo.error == ErrorBit.OVERLOAD

    write(servo, 34, *word(1023))
    assert servo.error == OK
    assert servo.driven


def test_the_manual_of_2006_also_clears_torque_enable():
    servo = holding(ServoParameters(shutdown_clears=Shutdown.BOTH))
    run(servo, 2.1, load_nm=2.0)

    assert (servo.registers["torque_enable"], servo.driven) == (0, False)


def test_without_the_shutdown_bit_an_overload_only_shows_while_it_lasts():
    servo = holding(alarm_shutdown=0)
    run(servo, 2.1, load_nm=2.0)
    assert (servo.error, servo.registers["torque_limit"]) == (ErrorBit.OVERLOAD, 1023)

    run(servo, 0.1)
    assert servo.error == OK


def test_a_wheel_at_low_output_is_not_overloaded_by_a_load_within_its_limit():
    servo = Servo(1, eeprom={"cw_angle_limit": 0, "ccw_angle_limit": 0})
    servo.store("moving_speed", 100)
    run(servo, 3.0, load_nm=0.6)

    assert servo.error == OK


def test_a_torque_limit_below_the_load_is_an_overload():
    servo = holding()
    servo.store("torque_limit", 200)
    run(servo, 2.1, load_nm=0.6)

    assert servo.error == ErrorBit.OVERLOAD


def test_without_torque_nothing_is_overloaded():
    servo = Servo(1)
    run(servo, 3.0, load_nm=2.0)

    assert servo.error == OK


@pytest.mark.parametrize(
    ("voltage", "error"), [(5.9, True), (6.1, False), (13.9, False), (14.1, True)]
)
def test_a_voltage_outside_its_limits_shows(voltage, error):
    servo = holding()
    servo.supply_voltage_v = voltage
    run(servo, STEP_S)

    assert servo.error == (ErrorBit.INPUT_VOLTAGE if error else OK)
    assert servo.registers["torque_limit"] == 1023


def test_a_voltage_with_its_shutdown_bit_shuts_down():
    servo = holding(alarm_shutdown=1)
    servo.supply_voltage_v = 5.0
    run(servo, STEP_S)
    servo.supply_voltage_v = 11.1
    run(servo, STEP_S)

    assert (servo.error, servo.registers["torque_limit"]) == (ErrorBit.INPUT_VOLTAGE, 0)


def test_too_warm_a_servo_shuts_down_and_cannot_recover_before_it_cools():
    servo = holding()
    servo.health.temperature_c = 71.0
    run(servo, STEP_S)
    assert (servo.error, servo.registers["torque_limit"]) == (ErrorBit.OVERHEATING, 0)

    write(servo, 34, *word(1023))
    run(servo, STEP_S)
    assert (servo.error, servo.registers["torque_limit"]) == (ErrorBit.OVERHEATING, 0)

    servo.health.temperature_c = 60.0
    write(servo, 34, *word(1023))
    run(servo, STEP_S)
    assert (servo.error, servo.registers["torque_limit"]) == (OK, 1023)


def test_a_power_cycle_ends_a_shut_down():
    servo = holding()
    run(servo, 2.1, load_nm=2.0)
    servo.power_cycle()

    assert (servo.error, servo.registers["torque_limit"]) == (OK, 1023)


def test_a_power_cycle_starts_the_time_of_an_overload_anew():
    servo = holding()
    run(servo, 1.5, load_nm=2.0)
    servo.power_cycle()
    servo.store("torque_enable", 1)
    run(servo, 1.5, load_nm=2.0)

    assert servo.error == OK


def test_output_warms_with_its_square_and_one_time_constant():
    parameters = HealthParameters(20.0, 80.0, 100.0)
    health = Health(20.0)
    for _ in range(100):
        health.step(parameters, 0.5, False, 1.0)

    assert health.temperature_c == pytest.approx(20.0 + 20.0 * (1 - 2.718281828**-1))


@pytest.mark.parametrize(
    "values", [{"time_constant_s": 0.0}, {"overload_after_s": -1.0}, {"ambient_c": float("nan")}]
)
def test_impossible_parameters_are_refused(values):
    with pytest.raises(ValueError, match="health"):
        HealthParameters(**values)


def test_a_supply_that_its_register_cannot_show_is_refused():
    with pytest.raises(ValueError, match="supply_voltage_v"):
        ServoParameters(supply_voltage_v=26.0)
