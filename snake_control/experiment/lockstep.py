"""Controller and plant in lockstep: no ROS, no clock, the same result every time."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator

import numpy as np

from snake_control.control.reference import Reference
from snake_control.control.scp_controller import ControlResult, ScpController
from snake_control.plant.plant import Plant, PlantState


@dataclasses.dataclass(frozen=True, eq=False)
class LockstepSample:
    """One step: what was measured and decided at time t, before the joints moved.

    Attributes:
        t: time [s].
        state: ground truth at t.
        result: what the controller decided at t.
    """

    t: float
    state: PlantState
    result: ControlResult


def lockstep(
    plant: Plant,
    state: PlantState,
    controller: ScpController,
    reference: Callable[[float], Reference],
    duration_s: float,
    dt: float,
) -> Iterator[LockstepSample]:
    """Run a controller against a plant whose joints follow exactly (perfect servos).

    Args:
        plant: the body, already reset.
        state: its state at t = 0, as ``reset`` returned it.
        controller: the controller.
        reference: wanted head pose at a time.
        duration_s: length of the run [s].
        dt: control step and plant step [s].

    Yields:
        One sample for each step, the last one at ``duration_s``.

    Raises:
        SingularError: the controller met a posture it cannot answer.
    """
    steps = round(duration_s / dt)
    for step in range(steps + 1):
        t = step * dt
        q = np.concatenate((state.w, state.phi))
        q_dot = np.concatenate((np.zeros(6), state.phi_dot))
        result = controller.step(q, q_dot, reference(t), t)
        yield LockstepSample(t, state, result)
        state = plant.step(result.u, dt)
