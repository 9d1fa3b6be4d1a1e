"""Node ``keyboard_teleop``: drives the head from a terminal, through ``cmd_vel``.

Nothing is sent before the first key. The head stops shortly after the last one, whether the key was
released, the terminal closed or this process ended: ``cmd_vel`` has a dead man's switch.
"""

from __future__ import annotations

import contextlib
import os
import select
import sys
import termios
import time
import tty
from collections.abc import Iterator
from typing import Any

from geometry_msgs.msg import TwistStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from snake_control.errors import ConfigError
from snake_control.nodes import topics
from snake_control.nodes.conversions import HEAD_FRAME, header, vector
from snake_control.nodes.parameters import NodeParameters
from snake_control.nodes.process import run
from snake_control.trajectory.keys import HELP, QUIT, Keys


class KeyboardTeleop(Node):
    """Publishes ``cmd_vel`` at a fixed rate from the first key on."""

    def __init__(self, **overrides: Any) -> None:
        """Take over the terminal.

        Raises:
            ConfigError: standard input is no terminal.
        """
        super().__init__("keyboard_teleop", **overrides)
        own = NodeParameters(self, "keyboard_teleop").config.keyboard_teleop
        if not sys.stdin.isatty():
            raise ConfigError("standard input", "no terminal", "run it in a terminal of its own")
        self._fd = sys.stdin.fileno()
        self._before = termios.tcgetattr(self._fd)
        tty.setcbreak(self._fd)
        self._keys = Keys(own.speed_m_s, own.turning_speed_rad_s, own.hold_s)
        self._driving = False
        t = topics.CMD_VEL
        self._cmd_vel = self.create_publisher(t.type, t.name, t.qos)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(1.0 / own.rate_hz, self._step, clock=steady)
        print(HELP.format(hold_s=own.hold_s), flush=True)

    def _step(self) -> None:
        for key in self._typed():
            if key in QUIT:
                raise KeyboardInterrupt
            if self._keys.press(key, time.monotonic()):
                self._driving = True
                print(f"\rspeed x {self._keys.scale:.2f}  ", end="", flush=True)
        if self._driving:
            command = self._keys.command(time.monotonic())
            message = TwistStamped(header=header(self.get_clock().now().nanoseconds, HEAD_FRAME))
            message.twist.linear = vector(command.linear)
            message.twist.angular = vector(command.angular)
            self._cmd_vel.publish(message)

    def _typed(self) -> Iterator[str]:
        while select.select([self._fd], [], [], 0.0)[0]:
            typed = os.read(self._fd, 64)
            if not typed:
                # The terminal was closed.
                yield QUIT[0]
                return
            yield from typed.decode(errors="ignore")

    def close(self) -> None:
        """Give the terminal back; the head stops when commands cease."""
        with contextlib.suppress(termios.error):
            termios.tcsetattr(self._fd, termios.TCSADRAIN, self._before)
        print(flush=True)


def main() -> int:
    """Run the node."""
    try:
        return run(KeyboardTeleop, "keyboard_teleop")
    except KeyboardInterrupt:
        return 0


if __name__ == "__main__":
    sys.exit(main())
