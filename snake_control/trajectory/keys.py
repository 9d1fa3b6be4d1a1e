"""What the keys of a keyboard mean for the head; no terminal and no clock."""

from __future__ import annotations

import dataclasses

import numpy as np

from snake_control.trajectory.teleop import HeadVelocityCommand

HELP = """\
 r t u   up, nose up, faster        w   ahead
 f g j   down, nose down, slower  a   d  left, right        q e  turn left, right
                                    s   back
 space   stand still        x or Ctrl-C  quit
Hold a key down to move; the head stops {hold_s:g} s after the last one."""

STOP, QUIT = " ", ("x", "\x03", "\x04")

# Along x, y, z and about y, z of the level frame that looks where the head looks.
_LINEAR = {
    "w": (1.0, 0.0, 0.0),
    "s": (-1.0, 0.0, 0.0),
    "a": (0.0, 1.0, 0.0),
    "d": (0.0, -1.0, 0.0),
    "r": (0.0, 0.0, 1.0),
    "f": (0.0, 0.0, -1.0),
}
_ANGULAR = {
    "q": (0.0, 0.0, 1.0),
    "e": (0.0, 0.0, -1.0),
    "t": (0.0, -1.0, 0.0),
    "g": (0.0, 1.0, 0.0),
}
_FASTER, _SLOWER = "u", "j"
_STEP = 1.25
_LOWEST, _HIGHEST = 0.1, 4.0


@dataclasses.dataclass
class Keys:
    """Turns keys into velocities; a velocity counts until ``hold_s`` after the last key.

    Attributes:
        speed, turning_speed: at scale 1 [m/s, rad/s].
        hold_s: for how long a key counts [s]: longer than the pause before a keyboard repeats.
        scale: factor of both speeds.
    """

    speed: float
    turning_speed: float
    hold_s: float = 0.6
    scale: float = 1.0
    _key: str = STOP
    _until: float = 0.0

    def press(self, key: str, now: float) -> bool:
        """Take a key; return whether it means anything.

        Args:
            key: one character.
            now: time of a steady clock [s].
        """
        key = key.lower()
        if key in (_FASTER, _SLOWER):
            wanted = self.scale * (_STEP if key == _FASTER else 1.0 / _STEP)
            self.scale = min(max(wanted, _LOWEST), _HIGHEST)
            return True
        if key != STOP and key not in _LINEAR and key not in _ANGULAR:
            return False
        self._key, self._until = key, now + self.hold_s
        return True

    def command(self, now: float) -> HeadVelocityCommand:
        """Return what the head shall do at a time [s]: the last key's velocity, or rest."""
        key = self._key if now <= self._until else STOP
        linear = self.scale * self.speed * np.array(_LINEAR.get(key, (0.0, 0.0, 0.0)))
        angular = self.scale * self.turning_speed * np.array(_ANGULAR.get(key, (0.0, 0.0, 0.0)))
        return HeadVelocityCommand(linear, angular, in_heading_frame=True)
