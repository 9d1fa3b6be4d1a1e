"""Kinetic and potential energy as plain sums over links, to check the dynamics against."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from snake_control.config import RobotConfig
from snake_control.model.floor import GRAVITY_M_S2
from support.derivatives import gradient


def along(f: Callable[[np.ndarray], np.ndarray], q: np.ndarray, q_dot: np.ndarray, h=1e-4):
    """Fourth-order central difference of f along a motion."""
    return (
        8 * (f(q + h * q_dot) - f(q - h * q_dot)) - (f(q + 2 * h * q_dot) - f(q - 2 * h * q_dot))
    ) / (12 * h)


def links(robot: RobotConfig, q: np.ndarray):
    """Yield (rotation, centre, Jacobian of the centre, angular Jacobian in the world) of each."""
    turns = Rotation.from_euler("ZYX", q[[5, 4, 3]]).as_matrix()
    yaw, pitch = (Rotation.from_euler("z", q[5]), Rotation.from_euler("y", q[4]))
    # Axis and pivot of every coordinate that turns something: R, P, Y, then the joints.
    axes = [(yaw * pitch).apply([1, 0, 0]), yaw.apply([0, 1, 0]), np.array([0.0, 0.0, 1.0])]
    pivots = [q[:3]] * 3
    tip = q[:3]
    for link in range(robot.links):
        if link > 0:
            tip = tip - 2 * robot.half_length_m * turns[:, 0]
            axis = np.array([0.0, 1.0, 0.0] if robot.joint_axes[link - 1] == "pitch" else [0, 0, 1])
            axes.append(turns @ axis)
            pivots.append(tip)
            turns = turns @ Rotation.from_rotvec(axis * q[5 + link]).as_matrix()
        center = tip - robot.half_length_m * turns[:, 0]
        linear, angular = np.zeros((3, len(q))), np.zeros((3, len(q)))
        linear[:, :3] = np.eye(3)
        linear[:, 3 : 3 + len(axes)] = np.cross(axes, center - np.array(pivots)).T
        angular[:, 3 : 3 + len(axes)] = np.array(axes).T
        yield turns, center, linear, angular


def inertia_matrix(robot: RobotConfig, q: np.ndarray) -> np.ndarray:
    total = np.zeros((len(q), len(q)))
    a, b, c = 2 * robot.half_length_m, *robot.link_size_m
    box = np.diag([b * b + c * c, a * a + c * c, a * a + b * b]) / 12
    for mass, (turns, _, linear, angular) in zip(robot.link_mass_kg, links(robot, q), strict=True):
        local = turns.T @ angular
        total += mass * (linear.T @ linear + local.T @ box @ local)
    return total


def potential_energy(robot: RobotConfig, q: np.ndarray) -> float:
    return GRAVITY_M_S2 * sum(
        mass * center[2]
        for mass, (_, center, _, _) in zip(robot.link_mass_kg, links(robot, q), strict=True)
    )


def coriolis(robot: RobotConfig, q: np.ndarray, q_dot: np.ndarray) -> np.ndarray:
    """d/dt dT/dq_dot - dT/dq at constant q_dot, without gravity and friction."""
    momentum_rate = along(lambda x: inertia_matrix(robot, x) @ q_dot, q, q_dot)
    return momentum_rate - gradient(lambda x: 0.5 * q_dot @ inertia_matrix(robot, x) @ q_dot, q)
