import dataclasses

import pytest

from snake_control.mock.firmware import execute
from snake_control.mock.models import AX_18A
from snake_control.mock.parameters import ServoParameters
from snake_control.mock.protocol import ErrorBit, InstructionPacket, StatusPacket
from snake_control.mock.servo import Servo
from support.packets import (
    ACTION,
    BROADCAST,
    FACTORY_RESET,
    PING,
    READ,
    REG_WRITE,
    SYNC_WRITE,
    WRITE,
    word,
)

OK = ErrorBit.NONE
BULK_READ, REBOOT = 0x92, 0x08
TORQUE_ENABLE, LED, GOAL, SPEED, TORQUE_LIMIT, LOCK, PUNCH = 24, 25, 30, 32, 34, 47, 48


def ask(servo: Servo, code: int, *parameters: int, to: int | None = None) -> StatusPacket | None:
    packet = InstructionPacket(servo.id if to is None else to, code, bytes(parameters))
    return execute(servo, packet)


def error_of(servo: Servo, code: int, *parameters: int) -> ErrorBit:
    status = ask(servo, code, *parameters)
    assert status is not None
    return status.error


def read(servo: Servo, address: int, size: int = 1) -> int:
    status = ask(servo, READ, address, size)
    assert status is not None
    assert len(status.parameters) == size
    return int.from_bytes(status.parameters, "little")


def test_a_ping_is_answered_with_nothing_but_the_id():
    assert ask(Servo(7), PING) == StatusPacket(7)


def test_another_servo_stays_silent():
    assert ask(Servo(7), PING, to=8) is None


def test_a_read_returns_what_a_write_wrote():
    servo = Servo(1)

    assert ask(servo, WRITE, GOAL, *word(700), *word(100)) == StatusPacket(1)
    assert ask(servo, READ, GOAL, 4) == StatusPacket(1, OK, bytes((*word(700), *word(100))))


def test_a_read_may_start_within_an_item_and_cover_the_table():
    servo = Servo(1)

    assert read(servo, 31, 1) == servo.registers["goal_position"] >> 8
    assert read(servo, 0, 50) & 0xFFFF == 12


def test_temperature_and_voltage_are_in_degrees_and_tenths_of_volts():
    servo = Servo(1)

    assert (read(servo, 43), read(servo, 42)) == (25, 111)


@pytest.mark.parametrize(("address", "size"), [(50, 1), (49, 2), (36, 15), (36, 0), (200, 8)])
def test_a_read_beyond_the_table_is_a_range_error_without_data(address, size):
    assert ask(Servo(1), READ, address, size) == StatusPacket(1, ErrorBit.RANGE)


@pytest.mark.parametrize("code", [FACTORY_RESET, BULK_READ, REBOOT, 0x00, 0x7F, 0xFF, SYNC_WRITE])
def test_an_unknown_instruction_is_an_instruction_error(code):
    assert error_of(Servo(1), code, 1, 2, 3) == ErrorBit.INSTRUCTION


def test_a_factory_reset_changes_nothing():
    servo = Servo(9, eeprom={"return_delay_time": 0})
    before = servo.registers.read(0, 50)

    assert error_of(servo, FACTORY_RESET) == ErrorBit.INSTRUCTION
    assert servo.registers.read(0, 50) == before


@pytest.mark.parametrize(
    ("code", "parameters"),
    [
        (READ, (36,)),
        (READ, (36, 8, 0)),
        (WRITE, (25,)),
        (WRITE, ()),
        (REG_WRITE, (30,)),
        (PING, (1,)),
    ],
)
def test_a_wrong_number_of_parameters_is_an_instruction_error(code, parameters):
    assert error_of(Servo(1), code, *parameters) == ErrorBit.INSTRUCTION


def test_a_wrong_checksum_is_reported_and_nothing_executed():
    servo = Servo(1)
    packet = InstructionPacket(1, WRITE, bytes((LED, 1)), checksum_ok=False)

    assert execute(servo, packet) == StatusPacket(1, ErrorBit.CHECKSUM)
    assert read(servo, LED) == 0


@pytest.mark.parametrize(
    ("address", "data"),
    [
        (3, (254,)),
        (16, (3,)),
        (12, (49,)),
        (TORQUE_ENABLE, (2,)),
        (LED, (2,)),
        (26, (255,)),
        (28, (0,)),
        (GOAL, word(1024)),
        (GOAL, word(4000)),
        (SPEED, word(1024)),
        (TORQUE_LIMIT, word(1024)),
        (PUNCH, word(1024)),
        (LOCK, (0,)),
        (GOAL, (*word(512), *word(2048))),
    ],
)
def test_a_value_out_of_range_is_refused(address, data):
    servo = Servo(1)
    before = servo.registers.read(0, 50)

    assert error_of(servo, WRITE, address, *data) == ErrorBit.RANGE
    assert servo.registers.read(0, 50) == before


