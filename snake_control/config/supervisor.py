"""The shared group of what keeps the robot away from its limits."""

from __future__ import annotations

import dataclasses

from snake_control.config.parameter import parameter
from snake_control.errors import ConfigError


@dataclasses.dataclass(frozen=True)
class SupervisorConfig:
    """When the controller slows down, when it holds, and how it gets away (docs/supervisor.md).

    Between a warning and a stop threshold the SCPs work to get away, and the motion is slowed; at
    the stop threshold nothing is done that brings the robot nearer.
    """

    enabled: bool = parameter(
        True,
        "keep away from limits; false for the bare law (22), of which only speeds and ranges of "
        "the joints are limited",
        run_time=True,
    )
    d_min_warn_m: float = parameter(
        0.015,
        "below this margin against falling (30) the SCPs work to regain it [m]",
        low=0.0,
        high=10.0,
        run_time=True,
    )
    d_min_stop_m: float = parameter(
        0.005, "no motion brings the margin below this [m]", low=0.0, high=10.0, run_time=True
    )
    floor_warn_m: float = parameter(
        0.006,
        "below this height of a raised link above the floor the H-SCPs work to lift it [m]",
        low=0.0,
        high=10.0,
        run_time=True,
    )
    floor_stop_m: float = parameter(
        0.002,
        "no motion brings a raised link nearer to the floor than this [m]",
        low=0.0,
        high=10.0,
        run_time=True,
    )
    nearness_warn: float = parameter(
        0.92,
        "above this nearness of a singular shape (Fig. 5) the SCPs work to get away",
        low=0.0,
        high=1.0,
        run_time=True,
    )
    nearness_stop: float = parameter(
        0.97,
        "no motion brings the robot nearer to a singular shape than this; 1 for no such limit",
        low=0.0,
        high=1.0,
        run_time=True,
    )
    regularity_warn: float = parameter(
        0.15,
        "below this regularity of the head's posture (1 / norm of the inverse of its four rows of "
        "(7), free of units) the H-SCPs work to regain it",
        low=0.0,
        high=10.0,
        run_time=True,
    )
    regularity_stop: float = parameter(
        0.05,
        "no motion brings the head nearer to a singular posture than this",
        low=0.0,
        high=10.0,
        run_time=True,
    )
    range_warn_rad: float = parameter(
        0.2,
        "this near to the end of a joint's range the SCPs work to get away [rad]",
        low=1e-3,
        high=10.0,
        run_time=True,
    )
    approach_rate_per_s: float = parameter(
        4.0,
        "a limit is approached no faster than by this share of what is left, per second [1/s]",
        low=0.1,
        high=50.0,
        run_time=True,
    )
    horizon_s: float = parameter(
        0.1,
        "how far ahead a motion is looked at: what measuring, computing and stopping take [s]",
        low=0.01,
        high=1.0,
        run_time=True,
    )
    escape_speed_rad_s: float = parameter(
        1.0,
        "speed of the fastest joint while the SCPs get away from a limit [rad/s]",
        low=0.0,
        high=5.0,
        run_time=True,
    )
    acceleration_limit_rad_s2: float = parameter(
        30.0,
        "largest change of a joint's commanded speed, but for the sake of the limits above; 0 for "
        "none [rad/s^2]",
        low=0.0,
        high=1e4,
        run_time=True,
    )
    scale_rise_per_s: float = parameter(
        1.0,
        "how fast the reference speeds up again after it was slowed [1/s]",
        low=0.01,
        high=100.0,
        run_time=True,
    )

    def __post_init__(self) -> None:
        if self.d_min_warn_m < self.d_min_stop_m:
            raise ConfigError(
                "supervisor.d_min_warn_m",
                self.d_min_warn_m,
                f"at least supervisor.d_min_stop_m = {self.d_min_stop_m:g}",
            )
        if self.floor_warn_m < self.floor_stop_m:
            raise ConfigError(
                "supervisor.floor_warn_m",
                self.floor_warn_m,
                f"at least supervisor.floor_stop_m = {self.floor_stop_m:g}",
            )
        if self.nearness_warn > self.nearness_stop:
            raise ConfigError(
                "supervisor.nearness_warn",
                self.nearness_warn,
                f"at most supervisor.nearness_stop = {self.nearness_stop:g}",
            )
        if self.regularity_warn < self.regularity_stop:
            raise ConfigError(
                "supervisor.regularity_warn",
                self.regularity_warn,
                f"at least supervisor.regularity_stop = {self.regularity_stop:g}",
            )
        if self.approach_rate_per_s * self.horizon_s > 1.0:
            raise ConfigError(
                "supervisor.approach_rate_per_s",
                self.approach_rate_per_s,
                f"at most 1 / supervisor.horizon_s = {1.0 / self.horizon_s:g}, or a limit is "
                "passed within the horizon",
            )
