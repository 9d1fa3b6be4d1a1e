import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snake_control.mock.mechanics import (
    Motion,
    MotorParameters,
    OpenLoop,
    Side,
    ToGoal,
    advance,
    slope_ticks,
)
from snake_control.mock.parameters import ServoParameters
from snake_control.mock.servo import Servo
from snake_control.mock.units import SPEED_UNIT_RAD_S, TICK_RAD, angle_from_ticks

FRICTIONLESS = MotorParameters(friction_torque_nm=0.0)
RATED_V = 12.0
STEP_S = 0.002


def servo(motor=FRICTIONLESS, voltage=RATED_V, angle=0.0, **registers: int) -> Servo:
    eeprom = {name: registers.pop(name) for name in list(registers) if name.endswith("_limit")}
    limit = {"torque_limit": eeprom.pop("torque_limit")} if "torque_limit" in eeprom else {}
    made = Servo(
        1, ServoParameters(motor=motor, supply_voltage_v=voltage), angle_rad=angle, eeprom=eeprom
    )
    for name, value in (registers | limit).items():
        made.store(name, value)
    return made


def run(moved: Servo, seconds: float, load_nm: float = 0.0) -> None:
    for _ in range(round(seconds / STEP_S)):
        moved.step(STEP_S, load_nm)


@pytest.mark.parametrize(("raw", "seconds"), [(1, 4.0), (100, 1.0), (400, 0.3)])
@pytest.mark.parametrize("goal", [0, 1023])
def test_a_move_has_the_speed_that_its_register_says(raw, seconds, goal):
    moved = servo(torque_enable=1, moving_speed=raw, goal_position=goal)
    run(moved, 0.2)
    start = moved.motion.angle_rad
    run(moved, seconds)

    speed = (moved.motion.angle_rad - start) / seconds
    assert speed == pytest.approx(math.copysign(raw * SPEED_UNIT_RAD_S, goal - 512), rel=1e-9)


def test_speed_0_means_as_fast_as_the_motor_can():
    moved = servo(torque_enable=1, moving_speed=0, goal_position=1023)
    run(moved, 0.3)

    assert moved.motion.speed_rad_s == pytest.approx(6.18, rel=1e-6)


@pytest.mark.parametrize("goal", [200, 511, 514, 800, 1023])
def test_a_move_ends_within_the_margin_and_stays(goal):
    moved = servo(torque_enable=1, moving_speed=100, goal_position=goal)
    run(moved, 4.0)

    assert abs(moved.motion.angle_rad - angle_from_ticks(goal)) <= 1.01 * TICK_RAD
    assert moved.motion.speed_rad_s == 0.0


def test_a_fast_move_overshoots_and_settles():
    moved = servo(torque_enable=1, moving_speed=0, goal_position=800)
    run(moved, 2.0)

    assert abs(moved.motion.angle_rad - angle_from_ticks(800)) <= 1.01 * TICK_RAD


@pytest.mark.parametrize("slope", [2, 128])
def test_every_slope_settles_in_steps_of_5_ms(slope):
    moved = servo(
        torque_enable=1, goal_position=800, cw_compliance_slope=slope, ccw_compliance_slope=slope
    )
    for _ in range(600):
        moved.step(0.005, 0.0)

    assert abs(moved.motion.angle_rad - angle_from_ticks(800)) <= 1.01 * TICK_RAD


def test_the_speed_changes_no_faster_than_the_acceleration():
    moved = servo(torque_enable=1, moving_speed=400, goal_position=1023)
    run(moved, 0.05)

    assert moved.motion.speed_rad_s == pytest.approx(0.05 * 60.0)
    assert moved.motion.angle_rad == pytest.approx(0.5 * 60.0 * 0.05**2)


def test_attainable_speed_falls_with_the_load():
    moved = servo(torque_enable=1, moving_speed=0, goal_position=1023)
    run(moved, 0.3, load_nm=0.6)

    assert moved.motion.speed_rad_s == pytest.approx(6.18 * (1.0 - 0.6 / 1.5), rel=1e-6)


