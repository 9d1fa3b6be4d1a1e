"""One robot on one trajectory in lockstep, and what came of it."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math

import numpy as np

from snake_control.config import ControllerConfig, RobotConfig
from snake_control.control.scp_controller import ScpController
from snake_control.errors import SnakeError
from snake_control.experiment.lockstep import lockstep
from snake_control.experiment.study.candidates import Candidate
from snake_control.experiment.study.trajectories import StudyTrajectory
from snake_control.model.geometry import planar_base
from snake_control.model.singular_shape import singular_shape
from snake_control.model.structure import structure
from snake_control.plant.kinematic import KinematicPlant

_FORMAT = 2
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
        failed: why the trial could not be run to its end, ``None`` if it could; the errors are
            infinite then, and the rest is what was seen before.
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
    failed: str | None = None

    @property
    def fell(self) -> bool:
        """Whether the robot fell."""
        return self.fell_at_s is not None


RUN_IN_S = 5.0
"""The first seconds carry the way from w(0) to w_d(0), which all candidates share."""


def transient_s(robot: RobotConfig, controller: ControllerConfig) -> float:
    """Return how long the head takes to its reference: errors are down to 5% [s]."""
    gains = [controller.K[i] for i in robot.controlled if i < 3 and controller.K[i] > 0.0]
    return 3.0 / min(gains) if gains else 0.0


def settled_from_s(duration_s: float) -> float:
    """Return from when on errors are judged in a trial of this length [s]."""
    return 2.0 / 3.0 * duration_s


def run_trial(trial: Trial) -> Outcome:
    """Run one trial; the same trial has the same outcome on the same machine.

    What fails in it, such as a sub-task of somebody else's, is in the outcome.
    """
    seen = _Seen(trial)
    try:
        seen.run()
    # Singular matrices of numpy are none of this package's errors.
    except (SnakeError, ArithmeticError, np.linalg.LinAlgError) as error:
        seen.failed = f"after {seen.t:.2f} s: {' '.join(str(error).split())}"
    return seen.outcome()


class _Seen:
    """What a trial has shown so far."""

    def __init__(self, trial: Trial) -> None:
        self._trial = trial
        self.failed: str | None = None
        self.t = 0.0
        self._position: list[float] = []
        self._rotation: list[float] = []
        self._singularity = self._peak = 0.0
        self._d_min = math.inf
        self._fell_at: float | None = None
        self._steps = self._at_range_end = 0

    def run(self) -> None:
        trial = self._trial
        robot = trial.candidate.robot(trial.template)
        plant = KinematicPlant(robot)
        state = plant.reset(robot.start_joint_angles_rad)
        self._d_min = state.d_min
        controller = ScpController(robot, trial.controller)
        reference = trial.trajectory.make().sample
        K = np.array(trial.controller.K[3:6])
        settled = settled_from_s(trial.duration_s)
        first_rotation = np.zeros(3)
        for sample in lockstep(plant, state, controller, reference, trial.duration_s, trial.dt):
            result, self.t = sample.result, sample.t
            self._steps += 1
            if self.t == 0.0:
                first_rotation = result.error[3:]
            self._at_range_end += bool(result.range_limited)
            base = planar_base(structure(robot), sample.state.phi[robot.head_links :])
            self._singularity = max(self._singularity, singular_shape(base).nearness)
            self._d_min = min(self._d_min, sample.state.d_min)
            if self.t >= min(RUN_IN_S, settled):
                self._peak = max(self._peak, float(np.abs(result.u_unlimited).max()))
            if self.t >= settled:
                self._position.append(float(result.error[:3] @ result.error[:3]))
                beyond = result.error[3:] - first_rotation * np.exp(-K * self.t)
                self._rotation.append(float(beyond @ beyond))
            if sample.state.fallen:
                self._fell_at = self.t
                return

    def outcome(self) -> Outcome:
        whole = self.failed is None
        return Outcome(
            candidate=self._trial.candidate,
            trajectory=self._trial.trajectory.name,
            fell_at_s=self._fell_at,
            position_error_rms_m=_rms(self._position) if whole else math.inf,
            rotation_error_rms_rad=_rms(self._rotation) if whole else math.inf,
            worst_singularity=self._singularity,
            min_d_min_m=self._d_min,
            peak_speed_rad_s=self._peak,
            range_steps=self._at_range_end / max(self._steps, 1),
            failed=self.failed,
        )


def _rms(squares: list[float]) -> float:
    return math.sqrt(sum(squares) / len(squares)) if squares else math.inf
