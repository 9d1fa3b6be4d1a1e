"""A supervised robot in lockstep: its reference slows down when the supervisor says so."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from snake_control.config import Config
from snake_control.control.reference import Reference
from snake_control.control.supervisor import SupervisedResult, Supervisor
from snake_control.experiment.servos import LimitedServos, PerfectServos, Servos
from snake_control.plant.kinematic import KinematicPlant
from snake_control.plant.plant import PlantState

Array = NDArray[np.float64]

PLANT_STEP_S = 0.01


@dataclasses.dataclass(frozen=True, eq=False)
class GuidedSample:
    """One cycle: what was there and what was decided.

    Attributes:
        t: time since the robot was made [s].
        own_t: the reference's own time [s].
        state: ground truth at t.
        reference: what the head should do.
        result: what the supervisor decided; ``None`` for a reference that is not finite, at which
            the joints rest.
    """

    t: float
    own_t: float
    state: PlantState
    reference: Reference
    result: SupervisedResult | None


class GuidedRobot:
    """Plant, servos and supervisor; one robot, on which motions follow one after the other.

    Attributes:
        state: ground truth now.
        t: time since it was made [s].
    """

    def __init__(
        self,
        config: Config,
        servos: Servos | None = None,
        phi: ArrayLike | None = None,
        w: ArrayLike | None = None,
    ) -> None:
        """Put the robot on the floor.

        Args:
            config: robot, controller, supervisor and rate.
            servos: perfect ones by default.
            phi: joint angles, (n-1,) [rad]; the start posture by default.
            w: head pose, of which x, y and Y count, (6,); the origin by default.
        """
        self._config = config
        self._dt = 1.0 / config.scp_controller.rate_hz
        self._servos = PerfectServos() if servos is None else servos
        self._plant = KinematicPlant(config.robot, PLANT_STEP_S)
        start = config.robot.start_joint_angles_rad if phi is None else phi
        self.state = self._plant.reset(start, w)
        self._servos.reset(self.state.phi)
        self._supervisor = Supervisor(config.robot, config.controller, config.supervisor, self._dt)
        self.t = 0.0

    def cycle(self, reference: Reference, own_t: float = 0.0) -> GuidedSample:
        """Decide and move on by one cycle."""
        result = None
        u = np.zeros(self._config.robot.joints)
        if np.isfinite(reference.w_d).all() and np.isfinite(reference.w_d_dot).all():
            q = np.concatenate((self.state.w, self._servos.measure(self.state.phi)))
            result = self._supervisor.step(q, None, reference, self.t)
            u = result.u
        else:
            self._supervisor.rest()
        sample = GuidedSample(self.t, own_t, self.state, reference, result)
        self.state = self._plant.step(self._servos.command(u, self.state.phi, self._dt), self._dt)
        self.t += self._dt
        return sample

    def follow(
        self,
        reference: Callable[[float], Reference],
        duration: float,
        longest: float = math.inf,
    ) -> Iterator[GuidedSample]:
        """Follow a reference, as fast as the supervisor lets it go on.

        Args:
            reference: by its own time, from 0 on.
            duration: of its own time [s].
            longest: give up after this time [s].

        Yields:
            One sample for each cycle.
        """
        begin, own, scale = self.t, 0.0, 1.0
        while own < duration and self.t - begin < longest:
            sample = self.cycle(dataclasses.replace(reference(own), time_scale=scale), own)
            yield sample
            if sample.result is not None:
                scale = sample.result.reference_scale
            own += self._dt * scale

    def turn(self, u: Array) -> PlantState:
        """Move the joints for one cycle, whatever the head does; return the ground truth then.

        Args:
            u: joint velocities, (n-1,) [rad/s].
        """
        self._supervisor.rest()
        self.state = self._plant.step(self._servos.command(u, self.state.phi, self._dt), self._dt)
        self.t += self._dt
        return self.state

    def measured(self) -> Array:
        """Return the joint angles that a controller would read, (n-1,) [rad]."""
        return self._servos.measure(self.state.phi)

    def pause(self) -> None:
        """Have no reference for a moment: the next one is a new start."""
        self._supervisor.rest()

    def insist(
        self, reference: Callable[[float], Reference], duration: float
    ) -> Iterator[GuidedSample]:
        """Be given a reference that heeds nothing, for ``duration`` seconds."""
        begin = self.t
        while self.t - begin < duration:
            own = self.t - begin
            yield self.cycle(reference(own), own)


def limited(config: Config) -> Servos:
    """Return the servos of a robot with an AX-12's limits."""
    return LimitedServos(config.robot)
