"""What the commands have in common: exit codes, parameter files, signals."""

from __future__ import annotations

import argparse
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

EXIT_OK, EXIT_FAILED, EXIT_USAGE = 0, 1, 2


def add_params_file(
    parser: argparse.ArgumentParser,
    words: str = "ROS parameter file; may be given several times, later ones win; default: the "
    "paper's robot",
) -> None:
    """Add ``--params-file``: any number of files, ``params_file`` a list of paths."""
    parser.add_argument(
        "--params-file", type=Path, action="append", default=[], metavar="F", help=words
    )


@contextmanager
def ending_signals(handler: Callable[[int, FrameType | None], object]) -> Iterator[None]:
    """Give SIGINT and SIGTERM to ``handler``; put the former handlers back at the end."""
    before = {number: signal.signal(number, handler) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)
