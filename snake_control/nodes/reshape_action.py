"""The action ``reshape``: SCPs to wanted angles while the head stands still."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from snake_interfaces.msg import ControllerState

from snake_control.config import Config
from snake_control.control.joint_motion import MotionStep
from snake_control.control.limits import JointLimits
from snake_control.control.reference import Reference
from snake_control.control.reshape_motion import ReshapeMotion
from snake_control.nodes import topics
from snake_control.nodes.controller_messages import Step, too_far
from snake_control.nodes.conversions import MessageError
from snake_control.nodes.joint_action import (
    STATUS_OF_PHASE,
    JointAction,
    Run,
    enter_status,
    wanted_angles,
    wanted_speed,
)

Array = NDArray[np.float64]
Control = Callable[[Step, Array, "Array | None", Reference], None]


class ReshapeAction(JointAction[ReshapeMotion]):
    """Serves the action."""

    needs = (topics.HEAD_ODOMETRY.name, topics.JOINT_STATES.name)

    def __init__(
        self, node: Node, config: Callable[[], Config], busy: Callable[[], str], control: Control
    ) -> None:
        """Offer the action; see ``JointAction``.

        Args:
            control: lets the supervised control law fill in a step, for joint angles, their rate
                (or ``None``) and a reference.
        """
        super().__init__(node, topics.RESHAPE, config, busy)
        self._control = control
        self._says = ""

    def _begin(self, run: Run[ReshapeMotion], step: Step, t: float) -> ReshapeMotion | None:
        config = self._config()
        robot, limits = config.robot, JointLimits(config.robot)
        speed = wanted_speed(run.goal, config, limits)
        names = robot.joint_names
        run.joints = [names[joint - 1] for joint in robot.scp_joints]
        others = [name for name in run.goal.name if name in names and name not in run.joints]
        if others:
            raise MessageError(f"no SCP: {', '.join(others)}; the SCPs are {', '.join(run.joints)}")
        wanted = wanted_angles(run.goal, names, limits)
        run.how = "the head stood still"
        self._says = ""
        return ReshapeMotion(
            robot,
            config.scp_controller,
            config.supervisor,
            np.concatenate([step.w, step.phi]),
            {joint + 1: angle for joint, angle in wanted.items()},
            speed,
            t,
        )

    def _move(
        self, run: Run[ReshapeMotion], motion: ReshapeMotion, step: Step, t: float
    ) -> tuple[MotionStep, str]:
        now = motion.step(step.phi, t)
        step.w_d, step.w_d_dot = now.reference.w_d, now.reference.w_d_dot
        error = self._head_error(step)
        run.head_error = (max(run.head_error[0], error[0]), max(run.head_error[1], error[1]))
        if now.motion.phase.over or now.danger:
            return now.motion, now.danger
        own = self._config().scp_controller
        if text := too_far(step, own.max_position_error_m, own.max_rotation_error_rad):
            return now.motion, text
        self._control(step, now.phi, None, now.reference)
        if step.result is None:
            return now.motion, step.text
        motion.heed(step.result.u, step.result.reference_scale)
        self._says = step.text
        words = STATUS_OF_PHASE[now.motion.phase]
        text = f"{self.name}: {words}, {100 * now.motion.progress:.0f} % done; {step.text}"
        reasons = step.reasons
        enter_status(step, ControllerState.STATUS_RESHAPING, text)
        step.reasons += reasons
        return now.motion, ""

    def _stop(self, motion: ReshapeMotion) -> None:
        motion.stop()

    def _pause(self, motion: ReshapeMotion) -> None:
        motion.pause()

    def _why(self, step: Step) -> str:
        return f"; the controller: {self._says}" if self._says else ""

    def _tell(self, message: Any, run: Run[ReshapeMotion], step: Step | None) -> None:
        error = run.head_error if step is None else self._head_error(step)
        message.head_position_error, message.head_rotation_error = error
        if step is not None:
            message.controller = self._says

    @staticmethod
    def _head_error(step: Step) -> tuple[float, float]:
        """Return the error of the head, position and rotation [m, rad]; 0 before it has one."""
        if not math.isfinite(float(step.w_d[0])):
            return 0.0, 0.0
        return float(np.linalg.norm(step.error[:3])), float(np.abs(step.error[3:]).max())
