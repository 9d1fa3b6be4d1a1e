"""Times M_tilde, h_tilde and E_tilde (20) against Pinocchio's own terms of the same robot.

Pinocchio's `crba` and `nonLinearEffects` give M and h + g of (15); the reduced dynamics need them,
the kinematics with F_bar, and the constraints' drift. In blocks paired with the other two calls, so
that a change of the machine's speed during the run meets all alike.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable

import numpy as np
import pinocchio
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks.run import LENGTHS, block, control_step, robot_of
from snake_control.config import RobotConfig
from snake_control.model.dynamics import Dynamics
from snake_control.model.floor import head_pose_on_floor
from snake_control.model.posture import Posture
from snake_control.model.urdf import urdf


def _state(robot: RobotConfig) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    phi = np.array(robot.start_joint_angles_rad)
    q = np.concatenate((head_pose_on_floor(robot, phi, np.zeros(3)), phi))
    return q, 0.1 * np.cos(np.arange(len(q)))


def reduced_dynamics(robot: RobotConfig) -> Callable[[], object]:
    """Return a call that works out posture, M_tilde, h_tilde and E_tilde from q and q_dot."""
    dynamics = Dynamics(robot)
    q, q_dot = _state(robot)
    return lambda: dynamics.reduced(Posture(robot, q), q_dot)


def pinocchio_terms(robot: RobotConfig) -> Callable[[], object]:
    """Return a call of Pinocchio's crba and nonLinearEffects for the free robot."""
    root = pinocchio.JointModelComposite(2)
    root.addJoint(pinocchio.JointModelTranslation())
    root.addJoint(pinocchio.JointModelSphericalZYX())
    model = pinocchio.buildModelFromXML(urdf(robot), root)
    data = model.createData()
    q, q_dot = _state(robot)

    def call() -> object:
        pinocchio.crba(model, data, q)
        return pinocchio.nonLinearEffects(model, data, q, q_dot)

    return call


def measure(blocks: int, calls: int) -> dict[str, dict[str, float]]:
    """Time the reduced dynamics over all lengths, with ratios to Pinocchio and the control step."""
    found = {}
    for n in tqdm(LENGTHS, desc="reduced dynamics"):
        robot = robot_of(n)
        timed = [reduced_dynamics(robot), pinocchio_terms(robot), control_step(robot)]
        for call in timed:
            block(call, calls)
        rows = [[block(call, calls) for call in timed] for _ in range(blocks)]
        found[str(n)] = {
            "median_ms": 1e3 * statistics.median(row[0] for row in rows),
            "ratio_to_crba_and_nonLinearEffects": statistics.median(r[0] / r[1] for r in rows),
            "ratio_to_control_step": statistics.median(row[0] / row[2] for row in rows),
        }
    return found


if __name__ == "__main__":
    for length, figures in measure(15, 40).items():
        print(f"n = {length:>3}  " + "  ".join(f"{k} {v:.3f}" for k, v in figures.items()))
