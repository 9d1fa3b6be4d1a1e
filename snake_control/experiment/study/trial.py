"""One robot on one trajectory in lockstep, and what came of it."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math

import numpy as np

from snake_control.config import ControllerConfig, RobotConfig
from snake_control.control.scp_controller import ScpController
from snake_control.experiment.lockstep import lockstep
from snake_control.experiment.study.candidates import Candidate
from snake_control.experiment.study.trajectories import StudyTrajectory
from snake_control.model.geometry import planar_base
from snake_control.model.singular_shape import singular_shape
from snake_control.model.structure import structure
from snake_control.plant.kinematic import KinematicPlant

_FORMAT = 1
"""Of a stored outcome; raised when the same trial would be judged otherwise."""


@dataclasses.dataclass(frozen=True)
class Trial:
    """Everything that determines an outcome.

    Attributes:
        template: the robot, whatever its own choice of SCPs.
        controller: gains and sub-tasks.
        candidate: the choice of SCPs that is tried.
        trajectory: of the head.
        duration_s: how long [s].
        dt: control and plant step [s].
    """

    template: RobotConfig
    controller: ControllerConfig
    candidate: Candidate
    trajectory: StudyTrajectory
    duration_s: float
    dt: float

    @property
    def key(self) -> str:
        """Name of this trial in a store: equal if and only if everything in it is."""
        robot = dataclasses.asdict(self.candidate.robot(self.template))
        content = dataclasses.asdict(self) | {"template": robot, "format": _FORMAT}
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:20]


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What came of a trial; errors are those of the last third of its time.

    Attributes:
        candidate, trajectory: what was tried.
        fell_at_s: when P_G left the support polygon, ``None`` if never; the trial ends then.
        position_error_rms_m: distance of the head from its reference.
        rotation_error_rms_rad: root of the sum of squares of R, P, Y, beyond the exponential that
            the gains of roll, pitch and yaw leave.
        worst_singularity: largest nearness to a singular shape, 0..1.
        min_d_min_m: least margin against falling.
        peak_speed_rad_s: largest joint speed asked for before limiting, after the run-in.
        range_steps: share of control steps with a joint at the end of its range, 0..1.
    """

    candidate: Candidate
    trajectory: str
    fell_at_s: float | None
    position_error_rms_m: float
    rotation_error_rms_rad: float
    worst_singularity: float
    min_d_min_m: float
    peak_speed_rad_s: float
    range_steps: float

    @property
    def fell(self) -> bool:
        """Whether the robot fell."""
        return self.fell_at_s is not None


RUN_IN_S = 5.0
"""The first seconds carry the way from w(0) to w_d(0), which all candidates share."""


def run_trial(trial: Trial) -> Outcome:
    """Run one trial; the same trial has the same outcome on the same machine."""
    robot = trial.candidate.robot(trial.template)
    plant = KinematicPlant(robot)
    state = plant.reset(robot.start_joint_angles_rad)
    controller = ScpController(robot, trial.controller)
    trajectory = trial.trajectory.make()
    K = np.array(trial.controller.K[3:6])
    settled = 2.0 / 3.0 * trial.duration_s
    first_rotation = np.zeros(3)
    position, rotation = [], []
    singularity = peak = 0.0
    d_min, fell_at = math.inf, None
    steps = at_range_end = 0
    for sample in lockstep(plant, state, controller, trajectory.sample, trial.duration_s, trial.dt):
        result, t = sample.result, sample.t
        steps += 1
        if t == 0.0:
            first_rotation = result.error[3:]
        at_range_end += bool(result.range_limited)
        base = planar_base(structure(robot), sample.state.phi[robot.head_links :])
        singularity = max(singularity, singular_shape(base).nearness)
        d_min = min(d_min, sample.state.d_min)
        if t >= min(RUN_IN_S, settled):
            peak = max(peak, float(np.abs(result.u_unlimited).max()))
        if t >= settled:
            position.append(float(result.error[:3] @ result.error[:3]))
            beyond = result.error[3:] - first_rotation * np.exp(-K * t)
            rotation.append(float(beyond @ beyond))
        if sample.state.fallen:
            fell_at = t
            break
    return Outcome(
        candidate=trial.candidate,
        trajectory=trial.trajectory.name,
        fell_at_s=fell_at,
        position_error_rms_m=_rms(position),
        rotation_error_rms_rad=_rms(rotation),
        worst_singularity=singularity,
        min_d_min_m=d_min,
        peak_speed_rad_s=peak,
        range_steps=at_range_end / steps,
    )


def _rms(squares: list[float]) -> float:
    return math.sqrt(sum(squares) / len(squares)) if squares else math.inf
