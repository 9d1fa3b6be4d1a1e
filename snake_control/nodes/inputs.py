"""The newest message of one topic, and whether it can be relied on."""

from __future__ import annotations

import dataclasses
import enum
import math
import time
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from snake_control.nodes.conversions import MessageError, stamp_ns

Value = TypeVar("Value")

FUTURE_TOLERANCE_S = 0.005
"""How far ahead of this computer's clock a stamp may be: what clock synchronisation leaves."""


class Fault(enum.IntEnum):
    """What can be wrong with an input; the worst has the highest number."""

    WAITING = 1
    STALE = 2
    INVALID = 3


@dataclasses.dataclass(frozen=True)
class Problem:
    """Why an input cannot be used; the text names its topic."""

    fault: Fault
    text: str
    topic: str


class Input(Generic[Value]):
    """Keeps the newest message of a topic in converted form; its age is judged by its stamp."""

    def __init__(self, name: str, timeout_s: float, convert: Callable[[Any], Value]) -> None:
        """Create an input that has received nothing.

        Args:
            name: the topic, for texts.
            timeout_s: older than this is no use; nor is anything from the future.
            convert: turns a message into a value, or raises ``MessageError``.
        """
        self.name = name
        self._timeout_s = timeout_s
        self._convert = convert
        self._stamp_ns: int | None = None
        self._arrived_at = math.nan
        self._value: Value | None = None
        self._fault = ""

    def receive(self, message: Any) -> None:
        """Take a message (the callback of a subscription)."""
        self._arrived_at = time.monotonic()
        self._stamp_ns = stamp_ns(message)
        try:
            self._value = self._convert(message)
            self._fault = ""
        except MessageError as error:
            self._value = None
            self._fault = str(error)

    @property
    def value(self) -> Value:
        """The newest value; only after ``problem`` returned ``None``."""
        assert self._value is not None
        return self._value

    def age(self, now_ns: int) -> float:
        """Age of the newest message [s]; infinite before the first."""
        return math.inf if self._stamp_ns is None else (now_ns - self._stamp_ns) * 1e-9

    def waited(self) -> float:
        """Time since the newest message arrived [s]; NaN before the first."""
        return time.monotonic() - self._arrived_at

    def problem(self, now_ns: int) -> Problem | None:
        """Return why the newest message cannot be used at ``now_ns``, ``None`` if it can."""
        if self._stamp_ns is None:
            return Problem(Fault.WAITING, f"waiting for {self.name}", self.name)
        if self._fault:
            return Problem(Fault.INVALID, f"{self.name}: {self._fault}", self.name)
        age = self.age(now_ns)
        if age < -FUTURE_TOLERANCE_S:
            # It would look fresh for as long as the clocks differ.
            return Problem(
                Fault.INVALID,
                f"{self.name}: stamped {-age:.3f} s ahead of this computer's clock",
                self.name,
            )
        if age > self._timeout_s:
            return Problem(
                Fault.STALE,
                f"{self.name} is {age:.2f} s old (limit {self._timeout_s:g} s)",
                self.name,
            )
        return None
