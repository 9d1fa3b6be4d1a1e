"""Lowering to a pose: straight there, all together, and given up when nothing moves any more."""

from __future__ import annotations

import itertools

import pytest

from snake_control.ax12.lowering import PATIENCE_S, TOLERANCE_RAD, Lowering, Phase, Step

DT = 0.02
SPEED = 0.2


class Joints:
    """Joints that do what they are told, each at its own share; their readings are in ticks."""

    TICK = 0.00512

    def __init__(self, angles: list[float], obedience: list[float] | None = None) -> None:
        self.angles = list(angles)
        self.obedience = obedience or [1.0] * len(angles)
        self.now = 100.0
        self.steps: list[Step] = []

    def lower(self, lowering: Lowering, longest_s: float) -> Step:
        for _ in range(round(longest_s / DT)):
            readings = [round(angle / self.TICK) * self.TICK for angle in self.angles]
            step = lowering.step(readings, self.now)
            self.steps.append(step)
            if step.phase is not Phase.MOVING:
                return step
            for i, velocity in enumerate(step.velocities):
                self.angles[i] += self.obedience[i] * velocity * DT
            self.now += DT
        raise AssertionError(f"no end after {longest_s} s: {self.angles}")


@pytest.mark.parametrize("speed", [0.02, 0.2, 2.0])
def test_all_joints_arrive_together_at_the_pose(speed: float) -> None:
    joints = Joints([1.1, -0.4, 0.0, -0.1])
    pose = [0.1, 0.1, 0.0, -0.1]
    step = joints.lower(Lowering(pose, speed, joints.now), 1.2 * 1.0 / speed + 2.0)
    assert step.phase is Phase.DONE
    assert set(step.velocities) == {0.0}
    for angle, goal in zip(joints.angles, pose, strict=True):
        assert abs(angle - goal) <= TOLERANCE_RAD + Joints.TICK
    # The ways are 1.0 and 0.5: half way down the second has half of its way to go, too.
    half = next(s for s in joints.steps if s.distance <= 0.5)
    assert half.velocities[1] == pytest.approx(-0.5 * half.velocities[0], rel=0.05)
    assert max(abs(v) for s in joints.steps for v in s.velocities) <= speed + 1e-9


def test_it_starts_and_ends_slowly_enough_to_stop_within_the_tolerance() -> None:
    joints = Joints([1.0])
    joints.lower(Lowering([0.0], 2.0, joints.now), 5.0)
    last = joints.steps[-2]
    assert abs(last.velocities[0]) * DT < 0.5 * last.distance
    assert joints.angles[0] > -TOLERANCE_RAD


def test_a_joint_that_lags_is_waited_for() -> None:
    joints = Joints([1.0, 1.0], obedience=[1.0, 0.5])
    step = joints.lower(Lowering([0.0, 0.0], SPEED, joints.now), 15.0)
    assert step.phase is Phase.DONE
    between = [s for s in joints.steps if 0.2 < s.distance < 0.5]
    assert all(s.farthest == 1 for s in between)


def test_a_blocked_joint_is_named_and_nothing_moves_any_more() -> None:
    joints = Joints([1.0, 0.3, 0.5], obedience=[1.0, 0.0, 1.0])
    step = joints.lower(Lowering([0.0, 0.0, 0.0], SPEED, joints.now), 60.0)
    assert step.phase is Phase.GIVEN_UP
    assert step.farthest == 1
    assert step.distance == pytest.approx(0.3, abs=Joints.TICK)
    assert set(step.velocities) == {0.0}


def test_a_robot_that_does_not_move_at_all_is_given_up_after_its_patience() -> None:
    joints = Joints([1.0], obedience=[0.0])
    joints.lower(Lowering([0.0], SPEED, joints.now), 10.0)
    assert joints.now - 100.0 == pytest.approx(PATIENCE_S, abs=3 * DT)


def test_a_joint_that_trembles_makes_no_progress() -> None:
    lowering = Lowering([0.0], SPEED, 0.0)
    times = itertools.count()
    for i in times:
        step = lowering.step([0.5 + (0.004 if i % 2 else -0.004)], i * DT)
        if step.phase is Phase.GIVEN_UP:
            break
        assert i * DT < 2.0 * PATIENCE_S


def test_a_robot_that_is_there_is_done_at_once() -> None:
    assert Lowering([0.1, -0.2], SPEED, 0.0).step([0.11, -0.19], 0.0).phase is Phase.DONE


def test_a_joint_without_a_goal_stays() -> None:
    joints = Joints([1.0, 2.0])
    step = joints.lower(Lowering([0.0, None], SPEED, joints.now), 10.0)
    assert step.phase is Phase.DONE
    assert joints.angles[1] == 2.0
