"""The supervisor: (22) where nothing is near, and what it does where something is."""

from __future__ import annotations

import dataclasses
import importlib

import numpy as np
import pytest

from snake_control.config import Config, RobotConfig, SupervisorConfig, load
from snake_control.control.barriers import Barriers, Limit
from snake_control.control.escape import Escape
from snake_control.control.reference import Reference
from snake_control.control.scp_controller import ScpController
from snake_control.control.supervisor import HOLDING_AFTER_S, HOLDING_BELOW, Supervisor
from snake_control.errors import ModelError
from snake_control.experiment.cases import config_directory, load_case
from snake_control.experiment.guided import GuidedRobot
from snake_control.model.bodies import Bodies
from snake_control.model.floor import geometry_on_floor, head_pose_on_floor
from snake_control.model.floor_clearance import floor_clearance
from snake_control.model.posture import Posture
from snake_control.trajectory.approach import Approach
from snake_control.trajectory.hold import Hold
from snake_control.trajectory.line import Line
from support.experiments import LONG_ROBOT
from support.robots import ROBOTS, random_q

DT = 0.02


def supervisor(config: Config, **changes: object) -> Supervisor:
    own = dataclasses.replace(config.supervisor, **changes)  # type: ignore[arg-type]
    return Supervisor(config.robot, config.controller, own, DT)


@pytest.fixture(scope="module")
def config() -> Config:
    return load_case((), 3)


@pytest.fixture(scope="module")
def start(config: Config) -> np.ndarray:
    phi = np.array(config.robot.start_joint_angles_rad)
    return np.concatenate((head_pose_on_floor(config.robot, phi, np.zeros(3)), phi))


@pytest.fixture(scope="module")
def table_1(config: Config) -> Reference:
    own = config.trajectory_generator
    return Reference(np.array(own.start_pose), np.array(own.velocity))


def settled(config: Config, made: Supervisor, q: np.ndarray, reference: Reference):
    """The answer once the acceleration limit has nothing to do any more."""
    for k in range(20):
        result = made.step(q, None, reference, DT * k)
    assert not result.accelerating
    return result


def test_far_from_all_limits_it_is_the_law_to_the_last_digit(
    config: Config, start: np.ndarray, table_1: Reference
) -> None:
    law = ScpController(config.robot, config.controller).step(start, None, table_1, 0.0)
    result = settled(config, supervisor(config), start, table_1)
    np.testing.assert_array_equal(result.u, law.u)
    np.testing.assert_array_equal(result.phi_tilde_dot_d, law.phi_tilde_dot_d)
    assert (result.reference_scale, result.feedback_scale, result.scp_scale) == (1.0, 1.0, 1.0)
    assert result.bound is None
    assert result.escaping == {}
    assert not result.holding


def test_switched_off_it_is_the_law_whatever_is_near(
    config: Config, start: np.ndarray, table_1: Reference
) -> None:
    far = Reference(table_1.w_d + [0.2, 0, 0.1, 0, 0, 0], 50 * table_1.w_d_dot)
    law = ScpController(config.robot, config.controller).step(start, None, far, 0.0)
    result = supervisor(config, enabled=False).step(start, None, far, 0.0)
    np.testing.assert_array_equal(result.u, law.u)
    assert (result.speed_scale, result.speed_limited) == (law.speed_scale, law.speed_limited)


def test_the_reference_is_slowed_before_the_correction_of_the_error(
    config: Config, start: np.ndarray, table_1: Reference
) -> None:
    quick = Reference(table_1.w_d, 60 * table_1.w_d_dot)
    result = settled(config, supervisor(config, d_min_warn_m=0.0, d_min_stop_m=0.0), start, quick)
    assert result.bound is not None
    assert 0.0 < result.reference_scale < 1.0
    assert (result.feedback_scale, result.scp_scale) == (1.0, 1.0)
    # All of the correction, and as much of the reference's rate.
    law = ScpController(config.robot, config.controller)
    posture, error = law.look(start, quick)
    scps = law.sub_tasks(posture, [0.0] * 6)
    w_dot = np.array(law.feedback(posture, error)) + result.speed_scale * quick.w_d_dot
    expected = posture.k.joint_velocities(w_dot.tolist(), scps.tolist())
    np.testing.assert_allclose(result.u, expected, rtol=1e-6, atol=1e-9)


def test_the_reference_speeds_up_again_slowly(
    config: Config, start: np.ndarray, table_1: Reference
) -> None:
    made = supervisor(config, scale_rise_per_s=0.5)
    quick = Reference(table_1.w_d, 60 * table_1.w_d_dot)
    slowed = settled(config, made, start, quick).reference_scale
    scales = [made.step(start, None, table_1, 1.0 + DT * k).reference_scale for k in range(15)]
    np.testing.assert_allclose(np.diff(scales), 0.5 * DT, atol=1e-12)
    assert scales[0] == pytest.approx(slowed + 0.5 * DT)