@pytest.mark.parametrize("address", [0, 2, 10, 20, 36, 38, 40, 42, 43, 44, 45, 46, 50, 255])
def test_what_is_read_only_or_beyond_the_table_cannot_be_written(address):
    assert error_of(Servo(1), WRITE, address, 0) == ErrorBit.RANGE


@pytest.mark.parametrize(
    ("address", "data"), [(GOAL, (0,)), (31, (1,)), (29, (32, 0)), (GOAL, (0, 1, 0))]
)
def test_two_byte_items_are_written_in_one_packet_or_not_at_all(address, data):
    assert error_of(Servo(1), WRITE, address, *data) == ErrorBit.RANGE


def test_a_write_is_done_wholly_or_not_at_all():
    servo = Servo(1)

    assert error_of(servo, WRITE, LED, 1, 5, 5, 32, 0) == ErrorBit.RANGE
    assert (read(servo, LED), read(servo, 26)) == (0, 1)


@pytest.mark.parametrize("goal", [299, 701])
def test_a_goal_outside_the_angle_limits_is_an_angle_limit_error(goal):
    servo = Servo(1, eeprom={"cw_angle_limit": 300, "ccw_angle_limit": 700})

    assert error_of(servo, WRITE, GOAL, *word(goal)) == ErrorBit.ANGLE_LIMIT
    assert read(servo, GOAL, 2) == 512
    assert error_of(servo, WRITE, GOAL, *word(300)) == OK


def test_in_wheel_mode_any_goal_but_zero_is_an_angle_limit_error():
    servo = Servo(1, eeprom={"cw_angle_limit": 0, "ccw_angle_limit": 0})

    assert error_of(servo, WRITE, GOAL, *word(512)) == ErrorBit.ANGLE_LIMIT
    assert error_of(servo, WRITE, GOAL, *word(0), *word(2047)) == OK


def test_eeprom_is_written_only_with_torque_off():
    servo = Servo(1)
    ask(servo, WRITE, TORQUE_ENABLE, 1)

    assert error_of(servo, WRITE, 5, 0) == ErrorBit.RANGE
    ask(servo, WRITE, TORQUE_ENABLE, 0)
    assert error_of(servo, WRITE, 5, 0) == OK
    assert read(servo, 5) == 0


def test_the_manual_of_2006_knows_no_such_rule():
    servo = Servo(1, ServoParameters(eeprom_needs_torque_off=False))
    ask(servo, WRITE, TORQUE_ENABLE, 1)

    assert error_of(servo, WRITE, 5, 0) == OK


def test_a_lock_leaves_ram_from_0x18_to_0x23_until_the_power_goes():
    servo = Servo(0)

    assert error_of(servo, WRITE, LOCK, 1) == OK
    assert error_of(servo, WRITE, 5, 0) == ErrorBit.RANGE
    assert error_of(servo, WRITE, PUNCH, *word(0x40)) == ErrorBit.RANGE
    assert error_of(servo, WRITE, LOCK, 0) == ErrorBit.RANGE
    assert error_of(servo, WRITE, TORQUE_ENABLE, 1) == OK
    assert error_of(servo, WRITE, TORQUE_LIMIT, *word(500)) == OK
    servo.power_cycle()
    assert error_of(servo, WRITE, PUNCH, *word(0x40)) == OK


def test_a_registered_write_waits_for_action():
    servo = Servo(1)

    assert ask(servo, REG_WRITE, GOAL, *word(500)) == StatusPacket(1)
    assert (read(servo, 44), read(servo, GOAL, 2)) == (1, 512)
    assert ask(servo, ACTION) == StatusPacket(1)
    assert (read(servo, 44), read(servo, GOAL, 2)) == (0, 500)


def test_an_action_without_a_registered_write_is_an_instruction_error():
    assert error_of(Servo(1), ACTION) == ErrorBit.INSTRUCTION


def test_a_registered_write_is_checked_at_once():
    servo = Servo(1)

    assert error_of(servo, REG_WRITE, GOAL, *word(1024)) == ErrorBit.RANGE
    assert read(servo, 44) == 0


def test_a_later_registered_write_takes_the_place_of_an_earlier_one():
    servo = Servo(1)
    ask(servo, REG_WRITE, GOAL, *word(500))
    ask(servo, REG_WRITE, LED, 1)
    ask(servo, ACTION)

    assert (read(servo, GOAL, 2), read(servo, LED)) == (512, 1)
    assert error_of(servo, ACTION) == ErrorBit.INSTRUCTION


def test_a_refused_registered_write_leaves_the_earlier_one_waiting():
    servo = Servo(1)
    ask(servo, REG_WRITE, GOAL, *word(500))
    assert error_of(servo, REG_WRITE, GOAL, *word(1024)) == ErrorBit.RANGE
    ask(servo, ACTION)

    assert read(servo, GOAL, 2) == 500


