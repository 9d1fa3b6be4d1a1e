"""The AX servos that share the control table: what differs between them.

Source: e-manual AX-12A, AX-12W, AX-18A; AX-12 User's Manual (2006-06-14), pages 12 and 19.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from snake_control.mock.control_table import BY_NAME
from snake_control.mock.mechanics import MotorParameters


@dataclasses.dataclass(frozen=True)
class Model:
    """One kind of servo.

    Attributes:
        name: as printed on it.
        number: Model Number register.
        defaults: registers whose factory or power-on value differs from the AX-12A's.
        motor: motor and gear.
    """

    name: str
    number: int
    defaults: Mapping[str, int]
    motor: MotorParameters

    def __post_init__(self) -> None:
        if not 0 <= self.number <= 0xFFFF:
            raise ValueError(f"{self.name}: number = {self.number!r}: give 0 to 65535")
        for name, value in self.defaults.items():
            register = BY_NAME[name]
            if not register.low <= value <= register.high:
                raise ValueError(f"{self.name}: {name} = {value} is out of range")


def _same(names: tuple[str, ...], value: int) -> dict[str, int]:
    return dict.fromkeys(names, value)


_MARGINS = ("cw_compliance_margin", "ccw_compliance_margin")
_SLOPES = ("cw_compliance_slope", "ccw_compliance_slope")
_RPM = 0.10471975511965977

AX_12A = Model("AX-12A", 12, {}, MotorParameters())
AX_12 = Model(
    "AX-12",
    12,
    {
        "temperature_limit": 85,
        "max_voltage_limit": 190,
        "alarm_led": 4,
        # Overheating alone: this servo does not save itself from an overload.
        "alarm_shutdown": 4,
        **_same(_MARGINS, 0),
    },
    MotorParameters(),
)
# Gear 32:1 instead of 254:1: fast and weak.
AX_12W = Model(
    "AX-12W",
    300,
    {**_same(_MARGINS, 4), **_same(_SLOPES, 64)},
    MotorParameters(
        stall_torque_nm=0.2,
        no_load_speed_rad_s=470 * _RPM,
        friction_torque_nm=0.01,
        joint_mode_speed_rad_s=54 * _RPM,
    ),
)
AX_18A = Model(
    "AX-18A",
    18,
    {"temperature_limit": 75, "max_torque": 983},
    MotorParameters(stall_torque_nm=1.8, no_load_speed_rad_s=97 * _RPM),
)

MODELS: Mapping[str, Model] = {model.name: model for model in (AX_12A, AX_12, AX_12W, AX_18A)}
