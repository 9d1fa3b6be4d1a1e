"""The internal motion (4)-(6) as a command: SCPs to wanted angles while the head stands still.

The head's reference is the pose that it has at the start. The SCPs' velocities in (22) follow a
plan instead of the sub-tasks (25), (27); the other joints then do what keeps the head there and
the wheels rolling.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from snake_control.config import RobotConfig, ScpControllerConfig, SupervisorConfig
from snake_control.control.joint_motion import MotionStep
from snake_control.control.joint_way import JointWay
from snake_control.control.limits import JointLimits
from snake_control.control.posture_motion import SPEED_SHARE, made_motion, planned_acceleration
from snake_control.control.posture_way import Obstacle, PostureMargins
from snake_control.control.reference import Reference

Array = NDArray[np.float64]

_WORSE_M = 1e-3
"""How far two links, or head and floor, may come into each other: what measuring leaves open."""


@dataclasses.dataclass(frozen=True, eq=False)
class ReshapeStep:
    """One moment of such a motion.

    Attributes:
        motion: how far it is; errors are those of the SCPs.
        reference: what the controller is to follow.
        phi: angles at which it is to do so, (n-1,) [rad]. Half a step ahead: a command holds until
            the next one, and the joints it is right for are those in the middle (midpoint rule).
        danger: what ended the motion at once; empty if nothing did.
    """

    motion: MotionStep
    reference: Reference
    phi: Array
    danger: str


class ReshapeMotion:
    """One such motion."""

    def __init__(
        self,
        robot: RobotConfig,
        own: ScpControllerConfig,
        supervisor: SupervisorConfig,
        q: Array,
        wanted: Mapping[int, float],
        speed: float,
        t: float,
    ) -> None:
        """Begin.

        Args:
            robot, own, supervisor: the configuration.
            q: [w, phi] at the start, (n+5,) [m, rad].
            wanted: angles of SCPs by the number of their joint, from 1 [rad]; SCPs that are not
                among them keep their angles.
            speed: of the fastest SCP [rad/s].
            t: time [s].
        """
        self._scps = np.array(robot.scp_joints, dtype=np.intp) - 1
        start = q[6:][self._scps]
        goal = [
            wanted.get(joint, angle) for joint, angle in zip(robot.scp_joints, start, strict=True)
        ]
        speeds = np.minimum(SPEED_SHARE * JointLimits(robot).speeds[self._scps], speed)
        way = JointWay([start, goal], speeds, planned_acceleration(own, supervisor))
        self.duration = way.duration
        self._motion = made_motion(way, own, supervisor, t)
        self._margins = PostureMargins(robot, supervisor)
        there = self._margins.at(q[6:])
        # Who stands badly to begin with may go on, but not worse.
        self._allowed_margins = {
            obstacle: min(there[obstacle], 0.0) - _WORSE_M
            for obstacle in (Obstacle.ITSELF, Obstacle.FLOOR)
        }
        self._period_s = 1.0 / own.rate_hz
        self._u = np.zeros(robot.joints)
        self._allowed = 1.0
        self._reference = Reference(q[:6].copy(), np.zeros(6))

    def stop(self) -> None:
        """Slow down to rest."""
        self._motion.stop()

    def pause(self) -> None:
        """Note that the joints rest for a moment."""
        self._motion.pause()
        self._u = np.zeros_like(self._u)

    def step(self, phi: Array, t: float) -> ReshapeStep:
        """Return what to do now; ``heed`` is to be told what came of it.

        Args:
            phi: measured angles of all joints, (n-1,) [rad].
            t: time [s].
        """
        now = self._motion.step(phi[self._scps], t, self._allowed)
        reference = dataclasses.replace(
            self._reference, time_scale=now.pace, phi_tilde_dot_d=now.velocities
        )
        return ReshapeStep(now, reference, phi + 0.5 * self._period_s * self._u, self._danger(phi))

    def _danger(self, phi: Array) -> str:
        """Return what the supervisor does not see: a link in another, or in the floor."""
        margins = self._margins.at(phi)
        for obstacle, allowed in self._allowed_margins.items():
            if margins[obstacle] < allowed:
                return self._margins.words(obstacle, margins[obstacle])
        return ""

    def heed(self, u: Array, reference_scale: float) -> None:
        """Take note of joint velocities, (n-1,) [rad/s], and pace that the supervisor gave."""
        self._u = u
        self._allowed = reference_scale
