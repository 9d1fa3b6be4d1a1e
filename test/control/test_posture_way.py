"""Moves to postures in lockstep with the plant: what is found never falls nor leaves limits."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from snake_control.config import Config, load
from snake_control.control.joint_motion import Phase
from snake_control.control.posture_motion import PostureMotion
from snake_control.control.posture_way import Obstacle, Order, PostureMargins, PostureWays
from snake_control.model.bodies import Bodies
from snake_control.plant.kinematic import KinematicPlant
from support.robots import CONFIG, ROBOTS

DT = 0.02


def configs() -> dict[str, Config]:
    files = {file: load(CONFIG / file) for file in ("paper_robot.yaml", "planar_snake.yaml")}
    paper = files["paper_robot.yaml"]
    return files | {name: dataclasses.replace(paper, robot=robot) for name, robot in ROBOTS.items()}


CONFIGS = configs()
PAPER = CONFIGS["paper_robot.yaml"]


def named(config: Config, name: str) -> np.ndarray:
    return np.array(config.postures.angles("", name))


@dataclasses.dataclass
class Moved:
    phi: np.ndarray
    took: float
    planned: float
    phase: Phase
    danger: str
    lowest_d_min: float
    lowest_clearance: float
    fastest: np.ndarray
    fallen: bool


def move(config: Config, found, speed=0.5, moves=1.0) -> Moved:
    """Let the plant follow what was found; its joints do a share of what they are told."""
    robot = config.robot
    plant = KinematicPlant(robot, 0.01)
    state = plant.reset(found.corners[0])
    made = PostureMotion(robot, config.scp_controller, config.supervisor, found, speed, 0.0)
    t, lowest, clearance = 0.0, state.d_min, np.inf
    fastest = np.zeros(robot.joints)
    while True:
        step = made.step(state.phi, t)
        assert step.d_min == pytest.approx(state.d_min, abs=1e-9)
        fastest = np.maximum(fastest, np.abs(step.u))
        if step.motion.phase.over:
            break
        state = plant.step(moves * step.u, DT)
        lowest = min(lowest, state.d_min)
        clearance = min(clearance, Bodies(robot, state.phi).self_clearance)
        t += DT
        assert t < made.duration + 20.0
    return Moved(
        state.phi,
        t,
        made.duration,
        step.motion.phase,
        step.danger,
        lowest,
        clearance,
        fastest,
        state.fallen,
    )


def assert_good(config: Config, moved: Moved, goal: np.ndarray, speed: float, start_d_min: float):
    assert moved.phase is Phase.ARRIVED, moved.danger
    np.testing.assert_allclose(moved.phi, goal, atol=config.scp_controller.posture_tolerance_rad)
    assert moved.took == pytest.approx(moved.planned, abs=0.1)
    allowed = min(config.supervisor.d_min_stop_m, start_d_min)
    assert moved.lowest_d_min > allowed - 1e-3
    assert moved.lowest_clearance > -2e-3
    limits = np.minimum(config.robot.joint_speed_limits_rad_s, 1.1 * speed)
    assert (moved.fastest <= limits).all()


@pytest.mark.parametrize("speed", [0.05, 0.3, 5.0])
def test_the_papers_robot_gets_up_from_lying_flat_and_down_again(speed):
    ways = PostureWays(PAPER.robot, PAPER.supervisor)
    flat, start = named(PAPER, "flat"), named(PAPER, "start")
    for a, b in ((flat, start), (start, flat)):
        found = ways.find(a, b)
        assert found.order is Order.AT_ONCE
        moved = move(PAPER, found, speed)
        assert_good(PAPER, moved, b, speed, 0.03)
        assert not moved.fallen
        assert moved.lowest_d_min > 0.025


@pytest.mark.parametrize("name", CONFIGS)
def test_flat_and_start_of_other_robots(name):
    config = CONFIGS[name]
    ways = PostureWays(config.robot, config.supervisor)
    margins = PostureMargins(config.robot, config.supervisor)
    flat, start = np.zeros(config.robot.joints), np.array(config.robot.start_joint_angles_rad)
    for a, b in ((flat, start), (start, flat)):
        found = ways.find(a, b)
        assert found.corners, found.text
        moved = move(config, found)
        assert_good(config, moved, b, 0.5, margins.d_min(a))


@settings(max_examples=12, deadline=None)
@given(data=st.data())
@pytest.mark.parametrize("name", ["paper_robot.yaml", "planar_snake.yaml", "long head, two H-SCPs"])
def test_what_is_found_never_falls_and_what_is_refused_names_what_is_in_the_way(name, data):
    config = CONFIGS[name]
    robot = config.robot
    ways = PostureWays(robot, config.supervisor)
    margins = PostureMargins(robot, config.supervisor)
    angle = st.floats(-1.0, 1.0)
    start, goal = (
        np.array(data.draw(st.lists(angle, min_size=robot.joints, max_size=robot.joints)))
        for _ in range(2)
    )
    # Most heads at random are in the floor: raise some.
    if robot.head_links and data.draw(st.booleans()):
        goal[: robot.head_links] *= 0.3
        goal[robot.head_links - 1] = 0.9
    for begin in (np.zeros(robot.joints), start):
        found = ways.find(begin, goal)
        bad = {o: m for o, m in margins.at(goal).items() if m < 0.0}
        if not found.corners:
            assert any(obstacle.value in found.text for obstacle in Obstacle)
            if bad:
                assert found.text.startswith("the posture itself: ")
                assert min(bad, key=bad.__getitem__).value in found.text
            else:
                assert "% of the way" in found.text
            continue
        assert not bad
        if min(margins.at(begin).values()) < 0.0:
            # It stands badly to begin with; what comes may be no worse.
            assert all(m >= min(margins.at(begin)[o], 0.0) for o, m in found.least.items())
            continue
        moved = move(config, found, 1.0)
        assert_good(config, moved, goal, 1.0, margins.d_min(begin))
        assert not moved.fallen


# Found among random postures; each is good by itself.
LEANING_LEFT = (-0.06, 0.47, 0.34, -0.72, 1.18, -0.21, -0.04, -0.71, 0.4, -0.42, 0.74)
CURLED = (0.33, -0.42, 0.13, 0.24, 1.25, 0.45, 0.87, 0.17, -0.99, -0.35, 0.48)
ONE_SIDE = (-0.14, 0.28, -0.34, 0.26, 0.81, 0.89, -0.86, -0.28, 0.53, -0.22, -0.08)
OTHER_SIDE = (-0.15, -0.72, -0.16, 0.68, 1.11, -0.38, 0.34, 0.59, 0.59, -0.89, -0.67)
FOLDED = (-0.02, 0.04, -0.38, -0.23, 1.24, -0.79, -0.73, -0.93, -0.01, 0.21, 0.07)
FLAT = (0.0,) * 11


@pytest.mark.parametrize(
    ("start", "goal", "order"),
    [
        (LEANING_LEFT, FLAT, Order.BODY_FIRST),
        (FLAT, CURLED, Order.HEAD_FIRST),
        (ONE_SIDE, OTHER_SIDE, Order.HEAD_DOWN),
    ],
)
def test_where_all_at_once_would_fall_it_moves_one_after_the_other(start, goal, order):
    start, goal = np.array(start), np.array(goal)
    found = PostureWays(PAPER.robot, PAPER.supervisor).find(start, goal)
    assert found.order is order
    assert found.text.startswith(order.value)
    assert "all joints at once: falling (d_min" in found.text
    moved = move(PAPER, found)
    assert_good(PAPER, moved, goal, 0.5, 1.0)
    assert not moved.fallen
    # All at once it would have come below the limit indeed.
    direct = dataclasses.replace(found, corners=(start, goal), least={})
    assert move(PAPER, direct).lowest_d_min < PAPER.supervisor.d_min_stop_m


def test_a_posture_that_no_order_reaches_is_refused_with_what_is_in_each_of_them():
    found = PostureWays(PAPER.robot, PAPER.supervisor).find(np.array(FLAT), np.array(FOLDED))
    assert found.corners == ()
    for order in Order:
        assert f"{order.value}: falling (d_min" in found.text


@pytest.mark.parametrize(
    ("joint", "angle", "words"),
    [
        (5, -0.3, "the posture itself: the floor (the head part would be"),
        (7, 2.5, "the posture itself: falling (d_min"),
    ],
)
def test_a_posture_that_is_bad_itself_says_why(joint, angle, words):
    goal = np.array(FLAT)
    goal[joint - 1] = angle
    found = PostureWays(PAPER.robot, PAPER.supervisor).find(np.array(FLAT), goal)
    assert found.text.startswith(words)


def test_a_robot_that_leans_may_come_up_but_not_lean_further():
    """Here the head hangs where nothing holds it: d_min is negative at the start."""
    leaning = named(PAPER, "start")
    leaning[:5] = (0.0, 1.2, 0.0, 0.9, 0.4)
    margins = PostureMargins(PAPER.robot, PAPER.supervisor)
    assert margins.d_min(leaning) < -0.002
    ways = PostureWays(PAPER.robot, PAPER.supervisor)
    up = ways.find(leaning, named(PAPER, "start"))
    assert up.order is Order.AT_ONCE
    further = leaning.copy()
    further[1] = 1.4
    assert ways.find(leaning, further).text.startswith("the posture itself: falling")


def test_a_move_that_is_about_to_tip_the_robot_all_the_same_ends_at_once():
    ways = PostureWays(PAPER.robot, PAPER.supervisor)
    start, goal = np.array(FLAT), np.array(FOLDED)
    good = ways.find(start, named(PAPER, "start"))
    # The way that all orders are refused for, with the margins of one that is good.
    moved = move(PAPER, dataclasses.replace(good, corners=(start, goal)))
    assert moved.phase is Phase.STOPPED
    assert moved.danger.startswith("falling (d_min 1")
    assert moved.lowest_d_min > 1e-3
    # Margins that were not looked at are not watched.
    assert move(PAPER, dataclasses.replace(good, corners=(start, goal), least={})).fallen
