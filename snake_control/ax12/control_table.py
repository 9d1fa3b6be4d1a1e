"""Control table of the AX-12 family, as data (e-manual AX-12A; user's manual 2006-06-14, p. 12-19).

Two-byte values are little endian and must be written in one packet.
"""

from __future__ import annotations

import dataclasses

EEPROM_END = 24
"""First address of the RAM area; everything below survives a power cycle."""

TABLE_END = 50
"""First address behind the table."""


@dataclasses.dataclass(frozen=True)
class Register:
    """One register: name in the manual, address, size in bytes, and whether it can be written."""

    name: str
    address: int
    size: int
    writable: bool

    @property
    def in_eeprom(self) -> bool:
        """Whether the value survives a power cycle."""
        return self.address < EEPROM_END

    @property
    def end(self) -> int:
        """Address behind the register."""
        return self.address + self.size

    def encode(self, value: int) -> bytes:
        """Return ``value`` as the register holds it.

        Raises:
            ValueError: the value does not fit into the register.
        """
        try:
            return value.to_bytes(self.size, "little")
        except OverflowError as error:
            raise ValueError(f"{self.name} cannot hold {value}") from error

    def decode(self, block: bytes, block_address: int) -> int:
        """Return the value of this register out of a block read from ``block_address``."""
        start = self.address - block_address
        return int.from_bytes(block[start : start + self.size], "little")


MODEL_NUMBER = Register("Model Number", 0, 2, False)
FIRMWARE_VERSION = Register("Firmware Version", 2, 1, False)
ID = Register("ID", 3, 1, True)
BAUD_RATE = Register("Baud Rate", 4, 1, True)
RETURN_DELAY_TIME = Register("Return Delay Time", 5, 1, True)
CW_ANGLE_LIMIT = Register("CW Angle Limit", 6, 2, True)
CCW_ANGLE_LIMIT = Register("CCW Angle Limit", 8, 2, True)
TEMPERATURE_LIMIT = Register("Temperature Limit", 11, 1, True)
MIN_VOLTAGE_LIMIT = Register("Min Voltage Limit", 12, 1, True)
MAX_VOLTAGE_LIMIT = Register("Max Voltage Limit", 13, 1, True)
MAX_TORQUE = Register("Max Torque", 14, 2, True)
STATUS_RETURN_LEVEL = Register("Status Return Level", 16, 1, True)
ALARM_LED = Register("Alarm LED", 17, 1, True)
ALARM_SHUTDOWN = Register("Alarm Shutdown", 18, 1, True)
TORQUE_ENABLE = Register("Torque Enable", 24, 1, True)
LED = Register("LED", 25, 1, True)
CW_COMPLIANCE_MARGIN = Register("CW Compliance Margin", 26, 1, True)
CCW_COMPLIANCE_MARGIN = Register("CCW Compliance Margin", 27, 1, True)
CW_COMPLIANCE_SLOPE = Register("CW Compliance Slope", 28, 1, True)
CCW_COMPLIANCE_SLOPE = Register("CCW Compliance Slope", 29, 1, True)
GOAL_POSITION = Register("Goal Position", 30, 2, True)
MOVING_SPEED = Register("Moving Speed", 32, 2, True)
TORQUE_LIMIT = Register("Torque Limit", 34, 2, True)
PRESENT_POSITION = Register("Present Position", 36, 2, False)
PRESENT_SPEED = Register("Present Speed", 38, 2, False)
PRESENT_LOAD = Register("Present Load", 40, 2, False)
PRESENT_VOLTAGE = Register("Present Voltage", 42, 1, False)
PRESENT_TEMPERATURE = Register("Present Temperature", 43, 1, False)
REGISTERED = Register("Registered", 44, 1, False)
MOVING = Register("Moving", 46, 1, False)
LOCK = Register("Lock", 47, 1, True)
PUNCH = Register("Punch", 48, 2, True)

TABLE: tuple[Register, ...] = tuple(
    sorted(
        (value for value in list(globals().values()) if isinstance(value, Register)),
        key=lambda register: register.address,
    )
)
"""All registers by address."""

FEEDBACK_BLOCK = (PRESENT_POSITION.address, PRESENT_TEMPERATURE.end - PRESENT_POSITION.address)
"""Address and length of position, speed, load, voltage and temperature: one READ of 8 bytes."""
