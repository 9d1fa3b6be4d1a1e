"""When the newest message of a topic can be relied on."""

import math

import pytest
from nav_msgs.msg import Odometry

from snake_control.nodes.conversions import MessageError, header
from snake_control.nodes.inputs import Fault, Input

SECOND = 1_000_000_000
NOW = 1000 * SECOND


def convert(message):
    if message.child_frame_id == "bad":
        raise MessageError("it is bad")
    return message.child_frame_id


def make():
    return Input("head/odometry", 0.1, convert)


def received(age_s, content="good"):
    source = make()
    source.receive(Odometry(header=header(NOW - round(age_s * SECOND)), child_frame_id=content))
    return source


def test_nothing_received():
    problem = make().problem(NOW)
    assert problem.fault is Fault.WAITING
    assert "head/odometry" in problem.text
    assert make().age(NOW) == math.inf


@pytest.mark.parametrize("age", [0.0, 0.099, -0.004])
def test_fresh(age):
    source = received(age)
    assert source.problem(NOW) is None
    assert source.value == "good"
    assert source.age(NOW) == pytest.approx(age)


@pytest.mark.parametrize(
    ("age", "fault", "text"),
    [(0.11, Fault.STALE, "0.11 s old"), (-0.02, Fault.INVALID, "0.020 s ahead")],
)
def test_old_and_from_the_future(age, fault, text):
    problem = received(age).problem(NOW)
    assert problem.fault is fault
    assert "head/odometry" in problem.text
    assert text in problem.text


def test_malformed_until_the_next_good_one():
    source = received(0.0, "bad")
    problem = source.problem(NOW)
    assert problem.fault is Fault.INVALID
    assert problem.text == "head/odometry: it is bad"
    source.receive(Odometry(header=header(NOW), child_frame_id="good"))
    assert source.problem(NOW) is None
