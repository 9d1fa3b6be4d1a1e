"""A motion that is tried on the model before it starts."""

from __future__ import annotations

import dataclasses

import numpy as np

from snake_control.config import load
from snake_control.experiment.guided import GuidedRobot
from snake_control.experiment.rehearsal import rehearse
from snake_control.trajectory.line import Line
from support.robots import CONFIG

PAPER = load(CONFIG / "paper_robot.yaml")
QUICK = dataclasses.replace(
    PAPER, scp_controller=dataclasses.replace(PAPER.scp_controller, rate_hz=10.0)
)
START = GuidedRobot(QUICK).state


def test_what_stands_still_is_not_waited_for_to_its_end() -> None:
    up = Line(START.w, [0.0, 0.0, 0.03, 0.0, 0.0, 0.0], 0.0, 15.0)
    found = rehearse(QUICK, START.phi, START.w, up.sample, 200.0)
    assert not found.possible
    assert "would hold it up after" in found.text
    assert found.at is not None
    assert found.at < 15.0
    assert found.took * 200.0 < found.at + 25.0


def test_a_motion_that_ends_at_rest_comes_through() -> None:
    ahead = Line(START.w, [0.02, 0.0, 0.0, 0.0, 0.0, 0.0], 0.0, 2.0)
    found = rehearse(QUICK, START.phi, START.w, ahead.sample, 25.0)
    assert found.possible, found.text
    assert found.at is None
    assert np.isfinite(found.took)
