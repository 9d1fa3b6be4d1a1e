"""The mock servos as a process of their own, without ROS."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from support.waiting import wait_for

ROOT = Path(__file__).resolve().parents[2]


class Mock:
    """Mock servos behind ``link``.

    Attributes:
        link: the port.
        process: the process.
    """

    def __init__(self, link: Path, *arguments: str) -> None:
        """Start it and wait for the port."""
        self.link = link
        self.process = subprocess.Popen(
            [sys.executable, "-m", "snake_control.mock", "--port-link", str(link), *arguments],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        wait_for(lambda: link.is_symlink() or self.process.poll() is not None, 30.0, "the link")
        assert self.process.poll() is None, self.process.communicate()[0]

    def stop(self) -> int:
        """End it in order; return its exit code."""
        self.process.terminate()
        self.process.communicate(timeout=10.0)
        return self.process.returncode
