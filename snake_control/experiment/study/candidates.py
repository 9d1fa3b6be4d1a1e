"""Every choice of SCPs that a robot admits."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np

from snake_control.config import RobotConfig
from snake_control.errors import ConfigError, StudyError

MOST_CANDIDATES = 20_000
"""More choices than this are not listed: long robots have millions."""


@dataclasses.dataclass(frozen=True, order=True)
class Candidate:
    """One choice: the wheelless links (hence the B-SCPs) and the H-SCPs, both counted from 1."""

    wheelless_links: tuple[int, ...]
    head_scp_joints: tuple[int, ...]

    @classmethod
    def of(cls, robot: RobotConfig) -> Candidate:
        """Return the choice that a robot's configuration makes."""
        return cls(robot.wheelless_links, robot.head_scp_joints)

    def robot(self, template: RobotConfig) -> RobotConfig:
        """Return ``template`` with this choice.

        Raises:
            ConfigError: it breaks a condition of the paper.
        """
        return dataclasses.replace(
            template,
            wheelless_links=self.wheelless_links,
            head_scp_joints=self.head_scp_joints,
        )

    def __str__(self) -> str:
        return f"links {_listed(self.wheelless_links)}; phi {_listed(self.head_scp_joints)}"


def admissible(
    template: RobotConfig, wheelless_counts: Sequence[int] | None = None
) -> list[Candidate]:
    """Return all choices that fulfil the paper's Conditions and Assumptions, in a fixed order.

    Args:
        template: the robot whose choice is varied.
        wheelless_counts: only sets of these sizes; all sizes by default.

    Raises:
        StudyError: there are more than ``MOST_CANDIDATES`` to look at, or none.
    """
    free_links = list(range(max(template.head_links, 1) + 1, template.links))
    if wheelless_counts is None:
        counts: Sequence[int] = range(len(free_links) + 1)
    else:
        counts = sorted(set(wheelless_counts))
    heads = list(
        itertools.combinations(range(1, template.head_links + 1), max(template.head_links - 4, 0))
    )
    total = len(heads) * sum(math.comb(len(free_links), count) for count in counts)
    if total > MOST_CANDIDATES:
        raise StudyError(
            f"{total} sets of SCPs are too many to list (at most {MOST_CANDIDATES}); "
            "give the numbers of wheelless links to look at"
        )
    found = sorted(_allowed(template, free_links, counts, heads))
    if not found:
        numbers = ", ".join(map(str, counts))
        raise StudyError(
            f"no choice with {numbers} of the links {free_links[0]} to {free_links[-1]} wheelless "
            "fulfils the paper's conditions"
        )
    return found


def sample(candidates: Sequence[Candidate], count: int, seed: int) -> list[Candidate]:
    """Return ``count`` of the candidates, drawn without repetition, in their order."""
    if count >= len(candidates):
        return list(candidates)
    chosen = np.random.default_rng(seed).choice(len(candidates), count, replace=False)
    return [candidates[i] for i in sorted(chosen.tolist())]


def _allowed(
    template: RobotConfig,
    free_links: Sequence[int],
    counts: Sequence[int],
    heads: Sequence[tuple[int, ...]],
) -> Iterator[Candidate]:
    # A planar snake's first link never has wheels; it is no choice.
    fixed = () if template.head_links else (1,)
    for count in counts:
        for links in itertools.combinations(free_links, count):
            for joints in heads:
                candidate = Candidate(fixed + links, joints)
                try:
                    candidate.robot(template)
                except ConfigError:
                    continue
                yield candidate


def _listed(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers)) or "none"
