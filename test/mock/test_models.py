import pytest

from snake_control.mock.models import AX_12, AX_12A, AX_12W, AX_18A, MODELS, Model
from snake_control.mock.servo import Servo


@pytest.mark.parametrize(
    ("model", "registers"),
    [
        (AX_12A, {"model_number": 12, "temperature_limit": 70, "alarm_shutdown": 36}),
        (AX_12, {"model_number": 12, "max_voltage_limit": 190, "alarm_shutdown": 4}),
        (AX_12W, {"model_number": 300, "cw_compliance_margin": 4, "ccw_compliance_slope": 64}),
        (AX_18A, {"model_number": 18, "max_torque": 983, "torque_limit": 983}),
    ],
)
def test_models_differ_as_their_manuals_say(model, registers):
    servo = Servo(1, model=model)
    assert {name: servo.registers[name] for name in registers} == registers
    servo.store("cw_compliance_margin", 9)
    servo.power_cycle()
    assert {name: servo.registers[name] for name in registers} == registers


def test_names_are_those_that_are_printed_on_them():
    assert set(MODELS) == {"AX-12A", "AX-12", "AX-12W", "AX-18A"}


def test_a_default_that_a_register_cannot_hold_is_refused():
    with pytest.raises(ValueError, match="max_torque = 2000"):
        Model("X", 1, {"max_torque": 2000}, AX_12A.motor)


def test_a_number_of_more_than_two_bytes_is_refused():
    with pytest.raises(ValueError, match="number = 65536"):
        Model("X", 65536, {}, AX_12A.motor)


def test_the_older_servo_does_not_save_itself_from_an_overload():
    servo = Servo(1, model=AX_12)
    servo.store("torque_enable", 1)
    for _ in range(300):
        servo.step(0.01, load_nm=2.0)
    assert servo.registers["torque_limit"] == 1023


@pytest.mark.parametrize("voltage", [-0.1, 25.6, float("nan")])
def test_a_voltage_that_no_supply_has_is_refused(voltage):
    servo = Servo(1)
    with pytest.raises(ValueError, match="supply_voltage_v"):
        servo.supply_voltage_v = voltage
