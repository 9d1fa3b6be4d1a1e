"""Which trajectory gives the reference, and when there is none."""

import numpy as np
import pytest

from snake_control.config import TrajectoryGeneratorConfig
from snake_control.trajectory.sequence import ReferenceSequence
from snake_control.trajectory.teleop import HeadVelocityCommand

HEAD = np.array([1.0, 2.0, 0.3, 0.1, -0.9, 0.5])
DT = 0.02
TABLE_1_START = np.array([0.0, 0.0, 0.2, np.pi / 8, np.pi / 8, 0.0])
TABLE_1_VELOCITY = np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0])


def make(**parameters):
    return ReferenceSequence(TrajectoryGeneratorConfig(**parameters))


def ahead(speed=0.05):
    return HeadVelocityCommand(np.array([speed, 0, 0]), np.zeros(3))


ZERO = ahead(0.0)


def run(sequence, start, end):
    """Sample every DT; return the last reference."""
    for k in range(round((end - start) / DT) + 1):
        reference = sequence.sample(start + k * DT)
    return reference


def test_nothing_happens_by_itself():
    sequence = make(autostart=True)
    assert sequence.idle
    assert sequence.sample(0.0) is None
    assert sequence.sample(100.0) is None


def test_given_line_needs_no_head_pose():
    sequence = make()
    outcome = sequence.start(10.0, None)
    assert outcome.done
    np.testing.assert_allclose(run(sequence, 10.0, 12.0).w_d, TABLE_1_START + 2 * TABLE_1_VELOCITY)
    assert sequence.line is not None


def test_line_from_the_head():
    sequence = make(start_from="head", velocity=(0.0, 0.02, 0.0, 0.0, 0.0, 0.0), duration_s=1.0)
    assert sequence.start(0.0, HEAD).done
    end = run(sequence, 0.0, 5.0)
    np.testing.assert_allclose(end.w_d, np.add(HEAD, [0, 0.02, 0, 0, 0, 0]))
    # The end is held until somebody stops it.
    assert run(sequence, 5.0, 50.0) is not None


@pytest.mark.parametrize("parameters", [{"start_from": "head"}, {"trajectory": "hold"}])
def test_where_the_head_is_must_be_known(parameters):
    sequence = make(**parameters)
    outcome = sequence.start(0.0, None)
    assert not outcome.done
    assert "head/odometry" in outcome.text
    assert sequence.idle
    assert sequence.start(1.0, HEAD).done
    np.testing.assert_array_equal(sequence.sample(1.0).w_d, HEAD)


def test_a_second_start_is_refused():
    sequence = make()
    sequence.start(0.0, None)
    outcome = sequence.start(5.0, None)
    assert not outcome.done
    assert "~/stop" in outcome.text


def test_stop_decelerates_and_then_gives_no_reference():
    sequence = make(velocity=(0.04, 0.0, 0.0, 0.0, 0.0, 0.0))
    sequence.start(0.0, None)
    before = run(sequence, 0.0, 1.0)
    assert sequence.stop(1.0).done
    rates, poses = [], []
    t = 1.0
    while (reference := sequence.sample(t)) is not None:
        rates.append(reference.w_d_dot[0])
        poses.append(reference.w_d[0])
        t += DT
    assert poses[0] == before.w_d[0]
    assert rates[0] == 0.04
    assert rates[-1] == 0.0
    assert np.all(np.diff(rates) < 0)
    assert np.abs(np.diff(rates)).max() <= 0.1 * DT * (1 + 1e-9)
    assert t - 1.0 == pytest.approx(0.04 / 0.1, abs=2 * DT)
    assert sequence.idle
    assert sequence.start(t, None).done


def test_stop_of_nothing_is_no_error():
    assert make().stop(0.0).done


def test_command_starts_at_the_head_at_rest():
    sequence = make()
    assert not sequence.command(ahead(), 0.0, None).done
    assert sequence.idle
    assert sequence.command(ahead(), 1.0, HEAD).done
    first = sequence.sample(1.0)
    np.testing.assert_array_equal(first.w_d, HEAD)
    np.testing.assert_array_equal(first.w_d_dot, np.zeros(6))
    assert run(sequence, 1.0, 1.4).w_d[0] > HEAD[0]


