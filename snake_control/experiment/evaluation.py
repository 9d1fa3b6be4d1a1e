"""Every model quantity at one state, for people who check their own code against this one."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snake_control.config import Config, RobotConfig
from snake_control.control.scp_controller import ScpController
from snake_control.errors import ConfigError
from snake_control.experiment.cases import CASES
from snake_control.model.dynamics import Dynamics
from snake_control.model.posture import Posture
from snake_control.trajectory.configured import configured_trajectory

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class State:
    """A state to evaluate.

    Attributes:
        q: [w, phi], (n + 5,) [m, rad].
        q_dot: its rate, (n + 5,).
        t: time at which the trajectory is asked for [s].
        case: preset of sub-tasks; ``None`` for the configuration's.
    """

    q: Array
    q_dot: Array
    t: float = 0.0
    case: int | None = None


def read_states(document: object, robot: RobotConfig) -> tuple[list[State], bool]:
    """Check what a JSON file holds and return its states, and whether it was a list of them.

    Raises:
        ConfigError: names the field, its value and what is allowed.
    """
    if isinstance(document, list):
        return [_state(item, f"state[{i}]", robot) for i, item in enumerate(document)], True
    return [_state(document, "state", robot)], False


# What is not finite is null in the output; warnings would say it once more.
@np.errstate(over="ignore", invalid="ignore")
def evaluate(config: Config, state: State) -> dict[str, Any]:
    """Return every model quantity at a state, ready for JSON.

    Rows and signs: docs/equations.md. What does not exist there (a singular head posture has no
    ``F_bar``: ``damping`` is above 0 then) or is not finite is ``None``. The control law has an
    answer everywhere.

    Args:
        config: robot, controller (with the state's case, if it has one) and trajectory.
        state: the state.
    """
    posture = Posture(config.robot, state.q)
    k = posture.k
    dynamics = Dynamics(config.robot)
    everywhere: dict[str, object] = {
        "A_bar": k.A_bar,
        "B_bar": k.B_bar,
        "A_tilde": k.A_tilde,
        "B_tilde": k.B_tilde,
        "V_h": posture.V_h,
        "d_min": posture.support.d_min,
        "singular_nearness": posture.singular_shape.nearness,
        "damping": k.damping,
    }
    with_inverse: dict[str, Callable[[], object]] = {
        "F_bar": lambda: k.F_bar,
        "E_tilde": lambda: k.E_tilde,
        "V_b1": lambda: posture.V_b1,
        "M_tilde": lambda: dynamics.reduced(posture, state.q_dot).M_tilde,
        "h_tilde": lambda: dynamics.reduced(posture, state.q_dot).h_tilde,
    }
    found = {name: _json(value) for name, value in everywhere.items()}
    found |= {
        name: _json(value()) if k.damping == 0.0 else None for name, value in with_inverse.items()
    }
    return found | _control(config, state)


def _control(config: Config, state: State) -> dict[str, Any]:
    """SCP velocities (25), (27) and the control law (22) before any limit."""
    robot = config.robot
    trajectory = configured_trajectory(config.trajectory_generator, state.q[:6])
    controller = ScpController(robot, config.controller)
    decided = controller.step(state.q, state.q_dot, trajectory.sample(state.t), state.t)
    m_h = len(robot.head_scp_joints)
    return {
        "phi_dot_hd": _json(decided.phi_tilde_dot_d[:m_h]),
        "phi_dot_bd": _json(decided.phi_tilde_dot_d[m_h:]),
        "u": _json(decided.u_unlimited),
    }


def _json(value: object) -> Any:
    """Return numbers and nested lists of them; ``None`` for each that is not finite."""
    if isinstance(value, np.ndarray):
        return [_json(item) for item in value]
    number = float(value)  # type: ignore[arg-type]
    return number if math.isfinite(number) else None


def _state(item: object, field: str, robot: RobotConfig) -> State:
    if not isinstance(item, Mapping):
        raise ConfigError(field, item, 'give an object like {"q": [...], "t": 0.0, "case": 2}')
    allowed = ("q", "q_dot", "t", "case")
    for name in item:
        if name not in allowed:
            raise ConfigError(f"{field}.{name}", item[name], f"allowed: {', '.join(allowed)}")
    if "q" not in item:
        raise ConfigError(f"{field}.q", None, f"give the {robot.links + 5} numbers of q")
    size = robot.links + 5
    case = item.get("case")
    if case is not None and (type(case) is not int or case not in CASES):
        raise ConfigError(f"{field}.case", case, f"allowed: {', '.join(map(str, CASES))}")
    return State(
        q=_vector(item["q"], f"{field}.q", size),
        q_dot=_vector(item["q_dot"], f"{field}.q_dot", size) if "q_dot" in item else np.zeros(size),
        t=_scalar(item.get("t", 0.0), f"{field}.t"),
        case=case,
    )


def _vector(value: object, field: str, size: int) -> Array:
    if not isinstance(value, Sequence) or isinstance(value, str):
        raise ConfigError(field, value, f"give a list of {size} numbers")
    if len(value) != size:
        raise ConfigError(
            field,
            f"{len(value)} entries",
            f"give {size}: x_h, y_h, z_h, R, P, Y, phi_1 .. phi_{size - 6}",
        )
    return np.array([_scalar(entry, f"{field}[{i}]") for i, entry in enumerate(value)])


def _scalar(value: object, field: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ConfigError(field, value, "give a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ConfigError(field, value, "give a finite number")
    return number
