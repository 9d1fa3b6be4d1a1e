"""Height of the raised links above the floor, against the links as bodies, and its derivative."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest

from snake_control.config import RobotConfig
from snake_control.model.bodies import Bodies
from snake_control.model.floor import geometry_on_floor
from snake_control.model.floor_clearance import (
    FloorClearance,
    floor_clearance,
    floor_clearance_by_head,
)
from support.robots import PAPER, ROBOTS

RAISED = [name for name, robot in ROBOTS.items() if not robot.planar]


def found(robot: RobotConfig, phi: np.ndarray) -> FloorClearance:
    return floor_clearance(geometry_on_floor(robot, phi))


@pytest.mark.parametrize("name", RAISED)
@pytest.mark.parametrize("seed", range(4))
def test_it_is_the_lowest_corner_of_the_raised_links(name: str, seed: int) -> None:
    robot = ROBOTS[name]
    phi = np.random.default_rng(seed).uniform(-1.5, 1.5, robot.joints)
    bodies = Bodies(robot, phi)
    half = np.array((robot.half_length_m, *(0.5 * np.array(robot.link_size_m))))
    base = min(0.0, robot.wheel_radius_m - half[2])
    heights = {}
    for link in range(1, robot.head_links + 1):
        ends = (1,) if link == robot.head_links else (-1, 1)
        heights[link] = min(
            (bodies.centers[link - 1] + bodies.frames[link - 1] @ (half * signs))[2] - base
            for signs in itertools.product(ends, (-1, 1), (-1, 1))
        )
    lowest = found(robot, phi)
    assert lowest.height == pytest.approx(min(heights.values()), abs=1e-12)
    assert heights[lowest.link] == pytest.approx(lowest.height, abs=1e-12)
    assert robot.wheel_radius_m + lowest.corner[2] - base == pytest.approx(lowest.height, abs=1e-12)


@pytest.mark.parametrize("name", RAISED)
@pytest.mark.parametrize("seed", range(4))
def test_its_derivative_is_that_of_finite_differences(name: str, seed: int) -> None:
    robot = ROBOTS[name]
    phi = np.random.default_rng(seed).uniform(-1.5, 1.5, robot.joints)
    g = geometry_on_floor(robot, phi)
    by_head = floor_clearance_by_head(g, floor_clearance(g))
    h = 1e-6
    for joint in range(robot.head_links):
        step = h * np.eye(robot.joints)[joint]
        numeric = (found(robot, phi + step).height - found(robot, phi - step).height) / (2 * h)
        assert by_head[joint] == pytest.approx(numeric, abs=1e-7)


def test_the_link_on_the_base_counts_by_its_front_end() -> None:
    phi = np.zeros(11)
    phi[4] = 0.2
    lowest = found(PAPER, phi)
    # Its own rear end is 4 mm above the floor, as the base is.
    assert lowest.height > 0.015
    phi[4] = -0.1
    lowest = found(PAPER, phi)
    assert lowest.link == 1
    assert lowest.height == pytest.approx(0.02 - 0.34 * math.sin(0.1) - 0.016 * math.cos(0.1))


def test_a_body_thicker_than_its_wheels_are_high_lies_on_the_floor() -> None:
    thick = dataclasses.replace(PAPER, link_size_m=(0.05, 0.06))
    assert found(thick, np.zeros(11)).height == pytest.approx(0.0, abs=1e-15)


def test_a_planar_snake_cannot_be_low() -> None:
    planar = ROBOTS["planar"]
    assert found(planar, np.zeros(planar.joints)).height == math.inf