def test_a_write_between_does_not_disturb_a_registered_one():
    servo = Servo(1)
    ask(servo, REG_WRITE, GOAL, *word(500))
    ask(servo, WRITE, GOAL, *word(700))
    assert read(servo, GOAL, 2) == 700
    ask(servo, ACTION)

    assert read(servo, GOAL, 2) == 500


def test_registered_writes_and_action_may_go_to_all():
    servos = [Servo(i) for i in (1, 2)]
    for servo in servos:
        assert ask(servo, REG_WRITE, GOAL, *word(500), to=BROADCAST) is None
        assert read(servo, GOAL, 2) == 512
        assert ask(servo, ACTION, to=BROADCAST) is None

    assert [read(servo, GOAL, 2) for servo in servos] == [500, 500]


@pytest.mark.parametrize(
    ("between", "registered", "error"),
    [
        ((LOCK, 1), (PUNCH, *word(99)), ErrorBit.RANGE),
        ((TORQUE_ENABLE, 1), (5, 0), ErrorBit.RANGE),
        ((8, *word(600)), (GOAL, *word(700)), ErrorBit.ANGLE_LIMIT),
    ],
)
def test_an_action_is_checked_once_more(between, registered, error):
    servo = Servo(1)
    assert error_of(servo, REG_WRITE, *registered) == OK
    assert error_of(servo, WRITE, *between) == OK
    before = servo.registers.read(0, 44)

    assert error_of(servo, ACTION) == error
    assert servo.registers.read(0, 44) == before
    assert read(servo, 44) == 0
    assert error_of(servo, ACTION) == ErrorBit.INSTRUCTION


def test_a_sync_write_reaches_each_servo_with_its_own_bytes():
    servos = [Servo(i) for i in (0, 1, 2)]
    parameters = bytes.fromhex("1E 04 00 10 00 50 01 01 20 02 60 03")

    replies = [ask(s, SYNC_WRITE, *parameters, to=BROADCAST) for s in servos]

    assert replies == [None, None, None]
    written = [(s.registers["goal_position"], s.registers["moving_speed"]) for s in servos]
    assert written == [(0x010, 0x150), (0x220, 0x360), (512, 0)]


@pytest.mark.parametrize("cut", [1, 2, 11])
def test_a_sync_write_of_a_wrong_length_is_not_executed(cut):
    servo = Servo(0)
    parameters = bytes.fromhex("1E 04 00 10 00 50 01 01 20 02 60 03")

    ask(servo, SYNC_WRITE, *parameters[:cut], to=BROADCAST)

    assert servo.registers["goal_position"] == 512


@pytest.mark.parametrize("parameters", [(LED, 0, 1), (LED, 0, 1, 2), (50, 1, 1, 0), (LED, 2, 1, 1)])
def test_a_sync_write_of_nothing_or_beyond_the_table_does_nothing(parameters):
    servo = Servo(1)
    before = servo.registers.read(0, 50)
    ask(servo, SYNC_WRITE, *parameters, to=BROADCAST)

    assert servo.registers.read(0, 50) == before


def test_a_sync_write_refused_by_one_servo_still_reaches_the_others():
    servos = [Servo(1), Servo(2)]
    entries = (1, *word(1024), 2, *word(700))
    for servo in servos:
        ask(servo, SYNC_WRITE, GOAL, 2, *entries, to=BROADCAST)

    assert [read(servo, GOAL, 2) for servo in servos] == [512, 700]


def test_of_two_entries_for_one_servo_the_later_holds():
    servo = Servo(1)
    ask(servo, SYNC_WRITE, GOAL, 2, 1, *word(600), 1, *word(700), to=BROADCAST)

    assert read(servo, GOAL, 2) == 700


@pytest.mark.parametrize(
    ("code", "parameters"), [(PING, ()), (READ, (36, 2)), (WRITE, (LED, 1)), (ACTION, ())]
)
def test_a_broadcast_is_never_answered(code, parameters):
    assert ask(Servo(1), code, *parameters, to=BROADCAST) is None


def test_a_broadcast_write_is_executed():
    servo = Servo(1)
    ask(servo, WRITE, LED, 1, to=BROADCAST)

    assert read(servo, LED) == 1


@pytest.mark.parametrize(
    ("level", "answered"), [(0, [True, False, False]), (1, [True, True, False]), (2, [True] * 3)]
)
def test_the_status_return_level_says_what_is_answered(level, answered):
    servo = Servo(1, eeprom={"status_return_level": level})

    replies = [ask(servo, PING), ask(servo, READ, 36, 2), ask(servo, WRITE, LED, 1)]

    assert [reply is not None for reply in replies] == answered
    assert servo.registers["led"] == 1


