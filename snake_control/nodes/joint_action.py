"""What the actions of ``scp_controller`` have in common: a goal's life, from arrival to result.

They move joints while no reference is followed, and one of them at a time. Every goal is accepted:
only a result can say why a motion cannot be. ``step`` is called in every control step; it fills in
the command while a motion is under way, and whatever is in the way of motion ends the goal.
"""

from __future__ import annotations

import abc
import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node
from rclpy.task import Future
from snake_interfaces.msg import ControllerState

from snake_control.config import Config
from snake_control.control.joint_motion import MotionStep, Phase
from snake_control.control.limits import JointLimits
from snake_control.control.posture_motion import SPEED_SHARE
from snake_control.control.supervisor import NO_ANSWER
from snake_control.nodes.controller_messages import Step
from snake_control.nodes.conversions import MessageError
from snake_control.nodes.topics import Action

Array = NDArray[np.float64]

_FEEDBACK_PERIOD_S = 0.1
_INPUT_WAIT_S = 1.0
"""How long a goal waits for inputs that have just gone stale."""
_GONE_S = 0.5
"""How long the joints of a motion rest, without inputs, before it ends."""
_BUS_WAIT_S = 3.0
"""How long it waits for a driver that wants to see a command of zero first, or that holds."""


@dataclasses.dataclass(frozen=True)
class Surroundings:
    """What the node knows in one control step.

    Attributes:
        t: time of a steady clock [s].
        missing: why inputs cannot be used, by topic; those that can are in the step.
        hindrance: why the joints have to rest; empty if they have not.
        bus_waits: what the bus driver waits for before it takes motion; empty if it takes it.
        referenced: whether a reference is sent.
    """

    t: float
    missing: dict[str, str]
    hindrance: str
    bus_waits: str
    referenced: bool


Motion = TypeVar("Motion")


@dataclasses.dataclass
class Run(Generic[Motion]):
    """One goal.

    Attributes:
        motion: once it has begun.
        head_error: largest error of the head so far [m, rad].
    """

    handle: ServerGoalHandle
    done: Future
    since: float | None = None
    motion: Motion | None = None
    stopping: bool = False
    missing_since: float | None = None
    bus_took_at: float = -math.inf
    last: MotionStep | None = None
    joints: Sequence[str] = ()
    how: str = ""
    head_error: tuple[float, float] = (0.0, 0.0)
    fed_back_at: float = -math.inf

    @property
    def goal(self) -> Any:
        """What is asked for."""
        return self.handle.request


