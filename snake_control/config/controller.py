"""The shared group of the controller's gains and sub-tasks."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from snake_control.config.obstacles import Circle, read_obstacles
from snake_control.config.parameter import parameter
from snake_control.config.presets import PRESETS, Preset
from snake_control.config.sub_tasks import BASE_SUB_TASKS, HEAD_SUB_TASKS, check_names
from snake_control.errors import ConfigError

# The paper's names of weights, and the base sub-tasks that they weigh.
_PAPER_WEIGHTS = {"a_prime": "singularity", "b_prime": "fall"}


@dataclasses.dataclass(frozen=True)
class ControllerConfig:
    """Gains and sub-tasks of the controllers, equations (21), (22), (25), (27), (30).

    ``preset`` and ``case`` say which sub-tasks head and base have, with which weights; what is
    given explicitly wins. ``a_prime`` and ``b_prime`` are the paper's names for the weights of the
    base sub-tasks ``singularity`` and ``fall``. After construction every field holds what is in
    force, ``()`` for no sub-tasks.

    Attributes:
        obstacles: circles of ``obstacles_file``; ``None`` without a file. Plain Python may give
            them directly.
    """

    case: int = parameter(
        3,
        "which sub-tasks: 1 SCPs still, 2 singularity avoidance, 3 and no falling",
        choices=(1, 2, 3),
        run_time=True,
    )
    preset: str = parameter(
        "paper",
        "costs and gains of the case: paper (as published, for the paper's robot) or scale_free "
        "(for robots of any size and length)",
        choices=tuple(PRESETS),
        run_time=True,
    )
    K: tuple[float, ...] = parameter(
        (0.4, 0.25, 0.5, 0.1, 0.1, 0.1),
        "diagonal of K for x_h, y_h, z_h, R, P, Y [1/s]; zeros for the SCPs may follow",
        low=0.0,
        high=100.0,
        run_time=True,
    )
    rotation_error: str = parameter(
        "rpy",
        "velocity control: error of the head's attitude, rpy as in (22), or rotation_vector, which "
        "also works through P = +-90 degrees (docs/equations.md)",
        choices=("rpy", "rotation_vector"),
        run_time=True,
    )
    K_p: tuple[float, ...] = parameter(
        (4.0,),
        "torque control (21): gain on the error of x_h, y_h, z_h, R, P, Y, or one for all [1/s^2]; "
        "zeros for the SCPs may follow",
        low=0.0,
        high=1e6,
        run_time=True,
    )
    K_v: tuple[float, ...] = parameter(
        (4.0,),
        "torque control (21): gain on the velocity error of x_h, y_h, z_h, R, P, Y and each SCP, "
        "or one for all [1/s]",
        low=0.0,
        high=1e6,
        run_time=True,
    )
    head_sub_tasks: tuple[str, ...] = parameter(
        None,
        "sub-tasks of the H-SCPs, [none] for none; default from preset and case "
        "(docs/sub_tasks.md)",
        run_time=True,
    )
    head_weights: tuple[float, ...] = parameter(
        None,
        "weight of each head sub-task; default from preset and case, or what suits the sub-task",
        low=0.0,
        high=1e12,
        run_time=True,
    )
    base_sub_tasks: tuple[str, ...] = parameter(
        None,
        "sub-tasks of the B-SCPs, [none] for none; default from preset and case "
        "(docs/sub_tasks.md)",
        run_time=True,
    )
    base_weights: tuple[float, ...] = parameter(
        None,
        "weight of each base sub-task; default from preset and case, or what suits the sub-task",
        low=0.0,
        high=1e12,
        run_time=True,
    )
    a_h: float = parameter(
        None,
        "gain of all head sub-tasks (25); default from preset and case",
        low=0.0,
        high=1e12,
        run_time=True,
    )
    a_b: float = parameter(
        None,
        "gain of all base sub-tasks (27); default from preset and case",
        low=0.0,
        high=1e12,
        run_time=True,
    )
    a_prime: float = parameter(
        None,
        "weight of V_b1 (30), the base sub-task singularity; default from preset and case",
        low=0.0,
        high=1e12,
        run_time=True,
    )
    b_prime: float = parameter(
        None,
        "weight of d_min (30), the base sub-task fall [1/m]; default from preset and case",
        low=0.0,
        high=1e12,
        run_time=True,
    )
    scp_law: str = parameter(
        None,
        "how sub-tasks move SCPs: gradient (25), (27), or projection (all joints come closest to "
        "the gradient); default from preset and case",
        choices=("gradient", "projection"),
        run_time=True,
    )
    joint_range_margin_rad: float = parameter(
        0.6,
        "sub-task joint_range: it acts this near to the ends of a range [rad]",
        low=0.01,
        high=10.0,
        run_time=True,
    )
    obstacle_margin_m: float = parameter(
        0.05,
        "sub-task obstacles: it acts this near to a circle [m]",
        low=1e-4,
        high=100.0,
        run_time=True,
    )
    obstacles_file: str = parameter(
        "",
        "sub-task obstacles: YAML file with a list of {x_m, y_m, radius_m}, empty for none",
        run_time=True,
    )
    obstacles: tuple[Circle, ...] | None = None

    def __post_init__(self) -> None:
        preset = PRESETS[self.preset]
        # A list of one's own has the gain and the law that go with sub-tasks, also in Case 1.
        own = self._given("head_sub_tasks") is not None or self._given("base_sub_tasks") is not None
        if self._given("scp_law") is None:
            self._set(scp_law=preset[3 if own else self.case].scp_law)
        self._compose_head(preset)
        self._compose_base(preset)
        if self.obstacles_file and self.obstacles is None:
            self._set(obstacles=read_obstacles("controller.obstacles_file", self.obstacles_file))
        if "obstacles" in self.base_sub_tasks and self.obstacles is None:
            raise ConfigError(
                "controller.obstacles_file",
                self.obstacles_file,
                "the sub-task obstacles needs a YAML file with a list of {x_m, y_m, radius_m}",
            )

    def _given(self, name: str) -> Any:
        """Return what was given for a field, ``None`` if nothing was."""
        return getattr(self, name)

    def _set(self, **values: object) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def _compose_head(self, preset: Mapping[int, Preset]) -> None:
        case, given = preset[self.case], self._given("head_sub_tasks")
        names = tuple(case.head) if given is None else _none_is_empty(given)
        check_names("controller.head_sub_tasks", names, HEAD_SUB_TASKS)
        gain = case.a_h if given is None else preset[3].a_h
        suited = case.head if given is None else _suited(names, HEAD_SUB_TASKS, gain)
        weights = _weights("head", names, self.head_weights, suited)
        self._set(head_sub_tasks=names, head_weights=weights)
        if self._given("a_h") is None:
            self._set(a_h=gain)

    def _compose_base(self, preset: Mapping[int, Preset]) -> None:
        case, given = preset[self.case], self._given("base_sub_tasks")
        names = tuple(case.base) if given is None else _none_is_empty(given)
        check_names("controller.base_sub_tasks", names, BASE_SUB_TASKS)
        gain = case.a_b if given is None else preset[3].a_b
        suited = dict(case.base if given is None else _suited(names, BASE_SUB_TASKS, gain))
        for key, name in _PAPER_WEIGHTS.items():
            weight = self._given(key)
            if weight is not None and name in suited:
                suited[name] = weight
        weights = _weights("base", names, self.base_weights, suited)
        in_force = dict(zip(names, weights, strict=True))
        for key, name in _PAPER_WEIGHTS.items():
            weight = self._given(key)
            if weight not in (None, in_force.get(name, 0.0)):
                raise ConfigError(f"controller.{key}", weight, _contradiction(key, name, in_force))
            self._set(**{key: in_force.get(name, 0.0)})
        self._set(base_sub_tasks=names, base_weights=weights)
        if self._given("a_b") is None:
            self._set(a_b=gain)

    @staticmethod
    def for_scps(config: ControllerConfig, m: int) -> ControllerConfig:
        """Return ``config`` with K and K_p cut to w, checked against ``m`` SCPs.

        Raises:
            ConfigError: another number of gains, or one that feeds back an SCP angle.
        """
        if len(config.K_v) not in (1, 6 + m):
            raise ConfigError(
                "controller.K_v", list(config.K_v), f"give one gain for all, or 6 + m = {6 + m}"
            )
        K_p = config.K_p if len(config.K_p) == 1 else _of_w("controller.K_p", config.K_p, m)
        return dataclasses.replace(config, K=_of_w("controller.K", config.K, m), K_p=K_p)


def _of_w(field: str, gains: tuple[float, ...], m: int) -> tuple[float, ...]:
    """Return the six gains of w; those of the ``m`` SCPs, where given, must be 0."""
    if len(gains) not in (6, 6 + m):
        raise ConfigError(field, list(gains), f"give 6 gains, or 6 + m = {6 + m}")
    if any(gains[6:]):
        raise ConfigError(
            field,
            list(gains),
            "the gains of the SCPs must be 0: (25) and (27) give them velocities, not angles",
        )
    return gains[:6]


def _none_is_empty(given: tuple[str, ...]) -> tuple[str, ...]:
    # rcl leaves a parameter given as [] uninitialised, so [none] is how a file says it.
    return () if given == ("none",) else given


def _suited(names: Sequence[str], known: Mapping[str, float], gain: float) -> dict[str, float]:
    """Return weights that suit sub-tasks whose list was given without any."""
    return {name: known.get(name, 1.0) / gain for name in names}


def _weights(
    part: str, names: Sequence[str], given: tuple[float, ...] | None, suited: Mapping[str, float]
) -> tuple[float, ...]:
    if given is None:
        return tuple(suited[name] for name in names)
    if not names and given == (0.0,):
        return ()
    if len(given) != len(names):
        raise ConfigError(
            f"controller.{part}_weights",
            list(given),
            f"give one weight for each of {part}_sub_tasks: {', '.join(names) or 'none'} "
            "(both at once to a running node: set_parameters_atomically)",
        )
    return given


def _contradiction(key: str, name: str, in_force: Mapping[str, float]) -> str:
    if name not in in_force:
        listed = ", ".join(in_force) or "none"
        return f"it weighs {name}, which is not among the base sub-tasks in force: {listed}"
    return (
        f"it weighs {name}, for which base_weights says {in_force[name]:g}; give {key} or "
        "base_weights, not both"
    )
