"""SCP velocities from a weighted sum of sub-tasks, equations (25) and (27)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import ControllerConfig, RobotConfig
from snake_control.control.sub_tasks.catalogue import make
from snake_control.control.sub_tasks.guard import GuardedSubTask
from snake_control.control.sub_tasks.sub_task import SubTask
from snake_control.model.posture import Posture
from snake_control.model.vector import sumprod

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

    @property
    def follows_head(self) -> bool:
        """Whether the SCPs' velocities depend on the head's: not those of (25), (27)."""
        return self._projection

    def velocities(self, posture: Posture, w_dot: ArrayLike) -> Array:
        """Return the wanted SCP velocities, H-SCPs first, (m,) [rad/s].

        Args:
            posture: the posture; only what the sub-tasks ask of it is worked out.
            w_dot: velocity of w that the head gets in this step, (6,), or (3,) for a planar snake.
        """
        k = posture.k
        s = k.s
        if self._projection:
            return self._projected(posture, np.asarray(w_dot, dtype=float).tolist())
        head, base = [0.0] * s.m_h, [0.0] * s.m_b
        if self._head and s.m_h:
            by_head = _sum(self._head, _by_head, posture, s.n_h).tolist()
            head = [sumprod(by_head, motion) for motion in k.head_scp_motion]
        if self._base and s.m_b:
            by_base = _sum(self._base, _by_base, posture, s.n_b - 1)
            base = by_base.dot(k.base_scp_motion).tolist()
        return np.array(head + base)

    def prepare(self, posture: Posture) -> None:
        """Work out in a posture what ``velocities`` will ask of it, as far as that is known.

        Sub-tasks of somebody else's are not asked: they may take their time.
        """
        for tasks, part in ((self._head, _by_head), (self._base, _by_base)):
            for _, task in tasks:
                if not isinstance(task, GuardedSubTask):
                    part(task, posture)
        if posture.k.s.m_h:
            _ = posture.k.head_scp_motion
        _ = posture.k.base

    def _projected(self, posture: Posture, w_dot: list[float]) -> Array:
        k = posture.k
        s = k.s
        phi_tilde_dot = np.zeros(s.m)
        if s.m_h:
            motion = np.transpose(k.head_scp_motion)
            without = k.joint_velocities(w_dot, phi_tilde_dot.tolist())[: s.n_h]
            wanted = _sum(self._head, _by_head, posture, s.n_h) - without
            phi_tilde_dot[: s.m_h] = np.linalg.lstsq(motion, wanted, rcond=_RCOND)[0]
        if s.m_b:
            without = k.joint_velocities(w_dot, phi_tilde_dot.tolist())[s.n_h :]
            wanted = _sum(self._base, _by_base, posture, s.n_b - 1) - without
            phi_tilde_dot[s.m_h :] = np.linalg.lstsq(k.base_scp_motion, wanted, rcond=_RCOND)[0]
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


def _by_head(task: SubTask, posture: Posture) -> Array:
    return task.by_head(posture)


def _by_base(task: SubTask, posture: Posture) -> Array:
    return task.by_base(posture)


def _sum(
    tasks: _Weighted, part: Callable[[SubTask, Posture], Array], posture: Posture, size: int
) -> Array:
    """Return the derivative of the weighted sum by the joints of one part, (size,)."""
    parts = [weight * part(task, posture) for weight, task in tasks]
    total: Array = sum(parts[1:], start=parts[0]) if parts else np.zeros(size)
    # The sum of squares is quicker; where it overflows, every component is looked at.
    if math.isfinite(total.dot(total)):
        return total
    return sum((each for each in parts if np.isfinite(each).all()), start=np.zeros(size))
