"""Times M_tilde, h_tilde and E_tilde (20) against Pinocchio's own terms of the same robot.

Pinocchio's `crba` and `nonLinearEffects` give M and h + g of (15); the reduced dynamics need them,
the kinematics with F_bar, and the constraints' drift. In blocks paired with the other two calls, so
that a change of the machine's speed during the run meets all alike.
"""

from __future__ import annotations

import numpy as np
import pinocchio
from numpy.typing import NDArray
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
from benchmarks.steps import control_step
from snake_control.config import RobotConfig
from snake_control.model.dynamics import Dynamics
from snake_control.model.posture import Posture
from snake_control.model.urdf import urdf


def _state(robot: RobotConfig) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    q = start_posture(robot)
    return q, 0.1 * np.cos(np.arange(len(q)))


def reduced_dynamics(robot: RobotConfig) -> Call:
    """Return a call that works out posture, M_tilde, h_tilde and E_tilde from q and q_dot."""
    dynamics = Dynamics(robot)
    q, q_dot = _state(robot)
    return lambda: dynamics.reduced(Posture(robot, q), q_dot)


def pinocchio_terms(robot: RobotConfig) -> Call:
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
        rounds = in_turn(timed, blocks, calls)
        found[str(n)] = {
            "median_ms": median_ms(rounds, 0),
            "ratio_to_crba_and_nonLinearEffects": median_ratio(rounds, 0, 1),
            "ratio_to_control_step": median_ratio(rounds, 0, 2),
        }
    return found
