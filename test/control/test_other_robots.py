"""The preset scale_free on robots unlike the paper's, its gains as they are."""

from __future__ import annotations

import pytest

from benchmarks.other_robots import ROBOTS, follow
from snake_control.config import ControllerConfig
from snake_control.model.singular_shape import SINGULAR_ABOVE


@pytest.mark.parametrize(
    "name",
    [
        "planar, 8 links",
        "10 links",
        "the paper's, 3 times as large",
        "14 links, short head",
        "24 links, every second",
    ],
)
def test_it_follows_stands_and_stays_away_from_singular_shapes(name):
    robot = ROBOTS[name]
    found = follow(robot, ControllerConfig(preset="scale_free"), 8.0)
    assert found.ended == ""
    assert found.nearness.max() < SINGULAR_ABOVE
    assert found.d_min.min() > 0
    # No limit had to step in: neither of speed nor of range.
    assert (found.scaled, found.at_range_end) == (0, 0)
    size = robot.half_length_m / 0.034
    assert found.off_exponential_mm < 5.0 * size
    assert found.off_exponential_rad < 0.02


def test_where_the_papers_gains_starve_the_head():
    robot = ROBOTS["24 links, every second"]
    found = follow(robot, ControllerConfig(preset="paper"), 1.0)
    assert found.scaled > 0.9 * len(found.t)
