import dataclasses

import numpy as np
import pytest

from snake_control.mock.mechanics import MotorParameters
from snake_control.mock.parameters import ServoParameters
from snake_control.mock.servo import Servo
from snake_control.mock.simulation import (
    LARGEST_LAG_S,
    BodySimulation,
    Mounting,
    Simulation,
    Snapshot,
)

STEP_S = 0.01
MOUNTINGS = (Mounting(), Mounting(-1, 0.1))


@dataclasses.dataclass
class State:
    phi: np.ndarray
    effort: np.ndarray


class Arm:
    """Joints that add up what they are told, each under a constant load."""

    def __init__(self, phi, effort):
        self.state = State(np.array(phi, dtype=float), np.array(effort, dtype=float))
        self.steps: list[float] = []

    def step(self, joint_command, dt):
        self.steps.append(dt)
        self.state = State(self.state.phi + np.asarray(joint_command) * dt, self.state.effort)
        return self.state


def make(phi=(0.3, -0.2), effort=(0.0, 0.0), mountings=MOUNTINGS, **options):
    arm = Arm(phi, effort)
    parameters = ServoParameters(MotorParameters(friction_torque_nm=0.0))
    servos = [
        Servo(i, parameters, angle_rad=m.servo_angle(p))
        for i, (m, p) in enumerate(zip(mountings, phi, strict=True), start=1)
    ]
    simulation = BodySimulation(servos, mountings, arm, arm.state, STEP_S, 0.0, **options)
    return simulation, servos, arm


def run_until(simulation: Simulation, end: float) -> None:
    while simulation.next_step_at <= end + 1e-9:
        assert simulation.step_if_due(simulation.next_step_at)


def test_a_step_is_done_when_its_time_has_come():
    simulation = Simulation([Servo(1)], STEP_S, start=5.0)

    assert not simulation.step_if_due(5.0 + 0.9 * STEP_S)
    assert simulation.step_if_due(5.0 + STEP_S)
    assert simulation.time == pytest.approx(5.0 + STEP_S)


def test_a_short_stall_is_caught_up():
    simulation = Simulation([Servo(1)], STEP_S, start=0.0)

    assert sum(simulation.step_if_due(0.0751) for _ in range(100)) == 7


def test_of_a_long_stall_only_the_end_is_caught_up():
    servo = Servo(1)
    for name, value in (("torque_enable", 1), ("moving_speed", 100), ("goal_position", 1023)):
        servo.store(name, value)
    simulation = Simulation([servo], STEP_S, start=0.0)

    steps = sum(simulation.step_if_due(60.0) for _ in range(10_000))

    assert steps * STEP_S == pytest.approx(LARGEST_LAG_S, abs=1.5 * STEP_S)
    assert servo.motion.angle_rad < 0.15
    assert 60.0 - simulation.time < STEP_S


def test_joints_follow_their_servos_through_direction_and_offset():
    simulation, servos, arm = make()
    for servo, goal in zip(servos, (600, 450), strict=True):
        servo.store("torque_enable", 1)
        servo.store("moving_speed", 100)
        servo.store("goal_position", goal)
    run_until(simulation, 1.0)

    expected = [
        m.direction * (s.motion.angle_rad - m.zero_offset_rad)
        for m, s in zip(MOUNTINGS, servos, strict=True)
    ]
    np.testing.assert_allclose(arm.state.phi, expected, atol=1e-12)
    assert abs(arm.state.phi[1] - -0.2) > 0.05


def test_efforts_load_the_servos_through_their_direction():
    simulation, servos, _ = make(effort=(0.5, 0.5), held_until_torque_on=False)
    start = [servo.motion.angle_rad for servo in servos]
    run_until(simulation, 0.2)

    assert servos[0].motion.angle_rad < start[0]
    assert servos[1].motion.angle_rad > start[1]


def test_the_body_is_held_until_the_first_servo_is_driven():
    simulation, servos, arm = make(effort=(0.5, 0.5))
    run_until(simulation, 0.5)
    assert simulation.held
    np.testing.assert_array_equal(arm.state.phi, [0.3, -0.2])

    servos[0].store("torque_enable", 1)
    run_until(simulation, 1.0)
    assert not simulation.held
    assert arm.state.phi[1] < -0.25
    servos[0].store("torque_enable", 0)
    run_until(simulation, 1.1)
    assert not simulation.held


def test_time_and_snapshots_go_on_while_the_body_is_held():
    seen: list[Snapshot[State]] = []
    simulation, _, _ = make(on_snapshot=seen.append)
    run_until(simulation, 0.1)

    assert [s.time for s in seen] == pytest.approx(np.arange(1, 11) * STEP_S)


def test_the_body_may_step_less_often_than_the_servos():
    seen: list[Snapshot[State]] = []
    simulation, servos, arm = make(steps_per_body_step=4, on_snapshot=seen.append)
    servos[0].store("torque_enable", 1)
    servos[0].store("moving_speed", 100)
    servos[0].store("goal_position", 1023)
    run_until(simulation, 0.41)

    assert arm.steps == pytest.approx([4 * STEP_S] * 10)
    assert [s.time for s in seen] == pytest.approx(np.arange(1, 11) * 4 * STEP_S)
    # One step of the servo has passed since the body's last.
    assert servos[0].motion.angle_rad - arm.state.phi[0] == pytest.approx(
        1.16239 * STEP_S, rel=1e-3
    )


def test_every_servo_needs_its_mounting():
    with pytest.raises(ValueError, match="mounting"):
        BodySimulation([Servo(1)], MOUNTINGS, Arm([0], [0]), None, STEP_S, 0.0)


def test_the_body_needs_steps():
    with pytest.raises(ValueError, match="steps_per_body_step"):
        make(steps_per_body_step=0)


@pytest.mark.parametrize("values", [(0, 0.0), (2, 0.0), (1, float("nan"))])
def test_impossible_mountings_are_refused(values):
    with pytest.raises(ValueError, match="mounting"):
        Mounting(*values)


def test_a_step_must_take_time():
    with pytest.raises(ValueError, match="step_s"):
        Simulation([], 0.0, 0.0)
