"""What the controller sends: the command, and everything it decided."""

from __future__ import annotations

import array
import dataclasses
import math

import numpy as np
from numpy.typing import NDArray
from snake_interfaces.msg import ControllerState, JointVelocityCommand

from snake_control.config import ControllerConfig, RobotConfig
from snake_control.control.barriers import Bound, Limit
from snake_control.control.supervisor import SupervisedResult
from snake_control.model.floor_clearance import floor_clearance
from snake_control.model.rotation import wrap

Array = NDArray[np.float64]


def _nothing() -> Array:
    return np.full(6, math.nan)


@dataclasses.dataclass
class Step:
    """One control step of the node, as far as it got.

    Attributes:
        stamp_ns: time of the step.
        status: ``ControllerState.STATUS_*``.
        text: the reason, naming the input, the joint or the limit.
        reasons: ``ControllerState.REASON_*`` of the text.
        reference_scale: how fast the reference may go on, 0..1.
        phi, w, w_d, w_d_dot: inputs as far as they could be used, else NaN.
        controlled: components of w, from 0, that the controller moves (not all, if planar).
        result: what the control law decided; ``None`` if it decided nothing.
        u: what the joints are commanded where the control law decided nothing, (n-1,) [rad/s];
            ``None`` if they are to rest.
        d_min: margin against falling, where the control law decided nothing [m].
        joint_states_age, head_age, reference_age: ages of the inputs [s].
        head_waited: how long the head pose had been here when the step began [s].
    """

    stamp_ns: int
    phi: Array
    w: Array = dataclasses.field(default_factory=_nothing)
    w_d: Array = dataclasses.field(default_factory=_nothing)
    w_d_dot: Array = dataclasses.field(default_factory=_nothing)
    status: int = ControllerState.STATUS_WAITING
    text: str = ""
    reasons: tuple[int, ...] = ()
    reference_scale: float = 0.0
    controlled: tuple[int, ...] = (0, 1, 2, 3, 4, 5)
    result: SupervisedResult | None = None
    u: Array | None = None
    d_min: float = math.nan
    joint_states_age: float = math.inf
    head_age: float = math.inf
    reference_age: float = math.inf
    head_waited: float = math.nan

    @property
    def error(self) -> Array:
        """The error w - w_d, angles wrapped to +-pi, shape (6,) [m, rad]; NaN while unknown.

        Components that the controller does not move have none.
        """
        difference: Array = self.w - self.w_d
        difference[3:] = wrap(difference[3:])
        error = np.zeros(6)
        controlled = list(self.controlled)
        error[controlled] = difference[controlled]
        return error

    @staticmethod
    def at(stamp_ns: int, robot: RobotConfig) -> Step:
        """Return a step that knows nothing yet."""
        return Step(stamp_ns, np.full(robot.joints, math.nan), controlled=robot.controlled)


_IMPOSSIBLE_M = 0.02
"""Deeper in the floor than this no droop and no rounding puts a link."""

REASON_OF_LIMIT = {
    Limit.JOINT_SPEED: ControllerState.REASON_JOINT_SPEED,
    Limit.JOINT_RANGE: ControllerState.REASON_JOINT_RANGE,
    Limit.FALL: ControllerState.REASON_FALL,
    Limit.FLOOR: ControllerState.REASON_FLOOR,
    Limit.SINGULAR_BODY: ControllerState.REASON_SINGULAR_BODY,
    Limit.SINGULAR_HEAD: ControllerState.REASON_SINGULAR_HEAD,
}


def judge(step: Step, result: SupervisedResult, robot: RobotConfig) -> None:
    """Enter the supervisor's answer, with a status that names what kept it from its reference."""
    step.result = result
    step.reference_scale = result.reference_scale
    found: list[tuple[int, str]] = []
    if result.bound is not None:
        found.append((REASON_OF_LIMIT[result.bound.limit], _slowed(result, result.bound, robot)))
    if result.damping > 0.0:
        text = (
            f"singular head posture (B_tilde): {100 * result.damping:.0f} % of the motion in its "
            "weakest direction is given up"
        )
        found.append((ControllerState.REASON_SINGULAR_HEAD, text))
    if result.accelerating:
        found.append((ControllerState.REASON_JOINT_ACCELERATION, "speeding up"))
    limited = bool(found)
    for limit in result.escaping:
        found.append((REASON_OF_LIMIT[limit], f"the SCPs get away from: {_near(limit, result)}"))
    step.status = (
        ControllerState.STATUS_HOLDING
        if result.holding
        else ControllerState.STATUS_LIMITED
        if limited
        else ControllerState.STATUS_RECOVERING
        if found
        else ControllerState.STATUS_TRACKING
    )
    step.text = "; ".join(text for _, text in found) or "tracking"
    step.reasons = tuple(dict.fromkeys(reason for reason, _ in found))


def _slowed(result: SupervisedResult, bound: Bound, robot: RobotConfig) -> str:
    """Return what a limit does to the motion."""
    joints = ", ".join(robot.joint_names[joint - 1] for joint in bound.joints)
    what = {
        Limit.JOINT_SPEED: f"{joints} at its speed limit",
        Limit.JOINT_RANGE: f"{joints} near the end of its range",
    }.get(bound.limit, _near(bound.limit, result))
    if result.holding:
        return f"{what}: the head rests"
    return f"{what}: the motion scaled to {result.speed_scale:.2f}"


