"""What the controller sends: the command, and everything it decided."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray
from snake_interfaces.msg import ControllerState, JointVelocityCommand

from snake_control.config import RobotConfig
from snake_control.control.scp_controller import ControlResult
from snake_control.nodes.conversions import header

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
        phi, w, w_d, w_d_dot: inputs as far as they could be used, else NaN.
        result: what the control law decided; ``None`` if the joints are commanded to rest.
        joint_states_age, head_age, reference_age: ages of the inputs [s].
    """

    stamp_ns: int
    phi: Array
    w: Array = dataclasses.field(default_factory=_nothing)
    w_d: Array = dataclasses.field(default_factory=_nothing)
    w_d_dot: Array = dataclasses.field(default_factory=_nothing)
    status: int = ControllerState.STATUS_WAITING
    text: str = ""
    result: ControlResult | None = None
    joint_states_age: float = math.inf
    head_age: float = math.inf
    reference_age: float = math.inf

    @staticmethod
    def at(stamp_ns: int, robot: RobotConfig) -> Step:
        """Return a step that knows nothing yet."""
        return Step(stamp_ns, np.full(robot.joints, math.nan))


def judge(step: Step, result: ControlResult, robot: RobotConfig) -> None:
    """Enter a control law's answer, with a status that names the limits that bit."""
    names = robot.joint_names
    step.result = result
    found = []
    if result.speed_limited:
        joints = ", ".join(names[j - 1] for j in result.speed_limited)
        found.append(f"{joints} at its speed limit: all scaled to {result.speed_scale:.2f}")
    if result.range_limited:
        joints = ", ".join(names[j - 1] for j in result.range_limited)
        found.append(f"{joints} at the end of its range: no velocity outwards")
    step.status = ControllerState.STATUS_LIMITED if found else ControllerState.STATUS_TRACKING
    step.text = "; ".join(found) or "tracking"


def velocity_command(step: Step, robot: RobotConfig) -> JointVelocityCommand:
    """Return the command of a step: the control law's velocities, or zeros."""
    return JointVelocityCommand(
        header=header(step.stamp_ns),
        name=list(robot.joint_names),
        velocity=[0.0] * robot.joints if step.result is None else step.result.u.tolist(),
    )


def controller_state(
    step: Step, robot: RobotConfig, case: int, frame_id: str, step_time: float
) -> ControllerState:
    """Return everything a step decided; NaN where it decided nothing.

    Args:
        step: the step.
        robot: for the names of joints.
        case: preset of sub-tasks in force.
        frame_id: frame of w and w_d.
        step_time: how long it took to compute [s].
    """
    names = robot.joint_names
    message = ControllerState(
        header=header(step.stamp_ns, frame_id),
        status=step.status,
        text=step.text,
        experiment_case=case,
        w=step.w,
        w_d=step.w_d,
        w_d_dot=step.w_d_dot,
        error=_nothing(),
        name=list(names),
        phi=step.phi.tolist(),
        u_unlimited=[0.0] * robot.joints,
        u=[0.0] * robot.joints,
        scp_name=[names[j - 1] for j in robot.scp_joints],
        phi_tilde_dot_d=[0.0] * len(robot.scp_joints),
        speed_scale=1.0,
        v_h=math.nan,
        v_b1=math.nan,
        d_min=math.nan,
        sigma_min_b_tilde=math.nan,
        sigma_min_a_hat=math.nan,
        joint_states_age=step.joint_states_age,
        head_age=step.head_age,
        reference_age=step.reference_age,
        step_time=step_time,
    )
    result = step.result
    if result is not None:
        message.error = result.error
        message.u_unlimited = result.u_unlimited.tolist()
        message.u = result.u.tolist()
        message.phi_tilde_dot_d = result.phi_tilde_dot_d.tolist()
        message.speed_scale = float(result.speed_scale)
        message.speed_limited = [names[j - 1] for j in result.speed_limited]
        message.range_limited = [names[j - 1] for j in result.range_limited]
        message.v_h = float(result.V_h)
        message.v_b1 = float(result.V_b1)
        message.d_min = float(result.d_min)
        message.sigma_min_b_tilde = float(result.sigma_min_B_tilde)
        message.sigma_min_a_hat = float(result.sigma_min_A_hat)
    return message
