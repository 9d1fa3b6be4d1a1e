"""The shortened campaign, on real nodes; ``make faults`` runs all of it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("snake_interfaces")

from faults.rig import Rig
from faults.scenario import Scenario, load

SHORT = [scenario for scenario in load() if scenario.short]


@pytest.fixture(scope="module")
def rig() -> Iterator[Rig]:
    with Rig() as rig:
        yield rig


@pytest.mark.parametrize("scenario", SHORT, ids=lambda scenario: scenario.name)
def test_the_robot_stays_safe_says_why_and_comes_back(rig: Rig, scenario: Scenario) -> None:
    outcome = rig.run(scenario)
    assert not outcome.violations, str(outcome)