def _near(limit: Limit, result: SupervisedResult) -> str:
    if limit is Limit.FALL:
        return f"falling (d_min {1e3 * result.d_min:.1f} mm)"
    if limit is Limit.FLOOR:
        lowest = floor_clearance(result.posture.g)
        height_mm = 1e3 * lowest.height
        if lowest.height < -_IMPOSSIBLE_M:
            return (
                f"the floor (by the joint angles link {lowest.link} is {-height_mm:.0f} mm in it: "
                "check directions, zeros and order of the head's joints)"
            )
        return f"the floor (link {lowest.link} {height_mm:.1f} mm above it)"
    if limit is Limit.SINGULAR_BODY:
        shape = result.singular_shape
        return f"singular shape of the body ({shape.kind}, nearness {shape.nearness:.3f})"
    if limit is Limit.SINGULAR_HEAD:
        return f"singular head posture (regularity {result.posture.k.head.regularity:.3f})"
    return "the end of a joint's range"


def too_far(step: Step, max_position_error_m: float, max_rotation_error_rad: float) -> str:
    """Return by how much the head is too far from its reference, empty if it is not."""
    error = step.error
    distance = float(np.linalg.norm(error[:3]))
    if distance > max_position_error_m:
        return (
            f"the head is {distance:.3g} m from its reference "
            f"(limit max_position_error_m = {max_position_error_m:g})"
        )
    worst = int(np.argmax(np.abs(error[3:])))
    angle = float(abs(error[3 + worst]))
    if angle > max_rotation_error_rad:
        return (
            f"{('roll', 'pitch', 'yaw')[worst]} of the head is {angle:.3g} rad from its reference "
            f"(limit max_rotation_error_rad = {max_rotation_error_rad:g})"
        )
    return ""


class ControllerMessages:
    """Makes the messages of a step; each is the same object every time, filled anew.

    Making them takes longer than filling them.

    Attributes:
        parameter_changes: how often parameters have been changed; to be counted by the node.
    """

    def __init__(self, robot: RobotConfig, frame_id: str) -> None:
        """Prepare for a robot; ``frame_id`` is that of w and w_d."""
        names = list(robot.joint_names)
        self._names = names
        self._at_rest = _array(np.zeros(robot.joints))
        self._no_scp = _array(np.zeros(len(robot.scp_joints)))
        self._command = JointVelocityCommand(name=names)
        self._state = ControllerState(
            name=names, scp_name=[names[joint - 1] for joint in robot.scp_joints]
        )
        self._state.header.frame_id = frame_id
        self.parameter_changes = 0

    def command(self, step: Step) -> JointVelocityCommand:
        """Return the command of a step: velocities of the control law or of a motion, or zeros."""
        message = self._command
        _stamp(message, step.stamp_ns)
        message.velocity = self._resting(step) if step.result is None else _array(step.result.u)
        return message

    def _resting(self, step: Step) -> array.array[float]:
        """Return the command where the control law decided nothing."""
        return self._at_rest if step.u is None else _array(step.u)

    def state(self, step: Step, gains: ControllerConfig, step_time: float) -> ControllerState:
        """Return everything a step decided; NaN where it decided nothing.

        Args:
            step: the step.
            gains: what is in force.
            step_time: how long it took to compute [s].
        """
        message = self._state
        _stamp(message, step.stamp_ns)
        message.status = step.status
        message.text = step.text
        message.reasons = step.reasons
        message.reference_scale = step.reference_scale
        message.experiment_case = gains.case
        message.preset = gains.preset
        message.k = gains.K
        message.parameter_changes = self.parameter_changes
        message.w = step.w
        message.w_d = step.w_d
        message.w_d_dot = step.w_d_dot
        message.error = step.error
        message.phi = _array(step.phi)
        message.joint_states_age = step.joint_states_age
        message.head_age = step.head_age
        message.reference_age = step.reference_age
        message.head_waited = step.head_waited
        message.step_time = step_time
        result = step.result
        if result is None:
            message.u_unlimited = message.u = self._resting(step)
            message.phi_tilde_dot_d = self._no_scp
            message.speed_scale = message.feedback_scale = message.scp_scale = 1.0
            message.speed_limited = message.range_limited = []
            message.v_h = message.v_b1 = math.nan
            message.d_min = float(step.d_min)
            message.sigma_min_b_tilde = message.sigma_min_a_hat = math.nan
            message.damping = message.singular_nearness = math.nan
            message.singular_shape = ""
        else:
            message.u_unlimited = _array(result.u_unlimited)
            message.u = _array(result.u)
            message.phi_tilde_dot_d = _array(result.phi_tilde_dot_d)
            message.speed_scale = float(result.speed_scale)
            message.feedback_scale = float(result.feedback_scale)
            message.scp_scale = float(result.scp_scale)
            message.speed_limited = [self._names[j - 1] for j in result.speed_limited]
            message.range_limited = [self._names[j - 1] for j in result.range_limited]
            message.v_h = float(result.V_h)
            message.v_b1 = float(result.V_b1)
            message.d_min = float(result.d_min)
            message.sigma_min_b_tilde = float(result.sigma_min_B_tilde)
            message.sigma_min_a_hat = float(result.sigma_min_A_hat)
            message.damping = float(result.damping)
            message.singular_nearness = float(result.singular_shape.nearness)
            message.singular_shape = str(result.singular_shape.kind)
        return message


def _array(values: Array) -> array.array[float]:
    return array.array("d", values.tobytes())


def _stamp(message: JointVelocityCommand | ControllerState, stamp_ns: int) -> None:
    stamp = message.header.stamp
    stamp.sec, stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
