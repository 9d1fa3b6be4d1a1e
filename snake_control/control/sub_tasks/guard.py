"""What stands between the controller and a sub-task of somebody else's."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snake_control.config import ControllerConfig, RobotConfig
from snake_control.control.sub_tasks.sub_task import SubTask
from snake_control.errors import SnakeError, SubTaskError
from snake_control.model.posture import Posture

Array = NDArray[np.float64]


class GuardedSubTask(SubTask):
    """A sub-task that answers as another does, or raises ``SubTaskError``, nothing else.

    Errors of this package, such as that of a singular posture, pass as they are.
    """

    def __init__(
        self, name: str, task: SubTask, robot: RobotConfig, controller: ControllerConfig
    ) -> None:
        """Guard ``task``, which the configuration calls ``name``."""
        super().__init__(robot, controller)
        self._name = name
        self._task = task

    def value(self, posture: Posture) -> float:
        """Return V."""
        return float(self._answer(self._task.value, posture, ()))

    def gradient(self, posture: Posture) -> Array:
        """Return the derivative of V by q, (n + 5,)."""
        return self._answer(self._task.gradient, posture, posture.g.q.shape)

    def by_head(self, posture: Posture) -> Array:
        """Return the part of ``gradient`` by the head's joints, (n_h,)."""
        if type(self._task).by_head is SubTask.by_head:
            # Parts of a gradient of the wrong shape would only say that they are too short.
            return super().by_head(posture)
        return self._answer(self._task.by_head, posture, (posture.k.s.n_h,))

    def by_base(self, posture: Posture) -> Array:
        """Return the part of ``gradient`` by the base's joints, (n_b - 1,)."""
        if type(self._task).by_base is SubTask.by_base:
            return super().by_base(posture)
        return self._answer(self._task.by_base, posture, (posture.k.s.n_b - 1,))

    def _answer(
        self, method: Callable[[Posture], Any], posture: Posture, shape: tuple[int, ...]
    ) -> Array:
        try:
            found = np.asarray(method(posture))
            # Of texts and complex numbers, too, numpy would make floats, or silently half of them.
            if found.dtype.kind not in "iufb":
                raise TypeError(f"it is made of {found.dtype}, not of real numbers")
            found = found.astype(float)
        except SnakeError:
            raise
        # Whatever else it is, it is the foreign code's; its own error stays attached.
        except Exception as error:
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            raise SubTaskError(self._name, method.__name__, reason) from error
        if found.shape != shape:
            reason = f"its answer has shape {found.shape}, it must have {shape}"
            raise SubTaskError(self._name, method.__name__, reason)
        return found
