"""The manuals' own examples, byte for byte: what goes to a servo, what comes back, what it did."""

import pytest

from snake_control.mock.bus import Bus
from snake_control.mock.models import AX_12
from snake_control.mock.parameters import ServoParameters
from snake_control.mock.protocol import ErrorBit
from snake_control.mock.servo import Servo

MBAUD = 1_000_000
FINE_0, FINE_1 = "FF FF 00 02 00 FD", "FF FF 01 02 00 FC"


class Line:
    """A bus that talks in hex, with a pause in front of every packet."""

    def __init__(self, *servos: Servo, rate: int = MBAUD) -> None:
        self._bus = Bus(servos)
        self._now = 0.0
        self.rate = rate

    def send(self, text: str) -> str:
        self._now += 1.0
        replies = self._bus.receive(bytes.fromhex(text), self._now, self.rate)
        return " ".join(reply.data.hex(" ").upper() for reply in replies)


# Manual of 2006, pages 24 to 29: number, packet, and what the registers say then.
@pytest.mark.parametrize(
    ("number", "packet", "registers"),
    [
        (9, "FF FF 00 04 03 05 02 F1", {"return_delay_time": 2}),
        (10, "FF FF 00 05 03 08 FF 01 EF", {"cw_angle_limit": 0, "ccw_angle_limit": 0x1FF}),
        (11, "FF FF 00 04 03 0B 50 9D", {"temperature_limit": 80}),
        (12, "FF FF 00 05 03 0C 64 AA DD", {"min_voltage_limit": 100, "max_voltage_limit": 170}),
        (13, "FF FF 00 05 03 0E FF 01 E9", {"max_torque": 0x1FF, "torque_limit": 0x3FF}),
        (14, "FF FF 00 04 03 10 00 E8", {"status_return_level": 0}),
        (15, "FF FF 00 05 03 11 04 04 DE", {"alarm_led": 4, "alarm_shutdown": 4}),
        (16, "FF FF 00 05 03 18 01 01 DD", {"torque_enable": 1, "led": 1}),
        (
            17,
            "FF FF 00 07 03 1A 01 01 40 40 59",
            {
                "cw_compliance_margin": 1,
                "ccw_compliance_margin": 1,
                "cw_compliance_slope": 0x40,
                "ccw_compliance_slope": 0x40,
            },
        ),
        (18, "FF FF 00 07 03 1E 00 02 00 02 D3", {"goal_position": 0x200, "moving_speed": 0x200}),
        (20, "FF FF 00 04 03 2F 01 C8", {"lock": 1}),
        (21, "FF FF 00 05 03 30 40 00 87", {"punch": 0x40}),
    ],
)
def test_a_write_of_the_manual_is_acknowledged_and_done(number, packet, registers):
    servo = Servo(0, model=AX_12)

    assert Line(servo).send(packet) == FINE_0
    assert {name: servo.registers[name] for name in registers} == registers


def test_example_1_and_3_temperature_and_ping():
    servo = Servo(1)
    servo.health.temperature_c = 32.0
    line = Line(servo)

    assert line.send("FF FF 01 04 02 2B 01 CC") == "FF FF 01 03 00 20 DB"
    assert line.send("FF FF 01 02 01 FB") == FINE_1


def test_example_4_a_reset_is_answered_under_the_old_id():
    servo = Servo(0, ServoParameters(has_factory_reset=True), eeprom={"return_delay_time": 7})
    line = Line(servo)

    assert line.send("FF FF 00 02 06 F7") == FINE_0
    assert (servo.id, servo.registers["return_delay_time"]) == (1, 250)
    assert line.send("FF FF 01 02 01 FB") == FINE_1


def test_example_7_and_8_id_and_rate_hold_from_the_next_packet_on():
    line = Line(Servo(1, eeprom={"baud_rate": 34}), rate=57142)

    assert line.send("FF FF 01 04 03 03 00 F4") == FINE_1
    assert line.send("FF FF 00 04 03 04 01 F3") == FINE_0
    assert line.send("FF FF 00 02 01 FC") == ""
    line.rate = MBAUD
    assert line.send("FF FF 00 02 01 FC") == FINE_0


def test_example_13_needs_the_power_off_and_on():
    servo = Servo(0)
    Line(servo).send("FF FF 00 05 03 0E FF 01 E9")
    servo.power_cycle()

    assert servo.registers["torque_limit"] == 0x1FF


def test_example_14_silence_begins_with_the_next_instruction():
    line = Line(Servo(0))

    assert line.send("FF FF 00 04 03 10 00 E8") == FINE_0
    assert line.send("FF FF 00 04 03 10 02 E6") == ""
    assert line.send("FF FF 00 04 03 10 02 E6") == FINE_0


def test_example_19_two_servos_begin_at_the_same_time():
    servos = Servo(0), Servo(1)
    line = Line(*servos)

    assert line.send("FF FF 00 05 04 1E 00 00 D8") == FINE_0
    assert line.send("FF FF 01 05 04 1E FF 03 D5") == FINE_1
    assert [servo.registers["goal_position"] for servo in servos] == [512, 512]
    assert line.send("FF FF FE 02 05 FA") == ""
    assert [servo.registers["goal_position"] for servo in servos] == [0, 1023]


def test_example_20_what_is_locked_is_a_range_error():
    line = Line(Servo(0))

    assert line.send("FF FF 00 04 03 2F 01 C8") == FINE_0
    assert line.send("FF FF 00 05 03 30 40 00 87") == "FF FF 00 02 08 F5"


def test_the_e_manuals_error_sample_is_overload_and_overheating():
    servo = Servo(1)
    servo.store("torque_enable", 1)
    for _ in range(210):
        servo.step(0.01, load_nm=2.0)
    servo.health.temperature_c = 75.0
    servo.step(0.01)

    assert servo.error == ErrorBit.OVERLOAD | ErrorBit.OVERHEATING
    assert Line(servo).send("FF FF 01 02 01 FB") == "FF FF 01 02 24 D8"


def test_the_e_manuals_broadcast_gives_every_servo_the_id_1():
    servos = Servo(5), Servo(9)

    assert Line(*servos).send("FF FF FE 04 03 03 01 F6") == ""
    assert [servo.id for servo in servos] == [1, 1]


def test_the_e_manuals_reg_write_and_action():
    servo = Servo(1)
    line = Line(servo)

    assert line.send("FF FF 01 05 04 1E F4 01 E2") == FINE_1
    assert line.send("FF FF FE 02 05 FA") == ""
    assert servo.registers["goal_position"] == 500


def test_the_e_manuals_bulk_read_is_for_other_servos():
    line = Line(Servo(1), Servo(2))

    assert line.send("FF FF FE 09 92 00 02 01 1E 02 02 24 1D") == ""
