"""Controller, servos and plant in lockstep: no ROS, no clock, the same result every time."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.control.reference import Reference
from snake_control.control.scp_controller import ControlResult
from snake_control.experiment.servos import PerfectServos, Servos
from snake_control.plant.plant import Plant, PlantState

Array = NDArray[np.float64]


class Decision(Protocol):
    """What a controller decided: at least the command ``u`` for the joints."""

    @property
    def u(self) -> Array:
        """Joint velocities or torques, as the plant takes them, (n-1,)."""


Result_co = TypeVar("Result_co", bound=Decision, covariant=True)


class Controller(Protocol[Result_co]):
    """What decides, once each control cycle; ``ScpController`` and others of its kind."""

    def step(self, q: ArrayLike, q_dot: ArrayLike, reference: Reference, t: float) -> Result_co:
        """Return the command for a posture, and everything that led to it."""


@dataclasses.dataclass(frozen=True, eq=False)
class LockstepSample(Generic[Result_co]):
    """One cycle: what was there, was measured and decided at time t, before the joints moved.

    Attributes:
        t: time [s].
        state: ground truth at t.
        result: what the controller decided at t, on what it measured.
    """

    t: float
    state: PlantState
    result: Result_co


class Unlimited:
    """A controller whose commands are those of (22): no speed limit, no joint range.

    The paper's law knows neither; together with perfect servos this is the paper's own model.
    """

    def __init__(self, controller: Controller[ControlResult]) -> None:
        """Take the limits off ``controller``."""
        self._controller = controller

    def step(self, q: ArrayLike, q_dot: ArrayLike, reference: Reference, t: float) -> ControlResult:
        """Return what the controller decides, as if no limit had bitten."""
        result = self._controller.step(q, q_dot, reference, t)
        return dataclasses.replace(
            result,
            u=result.u_unlimited,
            speed_scale=1.0,
            speed_limited=(),
            range_limited=(),
        )


def lockstep(
    plant: Plant,
    state: PlantState,
    controller: Controller[Result_co],
    reference: Callable[[float], Reference],
    duration_s: float,
    dt: float,
    servos: Servos | None = None,
) -> Iterator[LockstepSample[Result_co]]:
    """Run a controller against a plant.

    Args:
        plant: the body, already reset.
        state: its state at t = 0, as ``reset`` returned it.
        controller: the controller; its commands are what the plant takes.
        reference: wanted head pose at a time.
        duration_s: length of the run [s].
        dt: control cycle [s].
        servos: what stands between controller and joints; perfect ones, which pass velocities or
            torques on as they are, by default.

    Yields:
        One sample for each cycle, the last one at ``duration_s``.
    """
    servos = PerfectServos() if servos is None else servos
    servos.reset(state.phi)
    steps = round(duration_s / dt)
    for step in range(steps + 1):
        t = step * dt
        q = np.concatenate((state.w, servos.measure(state.phi)))
        q_dot = np.concatenate((state.w_dot, state.phi_dot))
        result = controller.step(q, q_dot, reference(t), t)
        yield LockstepSample(t, state, result)
        if step == steps:
            return
        state = plant.step(servos.command(result.u, state.phi, dt), dt)
