"""One node as a child process whose output is kept."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

_ABORT_S = 5.0


class Process:
    """A running child process; standard output and error go to one file.

    Attributes:
        name: what it is, for messages.
        pid: its process id.
    """

    def __init__(
        self,
        name: str,
        command: Sequence[str],
        *,
        log: Path,
        cwd: Path,
        environment: Mapping[str, str],
    ) -> None:
        self.name = name
        self._signalled = False
        self._log = log
        with log.open("wb") as stream:
            self._popen = subprocess.Popen(
                list(command),
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=subprocess.STDOUT,
                cwd=cwd,
                env={"PYTHONFAULTHANDLER": "1", **environment},
            )
        self.pid = self._popen.pid

    @property
    def running(self) -> bool:
        """Whether it has not ended yet."""
        return self._popen.poll() is None

    @property
    def exit_code(self) -> int | None:
        """Exit code, negative for a signal, ``None`` while it runs."""
        return self._popen.poll()

    @property
    def crashed(self) -> bool:
        """Whether it ended with an error, and not by a signal of the test."""
        return bool(self.exit_code) and not self._signalled

    def let_end(self) -> None:
        """Do not count its end as a crash, whatever its exit code: it is expected to give up."""
        self._signalled = True

    def output(self) -> str:
        """Everything it printed so far."""
        return self._log.read_text(encoding="utf-8", errors="replace")

    def interrupt(self) -> None:
        """Send SIGINT, as Ctrl-C does."""
        self._send(signal.SIGINT)

    def terminate(self) -> None:
        """Send SIGTERM."""
        self._send(signal.SIGTERM)

    def kill(self) -> None:
        """Send SIGKILL: it gets no chance to clean up."""
        self._send(signal.SIGKILL)

    def pause(self) -> None:
        """Send SIGSTOP: it does nothing until ``resume``."""
        self._send(signal.SIGSTOP)

    def resume(self) -> None:
        """Send SIGCONT."""
        self._send(signal.SIGCONT)

    def wait(self, timeout: float = 10.0) -> int:
        """Wait until it has ended and return its exit code.

        Raises:
            AssertionError: it still runs after ``timeout`` seconds; it is ended, and shows what it
                printed and where each of its threads was.
        """
        try:
            return self._popen.wait(timeout)
        except subprocess.TimeoutExpired:
            # Python's fault handler writes the stacks.
            self._send(signal.SIGABRT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._popen.wait(_ABORT_S)
            raise AssertionError(f"did not end within {timeout} s\n{self.report()}") from None

    def report(self, lines: int = 40) -> str:
        """The end of its output under a headline with its state."""
        state = "running" if self.running else f"exit code {self.exit_code}"
        tail = "\n".join(self.output().splitlines()[-lines:])
        return f"--- {self.name} (pid {self.pid}, {state})\n{tail}"

    def _send(self, number: signal.Signals) -> None:
        self._signalled = True
        if self.running:
            os.kill(self.pid, number)
