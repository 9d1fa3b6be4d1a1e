import itertools

import pytest

from snake_control.ax12.telemetry import FULL_LENGTH, SHORT_LENGTH, TelemetrySchedule

NOBODY = frozenset()


def run(schedule, cycles, period=0.02, reads_per_cycle=99, lost=NOBODY, silent=NOBODY, start=0.0):
    """Let cycles pass; return the requests of each."""
    done = []
    for k in range(cycles):
        now = start + k * period
        requests = schedule.cycle(lost, now)[:reads_per_cycle]
        for request in requests:
            schedule.asked(request, now, request.servo not in silent)
        done.append(requests)
    return done


def test_every_servo_is_read_in_every_cycle_in_the_order_of_the_joints():
    cycles = run(TelemetrySchedule(11, 0.02), 20)
    assert all([r.servo for r in requests] == list(range(11)) for requests in cycles)


def test_at_first_everything_is_read_and_then_the_slow_values_in_turn():
    first, *later = run(TelemetrySchedule(11, 0.02), 101)
    assert {r.length for r in first} == {FULL_LENGTH}
    assert (FULL_LENGTH, SHORT_LENGTH) == (8, 6)
    turns = [[r.servo for r in requests if r.length == FULL_LENGTH] for requests in later]
    assert turns[:22] == [[i] for i in range(11)] * 2


@pytest.mark.parametrize(("count", "period"), [(11, 0.02), (47, 0.02), (95, 0.1), (3, 0.002)])
def test_slow_values_are_never_older_than_their_period(count, period):
    cycles = run(TelemetrySchedule(count, period, slow_period=0.5), round(3.0 / period), period)
    for servo in range(count):
        times = [
            k * period
            for k, requests in enumerate(cycles)
            for r in requests
            if r.servo == servo and r.length == FULL_LENGTH
        ]
        assert max(b - a for a, b in itertools.pairwise(times)) <= 0.5 + period


def test_a_slow_value_that_was_not_answered_is_asked_for_again():
    cycles = run(TelemetrySchedule(3, 0.02), 5, silent=frozenset({1}))
    assert all(requests[1].length == FULL_LENGTH for requests in cycles)


def test_where_time_is_short_all_age_alike():
    cycles = run(TelemetrySchedule(11, 0.02), 110, reads_per_cycle=3)
    for servo in range(11):
        asked = [k for k, requests in enumerate(cycles) if servo in {r.servo for r in requests}]
        # Eleven servos, three a cycle.
        assert max(b - a for a, b in itertools.pairwise(asked)) <= 4


def test_a_lost_servo_is_asked_rarely_and_costs_the_others_no_turn():
    schedule = TelemetrySchedule(4, 0.02, lost_period=0.5)
    run(schedule, 1)
    cycles = run(schedule, 100, lost=frozenset({2}), start=0.02)
    asked = [k for k, requests in enumerate(cycles) if 2 in {r.servo for r in requests}]
    assert [b - a for a, b in itertools.pairwise(asked)] == [25] * (len(asked) - 1)
    assert all({0, 1, 3} <= {r.servo for r in requests} for requests in cycles)


def test_settings_are_looked_at_in_turn_and_not_of_the_lost():
    schedule = TelemetrySchedule(4, 0.02, check_period=0.15625)
    looks = [schedule.check(frozenset({2}), 0.03125 * k, spare=True) for k in range(31)]
    assert [(k, i) for k, i in enumerate(looks) if i is not None] == [
        (5, 1),
        (10, 3),
        (15, 0),
        (20, 1),
        (25, 3),
        (30, 0),
    ]
    assert schedule.check(frozenset(range(4)), 9.0, spare=True) is None


def test_settings_are_looked_at_also_where_reads_leave_no_time():
    schedule = TelemetrySchedule(4, 0.02, check_period=0.1)
    looks = [schedule.check(NOBODY, 0.02 * k, spare=False) for k in range(41)]
    assert [(k, i) for k, i in enumerate(looks) if i is not None] == [(13, 1), (26, 2), (39, 3)]
