"""Which sub-tasks the cases have, with which gains: the paper's, and forms for any robot."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType


@dataclasses.dataclass(frozen=True)
class Preset:
    """The composition of one case.

    Attributes:
        a_h, a_b: gains of all sub-tasks of head and base (25), (27).
        head, base: sub-tasks and their weights.
        scp_law: ``gradient`` or ``projection``.
    """

    a_h: float
    a_b: float
    head: Mapping[str, float]
    base: Mapping[str, float]
    scp_law: str


def _paper(a_h: float, a_b: float, a_prime: float, b_prime: float) -> Preset:
    base = {"singularity": a_prime, "fall": b_prime}
    return Preset(a_h, a_b, {"manipulability": 1.0}, base, "gradient")


def _scale_free(gain: float, fall: float, scp_law: str) -> Preset:
    head = {"log_manipulability": 0.1, "joint_range": 0.1}
    base = {"wheel_axes": 0.1, "relative_fall": fall, "joint_range": 0.1}
    return Preset(gain, gain, head, base, scp_law)


PRESETS: Mapping[str, Mapping[int, Preset]] = MappingProxyType(
    {
        "paper": MappingProxyType(
            {
                1: _paper(0.0, 0.0, 0.0, 0.0),
                2: _paper(1e5, 1.0, 1e-11, 0.0),
                3: _paper(1e5, 1.0, 1e-11, 3.0),
            }
        ),
        "scale_free": MappingProxyType(
            {
                1: _scale_free(0.0, 0.0, "gradient"),
                2: _scale_free(1.0, 0.0, "projection"),
                3: _scale_free(1.0, 0.3, "projection"),
            }
        ),
    }
)
"""By preset and case. ``paper``: Section 5. ``scale_free``: the same purposes with costs without
units, for robots of any size and length (docs/sub_tasks.md)."""
