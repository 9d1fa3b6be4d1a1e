"""The control table of an AX-12A as data: address, size, access, default and range of each item.

Source: AX-12 User's Manual (2006-06-14), page 12 ff. and 19; e-manual AX-12A, "Control Table".
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping

TABLE_SIZE = 50
"""Number of addresses; the last item, Punch, ends at 49."""

RAM_START = 24
"""First address of the RAM area; what lies below survives a power cycle."""

LOCK_WRITABLE = range(0x18, 0x24)
"""The only addresses that can be written while Lock is 1 (manual, example 20)."""


@dataclasses.dataclass(frozen=True, eq=False)
class Register:
    """One item of the control table.

    Attributes:
        name: the manual's name in lower case.
        address: of its first byte.
        size: 1 or 2 bytes, little endian.
        writable: whether WRITE may change it.
        default: factory value (EEPROM), or value at power-on (RAM).
        low, high: allowed values of a write.
    """

    name: str
    address: int
    size: int
    writable: bool
    default: int
    low: int
    high: int

    def __post_init__(self) -> None:
        largest = 256**self.size - 1
        if self.size not in (1, 2) or not 0 <= self.address <= TABLE_SIZE - self.size:
            raise ValueError(f"{self.name}: no {self.size}-byte item fits at {self.address}")
        if not 0 <= self.low <= self.high <= largest or not 0 <= self.default <= largest:
            raise ValueError(f"{self.name}: range or default does not fit its size")

    @property
    def eeprom(self) -> bool:
        """Whether the value survives a power cycle."""
        return self.address < RAM_START

    @property
    def end(self) -> int:
        """The address behind its last byte."""
        return self.address + self.size


def _read_write(name: str, address: int, size: int, default: int, low: int, high: int) -> Register:
    return Register(name, address, size, True, default, low, high)


def _read_only(name: str, address: int, size: int, default: int = 0) -> Register:
    return Register(name, address, size, False, default, 0, 256**size - 1)


TABLE: tuple[Register, ...] = (
    _read_only("model_number", 0, 2, 12),
    _read_only("firmware_version", 2, 1, 24),
    _read_write("id", 3, 1, 1, 0, 253),
    _read_write("baud_rate", 4, 1, 1, 0, 254),
    _read_write("return_delay_time", 5, 1, 250, 0, 254),
    _read_write("cw_angle_limit", 6, 2, 0, 0, 1023),
    _read_write("ccw_angle_limit", 8, 2, 1023, 0, 1023),
    _read_only("reserved_10", 10, 1),
    _read_write("temperature_limit", 11, 1, 70, 0, 150),
    _read_write("min_voltage_limit", 12, 1, 60, 50, 250),
    _read_write("max_voltage_limit", 13, 1, 140, 50, 250),
    _read_write("max_torque", 14, 2, 1023, 0, 1023),
    _read_write("status_return_level", 16, 1, 2, 0, 2),
    _read_write("alarm_led", 17, 1, 36, 0, 127),
    _read_write("alarm_shutdown", 18, 1, 36, 0, 127),
    _read_write("reserved_19", 19, 1, 0, 0, 1),
    _read_only("down_calibration", 20, 2),
    _read_only("up_calibration", 22, 2),
    _read_write("torque_enable", 24, 1, 0, 0, 1),
    _read_write("led", 25, 1, 0, 0, 1),
    _read_write("cw_compliance_margin", 26, 1, 1, 0, 254),
    _read_write("ccw_compliance_margin", 27, 1, 1, 0, 254),
    _read_write("cw_compliance_slope", 28, 1, 32, 1, 254),
    _read_write("ccw_compliance_slope", 29, 1, 32, 1, 254),
    _read_write("goal_position", 30, 2, 0, 0, 1023),
    # Up to 1023 in joint mode; the servo checks that, because it depends on the mode.
    _read_write("moving_speed", 32, 2, 0, 0, 2047),
    _read_write("torque_limit", 34, 2, 1023, 0, 1023),
    _read_only("present_position", 36, 2),
    _read_only("present_speed", 38, 2),
    _read_only("present_load", 40, 2),
    _read_only("present_voltage", 42, 1),
    _read_only("present_temperature", 43, 1),
    _read_only("registered", 44, 1),
    _read_only("reserved_45", 45, 1),
    _read_only("moving", 46, 1),
    # Only 1 can be written: a lock is undone by switching the power off.
    _read_write("lock", 47, 1, 0, 1, 1),
    _read_write("punch", 48, 2, 32, 0, 1023),
)

BY_NAME: Mapping[str, Register] = {register.name: register for register in TABLE}
_SPAN: Mapping[str, slice] = {r.name: slice(r.address, r.end) for r in TABLE}
_BYTES: Mapping[str, tuple[int, int]] = {r.name: (r.address, r.size) for r in TABLE}
_AT: Mapping[int, Register] = {
    address: register for register in TABLE for address in range(register.address, register.end)
}


@functools.cache
def registers_in(address: int, size: int) -> tuple[Register, ...]:
    """Return the items that ``size`` bytes from ``address`` touch, in order.

    Raises:
        IndexError: the bytes are none, or do not all lie in the table.
    """
    if size < 1 or address < 0 or address + size > TABLE_SIZE:
        raise IndexError(f"no {size} bytes at address {address} of the control table")
    found = dict.fromkeys(_AT[i] for i in range(address, address + size))
    return tuple(found)


class RegisterFile:
    """The values of one servo's control table, by name or as bytes."""

    def __init__(self, defaults: Mapping[str, int] | None = None) -> None:
        """Fill in the defaults.

        Args:
            defaults: values that differ from the AX-12A's, by register name.
        """
        self._bytes = bytearray(TABLE_SIZE)
        self._defaults = {r.name: r.default for r in TABLE} | dict(defaults or {})
        self.reset()

    def __getitem__(self, name: str) -> int:
        address, size = _BYTES[name]
        low = self._bytes[address]
        return low if size == 1 else low | self._bytes[address + 1] << 8

    def __setitem__(self, name: str, value: int) -> None:
        register = BY_NAME[name]
        self._bytes[_SPAN[name]] = value.to_bytes(register.size, "little")

    def read(self, address: int, size: int) -> bytes:
        """Return ``size`` bytes; the caller has checked the bounds with ``registers_in``."""
        return bytes(self._bytes[address : address + size])

    def write(self, address: int, data: bytes) -> None:
        """Store ``data``; the caller has checked bounds, access and ranges."""
        self._bytes[address : address + len(data)] = data

    def reset_ram(self) -> None:
        """Give the RAM area its power-on values."""
        for register in TABLE:
            if not register.eeprom:
                self[register.name] = self._defaults[register.name]

    def reset(self) -> None:
        """Give everything the values that the factory gave it."""
        for name, value in self._defaults.items():
            self[name] = value
