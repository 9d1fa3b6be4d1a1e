"""One mock servo without a bus: switched on, and led through time."""

from __future__ import annotations

from snake_control.mock.parameters import ServoParameters
from snake_control.mock.servo import Servo

STEP_S = 0.01


def holding(parameters: ServoParameters | None = None, **eeprom: int) -> Servo:
    """Return a servo with id 1 that holds its shaft."""
    servo = Servo(1, parameters, eeprom=eeprom)
    servo.store("torque_enable", 1)
    return servo


def run(servo: Servo, seconds: float, load_nm: float = 0.0) -> None:
    """Let time pass in steps of ``STEP_S`` under a load [N m]."""
    for _ in range(round(seconds / STEP_S)):
        servo.step(STEP_S, load_nm)
