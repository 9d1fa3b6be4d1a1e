"""A robot in lockstep as motion capture and a driver see it, with a fault that can be planted.

Noise, delay and filter of the pose are in the loop, and so are the servos' ticks. A wrong direction
or swapped ids change what the driver commands and what it reads alike, so the controller believes
in a posture that is not there.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from snake_control.config import Config, RobotConfig
from snake_control.control.head_filter import HeadEstimate, HeadFilter
from snake_control.control.pose_watch import PoseWatch, Verdict
from snake_control.control.supervisor import Supervisor
from snake_control.experiment.servos import LimitedServos
from snake_control.mock.motion_capture import MotionCapture, Noise
from snake_control.model.constraints import lateral_map, lateral_velocities
from snake_control.model.geometry import planar_base
from snake_control.model.rotation import (
    quaternion_from_rpy,
    rotation_from_rpy,
    rpy_from_rotation,
    unwrap_near,
)
from snake_control.plant.kinematic import KinematicPlant
from snake_control.trajectory.configured import configured_trajectory

PERIOD_S = 0.02
CAPTURES = 2
"""Poses for each control cycle: 100 in a second."""


@dataclasses.dataclass(frozen=True)
class Planted:
    """What is wrong with a robot; nothing by default.

    Attributes:
        flipped: joint whose direction is wrong, from 1.
        swapped: two joints whose ids are exchanged, from 1.
        offset: where the marker really is in the frame of the head, (3,) [m].
        slip: share by which each of the wheeled links named here (from the front, from 0) gives way
            to what the joints do to it.
        skid_m_s: speed at which the base slides to its left.
        slips_from_s: time at which slip and skid begin [s].
        zeros_rad: error of every joint's zero, of random sign [rad].
        early_s: how much too early the poses are stamped [s].
    """

    flipped: int = 0
    swapped: tuple[int, int] | None = None
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    slip: tuple[tuple[int, float], ...] = ()
    skid_m_s: float = 0.0
    slips_from_s: float = 0.0
    zeros_rad: float = 0.0
    early_s: float = 0.0

    def mapping(self, joints: int) -> np.ndarray:
        """Angles that the driver reports per true ones; its own inverse."""
        mapping = np.eye(joints)
        if self.flipped:
            mapping[self.flipped - 1, self.flipped - 1] = -1.0
        if self.swapped:
            a, b = self.swapped
            mapping[[a - 1, b - 1]] = mapping[[b - 1, a - 1]]
        return mapping


class SlippingPlant(KinematicPlant):
    """Wheels that give way to a share of what the joints do to them, and a base that may skid."""

    def __init__(self, robot: RobotConfig, planted: Planted) -> None:
        self.slipping = False
        self._given_way = np.ones(len(robot.wheeled_links))
        for wheel, share in planted.slip:
            self._given_way[wheel] -= share
        self._skid = planted.skid_m_s
        super().__init__(robot)

    def _base_velocity(self, phi, base, phi_dot):
        rate, slip = super()._base_velocity(phi, base, phi_dot)
        if not self.slipping:
            return rate, slip
        n_h = self._s.n_h
        links = planar_base(self._s, phi[n_h:])
        pushed = self._given_way * lateral_velocities(links, phi_dot[n_h:])
        x, y, turn = np.linalg.lstsq(lateral_map(links), -pushed, rcond=1e-9)[0]
        y += self._skid
        c, s = np.cos(base[2]), np.sin(base[2])
        return np.array((c * x - s * y, s * x + c * y, turn)), slip


@dataclasses.dataclass(frozen=True)
class Watched:
    """One cycle: time, what the watch says, the head pose, and what the filter makes of it."""

    t: float
    verdict: Verdict
    w: np.ndarray
    fallen: bool


def watched_run(
    config: Config,
    duration_s: float,
    seed: int,
    planted: Planted = Planted(),
    watch: PoseWatch | None = None,
    noise: Noise = Noise(0.0005, 0.002),  # noqa: B008  frozen
    delay_s: float = 0.02,
    moves: bool = True,
) -> Iterator[Watched]:
    """Run the configured motion with the supervised controller in the loop, and watch it."""
    robot = config.robot
    rng = np.random.default_rng(seed)
    mapping = planted.mapping(robot.joints)
    offset = np.array(planted.offset)
    zeros = planted.zeros_rad * rng.choice((-1.0, 1.0), robot.joints)
    plant = SlippingPlant(robot, planted)
    start = np.array(robot.start_joint_angles_rad)
    # No two runs begin in quite the same posture.
    state = plant.reset(start + rng.normal(0.0, 0.02, robot.joints))
    cameras = MotionCapture(noise, delay_s, rng)
    filter_ = HeadFilter(3.0, 0.1)
    servos = LimitedServos(robot)
    servos.reset(mapping @ state.phi + zeros)
    guide = Supervisor(robot, config.controller, config.supervisor, PERIOD_S)
    watch = PoseWatch(robot) if watch is None else watch
    goal = configured_trajectory(config.trajectory_generator, state.w)
    w: np.ndarray | None = None
    own_t, scale = 0.0, 1.0
    for step in range(round(duration_s / PERIOD_S)):
        t = step * PERIOD_S
        plant.slipping = t >= planted.slips_from_s
        phi = servos.measure(mapping @ state.phi + zeros)
        watch.joints(round(t * 1e9), phi)
        u = np.zeros(robot.joints)
        if w is not None and moves:
            reference = dataclasses.replace(goal.sample(own_t), time_scale=scale)
            result = guide.step(np.concatenate((w, phi)), None, reference, t)
            u, scale = result.u, result.reference_scale
            own_t += PERIOD_S * scale
        joints = mapping.T @ servos.command(u, mapping @ state.phi + zeros, PERIOD_S)
        for k in range(CAPTURES):
            now = t + k * PERIOD_S / CAPTURES
            attitude = rotation_from_rpy(state.w[3:])
            cameras.capture(now, state.w[:3] + attitude @ offset, quaternion_from_rpy(state.w[3:]))
            for pose in cameras.report(now + 1e-9):
                stamp = round(pose.time * 1e9)
                watch.pose(stamp - round(planted.early_s * 1e9), pose.position, pose.quaternion)
                estimate = filter_.update(stamp, pose.position, pose.quaternion)
                assert isinstance(estimate, HeadEstimate)
                rpy = rpy_from_rotation(estimate.rotation.as_matrix())
                rpy = rpy if w is None else unwrap_near(rpy, w[3:])
                w = np.concatenate((estimate.position, rpy))
            state = plant.step(joints, PERIOD_S / CAPTURES)
        yield Watched(t, watch.verdict, state.w, state.fallen)
