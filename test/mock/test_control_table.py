import pytest

from snake_control.mock.control_table import BY_NAME, TABLE, RegisterFile, registers_in

# Typed from the manual (page 12 and 19) and the e-manual: address, size, access, default, range.
MANUAL = """
model_number           0 2 R   12
id                     3 1 RW   1    0  253
baud_rate              4 1 RW   1    0  254
return_delay_time      5 1 RW 250    0  254
cw_angle_limit         6 2 RW   0    0 1023
ccw_angle_limit        8 2 RW 1023   0 1023
temperature_limit     11 1 RW  70    0  150
min_voltage_limit     12 1 RW  60   50  250
max_voltage_limit     13 1 RW 140   50  250
max_torque            14 2 RW 1023   0 1023
status_return_level   16 1 RW   2    0    2
alarm_led             17 1 RW  36    0  127
alarm_shutdown        18 1 RW  36    0  127
down_calibration      20 2 R    0
up_calibration        22 2 R    0
torque_enable         24 1 RW   0    0    1
led                   25 1 RW   0    0    1
cw_compliance_margin  26 1 RW   1    0  254
ccw_compliance_margin 27 1 RW   1    0  254
cw_compliance_slope   28 1 RW  32    1  254
ccw_compliance_slope  29 1 RW  32    1  254
goal_position         30 2 RW   0    0 1023
moving_speed          32 2 RW   0    0 2047
torque_limit          34 2 RW 1023   0 1023
present_position      36 2 R    0
present_speed         38 2 R    0
present_load          40 2 R    0
present_voltage       42 1 R    0
present_temperature   43 1 R    0
registered            44 1 R    0
moving                46 1 R    0
lock                  47 1 RW   0    1    1
punch                 48 2 RW  32    0 1023
"""


@pytest.mark.parametrize("line", MANUAL.split("\n")[1:-1], ids=lambda line: line.split()[0])
def test_each_item_is_as_the_manual_has_it(line):
    name, address, size, access, default, *bounds = line.split()
    register = BY_NAME[name]

    assert (register.address, register.size, register.default) == (
        int(address),
        int(size),
        int(default),
    )
    assert register.writable == (access == "RW")
    if bounds:
        assert [register.low, register.high] == [int(b) for b in bounds]


def test_the_items_leave_no_gap_and_end_at_49():
    ends = [register.end for register in TABLE]

    assert [register.address for register in TABLE] == [0, *ends[:-1]]
    assert ends[-1] == 50


def test_two_bytes_are_little_endian():
    registers = RegisterFile()
    registers["goal_position"] = 0x1F4

    assert registers.read(30, 2) == b"\xf4\x01"


@pytest.mark.parametrize(("address", "size"), [(50, 1), (49, 2), (0, 0), (255, 255)])
def test_nothing_lies_beyond_the_table(address, size):
    with pytest.raises(IndexError):
        registers_in(address, size)
