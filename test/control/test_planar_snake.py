"""The shipped planar snake follows a line, and its SCPs keep it from turning singular."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest

from snake_control.config import ControllerConfig, load
from snake_control.control.reference import Reference
from snake_control.control.scp_controller import ScpController
from snake_control.experiment.lockstep import LockstepSample, lockstep
from snake_control.plant.kinematic import KinematicPlant
from snake_control.trajectory.line import Line
from support.robots import CONFIG

SHIPPED = load(CONFIG / "planar_snake.yaml")
STILL = ControllerConfig(case=1, K=SHIPPED.controller.K)


@functools.cache
def run(gains: ControllerConfig) -> list[LockstepSample]:
    plant = KinematicPlant(SHIPPED.robot)
    state = plant.reset(SHIPPED.robot.start_joint_angles_rad)
    generator = SHIPPED.trajectory_generator
    line = Line(generator.start_pose, generator.velocity, 0.0)
    controller = ScpController(SHIPPED.robot, gains)
    return list(lockstep(plant, state, controller, line.sample, 40.0, 0.02))


def V_b1(gains: ControllerConfig) -> list[float]:
    return [sample.result.V_b1 for sample in run(gains)]


def test_head_follows_the_line():
    for sample in run(SHIPPED.controller):
        np.testing.assert_allclose(sample.result.error, 0.0, atol=5e-3)
        assert np.abs(sample.state.slip).max() < 5e-3
        np.testing.assert_array_equal(sample.state.effort, 0.0)
    np.testing.assert_allclose(
        run(SHIPPED.controller)[-1].state.w, [0.8, 0, 0.02, 0, 0, 0], atol=5e-3
    )


def test_moving_scps_keep_it_from_turning_singular():
    start = V_b1(STILL)[0]
    assert V_b1(SHIPPED.controller)[0] == start
    assert min(V_b1(SHIPPED.controller)) > 0.3 * start
    assert min(V_b1(STILL)) < 1e-6 * start
    assert SHIPPED.robot.base_scp_joints == (3, 6)
    for sample in run(STILL):
        np.testing.assert_array_equal(sample.result.phi_tilde_dot_d, 0.0)
    for joint in SHIPPED.robot.base_scp_joints:
        angles = [sample.state.phi[joint - 1] for sample in run(SHIPPED.controller)]
        assert np.ptp(angles) > 0.3


def test_z_roll_and_pitch_of_reference_gains_and_measurement_count_for_nothing():
    robot = SHIPPED.robot
    gains = dataclasses.replace(SHIPPED.controller, K=(0.4, 0.25, 9.0, 9.0, 9.0, 0.1))
    sample = run(SHIPPED.controller)[500]
    q = np.concatenate((sample.state.w, sample.state.phi))
    reference = Reference(sample.result.w_d, sample.result.w_d_dot)
    noise = np.array([0.0, 0.0, 0.7, 0.3, -0.2, 0.0])
    moved = Reference(reference.w_d - noise, reference.w_d_dot + noise)
    expected = ScpController(robot, SHIPPED.controller).step(q, None, reference, 0.0)
    found = ScpController(robot, gains).step(q + np.pad(noise, (0, robot.joints)), None, moved, 0.0)
    np.testing.assert_array_equal(found.u, expected.u)
    np.testing.assert_array_equal(found.error, expected.error)
    assert found.error[2:5] == pytest.approx([0.0, 0.0, 0.0])
