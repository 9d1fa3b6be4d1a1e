"""One case of the experiment in lockstep, recorded as the demo's runs are."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from snake_control.config import Config
from snake_control.control.scp_controller import ControlResult, ScpController
from snake_control.control.torque_controller import TorqueController, TorqueResult
from snake_control.errors import ModelError, SubTaskError
from snake_control.experiment.lockstep import Controller, LockstepSample, Unlimited, lockstep
from snake_control.experiment.parameters import configuration_parameters
from snake_control.experiment.series import Series, Step
from snake_control.experiment.servos import LimitedServos, PerfectServos, Servos
from snake_control.experiment.summary import Run, summarise
from snake_control.model.geometry import planar_base
from snake_control.model.singular_shape import singular_shape
from snake_control.model.structure import Structure, structure
from snake_control.plant.kinematic import KinematicPlant
from snake_control.plant.plant import PlantState
from snake_control.plant.torque import TorquePlant
from snake_control.trajectory.configured import configured_trajectory

SERVOS = ("perfect", "limited")
CONTROLLERS = ("velocity", "torque")
TORQUE_RATE_HZ = 200.0
"""Default of torque control: at 50 Hz held torques add errors of their own (docs/experiment.md)."""
AFTER_FALL_S = 2.0
"""A run goes on for this long after the robot fell, so that figures show the fall."""
RUNAWAY_RAD_S = 1e4
"""Joint velocities above this mean nothing any more; without limits they grow for ever."""


@dataclasses.dataclass(frozen=True)
class Settings:
    """How a run is made.

    Attributes:
        duration_s: length of the run [s].
        rate_hz: control cycles per second.
        plant_step_s: longest step in which the body without inertia is integrated [s].
        servos: ``perfect`` or ``limited``.
        carry_remainder: whether limited servos carry what rounding a speed leaves.
        controller: ``velocity`` (22) on the kinematic plant, or ``torque`` (21) on the one with
            inertia, whose actuators are perfect.
    """

    duration_s: float = 60.0
    rate_hz: float = 50.0
    plant_step_s: float = 0.01
    servos: str = "perfect"
    carry_remainder: bool = True
    controller: str = "velocity"

    @property
    def parameters(self) -> dict[str, Any]:
        """What a summary says about these settings."""
        limited = self.servos == "limited"
        return {
            "controller": self.controller,
            "servos": self.servos,
            "carry_remainder": self.carry_remainder if limited else None,
            "control_rate_hz": self.rate_hz,
            "plant_step_s": self.plant_step_s if self.controller == "velocity" else None,
            "requested_duration_s": self.duration_s,
        }


@dataclasses.dataclass(frozen=True, eq=False)
class CaseRun:
    """A finished run.

    Attributes:
        case: preset of sub-tasks, 1..3.
        config: everything it was configured with.
        settings: how it was made.
        series: one row for each control cycle.
        summary: ready for JSON.
        interrupted: whether somebody ended it early.
    """

    case: int
    config: Config
    settings: Settings
    series: Series
    summary: Mapping[str, Any]
    interrupted: bool


def run_case(
    config: Config,
    settings: Settings,
    csv: Path | None = None,
    on_step: Callable[[Step], bool] = lambda step: True,
) -> CaseRun:
    """Run one case to its end: the duration, a fall, or a posture without an answer.

    Args:
        config: robot, controller (with its case) and trajectory.
        settings: how to run it.
        csv: file of the series, written as it grows; none by default.
        on_step: called with every row; when it returns False, the run ends there.

    Raises:
        OSError: the file cannot be written.
    """
    series = Series(config.robot, csv)
    ended, interrupted, fell_at_s = "duration reached", False, None
    try:
        for step in _steps(config, settings):
            series.append(step)
            if not on_step(step):
                ended, interrupted = f"interrupted at {step.t_s:.2f} s", True
                break
            fastest = float(np.abs(step.u).max())
            if fastest > RUNAWAY_RAD_S:
                ended = f"the motion ran away at {step.t_s:.2f} s: {fastest:.0e} rad/s"
                break
            if step.fallen and fell_at_s is None:
                fell_at_s = step.t_s
            if fell_at_s is not None and step.t_s >= fell_at_s + AFTER_FALL_S:
                ended = f"the robot fell at {fell_at_s:.1f} s"
                break
    except (ModelError, SubTaskError) as error:
        ended = f"no answer after {len(series) / settings.rate_hz:.2f} s: {error}"
    finally:
        series.close()
    case = config.controller.case
    run = Run(
        case=case,
        # The exponential (24) is the velocity controller's.
        K=config.controller.K if settings.controller == "velocity" else (math.nan,) * 6,
        ended=ended,
        parameters={**settings.parameters, **configuration_parameters(config)},
    )
    return CaseRun(case, config, settings, series, summarise(series, run), interrupted)


def step_of(sample: LockstepSample[ControlResult]) -> Step:
    """Return the row of velocity control; nobody timed it, and there is no bus."""
    result = sample.result
    limited = result.speed_scale < 1.0 or bool(result.range_limited) or result.damping > 0.0
    return Step(
        **_common(sample),
        status="limited" if limited else "tracking",
        u_unlimited=result.u_unlimited,
        u=result.u,
        speed_scale=result.speed_scale,
        speed_limited=result.speed_limited,
        range_limited=result.range_limited,
        sigma_min_B_tilde=result.sigma_min_B_tilde,
        sigma_min_A_hat=result.sigma_min_A_hat,
        damping=result.damping,
        singular_nearness=result.singular_shape.nearness,
        singular_shape=result.singular_shape.kind,
        effort=sample.state.effort,
    )


def torque_step_of(sample: LockstepSample[TorqueResult], s: Structure) -> Step:
    """Return the row of torque control: u are the joint velocities that came of the torques."""
    shape = singular_shape(planar_base(s, sample.result.phi[s.n_h :]))
    return Step(
        **_common(sample),
        status="tracking",
        u_unlimited=sample.state.phi_dot,
        u=sample.state.phi_dot,
        speed_scale=1.0,
        speed_limited=(),
        range_limited=(),
        sigma_min_B_tilde=math.nan,
        sigma_min_A_hat=math.nan,
        damping=math.nan,
        singular_nearness=shape.nearness,
        singular_shape=shape.kind,
        effort=sample.result.u,
    )


def _common(sample: LockstepSample[Any]) -> dict[str, Any]:
    state, result = sample.state, sample.result
    return {
        "t_s": sample.t,
        "w_measured": result.w,
        "w_d": result.w_d,
        "phi_measured": result.phi,
        "phi_tilde_dot_d": result.phi_tilde_dot_d,
        "V_h": result.V_h,
        "V_b1": result.V_b1,
        "d_min": result.d_min,
        "w": state.w,
        "phi": state.phi,
        "d_min_true": state.d_min,
        "fallen": state.fallen,
        "slip": state.slip,
    }


def _steps(config: Config, settings: Settings) -> Iterator[Step]:
    """Run the configured controller, servos and plant; yield the rows."""
    robot, start = config.robot, config.robot.start_joint_angles_rad
    period_s = 1.0 / settings.rate_hz
    if settings.controller == "torque":
        body = TorquePlant(robot)
        state: PlantState = body.reset(start)
        goal = configured_trajectory(config.trajectory_generator, state.w)
        law = TorqueController(robot, config.controller)
        for sample in lockstep(body, state, law, goal.sample, settings.duration_s, period_s):
            yield torque_step_of(sample, structure(robot))
        return
    plant = KinematicPlant(robot, settings.plant_step_s)
    state = plant.reset(start)
    controller: Controller[ControlResult] = ScpController(robot, config.controller)
    servos: Servos = LimitedServos(robot, settings.carry_remainder)
    if settings.servos == "perfect":
        controller, servos = Unlimited(controller), PerfectServos()
    goal = configured_trajectory(config.trajectory_generator, state.w)
    yield from map(
        step_of,
        lockstep(
            plant,
            state,
            controller,
            goal.sample,
            settings.duration_s,
            period_s,
            servos,
        ),
    )