def test_a_low_battery_slows_the_motor():
    moved = servo(voltage=9.0, torque_enable=1, moving_speed=0, goal_position=1023)
    run(moved, 0.3)

    assert moved.motion.speed_rad_s == pytest.approx(6.18 * 9.0 / 12.0, rel=1e-6)


def test_speed_control_also_brakes_a_helping_load():
    moved = servo(torque_enable=1, moving_speed=50, goal_position=1023)
    run(moved, 0.5, load_nm=-0.9)

    assert moved.motion.speed_rad_s == pytest.approx(50 * SPEED_UNIT_RAD_S)
    assert moved.motion.output < 0


def test_a_torque_limit_caps_the_speed():
    moved = servo(torque_enable=1, moving_speed=0, goal_position=1023, torque_limit=512)
    run(moved, 0.3)

    assert moved.motion.speed_rad_s == pytest.approx(6.18 * 512 / 1023, rel=1e-6)


@pytest.mark.parametrize("load", [0.2, 0.6, 1.2, -0.6])
def test_a_load_lets_the_joint_droop_until_the_output_carries_it(load):
    moved = servo(torque_enable=1, goal_position=512)
    run(moved, 3.0, load)

    output = abs(load) / 1.5
    droop_ticks = 1 + 32 * (output - 32 / 1023) / (1 - 32 / 1023)
    expected = -math.copysign(droop_ticks * TICK_RAD, load)
    assert moved.motion.angle_rad == pytest.approx(expected, rel=1e-3)
    assert moved.motion.speed_rad_s == pytest.approx(0.0, abs=1e-4)


def test_a_steeper_slope_droops_less():
    soft = servo(torque_enable=1, goal_position=512, ccw_compliance_slope=128)
    stiff = servo(torque_enable=1, goal_position=512, ccw_compliance_slope=4)
    for each in (soft, stiff):
        run(each, 3.0, 0.6)

    assert soft.motion.angle_rad < 10 * stiff.motion.angle_rad < 0


def test_a_load_beyond_the_torque_limit_drives_the_joint_back():
    moved = servo(torque_enable=1, goal_position=512, torque_limit=300)
    run(moved, 1.0, load_nm=0.6)

    excess = 0.6 - 1.5 * 300 / 1023
    assert moved.motion.speed_rad_s == pytest.approx(-6.18 * excess / 1.5, rel=1e-6)


def test_friction_holds_a_load_without_output():
    moved = servo(MotorParameters(friction_torque_nm=0.1), torque_enable=0)
    run(moved, 1.0, load_nm=0.099)

    assert moved.motion.angle_rad == 0.0


def test_without_torque_a_load_sinks_with_limited_speed():
    moved = servo(MotorParameters(friction_torque_nm=0.1), torque_enable=0)
    run(moved, 0.3, load_nm=0.45)

    assert moved.motion.speed_rad_s == pytest.approx(-6.18 * 0.35 / 1.4, rel=1e-6)
    assert moved.motion.output == 0.0


def test_friction_does_not_change_the_speed_without_load():
    moved = servo(MotorParameters(friction_torque_nm=0.3), torque_enable=1, goal_position=1023)
    run(moved, 0.3)

    assert moved.motion.speed_rad_s == pytest.approx(6.18, rel=1e-6)


@pytest.mark.parametrize(
    ("raw", "output"), [(512, 512 / 1023), (1023, 1.0), (1024 + 512, -512 / 1023), (2047, -1.0)]
)
def test_in_wheel_mode_the_speed_register_is_an_output(raw, output):
    moved = servo(cw_angle_limit=0, ccw_angle_limit=0, torque_enable=1, moving_speed=raw)
    run(moved, 0.5)
    free = moved.motion.speed_rad_s
    run(moved, 0.5, load_nm=0.3)

    assert free == pytest.approx(6.18 * output, rel=1e-6)
    assert moved.motion.speed_rad_s == pytest.approx(6.18 * (output - 0.2), rel=1e-6)


@pytest.mark.parametrize("raw", [0, 1024])
def test_in_wheel_mode_0_neither_drives_nor_holds(raw):
    moved = servo(cw_angle_limit=0, ccw_angle_limit=0, torque_enable=1, moving_speed=raw)
    run(moved, 0.2)
    assert moved.motion.angle_rad == 0.0

    run(moved, 0.2, load_nm=0.3)
    assert moved.motion.angle_rad < 0


