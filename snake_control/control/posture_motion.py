"""A move of all joints to a posture: planned and looked through, then followed and watched."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from snake_control.config import RobotConfig, ScpControllerConfig, SupervisorConfig
from snake_control.control.joint_motion import JointMotion, MotionStep, Phase
from snake_control.control.joint_way import JointWay
from snake_control.control.limits import JointLimits
from snake_control.control.posture_way import Found, Obstacle, PostureMargins

Array = NDArray[np.float64]

SPEED_SHARE = 0.9
"""Share of a joint's speed limit that a plan uses; the rest is for the correction of errors."""

_WORSE_M = {Obstacle.FALL: 0.003, Obstacle.ITSELF: 0.005}
"""How much less than planned a margin may be: joints lag, and servos give way. The floor is not
among them: where the head sinks onto it the floor holds it."""


def planned_acceleration(own: ScpControllerConfig, supervisor: SupervisorConfig) -> float:
    """Return the acceleration that plans of joint motions use [rad/s^2]."""
    limit = supervisor.acceleration_limit_rad_s2
    wanted = own.posture_acceleration_rad_s2
    return min(wanted, limit) if limit > 0.0 else wanted


def made_motion(
    way: JointWay, own: ScpControllerConfig, supervisor: SupervisorConfig, t: float
) -> JointMotion:
    """Return a motion along a way that begins at time ``t`` [s]."""
    return JointMotion(
        way,
        gain=own.posture_gain_per_s,
        acceleration=planned_acceleration(own, supervisor),
        tolerance=own.posture_tolerance_rad,
        patience=own.posture_patience_s,
        t=t,
    )


@dataclasses.dataclass(frozen=True, eq=False)
class PostureStep:
    """One moment of a move.

    Attributes:
        motion: how far it is.
        u: joint velocities within the limits, (n-1,) [rad/s].
        d_min: margin against falling at the measured angles [m].
        danger: what ended the move; empty if nothing did.
    """

    motion: MotionStep
    u: Array
    d_min: float
    danger: str


class PostureMotion:
    """Follows a way that was found."""

    def __init__(
        self,
        robot: RobotConfig,
        own: ScpControllerConfig,
        supervisor: SupervisorConfig,
        found: Found,
        speed: float,
        t: float,
    ) -> None:
        """Begin.

        Args:
            robot, own, supervisor: the configuration.
            found: the way; margins that it does not know are not watched.
            speed: of the fastest joint [rad/s].
            t: time [s].
        """
        self._limits = JointLimits(robot)
        speeds = np.minimum(SPEED_SHARE * self._limits.speeds, speed)
        self._way = JointWay(found.corners, speeds, planned_acceleration(own, supervisor))
        self._motion = made_motion(self._way, own, supervisor, t)
        self._margins = PostureMargins(robot, supervisor)
        self._allowed = {
            obstacle: min(found.least[obstacle], 0.0) - worse
            for obstacle, worse in _WORSE_M.items()
            if obstacle in found.least
        }
        self._danger = ""

    @property
    def duration(self) -> float:
        """Planned length [s]."""
        return self._way.duration

    def stop(self) -> None:
        """Slow down to rest."""
        self._motion.stop()

    def pause(self) -> None:
        """Note that the joints rest for a moment."""
        self._motion.pause()

    def step(self, phi: Array, t: float) -> PostureStep:
        """Return what to do now.

        Args:
            phi: measured angles, (n-1,) [rad].
            t: time [s].
        """
        margins = self._margins.at(phi)
        for obstacle, allowed in self._allowed.items():
            if not self._danger and margins[obstacle] < allowed:
                self._danger = self._margins.words(obstacle, margins[obstacle])
        motion = self._motion.step(phi, t)
        if self._danger:
            # At once: what is left of the margin is too little to slow down smoothly.
            rest = np.zeros_like(phi)
            motion = dataclasses.replace(motion, phase=Phase.STOPPED, velocities=rest)
        u = self._limits.apply(phi, motion.velocities).u
        return PostureStep(motion, u, self._margins.d_min_of(margins), self._danger)
