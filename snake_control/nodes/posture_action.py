"""The action ``go_to_posture``: all joints to a posture, whatever the head does meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from snake_interfaces.msg import ControllerState

from snake_control.config import Config
from snake_control.control.joint_motion import MotionStep
from snake_control.control.limits import JointLimits
from snake_control.control.posture_motion import PostureMotion
from snake_control.control.posture_way import Found, Order, PostureWays
from snake_control.errors import ConfigError
from snake_control.nodes import topics
from snake_control.nodes.controller_messages import Step
from snake_control.nodes.conversions import MessageError
from snake_control.nodes.joint_action import (
    STATUS_OF_PHASE,
    JointAction,
    Run,
    enter_status,
    require_reachable,
    wanted_angles,
    wanted_speed,
)

Array = NDArray[np.float64]


class PostureAction(JointAction[PostureMotion]):
    """Serves the action."""

    needs = (topics.JOINT_STATES.name,)

    def __init__(self, node: Node, config: Callable[[], Config], busy: Callable[[], str]) -> None:
        """Offer the action; see ``JointAction``."""
        super().__init__(node, topics.GO_TO_POSTURE, config, busy)
        # Looking through all orders may take longer than a control step.
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="posture")
        self._search: tuple[Run[PostureMotion], float, Future[Found]] | None = None

    def close(self) -> None:
        """Serve no more."""
        self._worker.shutdown(wait=False, cancel_futures=True)
        super().close()

    def _begin(self, run: Run[PostureMotion], step: Step, t: float) -> PostureMotion | None:
        config = self._config()
        if self._search is None or self._search[0] is not run:
            limits = JointLimits(config.robot)
            speed = wanted_speed(run.goal, config, limits)
            goal = self._goal(run, config, limits, step.phi)
            run.joints = config.robot.joint_names
            if run.goal.skip_check:
                found = Found(
                    (step.phi, goal), Order.AT_ONCE, {}, f"{Order.AT_ONCE.value}, unchecked"
                )
                return self._made(run, config, found, speed, t)
            ways = PostureWays(config.robot, config.supervisor)
            self._search = run, speed, self._worker.submit(ways.find, step.phi, goal)
        _, speed, search = self._search
        self._feed_back(run, step, t, phase="checking")
        if not search.done():
            return None
        self._search = None
        found = search.result()
        if not found.corners:
            self._end(run, self._type.Result.UNSAFE, f"no way leads there: {found.text}")
            return None
        return self._made(run, config, found, speed, t)

    def _made(
        self, run: Run[PostureMotion], config: Config, found: Found, speed: float, t: float
    ) -> PostureMotion:
        run.how = found.text
        own = config.scp_controller
        return PostureMotion(config.robot, own, config.supervisor, found, speed, t)

    def _goal(
        self, run: Run[PostureMotion], config: Config, limits: JointLimits, phi: Array
    ) -> Array:
        """Return the angles to go to, (n-1,) [rad]."""
        asked, names = run.goal, config.robot.joint_names
        if not asked.posture:
            goal = phi.copy()
            for joint, angle in wanted_angles(asked, names, limits).items():
                goal[joint] = angle
            return goal
        if asked.name or asked.angle:
            raise MessageError("give a posture by name, or joints and their angles, not both")
        try:
            angles = config.postures.angles("posture", asked.posture)
        except ConfigError as error:
            raise MessageError(str(error)) from error
        for joint, (name, angle) in enumerate(zip(names, angles, strict=True)):
            require_reachable(name, angle, joint, limits)
        return np.array(angles)

    def _move(
        self, run: Run[PostureMotion], motion: PostureMotion, step: Step, t: float
    ) -> tuple[MotionStep, str]:
        now = motion.step(step.phi, t)
        step.u, step.d_min = now.u, now.d_min
        if not now.motion.phase.over:
            where = run.goal.posture or "given angles"
            words = STATUS_OF_PHASE[now.motion.phase]
            text = f"{self.name} ({where}): {words}, {100 * now.motion.progress:.0f} % done"
            enter_status(step, ControllerState.STATUS_POSTURE, text)
        return now.motion, now.danger

    def _stop(self, motion: PostureMotion) -> None:
        motion.stop()

    def _pause(self, motion: PostureMotion) -> None:
        motion.pause()