def test_speeds_change_no_faster_than_allowed_and_the_wheels_go_on_rolling(
    config: Config, start: np.ndarray, table_1: Reference
) -> None:
    made = supervisor(config, acceleration_limit_rad_s2=5.0)
    before = np.zeros(11)
    final = settled(config, supervisor(config), start, table_1).u
    for k in range(30):
        result = made.step(start, None, table_1, DT * k)
        assert np.abs(result.u - before).max() <= 5.0 * DT + 1e-12
        if result.accelerating:
            # The same posture: a share of the final motion.
            share = result.u[5] / final[5]
            np.testing.assert_allclose(result.u, share * final, atol=1e-9)
        before = result.u
    np.testing.assert_allclose(before, final, atol=1e-9)
    made.rest()
    assert made.step(start, None, table_1, 1.0).accelerating


def test_near_falling_the_scps_regain_the_margin_while_the_head_goes_on(config: Config) -> None:
    robot = GuidedRobot(config)
    own = config.trajectory_generator
    line = Line(np.array(own.start_pose), own.velocity, 0.0)
    seen = list(robot.follow(line.sample, 8.0, 20.0))
    results = [s.result for s in seen if s.result is not None]
    escaping = [r for r in results if Limit.FALL in r.escaping]
    assert escaping, "the transient of Table 1 comes near falling"
    assert min(s.state.d_min for s in seen) > config.supervisor.d_min_stop_m - 1e-4
    assert seen[-1].state.d_min > config.supervisor.d_min_warn_m
    # An urgent escape fades the sub-tasks.
    worst = max(escaping, key=lambda r: r.escaping[Limit.FALL])
    assert worst.escaping[Limit.FALL] > 0.3


def test_a_danger_stays_in_the_list_until_it_is_well_over(config: Config) -> None:
    robot = GuidedRobot(config)
    own = config.trajectory_generator
    line = Line(np.array(own.start_pose), own.velocity, 0.0)
    flags = [
        Limit.FALL in s.result.escaping
        for s in robot.follow(line.sample, 10.0, 20.0)
        if s.result is not None
    ]
    changes = int(np.abs(np.diff(np.array(flags, dtype=int))).sum())
    assert 1 <= changes <= 4


def test_it_holds_and_says_so_and_goes_on_at_once_when_led_away(config: Config) -> None:
    robot = GuidedRobot(config)
    level = np.array([0.0, 0.0, 0.2, 0.39, 0.39, 0.0])
    for _ in robot.follow(Approach(Hold(level), robot.state.w, 0.0, 10.0).sample, 14.0, 40.0):
        pass
    up = Line(robot.state.w, (0.0, 0.0, 0.02, 0.0, 0.0, 0.0), 0.0)
    seen = list(robot.follow(up.sample, 20.0, 30.0))
    results = [s.result for s in seen if s.result is not None]
    first = next(i for i, r in enumerate(results) if r.holding)
    needed = round(HOLDING_AFTER_S / DT)
    scales = [r.reference_scale for r in results]
    assert max(scales[first - needed : first + 1]) <= HOLDING_BELOW
    assert max(scales[: first - needed]) > HOLDING_BELOW
    last = results[-1]
    assert last.holding
    assert last.bound is not None
    assert not robot.state.fallen
    top = robot.state.w[2]
    assert top > 0.22, "it went as far as it could"
    down = Line(robot.state.w, (0.0, 0.0, -0.02, 0.0, 0.0, 0.0), 0.0)
    seen = list(robot.follow(down.sample, 2.0, 4.0))
    assert robot.state.w[2] < top - 0.02
    assert not seen[-1].result.holding  # type: ignore[union-attr]


def test_the_head_is_not_led_into_the_floor(config: Config) -> None:
    """The posture stands well: nothing but the floor is in the way of a head that is lowered."""
    phi = np.array(config.robot.start_joint_angles_rad)
    phi[:5] = [0.2, 0.3, -1.0, -0.3, 0.8]
    heights = {}
    for name, limits in {"limits": {}, "none": {"enabled": False}}.items():
        own = dataclasses.replace(config.supervisor, **limits)  # type: ignore[arg-type]
        robot = GuidedRobot(dataclasses.replace(config, supervisor=own), None, phi)
        down = Line(robot.state.w, (0.0, 0.0, -0.03, 0.0, 0.0, 0.0), 0.0)
        seen = list(robot.follow(down.sample, 6.0, 8.0))
        heights[name] = [Bodies(config.robot, s.state.phi).ground_clearance for s in seen]
        if name == "limits":
            last = seen[-1].result
            assert last is not None
            assert last.holding
            assert last.bound is not None
            assert last.bound.limit is Limit.FLOOR
            top = robot.state.w[2]
            up = Line(robot.state.w, (0.0, 0.0, 0.02, 0.0, 0.0, 0.0), 0.0)
            list(robot.follow(up.sample, 2.0, 4.0))
            assert robot.state.w[2] > top + 0.02
    assert min(heights["limits"]) > config.supervisor.floor_stop_m - 1e-4
    assert min(heights["none"]) < 0.0


