"""Argument types of the commands."""

from __future__ import annotations

import argparse
import math
import re


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


def counting(text: str) -> int:
    """Return an integer from 1 on.

    Raises:
        ArgumentTypeError: it is none.
    """
    value = natural(text)
    if value == 0:
        raise argparse.ArgumentTypeError("0 is not at least 1")
    return value


def network_address(text: str) -> str:
    """Return an address such as ``tcp://host:8786``.

    Raises:
        ArgumentTypeError: protocol, host or port is missing.
    """
    if re.fullmatch(r"[a-z]+://([^\s/:\[\]]+|\[[0-9a-fA-F:.]+\]):\d{1,5}", text) is None:
        raise argparse.ArgumentTypeError(f"{text!r} is no address like tcp://host:8786")
    return text