class JointAction(abc.ABC, Generic[Motion]):
    """Serves one action."""

    needs: tuple[str, ...] = ()
    """Topics without which it cannot go on."""

    def __init__(
        self,
        node: Node,
        action: Action,
        config: Callable[[], Config],
        busy: Callable[[], str],
    ) -> None:
        """Offer the action.

        Args:
            node: where.
            action: name and type.
            config: the configuration in force.
            busy: name of the action that moves the joints at present; empty if none does.
        """
        self.name = action.name
        self._type = action.type
        self._node = node
        self._config = config
        self._busy = busy
        self._run: Run[Motion] | None = None
        self._server = ActionServer(
            node,
            action.type,
            action.name,
            execute_callback=self._execute,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

    def close(self) -> None:
        """Serve no more."""
        self._server.destroy()

    @property
    def active(self) -> bool:
        """Whether there is a goal."""
        return self._run is not None

    @property
    def moving(self) -> bool:
        """Whether it moves joints."""
        return self._run is not None and self._run.motion is not None

    async def _execute(self, handle: ServerGoalHandle) -> Any:
        run: Run[Motion] = Run(handle, Future())
        other = self._busy()
        if other:
            text = f"{other} is under way: cancel it first"
            self._end(run, self._type.Result.NOT_AT_REST, text)
        else:
            self._run = run
        return await run.done

    def step(self, step: Step, around: Surroundings) -> bool:
        """Go on with the goal there is; return whether it has filled in the step."""
        run = self._run
        if run is None:
            return False
        result = self._type.Result
        run.stopping = run.stopping or run.handle.is_cancel_requested
        if around.hindrance:
            self._end(run, result.STOPPED, around.hindrance)
            return False
        missing = "; ".join(text for topic, text in around.missing.items() if topic in self.needs)
        if run.motion is not None:
            if missing:
                self._wait_for_inputs(run, run.motion, missing, around.t)
                return False
            run.missing_since = None
            return self._go_on(run, run.motion, step, around)
        if run.stopping:
            self._end(run, result.CANCELED, "canceled before it began")
        elif around.referenced:
            text = "a head reference is followed: stop the reference first (its sender's ~/stop)"
            self._end(run, result.NOT_AT_REST, text)
        else:
            self._try_to_begin(run, missing, step, around)
        return False

    def _try_to_begin(
        self, run: Run[Motion], missing: str, step: Step, around: Surroundings
    ) -> None:
        result = self._type.Result
        since = run.since = around.t if run.since is None else run.since
        if missing:
            if around.t - since > _INPUT_WAIT_S:
                self._end(run, result.NO_INPUT, missing)
        elif around.bus_waits:
            if around.t - since > _BUS_WAIT_S:
                self._end(run, result.STOPPED, around.bus_waits)
        else:
            try:
                run.motion = self._begin(run, step, around.t)
            except MessageError as error:
                self._end(run, result.INVALID, str(error))
                return
            except NO_ANSWER as error:
                self._end(run, result.STOPPED, f"this posture has no answer: {error}")
                return
            if run.motion is not None:
                run.bus_took_at = around.t
                self._node.get_logger().info(f"{self.name}: {run.how}")

    def _wait_for_inputs(self, run: Run[Motion], motion: Motion, missing: str, t: float) -> None:
        """Let the joints rest; go on when the inputs are back soon."""
        since = run.missing_since = t if run.missing_since is None else run.missing_since
        if t - since > _GONE_S:
            self._end(run, self._type.Result.STOPPED, missing)
        else:
            self._pause(motion)

    def _go_on(self, run: Run[Motion], motion: Motion, step: Step, around: Surroundings) -> bool:
        result = self._type.Result
        if not around.bus_waits:
            run.bus_took_at = around.t
        elif around.t - run.bus_took_at > _BUS_WAIT_S:
            self._end(run, result.STOPPED, around.bus_waits)
            return False
        if run.stopping:
            self._stop(motion)
        try:
            last, stopped = self._move(run, motion, step, around.t)
        except NO_ANSWER as error:
            self._end(run, result.STOPPED, f"this posture has no answer: {error}")
            return False
        run.last = last
        worst = self._worst(run)
        if last.phase.over or stopped:
            step.u = step.result = None
            step.d_min = math.nan
            self._feed_back(run, step, around.t, at_once=True)
            if stopped:
                self._end(run, result.STOPPED, stopped)
            elif last.phase is Phase.ARRIVED:
                self._end(run, result.NONE, f"arrived: {run.how}")
            elif last.phase is Phase.STOPPED:
                self._end(run, result.CANCELED, "canceled")
            else:
                text = f"{worst} is {last.error:.3f} rad away and does not come nearer"
                self._end(run, result.STOPPED, text + self._why(step))
            return False
        step.reference_scale = 0.0
        self._feed_back(run, step, around.t)
        return True

    # What the actions differ in.

    @abc.abstractmethod
    def _begin(self, run: Run[Motion], step: Step, t: float) -> Motion | None:
        """Return the motion of a goal, ``None`` if it is not made yet, or if the goal was ended.

        Sets ``run.joints`` and ``run.how``.

        Raises:
            MessageError: what is wrong with the goal.
        """

    @abc.abstractmethod
    def _move(
        self, run: Run[Motion], motion: Motion, step: Step, t: float
    ) -> tuple[MotionStep, str]:
        """Fill in a step; return how far the motion is, and what has ended it at once, if any."""

    @abc.abstractmethod
    def _pause(self, motion: Motion) -> None:
        """Note that the joints rest for a moment."""

    @abc.abstractmethod
    def _stop(self, motion: Motion) -> None:
        """Let a motion slow down to rest."""

    def _why(self, step: Step) -> str:
        """Return what may be the reason that a joint does not come nearer."""
        return ""

    def _tell(self, message: Any, run: Run[Motion], step: Step | None) -> None:
        """Add to a feedback, or to a result (no step), what other actions do not have."""

    # The messages.

    def _worst(self, run: Run[Motion]) -> str:
        return run.joints[run.last.worst] if run.last is not None and run.joints else ""

    def _feed_back(
        self, run: Run[Motion], step: Step, t: float, at_once: bool = False, phase: str = ""
    ) -> None:
        if t - run.fed_back_at < _FEEDBACK_PERIOD_S and not at_once:
            return
        run.fed_back_at = t
        feedback = self._type.Feedback(phase=phase)
        if run.last is not None:
            # The last feedback of all tells where the joints were as the motion ended.
            feedback.phase = (Phase.ARRIVING if run.last.phase.over else run.last.phase).value
            feedback.progress = run.last.progress
            feedback.time_left = run.last.time_left
            feedback.error = run.last.error
            feedback.worst = self._worst(run)
        self._tell(feedback, run, step)
        run.handle.publish_feedback(feedback)

    def _end(self, run: Run[Motion], code: int, text: str) -> None:
        result = self._type.Result(code=code, text=text, worst=self._worst(run))
        result.error = math.nan if run.last is None else run.last.error
        self._tell(result, run, None)
        if code == result.NONE:
            run.handle.succeed()
        elif run.handle.is_cancel_requested:
            run.handle.canceled()
        else:
            run.handle.abort()
        self._node.get_logger().info(f"{self.name} ended: {text}")
        if self._run is run:
            self._run = None
        run.done.set_result(result)


def wanted_angles(goal: Any, names: Sequence[str], limits: JointLimits) -> dict[int, float]:
    """Return the angles of a goal by the index of the joint [rad].

    Args:
        goal: with ``name`` and ``angle``.
        names: of all joints.
        limits: of the robot.

    Raises:
        MessageError: lengths differ, a joint is unknown or twice there, or an angle is beyond its
            range or not finite.
    """
    if len(goal.name) != len(goal.angle):
        raise MessageError(f"{len(goal.name)} names but {len(goal.angle)} angles")
    if not goal.name:
        raise MessageError("it names no joint")
    found: dict[int, float] = {}
    for name, angle in zip(goal.name, goal.angle, strict=True):
        if name not in names:
            raise MessageError(f"{name} is no joint; there are {names[0]} to {names[-1]}")
        joint = names.index(name)
        if joint in found:
            raise MessageError(f"{name} given twice")
        require_reachable(name, angle, joint, limits)
        found[joint] = angle
    return found


def require_reachable(name: str, angle: float, joint: int, limits: JointLimits) -> None:
    """Raise ``MessageError`` unless a joint, by its index, can be brought to an angle [rad]."""
    lower, upper = limits.lower[joint], limits.upper[joint]
    # What is not finite is not between them either.
    if not lower <= angle <= upper:
        raise MessageError(
            f"{name} = {angle:.4g} rad: allowed: {lower:.3f} to {upper:.3f}, its range less what "
            "is kept of it"
        )


def wanted_speed(goal: Any, config: Config, limits: JointLimits) -> float:
    """Return the speed of a goal, that of the configuration if it gives none [rad/s].

    Raises:
        MessageError: negative, not finite, or more than joints can do.
    """
    most = SPEED_SHARE * float(limits.speeds.max())
    if not 0.0 <= goal.speed <= most:
        raise MessageError(
            f"speed = {goal.speed:g} rad/s: allowed: up to {most:.3g}, 0 for default"
        )
    return goal.speed or min(config.scp_controller.posture_speed_rad_s, most)


STATUS_OF_PHASE = {
    Phase.MOVING: "moving",
    Phase.ARRIVING: "arriving",
    Phase.STOPPING: "slowing down",
}
"""In words of ``controller_state``."""


def enter_status(step: Step, status: int, text: str) -> None:
    """Say in a step that an action moves the joints."""
    step.status = status
    step.text = text
    step.reasons = (ControllerState.REASON_JOINT_MOTION,)
