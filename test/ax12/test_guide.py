import dataclasses
import math

import pytest

from snake_control.ax12.guide import direction_of, measure
from snake_control.ax12.joint import JointSetup

TICK = math.radians(300 / 1023)
JOINT = JointSetup("joint_4", 4, 1, 0.0, "joint", -1.5, 1.5, 5.5, 1, 32, 32, 1.0)


@pytest.mark.parametrize(
    ("straight", "turned", "direction"),
    [(512, 560, 1), (512, 460, -1), (512, 530, None), (512, 1024, None), (2047, 512, None)],
)
def test_a_direction_takes_a_way_that_is_seen(straight, turned, direction):
    assert direction_of(straight, turned) == direction


def test_a_joint_as_configured_needs_no_remark():
    found = measure(JOINT, 1, 512, (512 - 300, 512 + 300))
    assert found.remarks == ()
    assert (found.lower, found.upper) == pytest.approx((-300 * TICK, 300 * TICK))


def test_a_servo_mounted_the_other_way_round_and_askew_is_told():
    found = measure(JOINT, -1, 530, (230, 830))
    assert found.direction == -1
    assert found.zero_offset == pytest.approx(18 * TICK)
    assert (found.lower, found.upper) == pytest.approx((-300 * TICK, 300 * TICK))
    assert found.remarks == (
        "servos.directions is +1, the joint turns -1",
        "servos.zero_offsets_rad is 0.000, straight is at 0.092 rad",
    )


def test_a_range_leaves_room_for_what_loads_do():
    found = measure(JOINT, 1, 512, (10, 1000))
    give = JOINT.compliance_ticks
    assert found.lower - give * TICK >= -math.radians(150)
    assert found.upper + give * TICK <= math.radians(150)
    assert found.upper - found.lower > (1023 - 2 * give - 2) * TICK
    wheel = dataclasses.replace(JOINT, mode="wheel")
    assert measure(wheel, 1, 512, (10, 1000)).lower == pytest.approx(-502 * TICK)


def test_ends_beyond_the_sensor_and_a_shorter_way_are_told():
    found = measure(JOINT, 1, 900, (700, 1023))
    assert any("edge of the servo's 300 degrees" in remark for remark in found.remarks)
    assert any("joint_limits_rad allows -1.500 to 1.500" in remark for remark in found.remarks)
    assert any("measure this joint again" in r for r in measure(JOINT, 1, 512, (600, 700)).remarks)