@pytest.mark.parametrize("level", [0, 1])
def test_a_change_of_the_status_return_level_counts_from_the_next_instruction(level):
    servo = Servo(1)

    assert ask(servo, WRITE, 16, level) == StatusPacket(1)
    assert ask(servo, WRITE, 16, 2) is None
    assert ask(servo, WRITE, LED, 1) == StatusPacket(1)


def test_a_ping_with_a_wrong_checksum_is_answered_at_every_level():
    servo = Servo(1, eeprom={"status_return_level": 0})
    for code, answered in ((PING, True), (READ, False), (WRITE, False)):
        status = execute(servo, InstructionPacket(1, code, b"", checksum_ok=False))
        assert status == (StatusPacket(1, ErrorBit.CHECKSUM) if answered else None)


def test_a_ping_to_all_is_answered_where_page_22_of_the_old_manual_holds():
    servo = Servo(3, ServoParameters(answers_broadcast_ping=True))

    assert ask(servo, PING, to=BROADCAST) == StatusPacket(3)
    assert ask(servo, READ, 36, 2, to=BROADCAST) is None
    assert ask(servo, WRITE, LED, 1, to=BROADCAST) is None


def resettable(**eeprom: int) -> Servo:
    return Servo(9, ServoParameters(has_factory_reset=True), eeprom=eeprom)


def test_a_factory_reset_resets_everything_where_the_firmware_has_it():
    servo = resettable(return_delay_time=0, baud_rate=34, max_torque=500)
    ask(servo, WRITE, LED, 1)

    assert ask(servo, FACTORY_RESET, to=9) == StatusPacket(9)
    assert (servo.id, servo.baud_rate, servo.return_delay_s) == (1, 1_000_000, 500e-6)
    fresh = Servo(1)
    assert servo.registers.read(0, 50) == fresh.registers.read(0, 50)


def test_a_factory_reset_keeps_the_model_with_its_defaults():
    servo = Servo(9, ServoParameters(has_factory_reset=True), model=AX_18A)
    ask(servo, FACTORY_RESET)

    r = servo.registers
    assert (r["model_number"], r["temperature_limit"], r["torque_limit"]) == (18, 75, 983)


@pytest.mark.parametrize("address", [TORQUE_ENABLE, LOCK])
def test_a_factory_reset_is_refused_like_any_write_of_the_eeprom(address):
    servo = resettable()
    ask(servo, WRITE, address, 1)

    assert error_of(servo, FACTORY_RESET) == ErrorBit.RANGE
    assert servo.id == 9


def test_a_change_of_id_is_answered_under_the_old_one():
    servo = Servo(1)

    assert ask(servo, WRITE, 3, 9) == StatusPacket(1)
    assert servo.id == 9


def test_a_condition_rides_on_every_reply_beside_the_data():
    servo = Servo(1)
    servo.supply_voltage_v = 5.0
    servo.step(0.01)

    assert ask(servo, PING) == StatusPacket(1, ErrorBit.INPUT_VOLTAGE)
    status = ask(servo, READ, 42, 1)
    assert status == StatusPacket(1, ErrorBit.INPUT_VOLTAGE, bytes((50,)))
    assert error_of(servo, WRITE, LED, 2) == ErrorBit.INPUT_VOLTAGE | ErrorBit.RANGE
    servo.supply_voltage_v = 11.1
    servo.step(0.01)
    assert error_of(servo, PING) == OK


def test_power_on_takes_goal_and_torque_limit_over_and_torque_off():
    servo = Servo(1, angle_rad=0.5, eeprom={"max_torque": 700})
    for address, data in ((TORQUE_ENABLE, (1,)), (GOAL, word(100)), (PUNCH, word(99))):
        assert error_of(servo, WRITE, address, *data) == OK
    servo.step(0.3)
    servo.power_cycle()

    r = servo.registers
    assert read(servo, 36, 2) == r["goal_position"] < 600
    assert (r["torque_enable"], r["moving_speed"], r["torque_limit"]) == (0, 0, 700)
    assert (r["punch"], r["max_torque"]) == (32, 700)
    assert not servo.driven


@pytest.mark.parametrize("values", [{"led": 1}, {"baud_rate": 255}, {"max_torque": 1024}])
def test_only_eeprom_values_in_their_range_can_be_given(values):
    with pytest.raises(ValueError, match=next(iter(values))):
        Servo(1, eeprom=values)


def test_a_goal_may_switch_torque_on_where_the_firmware_does_that():
    plain = Servo(1)
    other = Servo(1, dataclasses.replace(ServoParameters(), goal_enables_torque=True))
    for servo in (plain, other):
        ask(servo, WRITE, GOAL, *word(600))

    assert (plain.driven, other.driven) == (False, True)
    assert (read(plain, TORQUE_ENABLE), read(other, TORQUE_ENABLE)) == (0, 1)
