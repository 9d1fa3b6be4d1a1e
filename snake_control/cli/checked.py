"""Argument types of the commands."""

from __future__ import annotations

import argparse
import math


def positive(text: str) -> float:
    """Return a finite number above 0.

    Raises:
        ArgumentTypeError: it is none (argparse then shows the usage).
    """
    value = float(text)
    if not (math.isfinite(value) and value > 0):
        raise argparse.ArgumentTypeError(f"{text} is not more than 0")
    return value


def natural(text: str) -> int:
    """Return an integer from 0 on.

    Raises:
        ArgumentTypeError: it is none.
    """
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} is negative")
    return value
