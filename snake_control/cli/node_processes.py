"""The nodes of one robot as child processes: started, watched, stopped in order."""

from __future__ import annotations

import ctypes
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from snake_control.errors import NodeDiedError

_LIBC = ctypes.CDLL(None)
_PR_SET_PDEATHSIG = 1
_LOG_TAIL_LINES = 15


class NodeProcesses:
    """Child processes by kind of node, in the order they were started."""

    def __init__(self, log_directory: Path, environment: Mapping[str, str]) -> None:
        """Prepare; each node writes ``<kind>.log`` into an existing directory."""
        self._log_directory = log_directory
        self._environment = dict(environment)
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, kind: str, arguments: Sequence[str]) -> None:
        """Start ``snake_control.nodes.<kind>`` with the given arguments.

        Raises:
            OSError: no process or log file could be made.
        """
        with self.log(kind).open("wb") as log:
            self._running[kind] = subprocess.Popen(
                [sys.executable, "-m", f"snake_control.nodes.{kind}", *arguments],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env=self._environment,
                # Ctrl-C in the terminal must reach us alone: we stop the nodes in order.
                start_new_session=True,
                preexec_fn=_interrupt_when_parent_dies,
            )

    def log(self, kind: str) -> Path:
        """Return the log file of a node."""
        return self._log_directory / f"{kind}.log"

    def is_running(self, kind: str) -> bool:
        """Whether a node was started and has not ended."""
        process = self._running.get(kind)
        return process is not None and process.poll() is None

    def pids(self) -> dict[str, int]:
        """Return the process ids by kind of node."""
        return {kind: process.pid for kind, process in self._running.items()}

    def check(self) -> None:
        """Do nothing while all nodes run.

        Raises:
            NodeDiedError: names the first that ended, with the end of its log.
        """
        for kind, process in self._running.items():
            code = process.poll()
            if code is not None:
                raise NodeDiedError(kind, code, str(self.log(kind)), self._log_tail(kind))

    def stop(self, kinds: Iterable[str], timeout_s: float) -> list[str]:
        """Interrupt nodes one after the other, each when the one before has ended.

        Returns:
            What went wrong, one sentence per node: it had to be killed, or its exit code was not 0.
        """
        findings = []
        for kind in kinds:
            process = self._running.pop(kind, None)
            if process is None:
                continue
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
            try:
                code = process.wait(timeout_s)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                findings.append(f"{kind} did not end within {timeout_s:g} s and was killed")
                continue
            if code != 0:
                findings.append(f"{kind} ended with {_meaning(code)}")
        return findings

    def kill(self) -> None:
        """Kill what is still running."""
        for process in self._running.values():
            process.kill()
        deadline = time.monotonic() + 5.0
        for process in self._running.values():
            process.wait(max(0.1, deadline - time.monotonic()))
        self._running.clear()

    def _log_tail(self, kind: str) -> str:
        text = self.log(kind).read_text(encoding="utf-8", errors="replace")
        return "\n".join(text.splitlines()[-_LOG_TAIL_LINES:])


def _meaning(code: int) -> str:
    return f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"


def _interrupt_when_parent_dies() -> None:
    # Nodes in sessions of their own would outlive a killed parent for ever.
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGINT)
