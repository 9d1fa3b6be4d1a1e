"""The internal motion as a command, in lockstep with the plant."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from snake_control.config import Config, load
from snake_control.control.barriers import Limit
from snake_control.control.joint_motion import Phase
from snake_control.control.reference import Reference
from snake_control.control.reshape_motion import ReshapeMotion
from snake_control.control.supervisor import Supervisor
from snake_control.model.bodies import Bodies
from snake_control.model.floor import head_pose_on_floor
from snake_control.model.internal_motion import internal_motion_basis
from snake_control.model.rotation import wrap
from snake_control.plant.kinematic import KinematicPlant
from support.robots import CONFIG

DT = 0.02
PAPER = load(CONFIG / "paper_robot.yaml")
PLANAR = load(CONFIG / "planar_snake.yaml")


@dataclasses.dataclass
class Reshaped:
    phase: Phase
    phi: np.ndarray
    took: float
    planned: float
    head_m: float
    head_rad: float
    lowest_d_min: float
    slowest: float
    limits: set
    danger: str


def reshape(config: Config, wanted, speed=0.2, phi=None, stop_at=np.inf, longest=40.0) -> Reshaped:
    """Reshape a robot that does what it is told, supervised."""
    robot = config.robot
    plant = KinematicPlant(robot, 0.01)
    state = plant.reset(robot.start_joint_angles_rad if phi is None else phi)
    supervisor = Supervisor(robot, config.controller, config.supervisor, DT)
    w = state.w
    q = np.concatenate((w, state.phi))
    own = config.scp_controller
    motion = ReshapeMotion(robot, own, config.supervisor, q, wanted, speed, 0.0)
    t, head_m, head_rad, lowest, slowest, limits = 0.0, 0.0, 0.0, state.d_min, 1.0, set()
    while t < longest:
        if t >= stop_at:
            motion.stop()
        step = motion.step(state.phi, t)
        if step.motion.phase.over or step.danger:
            break
        q = np.concatenate((state.w, step.phi))
        result = supervisor.step(q, None, step.reference, t)
        motion.heed(result.u, result.reference_scale)
        slowest = min(slowest, result.reference_scale)
        if result.bound is not None:
            limits.add(result.bound.limit)
        state = plant.step(result.u, DT)
        off = state.w - w
        head_m = max(head_m, float(np.linalg.norm(off[:3])))
        head_rad = max(head_rad, float(np.abs(wrap(off[3:])).max()))
        lowest = min(lowest, state.d_min)
        t += DT
    phase = step.motion.phase
    planned = motion.duration
    return Reshaped(
        phase, state.phi, t, planned, head_m, head_rad, lowest, slowest, limits, step.danger
    )


@pytest.mark.parametrize("turn", [0.3, -0.3])
@pytest.mark.parametrize("config", [PAPER, PLANAR], ids=["paper", "planar"])
def test_each_scp_turns_and_the_head_stands_still(config, turn):
    start = np.array(config.robot.start_joint_angles_rad)
    for joint in config.robot.scp_joints:
        done = reshape(config, {joint: start[joint - 1] + turn})
        assert done.phase is Phase.ARRIVED
        assert done.phi[joint - 1] == pytest.approx(start[joint - 1] + turn, abs=0.02)
        assert done.head_m < 1e-3
        assert done.head_rad < 2e-3
        assert done.planned - DT < done.took < done.planned + 1.0
        others = [other - 1 for other in config.robot.scp_joints if other != joint]
        np.testing.assert_allclose(done.phi[others], start[others], atol=2e-3)
        assert done.lowest_d_min > config.supervisor.d_min_stop_m


def test_several_at_once_arrive_together_and_the_way_back_leads_back():
    start = np.array(PAPER.robot.start_joint_angles_rad)
    there = reshape(PAPER, {3: 0.2, 8: 0.3, 10: -0.8})
    assert there.phase is Phase.ARRIVED
    np.testing.assert_allclose(there.phi[[2, 7, 9]], [0.2, 0.3, -0.8], atol=0.02)
    assert there.head_m < 1e-3
    assert there.head_rad < 2e-3
    back = reshape(PAPER, {j: start[j - 1] for j in PAPER.robot.scp_joints}, phi=there.phi)
    np.testing.assert_allclose(back.phi[PAPER.robot.head_links :], start[5:], atol=0.06)
    assert back.head_m < 1e-3


def test_the_joints_move_along_the_papers_basis():
    phi = np.array(PAPER.robot.start_joint_angles_rad)
    w = head_pose_on_floor(PAPER.robot, phi, np.zeros(3))
    supervisor = Supervisor(PAPER.robot, PAPER.controller, PAPER.supervisor, DT)
    scps = np.array([0.05, -0.02, 0.01, 0.02])
    reference = Reference(w, np.zeros(6), phi_tilde_dot_d=scps)
    result = supervisor.step(np.concatenate((w, phi)), None, reference, 0.0)
    N = internal_motion_basis(result.posture.k)
    np.testing.assert_allclose(result.u, N @ scps, atol=1e-9)
    np.testing.assert_array_equal(result.phi_tilde_dot_d, scps)
    bare = dataclasses.replace(PAPER.supervisor, enabled=False)
    law = Supervisor(PAPER.robot, PAPER.controller, bare, DT)
    plain = law.step(np.concatenate((w, phi)), None, reference, 0.0)
    np.testing.assert_allclose(plain.u, N @ scps, atol=1e-9)


def test_a_stop_leaves_scps_and_head_at_rest():
    done = reshape(PAPER, {8: -0.5}, speed=0.4, stop_at=1.5)
    assert done.phase is Phase.STOPPED
    assert 1.5 < done.took < 2.5
    assert -0.4 < done.phi[7] < 0.45
    assert done.head_m < 2e-3


@pytest.mark.parametrize(
    ("joint", "angle", "limit"),
    [(3, 1.6, Limit.SINGULAR_HEAD), (10, -1.6, Limit.SINGULAR_BODY), (6, 1.9, Limit.FALL)],
)
def test_a_limit_slows_it_down_and_ends_it_where_it_would_be_passed(joint, angle, limit):
    supervisor = dataclasses.replace(PAPER.supervisor, d_min_warn_m=0.02, d_min_stop_m=0.015)
    config = dataclasses.replace(PAPER, supervisor=supervisor)
    done = reshape(config, {joint: angle}, speed=0.5)
    assert done.phase is Phase.GIVEN_UP
    assert limit in done.limits
    assert done.slowest < 0.1
    assert done.lowest_d_min > supervisor.d_min_stop_m - 1e-4
    assert done.head_m < 1e-3
    assert done.head_rad < 2e-3


def test_a_body_that_curls_up_stops_before_it_is_in_itself():
    """With the supervisor's own limits out of the way: it knows nothing of that."""
    supervisor = dataclasses.replace(
        PAPER.supervisor, nearness_warn=1.0, nearness_stop=1.0, d_min_warn_m=0.0, d_min_stop_m=0.0
    )
    config = dataclasses.replace(PAPER, supervisor=supervisor)
    done = reshape(config, {6: 2.3, 8: 2.3, 10: 2.3}, speed=0.5)
    assert done.danger.startswith("the robot itself (two links would be")
    assert Bodies(PAPER.robot, done.phi).self_clearance > -3e-3
