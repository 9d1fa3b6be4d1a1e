"""SCP velocities from a weighted sum of sub-tasks, equations (25) and (27)."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from snake_control.config import ControllerConfig, RobotConfig
from snake_control.control.sub_tasks.catalogue import make
from snake_control.control.sub_tasks.sub_task import SubTask
from snake_control.model.posture import Posture
from snake_control.model.structure import Indices

Array = NDArray[np.float64]

_Weighted = tuple[tuple[float, SubTask], ...]

# F_3b grows by orders of magnitude along long robots; its small directions still count.
_RCOND = 1e-14


class Composition:
    """The sub-tasks of head and base with their weights; what weighs nothing costs nothing.

    With V = sum of weight_i V_i over the head's sub-tasks, and likewise for the base, the law
    ``gradient`` is the paper's:

        phi_dot_hd = a_h (dV/dphi_tilde_h + dV/dtheta_bar_h F_2h)^T    (25)
        phi_dot_bd = a_b (dV/dphi_tilde_b + dV/dtheta_bar_b F_3b)^T    (27)

    The law ``projection`` gives the SCPs the velocities with which all joints of their part, not
    the SCPs alone, come closest to a_h dV/dphi_h and a_b dV/dphi_b: least squares of

        phi_dot_h - a_h dV/dphi_h,   then of   phi_dot_b - a_b dV/dphi_b,

    where phi_dot follows from w_dot and the SCPs by (8). Without sub-tasks that is the motion of
    least joint speed, (4) with eta = 0 for each part. F_3b, which grows along the body, then cannot
    make joints faster than the task of the head needs.
    """

    def __init__(self, robot: RobotConfig, controller: ControllerConfig) -> None:
        """Make the sub-tasks of a configuration.

        Raises:
            ConfigError: a sub-task cannot be made.
        """
        c = controller
        head = _Part("head", c.head_sub_tasks, c.head_weights, c.a_h)
        base = _Part("base", c.base_sub_tasks, c.base_weights, c.a_b)
        self._head, self._base = head.made(robot, c), base.made(robot, c)
        self._projection = c.scp_law == "projection"

    def velocities(self, posture: Posture, w_dot: Array) -> Array:
        """Return the wanted SCP velocities, H-SCPs first, (m,) [rad/s].

        Args:
            posture: the posture; only what the sub-tasks ask of it is worked out.
            w_dot: velocity of w that the head gets in this step, (6,), or (3,) for a planar snake.

        Raises:
            SingularError: B_tilde has no inverse.
        """
        s = posture.k.s
        phi_tilde_dot = np.zeros(s.m)
        if not (self._head or self._base or self._projection):
            return phi_tilde_dot
        F_bar = posture.k.F_bar
        # Columns of F_bar: w, H-SCPs, B-SCPs; rows: theta_bar of the head, then of the base.
        h = F_bar.shape[1] - s.m
        b = h + s.m_h
        head, base = F_bar[: len(s.theta_h)], F_bar[len(s.theta_h) :]
        if s.m_h:
            by_phi = _gradient(self._head, posture)
            phi_tilde_dot[: s.m_h] = (
                _projected(by_phi, s.scp_h, s.theta_h, head[:, h:b], head[:, :h] @ w_dot)
                if self._projection
                else by_phi[s.scp_h] + by_phi[s.theta_h] @ head[:, h:b]
            )
        if s.m_b:
            by_phi = _gradient(self._base, posture)
            if self._projection:
                by_head = base[:, :h] @ w_dot + base[:, h:b] @ phi_tilde_dot[: s.m_h]
                phi_tilde_dot[s.m_h :] = _projected(
                    by_phi, s.scp_b, s.theta_b, base[:, b:], by_head
                )
            else:
                phi_tilde_dot[s.m_h :] = by_phi[s.scp_b] + by_phi[s.theta_b] @ base[:, b:]
        return phi_tilde_dot


@dataclasses.dataclass(frozen=True)
class _Part:
    part: str
    names: Sequence[str]
    weights: Sequence[float]
    gain: float

    def made(self, robot: RobotConfig, controller: ControllerConfig) -> _Weighted:
        """Return the sub-tasks that weigh something; all are made, so that mistakes show."""
        field = f"controller.{self.part}_sub_tasks"
        tasks = [make(f"{field}[{i}]", n, robot, controller) for i, n in enumerate(self.names)]
        weighted = zip(self.weights, tasks, strict=True)
        return tuple((self.gain * w, task) for w, task in weighted if self.gain * w)


def _gradient(tasks: _Weighted, posture: Posture) -> Array:
    """Return the derivative of the weighted sum by phi, (n - 1,)."""
    total: Array = np.zeros(posture.k.s.n - 1)
    for weight, task in tasks:
        by_phi = task.gradient(posture)[6:]
        if np.isfinite(by_phi).all():
            total += weight * by_phi
    return total


def _projected(by_phi: Array, scp: Indices, theta: Indices, F: Array, without: Array) -> Array:
    """Return the SCP velocities that bring all joints of a part closest to ``by_phi``.

    Args:
        by_phi: joint velocities wanted, (n - 1,) [rad/s].
        scp, theta: SCPs and other joints of the part.
        F: velocity of the other joints for each SCP.
        without: velocity of the other joints with the SCPs still [rad/s].
    """
    joints = np.vstack((np.eye(len(scp)), F))
    wanted = np.concatenate((by_phi[scp], by_phi[theta] - without))
    return np.asarray(np.linalg.lstsq(joints, wanted, rcond=_RCOND)[0], dtype=float)
