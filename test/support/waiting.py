"""Waiting for a condition with a deadline, outside any ROS graph."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TypeVar

_Result = TypeVar("_Result")


def wait_for(condition: Callable[[], _Result], timeout_s: float, what: str) -> _Result:
    """Return what ``condition()`` returned once it is true.

    Raises:
        AssertionError: it was not within ``timeout_s``; names ``what``.
    """
    pause = threading.Event()
    deadline = time.monotonic() + timeout_s
    while not (result := condition()):
        if time.monotonic() > deadline:
            raise AssertionError(f"{what}: not within {timeout_s} s")
        pause.wait(0.02)
    return result