@pytest.mark.parametrize("seed", range(6))
def test_near_the_floor_the_scps_lift_the_lowest_link_and_leave_the_head_at_rest(
    config: Config, seed: int
) -> None:
    """Where a link other than the first is the lowest: the head's own height is not theirs."""
    robot = config.robot
    rng = np.random.default_rng(seed)
    while True:
        phi = np.array(robot.start_joint_angles_rad)
        phi[:5] = rng.uniform(-1.2, 1.2, 5)
        lowest = floor_clearance(geometry_on_floor(robot, phi))
        if lowest.link > 1 and 0.0 < lowest.height < 0.05:
            break
    near = dataclasses.replace(config.supervisor, floor_warn_m=0.1)
    posture = Posture(robot, np.concatenate((head_pose_on_floor(robot, phi, np.zeros(3)), phi)))
    escape = Escape(robot, near, Barriers(robot, near))
    scps = escape.velocities(posture, {Limit.FLOOR: 1.0})
    u = np.array(posture.k.joint_velocities([0.0] * 6, scps.tolist()))
    assert np.abs(u).max() == pytest.approx(near.escape_speed_rad_s)
    h = 1e-6
    above = [floor_clearance(geometry_on_floor(robot, phi + s * u)).height for s in (-h, h)]
    assert above[1] > above[0]


def test_a_motion_that_begins_in_a_singular_posture_may_lead_out_by_any_way(
    config: Config,
) -> None:
    phi = np.array(config.robot.start_joint_angles_rad)
    phi[5:] = [0.02, 0.02, 0.02, -0.02, -0.02, -0.02]
    q = np.concatenate((head_pose_on_floor(config.robot, phi, np.zeros(3)), phi))
    ahead = Reference(q[:6], np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0]))
    made = supervisor(config, escape_speed_rad_s=0.0)
    first = made.step(q, None, ahead, 0.0)
    assert first.singular_shape.nearness > config.supervisor.nearness_stop
    assert first.bound is None or first.bound.limit is not Limit.SINGULAR_BODY


@pytest.mark.parametrize("file", ["planar_snake.yaml", "scale_free.yaml"])
def test_other_robots_are_kept_within_their_limits_too(file: str) -> None:
    config = load(config_directory() / file)
    if not config.robot.planar:
        config = dataclasses.replace(config, robot=LONG_ROBOT)
    robot = GuidedRobot(config)
    rush = Line(robot.state.w, (0.3, 0.0, 0.0, 0.0, 0.0, 0.0), 0.0)
    seen = list(robot.insist(rush.sample, 4.0))
    speeds = np.array(config.robot.joint_speed_limits_rad_s)
    assert any(s.result.bound is not None for s in seen)  # type: ignore[union-attr]
    assert all((np.abs(s.result.u) <= speeds * (1 + 1e-9)).all() for s in seen)  # type: ignore[union-attr]
    bounds = np.array(config.robot.joint_limits_rad).reshape(-1, 2)
    assert all(((bounds[:, 0] <= s.state.phi) & (s.state.phi <= bounds[:, 1])).all() for s in seen)
    assert not robot.state.fallen


def test_a_change_of_parameters_does_not_interrupt_a_motion(
    config: Config, start: np.ndarray, table_1: Reference
) -> None:
    before = supervisor(config)
    u = settled(config, before, start, table_1).u
    after = supervisor(config, scale_rise_per_s=0.5)
    after.go_on_from(before)
    result = after.step(start, None, table_1, 1.0)
    assert not result.accelerating
    np.testing.assert_array_equal(result.u, u)


def test_a_gradient_without_bounds_leaves_the_head_its_joint_speeds(config: Config) -> None:
    wild = dataclasses.replace(config, controller=dataclasses.replace(config.controller, a_b=1e6))
    start = GuidedRobot(wild)
    line = Line(start.state.w, (0.01, 0, 0, 0, 0, 0), 0.0)
    seen = list(start.follow(line.sample, 6.0, 20.0))
    took = start.t
    assert took < 9.0
    error = np.abs(seen[-1].state.w - seen[-1].reference.w_d)
    assert error[:3].max() < 0.01
    # The sub-tasks' steps shorten instead of beating to and fro.
    late = np.array([s.result.u for s in seen[-50:] if s.result is not None])
    beats = (np.sign(late[1:]) * np.sign(late[:-1]) < 0) & (np.abs(late[1:]) > 0.5)
    assert beats.mean() < 0.1


