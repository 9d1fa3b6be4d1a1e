"""One line that tells how a run goes: rewritten on a terminal, repeated now and then in a log."""

from __future__ import annotations

import shutil
import sys
import time
from typing import TextIO


class ProgressLine:
    """Shows the newest state of a long run.

    On a terminal one line is rewritten in place; elsewhere a line is printed every few seconds.
    """

    def __init__(
        self,
        stream: TextIO | None = None,
        terminal_period_s: float = 0.2,
        log_period_s: float = 5.0,
    ) -> None:
        self._stream = sys.stdout if stream is None else stream
        self._terminal = self._stream.isatty()
        self._period_s = terminal_period_s if self._terminal else log_period_s
        self._next = 0.0
        self._open = False

    @property
    def due(self) -> bool:
        """Whether it is time to show something."""
        return time.monotonic() >= self._next

    def show(self, text: str) -> None:
        """Show ``text`` now."""
        self._next = time.monotonic() + self._period_s
        if self._terminal:
            width = shutil.get_terminal_size().columns - 1
            self._stream.write("\r\x1b[K" + text[:width])
            self._open = True
        else:
            self._stream.write(text + "\n")
        self._stream.flush()

    def say(self, text: str) -> None:
        """Print a line that stays."""
        self.close()
        self._stream.write(text + "\n")
        self._stream.flush()

    def close(self) -> None:
        """End the rewritten line, so that what follows starts on a new one."""
        if self._open:
            self._stream.write("\n")
            self._open = False