def test_in_wheel_mode_a_low_output_does_not_move_a_gear_with_friction():
    moved = servo(
        MotorParameters(), cw_angle_limit=0, ccw_angle_limit=0, torque_enable=1, moving_speed=50
    )
    run(moved, 0.5)

    assert moved.motion.angle_rad == 0.0


def test_in_wheel_mode_a_speed_powers_the_motor_whatever_torque_enable_says():
    moved = servo(cw_angle_limit=0, ccw_angle_limit=0, moving_speed=500)
    run(moved, 0.2)
    assert moved.driven
    assert moved.motion.angle_rad > 0

    moved.store("torque_enable", 0)
    run(moved, 0.2)
    assert moved.motion.speed_rad_s == 0.0


def test_whole_turns_of_wheel_mode_do_not_count_in_joint_mode():
    moved = servo(angle=4 * math.pi + 0.1, torque_enable=1, moving_speed=100, goal_position=512)
    run(moved, 1.0)

    assert moved.motion.angle_rad == pytest.approx(4 * math.pi, abs=1.01 * TICK_RAD)


@pytest.mark.parametrize(
    ("raw", "step"),
    [
        *[(1, 2), (3, 2), (4, 4), (7, 4), (8, 8), (15, 8), (16, 16), (31, 16)],
        *[(32, 32), (63, 32), (64, 64), (127, 64), (128, 128), (254, 128)],
    ],
)
def test_the_slope_has_seven_steps(raw, step):
    assert slope_ticks(raw) == step


def drive(punch=0.1, torque_limit=0.8) -> ToGoal:
    return ToGoal(
        0.0,
        math.inf,
        ccw=Side(0.02, 0.1),
        cw=Side(0.05, 0.4),
        punch=punch,
        torque_limit=torque_limit,
    )


@pytest.mark.parametrize(
    ("error", "output"),
    [
        (0.02, 0.0),
        (0.020001, 0.1),
        (0.07, 0.45),
        (0.12, 0.8),
        (1.0, 0.8),
        (-0.05, 0.0),
        (-0.25, -0.45),
        (-0.45, -0.8),
        (-2.0, -0.8),
    ],
)
def test_the_output_follows_the_figure_of_the_manual(error, output):
    assert drive().output(error) == pytest.approx(output, abs=1e-5)


def test_a_punch_beyond_the_torque_limit_gives_the_torque_limit():
    assert drive(punch=0.5, torque_limit=0.2).output(0.03) == pytest.approx(0.2)


@given(st.floats(-3, 3), st.floats(-3, 3))
def test_the_output_never_falls_with_the_error(a, b):
    low, high = sorted((a, b))

    assert drive().output(low) <= drive().output(high)


@given(
    st.floats(-10, 10),
    st.floats(-6, 6),
    st.floats(-3, 3),
    st.floats(-1, 1),
    st.floats(0.0, 14.0),
)
def test_a_step_stays_within_acceleration_and_speed(angle, speed, load, output, voltage):
    motor = MotorParameters()
    motion = Motion(angle, speed)
    advance(motion, OpenLoop(output), motor, load, voltage, 0.005)

    assert abs(motion.speed_rad_s - speed) <= 60.0 * 0.005 + 1e-9
    assert abs(motion.angle_rad - angle) <= max(abs(speed), abs(motion.speed_rad_s)) * 0.005 + 1e-9


@pytest.mark.parametrize(
    "values",
    [
        {"stall_torque_nm": 0.0},
        {"no_load_speed_rad_s": -1.0},
        {"acceleration_rad_s2": math.nan},
        {"friction_torque_nm": 1.5},
        {"friction_torque_nm": -0.1},
        {"joint_mode_speed_rad_s": 0.0},
        {"stall_torque_nm": math.inf},
    ],
)
def test_impossible_motors_are_refused(values):
    with pytest.raises(ValueError, match=next(iter(values))):
        MotorParameters(**values)
