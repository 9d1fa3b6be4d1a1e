"""What the bus thread tells the rest of the driver after each cycle."""

from __future__ import annotations

import dataclasses
import enum

from snake_control.ax12.driven_joint import JointReading
from snake_control.nodes.bus_command import Followed


class State(enum.IntEnum):
    """What the driver does with commands; the numbers of snake_interfaces/BusState."""

    INACTIVE = 0
    HOLDING = 1
    MOVING = 2
    TORQUE_OFF = 3
    STOPPED = 4
    EMERGENCY_STOP = 5
    LOWERING = 6
    DRY_RUN = 7


@dataclasses.dataclass(frozen=True)
class Snapshot:
    """The bus after one cycle.

    Attributes:
        state, text: what is done with commands, and why.
        read_at: middle of the read cycle on the monotonic clock [s].
        oldest_at: when the oldest of the readings was taken [s]; minus infinite without any.
        readings: one per joint; none without a port.
        cycle_time: from the first byte to the last [s].
        cycle_rate: measured [Hz].
        command_age: [s], infinite without a command.
        followed: the command that the goals follow; ``None`` if they follow none.
        goals_sent_at: when they had left, on the monotonic clock [s].
        cycles, late_cycles: since activation.
        error_rate: share of the last requests without a good reply at the first try.
        reconnections: how often the port was opened anew since the driver was configured.
        emergency: whether an emergency stop is latched.
    """

    state: State
    text: str
    read_at: float
    oldest_at: float
    readings: tuple[JointReading, ...]
    cycle_time: float
    cycle_rate: float
    command_age: float
    followed: Followed | None
    goals_sent_at: float
    cycles: int
    late_cycles: int
    error_rate: float
    reconnections: int
    emergency: bool
