"""What a servo remembers beside its registers as long as it has power."""

from __future__ import annotations

import dataclasses

from snake_control.mock.control_table import registers_in


@dataclasses.dataclass(frozen=True, slots=True)
class RegisteredWrite:
    """A REG_WRITE that waits for its ACTION.

    Attributes:
        address: of the first byte.
        data: what to write; it ends within the table.
    """

    address: int
    data: bytes

    def __post_init__(self) -> None:
        registers_in(self.address, len(self.data))


@dataclasses.dataclass(slots=True)
class Volatile:
    """State that goes with the power; a new one is what a servo starts with.

    Attributes:
        driven: whether the motor is switched on.
        waiting: the registered write, if there is one.
        conditions: error bits of the conditions that hold now.
        tripped: error bits of the conditions that have shut the servo down.
        shut_down: whether an alarm has switched the motor off.
        blinking_for_s: how much longer the LED blinks for an alarm [s].
        executing: whether a goal is being executed.
        resting_for_s: how long the shaft has not turned meanwhile [s].
    """

    driven: bool = False
    waiting: RegisteredWrite | None = None
    conditions: int = 0
    tripped: int = 0
    shut_down: bool = False
    blinking_for_s: float = 0.0
    executing: bool = False
    resting_for_s: float = 0.0