def test_command_takes_over_a_line_without_a_jump():
    sequence = make(velocity=(0.04, 0.0, 0.0, 0.0, 0.0, 0.0))
    sequence.start(0.0, None)
    before = run(sequence, 0.0, 2.0)
    assert sequence.command(ahead(-0.05), 2.0, HEAD).done
    after = sequence.sample(2.0)
    np.testing.assert_array_equal(after.w_d, before.w_d)
    np.testing.assert_array_equal(after.w_d_dot, before.w_d_dot)
    assert run(sequence, 2.0, 2.2).w_d_dot[0] == pytest.approx(0.02, abs=1e-9)
    assert sequence.line is None


def test_commands_that_cease_end_the_reference():
    sequence = make(cmd_vel_timeout_s=0.5)
    for k in range(51):
        sequence.command(ahead(), k * DT, HEAD)
        last = sequence.sample(k * DT)
    assert last.w_d_dot[0] == pytest.approx(0.05)
    t = 1.0
    while (reference := sequence.sample(t)) is not None:
        last = reference
        t += DT
    assert t - 1.0 == pytest.approx(0.5 + 0.5, abs=3 * DT)
    np.testing.assert_array_equal(last.w_d_dot, np.zeros(6))


def test_an_old_command_counts_no_longer_than_one_that_came_at_once():
    sequence = make(cmd_vel_timeout_s=0.5)
    sequence.command(ahead(), 0.0, HEAD, age=0.4)
    assert run(sequence, 0.0, 0.08).w_d_dot[0] == pytest.approx(0.008)
    assert run(sequence, 0.12, 0.14).w_d_dot[0] < 0.008


@pytest.mark.parametrize("stall", [0.1, 3600.0])
def test_a_stall_makes_no_jump(stall):
    sequence = make(velocity=(0.04, 0.0, 0.0, 0.0, 0.0, 0.0))
    sequence.start(0.0, None)
    before = run(sequence, 0.0, 1.0)
    after = sequence.sample(1.0 + stall)
    assert after.w_d[0] - before.w_d[0] == pytest.approx(0.04 * 2 * DT)
    later = run(sequence, 1.0 + stall, 2.0 + stall)
    assert later.w_d[0] - after.w_d[0] == pytest.approx(0.04)


def test_a_command_is_over_after_a_stall():
    sequence = make(cmd_vel_timeout_s=0.5)
    sequence.command(ahead(), 0.0, HEAD)
    before = run(sequence, 0.0, 0.3).w_d_dot[0]
    assert sequence.sample(1.0).w_d_dot[0] < before


def test_a_zero_command_starts_nothing_and_takes_over_nothing():
    sequence = make()
    sequence.command(ZERO, 0.0, HEAD)
    assert sequence.idle
    sequence.start(0.0, None)
    run(sequence, 0.0, 1.0)
    sequence.command(ZERO, 1.0, HEAD)
    assert sequence.line is not None
    assert not sequence.commanded


def test_a_zero_command_after_others_stops_the_head_and_holds_it():
    sequence = make()
    sequence.command(ahead(), 0.0, HEAD)
    run(sequence, 0.0, 0.4)
    for k in range(100):
        sequence.command(ZERO, 0.4 + k * DT, HEAD)
        reference = sequence.sample(0.4 + k * DT)
    assert sequence.commanded
    np.testing.assert_array_equal(reference.w_d_dot, np.zeros(6))


def test_a_joystick_at_rest_does_not_keep_a_stopped_reference_alive():
    sequence = make()
    sequence.start(0.0, None)
    run(sequence, 0.0, 1.0)
    sequence.stop(1.0)
    for k in range(20):
        sequence.command(ZERO, 1.0 + k * DT, HEAD)
        sequence.sample(1.0 + k * DT)
    assert sequence.idle


def test_the_motions_own_time_goes_as_fast_as_it_may():
    sequence = make()
    assert sequence.start(0.0, None).done
    before = sequence.sample(0.02)
    assert before is not None
    assert before.time_scale == 1.0
    for k in range(2, 52):
        sequence.time_scale = 0.25
        slowed = sequence.sample(0.02 * k)
    assert slowed is not None
    assert slowed.time_scale == 0.25
    np.testing.assert_array_equal(slowed.w_d_dot, before.w_d_dot)
    np.testing.assert_allclose(slowed.w_d - before.w_d, 0.25 * before.w_d_dot, atol=1e-12)
    sequence.time_scale = 0.0
    still = sequence.sample(1.04)
    again = sequence.sample(1.06)
    assert still is not None
    assert again is not None
    np.testing.assert_array_equal(still.w_d, again.w_d)
    # Coming to rest takes no longer than it must.
    sequence.stop(1.06)
    braking = sequence.sample(1.08)
    assert braking is not None
    assert braking.time_scale == 1.0
