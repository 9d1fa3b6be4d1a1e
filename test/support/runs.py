"""Runs of the paper's cases that several tests look at, each made once."""

from __future__ import annotations

import functools

from snake_control.experiment.cases import load_case
from snake_control.experiment.facts import Facts
from snake_control.experiment.run import CaseRun, Settings, run_case


@functools.cache
def paper_run(case: int, servos: str = "perfect") -> CaseRun:
    """One case of the paper for 60 s, one plant step for each control cycle."""
    return run_case(load_case((), case), Settings(plant_step_s=0.02, servos=servos))


@functools.cache
def paper_facts(case: int, servos: str = "perfect") -> Facts:
    return Facts(paper_run(case, servos))
