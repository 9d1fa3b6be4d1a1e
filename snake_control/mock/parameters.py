"""What a servo is made of, and which reading of its manuals it follows where they differ."""

from __future__ import annotations

import dataclasses
import enum

from snake_control.mock.health import HealthParameters
from snake_control.mock.mechanics import MotorParameters


class Shutdown(enum.Flag):
    """What an alarm shutdown clears, and so what has to be written to end it."""

    TORQUE_LIMIT = enum.auto()
    """The e-manual: Torque Limit becomes 0; another value lets the motor work again."""
    TORQUE_ENABLE = enum.auto()
    """The manual of 2006, page 15: the torque is off until Torque Enable is set to 1."""
    BOTH = TORQUE_LIMIT | TORQUE_ENABLE


@dataclasses.dataclass(frozen=True)
class ServoParameters:
    """Motor, supply and firmware of one servo.

    The defaults of the firmware are the e-manual's.

    Attributes:
        motor: motor and gear.
        health: warming and overload.
        supply_voltage_v: voltage at power-on [V].
        eeprom_needs_torque_off: refuse EEPROM writes while the servo is driven, as the e-manual
            asks; the manual of 2006 knows no such rule.
        goal_enables_torque: let a write of Goal Position in joint mode switch torque on, as users
            report of some firmware.
        shutdown_clears: what an alarm shutdown clears.
        has_factory_reset: carry FACTORY_RESET out, as both manuals have it; the AX-12's firmware
            does not know it, says the maker's support.
        answers_broadcast_ping: answer a PING to all, as page 22 of the manual of 2006 says against
            its own page 15 and the e-manual.
    """

    motor: MotorParameters = dataclasses.field(default_factory=MotorParameters)
    health: HealthParameters = dataclasses.field(default_factory=HealthParameters)
    supply_voltage_v: float = 11.1
    eeprom_needs_torque_off: bool = True
    goal_enables_torque: bool = False
    shutdown_clears: Shutdown = Shutdown.TORQUE_LIMIT
    has_factory_reset: bool = False
    answers_broadcast_ping: bool = False

    def __post_init__(self) -> None:
        if not 0 <= self.supply_voltage_v <= 25.5:
            raise ValueError(f"supply_voltage_v = {self.supply_voltage_v!r}: give 0 to 25.5")
        if not self.shutdown_clears:
            raise ValueError("shutdown_clears: a shutdown that clears nothing would never end")
