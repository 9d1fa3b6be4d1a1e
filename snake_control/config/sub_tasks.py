"""The names of sub-tasks, and gains that suit them; what they are is in ``control/sub_tasks``."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from snake_control.errors import ConfigError

HEAD_SUB_TASKS: Mapping[str, float] = MappingProxyType(
    {"manipulability": 1e5, "log_manipulability": 0.1, "joint_range": 0.1}
)
"""Sub-tasks that the head may have, and the product of gain and weight that each gets when no
weights are given."""

BASE_SUB_TASKS: Mapping[str, float] = MappingProxyType(
    {
        "singularity": 1e-11,
        "log_singularity": 0.1,
        "wheel_axes": 0.1,
        "fall": 3.0,
        "relative_fall": 0.3,
        "joint_range": 0.1,
        "obstacles": 0.3,
    }
)
"""The same of the base."""

_OF_OTHERS = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")


def check_names(field: str, names: Sequence[str], known: Mapping[str, float]) -> None:
    """Check a list of sub-tasks; whether somebody else's class exists shows when it is made.

    Raises:
        ConfigError: a name that is unknown or repeated; it lists what is allowed.
    """
    for i, name in enumerate(names):
        if name not in known and not _OF_OTHERS.fullmatch(name):
            raise ConfigError(
                f"{field}[{i}]",
                name,
                f"allowed: {', '.join(known)}, your own as package.module:Class, or [none]",
            )
        if name in names[:i]:
            raise ConfigError(f"{field}[{i}]", name, "give every sub-task once")
