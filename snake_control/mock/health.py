"""Conditions that a servo watches over: voltage, temperature and overload."""

from __future__ import annotations

import dataclasses
import math

from snake_control.mock.protocol import ErrorBit


@dataclasses.dataclass(frozen=True, slots=True)
class HealthParameters:
    """How a servo warms up, and when it calls a load too much.

    Attributes:
        ambient_c: temperature it cools down to [degC].
        rise_at_full_output_k: how far above that constant full output ends [K].
        time_constant_s: of warming and cooling [s].
        overload_after_s: how long a load may exceed what the output carries [s].
    """

    ambient_c: float = 25.0
    rise_at_full_output_k: float = 80.0
    time_constant_s: float = 300.0
    overload_after_s: float = 2.0

    def __post_init__(self) -> None:
        values = dataclasses.astuple(self)
        if not all(math.isfinite(v) for v in values):
            raise ValueError(f"health parameters must be finite: {values}")
        if min(self.rise_at_full_output_k, self.overload_after_s) < 0 or self.time_constant_s <= 0:
            raise ValueError(f"health parameters must not be negative: {values}")


@dataclasses.dataclass(slots=True)
class Health:
    """Temperature and overload of one servo over time.

    Attributes:
        temperature_c: inside the servo [degC].
        overloaded_for_s: how long the load has exceeded the output without a pause [s].
    """

    temperature_c: float
    overloaded_for_s: float = 0.0

    def step(
        self, parameters: HealthParameters, output: float, overloaded: bool, dt: float
    ) -> None:
        """Go on by ``dt`` seconds at a constant output; its loss heats with the square."""
        p = parameters
        final = p.ambient_c + p.rise_at_full_output_k * output * output
        self.temperature_c += (final - self.temperature_c) * -math.expm1(-dt / p.time_constant_s)
        self.overloaded_for_s = self.overloaded_for_s + dt if overloaded else 0.0

    def conditions(
        self,
        parameters: HealthParameters,
        voltage_v: float,
        voltage_limits_v: tuple[float, float],
        temperature_limit_c: float,
    ) -> ErrorBit:
        """Return the error bits of the conditions that hold now."""
        bits = ErrorBit.NONE
        low, high = voltage_limits_v
        if not low <= voltage_v <= high:
            bits |= ErrorBit.INPUT_VOLTAGE
        if self.temperature_c > temperature_limit_c:
            bits |= ErrorBit.OVERHEATING
        if self.overloaded_for_s > parameters.overload_after_s:
            bits |= ErrorBit.OVERLOAD
        return bits
