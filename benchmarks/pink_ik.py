"""The control step against `pink.solve_ik` on the same robot.

Pink solves one quadratic program for the joint velocities that serve a list of tasks. Here it gets
what comes nearest to (22): the head follows its reference, no wheel slides sideways, and the
posture is kept. It knows neither floor nor SCPs and no gradients of V_h, V_b1 and d_min. As its
examples do, it keeps model, tasks and configuration from step to step; a step sets the new
reference, updates the configuration and solves, with the joint limits that both sides respect.

BLAS gets one thread: with two, Pink's matrices of long robots take many times as long as soon as
another process is busy. The control step does not mind either way.
"""

from __future__ import annotations

import numpy as np
import pink
import pinocchio
from numpy.typing import NDArray
from pink.tasks import FrameTask, PostureTask, Task
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from benchmarks.common import (
    LENGTHS,
    Call,
    in_turn,
    median_ms,
    median_ratio,
    robot_of,
    start_posture,
)
from benchmarks.steps import W_D, control_step
from snake_control.config import RobotConfig
from snake_control.model.rotation import quaternion_from_rpy, rotation_from_rpy

Array = NDArray[np.float64]

_DT = 0.02


class LateralWheelTask(Task):
    """The centre of a wheeled link has no velocity along the wheels' axle.

    One row of what `pink.tasks.RollingTask` does, without its rim and its floor.
    """

    def __init__(self, frame: str) -> None:
        super().__init__(cost=[1.0])
        self.frame = frame

    def compute_error(self, configuration: pink.Configuration) -> Array:
        """Return 0: the task is a velocity, not a place."""
        return np.zeros(1)

    def compute_jacobian(self, configuration: pink.Configuration) -> Array:
        """Return the sideways row of the frame's own Jacobian, (1, n_v)."""
        return configuration.get_frame_jacobian(self.frame)[1:2]

    def __repr__(self) -> str:
        return f"LateralWheelTask({self.frame})"


def pinocchio_model(robot: RobotConfig) -> pinocchio.Model:
    """Return the robot with a free head, its joint limits and a frame for each wheeled link."""
    model = pinocchio.Model()
    still = pinocchio.SE3.Identity()
    joint = model.addJoint(0, pinocchio.JointModelFreeFlyer(), still, "head")
    model.addFrame(pinocchio.Frame("link_1", joint, 0, still, pinocchio.FrameType.BODY))
    behind = np.array([-2 * robot.half_length_m, 0.0, 0.0])
    for number, axis in enumerate(robot.joint_axes, start=1):
        lower, upper = robot.joint_range(number)
        joint = model.addJoint(
            joint,
            pinocchio.JointModelRY() if axis == "pitch" else pinocchio.JointModelRZ(),
            pinocchio.SE3(np.eye(3), behind),
            f"joint_{number}",
            np.array([100.0]),
            np.array([robot.joint_speed_limits_rad_s[number - 1]]),
            np.array([lower]),
            np.array([upper]),
        )
        if number + 1 in robot.wheeled_links:
            center = pinocchio.SE3(np.eye(3), behind / 2)
            kind = pinocchio.FrameType.OP_FRAME
            model.addFrame(pinocchio.Frame(f"wheels_{number + 1}", joint, 0, center, kind))
    return model


def pink_step(robot: RobotConfig) -> Call:
    """Return a call of one step of differential inverse kinematics with Pink."""
    model = pinocchio_model(robot)
    w, phi = np.split(start_posture(robot), [6])
    q = np.concatenate((w[:3], quaternion_from_rpy(w[3:]), phi))
    configuration = pink.Configuration(model, model.createData(), q)
    head = FrameTask("link_1", position_cost=1.0, orientation_cost=1.0)
    wheels = [LateralWheelTask(f"wheels_{link}") for link in robot.wheeled_links]
    posture = PostureTask(cost=1e-3)
    posture.set_target(q)
    tasks = [head, *wheels, posture]
    target = pinocchio.SE3(rotation_from_rpy(W_D[3:]), W_D[:3])

    def step() -> Array:
        configuration.update(q)
        head.set_target(target)
        return pink.solve_ik(configuration, tasks, _DT, solver="daqp")

    return step


def measure(blocks: int, calls: int) -> dict[str, dict[str, float]]:
    """Time both over all lengths, and Pink against itself as the control of the noise."""
    found = {}
    for n in tqdm(LENGTHS, desc="control step and Pink"):
        robot = robot_of(n)
        pink_call = pink_step(robot)
        with threadpool_limits(1):
            rounds = in_turn([pink_call, control_step(robot), pink_call], blocks, calls)
        found[str(n)] = {
            "control_step_ms": median_ms(rounds, 1),
            "pink_ms": median_ms(rounds, 0),
            "ratio": median_ratio(rounds, 1, 0),
            "pink_to_itself": median_ratio(rounds, 2, 0),
        }
    return found
