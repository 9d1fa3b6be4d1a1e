"""Limits of a motion: what is allowed, how much of it, and what ends it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from snake_control.config import RobotConfig, SupervisorConfig, load
from snake_control.control.barriers import Barriers, Limit
from snake_control.control.limits import RANGE_MARGIN_RAD
from snake_control.experiment.cases import config_directory

ROBOT = RobotConfig()
CONFIG = SupervisorConfig()
PHI = np.array(ROBOT.start_joint_angles_rad)
END = 2.4 - RANGE_MARGIN_RAD


def motion(**joints: float) -> np.ndarray:
    """Joint velocities by name."""
    u = np.zeros(ROBOT.joints)
    for name, velocity in joints.items():
        u[int(name.rpartition("_")[2]) - 1] = velocity
    return u


def test_far_from_all_limits_everything_within_the_speeds_is_allowed() -> None:
    at = Barriers(ROBOT, CONFIG).at(PHI)
    assert at.allows(motion(joint_2=1.0))
    assert at.largest_share(np.zeros(11), motion(joint_2=1.0)) == (1.0, None)
    share, bound = at.largest_share(np.zeros(11), motion(joint_9=11.0))
    assert share == pytest.approx(0.5)
    assert bound is not None
    assert (bound.limit, bound.joints) == (Limit.JOINT_SPEED, (9,))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_end_of_a_range_is_approached_ever_more_slowly_and_left_at_any_speed(
    side: float,
) -> None:
    ranges_alone = dataclasses.replace(
        CONFIG, d_min_stop_m=0.0, nearness_stop=1.0, regularity_stop=0.0
    )
    barriers = Barriers(ROBOT, ranges_alone)
    for left in (0.2, 0.1, 0.01, 0.0, -0.02):
        phi = PHI.copy()
        phi[10] = side * (END - left)
        at = barriers.at(phi)
        share, bound = at.largest_share(np.zeros(11), motion(joint_11=side * 5.0))
        assert share * 5.0 == pytest.approx(CONFIG.approach_rate_per_s * max(left, 0.0))
        assert bound is not None
        assert (bound.limit, bound.joints) == (Limit.JOINT_RANGE, (11,))
        assert (at.lowest[10] if side > 0 else -at.highest[10]) == pytest.approx(-5.5)


def test_a_start_that_is_not_allowed_is_told() -> None:
    at = Barriers(ROBOT, CONFIG).at(PHI)
    share, bound = at.largest_share(motion(joint_3=7.0), motion(joint_4=1.0))
    assert share < 0.0
    assert bound is not None
    assert (bound.limit, bound.joints) == (Limit.JOINT_SPEED, (3,))


def test_a_margin_of_the_whole_body_shrinks_by_its_share_at_most() -> None:
    tight = dataclasses.replace(CONFIG, d_min_stop_m=0.03, d_min_warn_m=0.032)
    barriers = Barriers(ROBOT, tight)
    at = barriers.at(PHI)
    left = at.margins[Limit.FALL]
    assert left == pytest.approx(0.034238 - 0.03, abs=1e-6)
    # Lowering the neck moves the head's weight out of the support polygon.
    gradient = [barriers.margins(PHI + 1e-4 * np.eye(11)[i])[Limit.FALL] - left for i in range(11)]
    worst = int(np.argmin(gradient))
    u = 1.0 * np.eye(11)[worst]
    share, bound = at.largest_share(np.zeros(11), u)
    assert 0.0 < share < 1.0
    assert bound is not None
    assert bound.limit is Limit.FALL
    ahead = barriers.margins(PHI + tight.horizon_s * share * u)[Limit.FALL]
    keep = 1.0 - tight.approach_rate_per_s * tight.horizon_s
    assert keep * left <= ahead <= keep * left + 0.02 * left
    # Away from the limit nothing is in the way.
    assert at.largest_share(np.zeros(11), -u) == (1.0, None)


def test_beyond_a_limit_no_motion_makes_it_worse_and_any_may_make_it_better() -> None:
    beyond = dataclasses.replace(CONFIG, d_min_stop_m=0.04, d_min_warn_m=0.05)
    barriers = Barriers(ROBOT, beyond)
    at = barriers.at(PHI)
    assert at.margins[Limit.FALL] < 0.0
    gradient = np.array(
        [
            barriers.margins(PHI + 1e-4 * np.eye(11)[i])[Limit.FALL] - at.margins[Limit.FALL]
            for i in range(11)
        ]
    )
    better = 0.1 * gradient / np.abs(gradient).max()
    assert at.allows(better)
    assert not at.allows(-better)
    assert at.allows(np.zeros(11))


def test_a_nearly_straight_body_becomes_straighter_ever_more_slowly() -> None:
    phi = PHI.copy()
    phi[5:] = [0.05, 0.05, 0.05, -0.05, -0.05, -0.05]
    straighter = np.concatenate((np.zeros(5), -5.0 * phi[5:]))
    barriers = Barriers(ROBOT, CONFIG)
    at = barriers.at(phi)
    left = at.margins[Limit.SINGULAR_BODY]
    assert 0.0 < left < CONFIG.nearness_stop - CONFIG.nearness_warn
    share, bound = at.largest_share(np.zeros(11), straighter)
    assert 0.2 < share < 1.0
    assert bound is not None
    assert bound.limit is Limit.SINGULAR_BODY
    ahead = barriers.margins(phi + CONFIG.horizon_s * share * straighter)[Limit.SINGULAR_BODY]
    assert ahead == pytest.approx(0.6 * left, rel=0.05)
    tight = dataclasses.replace(CONFIG, nearness_stop=0.9, nearness_warn=0.9)
    beyond = Barriers(ROBOT, tight).at(phi)
    assert not beyond.allows(straighter)
    assert beyond.allows(-straighter)
    beyond.lifted = frozenset({Limit.SINGULAR_BODY})
    assert beyond.allows(straighter)
    free = dataclasses.replace(CONFIG, nearness_stop=1.0)
    assert Limit.SINGULAR_BODY not in Barriers(ROBOT, free).at(phi).margins


def test_a_planar_snake_has_no_head_to_be_singular() -> None:
    planar = load(config_directory() / "planar_snake.yaml").robot
    margins = Barriers(planar, CONFIG).at(np.array(planar.start_joint_angles_rad)).margins
    assert set(margins) == {Limit.FALL, Limit.SINGULAR_BODY}


def test_a_head_that_is_lowered_nears_the_floor_ever_more_slowly() -> None:
    barriers = Barriers(ROBOT, CONFIG)
    phi = PHI.copy()
    phi[:5] = [0.2, 0.3, -1.0, -0.3, 0.8]
    lowering = motion(joint_5=-1.0)
    while barriers.margins(phi + 0.001 * lowering)[Limit.FLOOR] > 0.003:
        phi += 0.001 * lowering
    at = barriers.at(phi)
    left = at.margins[Limit.FLOOR]
    assert 0.0 < left < CONFIG.floor_warn_m - CONFIG.floor_stop_m
    share, bound = at.largest_share(np.zeros(11), lowering)
    assert 0.0 < share < 0.5
    assert bound is not None
    assert bound.limit is Limit.FLOOR
    ahead = barriers.margins(phi + CONFIG.horizon_s * share * lowering)[Limit.FLOOR]
    assert 0.6 * left <= ahead <= 0.7 * left
    assert at.allows(-lowering)
