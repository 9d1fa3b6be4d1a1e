"""The driver's table against rows typed from the manual."""

import pytest

from snake_control.ax12 import control_table as ct

# address, size, writable, name: e-manual AX-12A, "Control Table of EEPROM / RAM Area".
MANUAL = """
0 2 R Model Number
2 1 R Firmware Version
3 1 RW ID
4 1 RW Baud Rate
5 1 RW Return Delay Time
6 2 RW CW Angle Limit
8 2 RW CCW Angle Limit
11 1 RW Temperature Limit
12 1 RW Min Voltage Limit
13 1 RW Max Voltage Limit
14 2 RW Max Torque
16 1 RW Status Return Level
17 1 RW Alarm LED
18 1 RW Alarm Shutdown
24 1 RW Torque Enable
25 1 RW LED
26 1 RW CW Compliance Margin
27 1 RW CCW Compliance Margin
28 1 RW CW Compliance Slope
29 1 RW CCW Compliance Slope
30 2 RW Goal Position
32 2 RW Moving Speed
34 2 RW Torque Limit
36 2 R Present Position
38 2 R Present Speed
40 2 R Present Load
42 1 R Present Voltage
43 1 R Present Temperature
44 1 R Registered
46 1 R Moving
47 1 RW Lock
48 2 RW Punch
"""


def test_agrees_with_the_manual() -> None:
    rows = [line.split(maxsplit=3) for line in MANUAL.strip().splitlines()]
    typed = [(int(a), int(s), access == "RW", name) for a, s, access, name in rows]
    assert [(r.address, r.size, r.writable, r.name) for r in ct.TABLE] == typed
    assert [r.in_eeprom for r in ct.TABLE] == [address <= 23 for address, *_ in typed]


def test_the_feedback_block_is_the_eight_bytes_from_position_to_temperature() -> None:
    assert ct.FEEDBACK_BLOCK == (36, 8)


def test_values_are_little_endian() -> None:
    assert ct.GOAL_POSITION.encode(0x1F4) == b"\xf4\x01"
    assert ct.PRESENT_SPEED.decode(bytes((9, 9, 0x34, 0x02)), 36) == 0x234


@pytest.mark.parametrize("value", [-1, 65536])
def test_a_value_that_does_not_fit_is_refused(value: int) -> None:
    with pytest.raises(ValueError, match="Goal Position cannot hold"):
        ct.GOAL_POSITION.encode(value)
