"""What comes upon one servo from outside, beside its instructions and the load of its joint."""

from __future__ import annotations

import dataclasses
import math


@dataclasses.dataclass(frozen=True, slots=True)
class Disturbance:
    """Outside causes that act on a servo as long as they last.

    Attributes:
        shaft_blocked: something holds the shaft: it does not turn, whatever drives it.
        extra_load_nm: added to the load of the joint [N m].
        temperature_c: forced upon the inside [degC]; ``None`` to let it warm by itself.
        frozen_sensor: Present Position and Present Speed keep the values that they had.
    """

    shaft_blocked: bool = False
    extra_load_nm: float = 0.0
    temperature_c: float | None = None
    frozen_sensor: bool = False

    def __post_init__(self) -> None:
        if not math.isfinite(self.extra_load_nm):
            raise ValueError(f"extra_load_nm = {self.extra_load_nm!r}: give a finite number")
        temperature = self.temperature_c
        if temperature is not None and not -40.0 <= temperature <= 255.0:
            raise ValueError(f"temperature_c = {temperature!r}: give -40 to 255")


NONE = Disturbance()
"""Nothing from outside."""
