"""When a joint counts as unheard."""

from __future__ import annotations

from snake_control.ax12.arming import Seed
from snake_control.ax12.bus import Reply
from snake_control.ax12.driven_joint import DrivenJoint, Motion
from snake_control.ax12.eeprom import ServoInfo
from snake_control.ax12.joint import JointSetup

JOINT = JointSetup("joint_1", 1, 1, 0.0, "joint", -2.4, 2.4, 5.5, 1, 32, 32, 1.0)
INFO = ServoInfo(12, 24, 0.0, (0, 1023), 44, 980, 1023, 36)
MOTION = Motion(period=0.02, look_ahead=0.15, acceleration=0.0, lost_after_misses=25)


def test_a_joint_is_unheard_after_the_time_and_enough_questions() -> None:
    joint = DrivenJoint(JOINT, INFO, MOTION)
    joint.armed(Seed(512, 0.0, 0.0, False), 10.0)
    # A computer that paused: much time, and hardly a question.
    joint.asked_in_vain = 4
    assert not joint.unheard(11.0)
    joint.asked_in_vain = 5
    assert not joint.unheard(10.4)
    assert joint.unheard(10.6)
    joint.take(Reply(bytes((0, 2, 0, 0, 0, 0)), 0), 10.7)
    assert not joint.unheard(10.8)