@pytest.mark.parametrize(
    ("given", "field"),
    [
        ({"d_min_warn_m": 0.001}, "supervisor.d_min_warn_m"),
        ({"floor_warn_m": 0.001}, "supervisor.floor_warn_m"),
        ({"nearness_warn": 0.99}, "supervisor.nearness_warn"),
        ({"regularity_warn": 0.01}, "supervisor.regularity_warn"),
        ({"approach_rate_per_s": 20.0}, "supervisor.approach_rate_per_s"),
    ],
)
def test_thresholds_that_contradict_each_other_are_refused(
    given: dict[str, float], field: str
) -> None:
    with pytest.raises(ValueError, match=f"^{field}"):
        SupervisorConfig(**given)


@pytest.mark.parametrize("robot", list(ROBOTS.values()), ids=list(ROBOTS))
@pytest.mark.parametrize("rotation_error", ["rpy", "rotation_vector"])
@pytest.mark.parametrize("scp_law", ["gradient", "projection"])
def test_what_was_prepared_changes_nothing_and_is_not_used_elsewhere(
    robot: RobotConfig, rotation_error: str, scp_law: str, config: Config
) -> None:
    own = dataclasses.replace(config.controller, rotation_error=rotation_error, scp_law=scp_law)
    plain = Supervisor(robot, own, config.supervisor, DT)
    prepared = Supervisor(robot, own, config.supervisor, DT)
    rng = np.random.default_rng(0)
    q = random_q(robot, 1)
    for i in range(12):
        before = q.copy()
        if i % 4:
            q = q + 0.01 * rng.normal(size=len(q))
        w, phi = (q if i % 3 else before)[:6], (q if i % 5 else before)[6:]
        prepared.prepare(phi)
        if i % 2:
            prepared.prepare(phi, w)
        reference = Reference(q[:6] + 0.01 * rng.normal(size=6), 0.01 * rng.normal(size=6))
        a, b = (made.step(q, None, reference, DT * i) for made in (plain, prepared))
        for name in ("u", "u_unlimited", "error", "phi_tilde_dot_d", "support_polygon"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
        for name in ("bound", "escaping", "d_min", "V_h", "V_b1", "damping", "singular_shape"):
            assert getattr(a, name) == getattr(b, name), name


def test_a_step_takes_the_posture_that_was_prepared_for_it(
    config: Config, start: np.ndarray, table_1: Reference
) -> None:
    made = supervisor(config)
    made.prepare(start[6:], start[:6])
    ready = made.step(start, None, table_1, 0.0).posture
    assert made.step(start, None, table_1, DT).posture is ready
    moved = start + np.eye(len(start))[0]
    other = made.step(moved, None, table_1, 2 * DT).posture
    assert other is not ready
    assert other.k.base is ready.k.base, "it depends on the joints alone"


def test_sub_tasks_of_others_are_not_asked_before_the_step(
    config: Config, start: np.ndarray, table_1: Reference, own_package
) -> None:
    own_package(
        """
        import numpy as np
        from snake_control.control.sub_tasks.sub_task import SubTask

        class Counting(SubTask):
            asked = 0

            def value(self, posture):
                return 0.0

            def gradient(self, posture):
                Counting.asked += 1
                return np.zeros_like(posture.g.q)
        """
    )
    own = dataclasses.replace(
        config.controller,
        base_sub_tasks=(*config.controller.base_sub_tasks, "my_package.my_module:Counting"),
        base_weights=(*config.controller.base_weights, 1.0),
    )
    made = Supervisor(config.robot, own, config.supervisor, DT)
    counting = importlib.import_module("my_package.my_module").Counting
    before = counting.asked
    made.prepare(start[6:], start[:6])
    assert counting.asked == before
    made.step(start, None, table_1, 0.0)
    assert counting.asked > before


@pytest.mark.parametrize("shape", [(), (16,), (18,), (1, 17)])
def test_a_posture_of_another_shape_is_refused(
    config: Config, table_1: Reference, shape: tuple[int, ...]
) -> None:
    with pytest.raises(ModelError, match="shape"):
        supervisor(config).step(np.zeros(shape), None, table_1, 0.0)
    with pytest.raises(ModelError, match="shape"):
        supervisor(config).prepare(np.zeros(shape))
