"""The robot as rigid bodies on the floor, for simulation: a tree rooted at the first base link.

The root moves by x, y and yaw alone, so the floor holds exactly and no attitude of the head is
singular. Nothing here uses F_bar or the matrices of (1)-(20): the tree, the wheels' rows and their
rates are Pinocchio's, so that simulations check the controllers' own elimination.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pinocchio
from numpy.typing import NDArray

from snake_control.config import RobotConfig
from snake_control.model.floor import GRAVITY_M_S2
from snake_control.model.rotation import rpy_from_rotation, rpy_rate_drift, rpy_rates
from snake_control.model.urdf import link_box_m

Array = NDArray[np.float64]

_AXES = {"pitch": np.array([0.0, 1.0, 0.0]), "yaw": np.array([0.0, 0.0, 1.0])}


@dataclasses.dataclass(frozen=True, eq=False)
class FloorDynamics:
    """M v_dot + bias = [0, 0, 0, tau] + wheel_rows^T forces, wheel_rows v_dot + drift = 0.

    In coordinates p = [x, y, yaw, phi] of the first base link's front end and the joints.

    Attributes:
        M: inertia matrix, (n + 2, n + 2).
        bias: Coriolis, centrifugal, viscous and gravity term, (n + 2,).
        wheel_rows: sideways velocity of each wheeled link per v = p_dot, (n_b - m_b, n + 2).
        wheel_drift: rate of the wheel rows times v, (n_b - m_b,) [m/s^2].
    """

    M: Array
    bias: Array
    wheel_rows: Array
    wheel_drift: Array


class FloorBody:
    """One robot on the floor.

    It keeps Pinocchio's work space, so threads need one each.
    """

    def __init__(self, robot: RobotConfig) -> None:
        self._model = pinocchio.Model()
        self._model.gravity = pinocchio.Motion(np.array([0, 0, -GRAVITY_M_S2, 0, 0, 0]))
        self._wheels: list[int] = []
        self._tip = 0
        joints = self._grow(robot)
        self._data = self._model.createData()
        # Pinocchio counts joints in the order of the tree: head joints backwards, then the base's.
        columns = [self._model.joints[joint].idx_v for joint in joints]
        self._columns = np.array([0, 1, 2, *columns])
        self._order = np.argsort(self._columns)
        self._friction = np.concatenate((np.zeros(3), robot.joint_friction))

    def dynamics(self, p: Array, v: Array) -> FloorDynamics:
        """Return the equations of motion.

        Args:
            p: [x, y, yaw, phi], (n + 2,) [m, rad].
            v: its rate, (n + 2,) [m/s, rad/s].
        """
        model, data, columns = self._model, self._data, self._columns
        p, v_tree = p[self._order], v[self._order]
        M = pinocchio.crba(model, data, p)[np.ix_(columns, columns)]
        bias = pinocchio.nonLinearEffects(model, data, p, v_tree)[columns] + self._friction * v
        pinocchio.computeJointJacobians(model, data, p)
        pinocchio.forwardKinematics(model, data, p, v_tree, np.zeros_like(v))
        local = pinocchio.ReferenceFrame.LOCAL
        rows = np.empty((len(self._wheels), len(v)))
        drift = np.empty(len(self._wheels))
        for i, wheels in enumerate(self._wheels):
            rows[i] = pinocchio.getFrameJacobian(model, data, wheels, local)[1]
            # The rate of the velocity's own y component, which turns with the link.
            drift[i] = pinocchio.getFrameAcceleration(model, data, wheels, local).linear[1]
        return FloorDynamics(M, bias, rows[:, columns], drift)

    def energy(self, p: Array, v: Array) -> float:
        """Return kinetic and potential energy together, the latter from the floor up [J]."""
        model, data = self._model, self._data
        p, v = p[self._order], v[self._order]
        kinetic = pinocchio.computeKineticEnergy(model, data, p, v)
        return float(kinetic + pinocchio.computePotentialEnergy(model, data, p))

    def head(self, p: Array, v: Array) -> tuple[Array, Array]:
        """Return the head pose w and its rate, (6,) each [m, rad, m/s, rad/s].

        The rates of R and Y grow beyond all bounds towards P = +-pi/2.
        """
        model, data = self._model, self._data
        pinocchio.forwardKinematics(model, data, p[self._order], v[self._order])
        pose = pinocchio.updateFramePlacement(model, data, self._tip)
        motion = pinocchio.getFrameVelocity(
            model, data, self._tip, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        rpy = rpy_from_rotation(pose.rotation)
        return (
            np.concatenate((pose.translation, rpy)),
            np.concatenate((motion.linear, rpy_rates(rpy, motion.angular))),
        )

    def head_acceleration(self, p: Array, v: Array, a: Array) -> Array:
        """Return w_ddot for p_ddot = a, (6,) [m/s^2, rad/s^2].

        Args:
            p: [x, y, yaw, phi], (n + 2,) [m, rad].
            v: its rate, (n + 2,).
            a: the rate of v, (n + 2,).
        """
        model, data, order = self._model, self._data, self._order
        pinocchio.forwardKinematics(model, data, p[order], v[order], a[order])
        world = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
        pose = pinocchio.updateFramePlacement(model, data, self._tip)
        angular = pinocchio.getFrameVelocity(model, data, self._tip, world).angular
        motion = pinocchio.getFrameClassicalAcceleration(model, data, self._tip, world)
        rpy = rpy_from_rotation(pose.rotation)
        by_rates = rpy_rate_drift(rpy, rpy_rates(rpy, angular))
        return np.concatenate((motion.linear, rpy_rates(rpy, motion.angular - by_rates)))

    def _grow(self, robot: RobotConfig) -> list[int]:
        """Make the tree; return Pinocchio's number of each joint, joint 1 first."""
        half, n_h = robot.half_length_m, robot.head_links
        root = pinocchio.JointModelComposite(3)
        for joint in (pinocchio.JointModelPX, pinocchio.JointModelPY, pinocchio.JointModelRZ):
            root.addJoint(joint())
        first = self._model.addJoint(0, root, _shift(z=robot.wheel_radius_m), "floor")
        self._add_link(robot, n_h + 1, first, -half)
        numbers = {}
        parent, at = first, _shift()
        for joint in range(n_h, 0, -1):
            # Seen from the base, joint i turns link i the other way.
            turn = pinocchio.JointModelRevoluteUnaligned(-_AXES[robot.joint_axes[joint - 1]])
            parent = self._model.addJoint(parent, turn, at, f"joint_{joint}")
            self._add_link(robot, joint, parent, half)
            numbers[joint] = parent
            at = _shift(x=2 * half)
        self._tip = self._add_frame("tip", parent, at)
        parent = first
        for joint in range(n_h + 1, robot.links):
            parent = self._model.addJoint(
                parent, pinocchio.JointModelRZ(), _shift(x=-2 * half), f"joint_{joint}"
            )
            self._add_link(robot, joint + 1, parent, -half)
            numbers[joint] = parent
        return [numbers[joint] for joint in range(1, robot.links)]

    def _add_link(self, robot: RobotConfig, link: int, joint: int, center: float) -> None:
        """Hang a link on a joint, its centre at x = ``center`` in the joint's frame."""
        inertia = pinocchio.Inertia.FromBox(robot.link_mass_kg[link - 1], *link_box_m(robot))
        self._model.appendBodyToJoint(joint, inertia, _shift(x=center))
        if link in robot.wheeled_links:
            self._wheels.append(self._add_frame(f"wheels_{link}", joint, _shift(x=center)))

    def _add_frame(self, name: str, joint: int, placement: pinocchio.SE3) -> int:
        frame = pinocchio.Frame(name, joint, 0, placement, pinocchio.FrameType.OP_FRAME)
        return int(self._model.addFrame(frame))


def _shift(x: float = 0.0, z: float = 0.0) -> pinocchio.SE3:
    return pinocchio.SE3(np.eye(3), np.array([x, 0.0, z]))
