import os
import subprocess
import sys
import time

import pytest

from snake_control.cli.processor import ProcessorWatch, processor_s


def shares(times, warm_up_s=5.0, period_s=0.5):
    """Look every ``period_s`` seconds at a process that has taken these times by then."""
    taken = iter(times)
    watch = ProcessorWatch(warm_up_s, read=lambda _: next(taken))
    for k in range(200):
        try:
            watch.look(100.0 + k * period_s, {"node": 1})
        except StopIteration:
            break
    return watch.shares()


def test_what_is_taken_after_the_warm_up_counts():
    # 2.5 s are read at 5 s; from then on 0.2 s in each second.
    assert shares([2.5 + 0.2 * k for k in range(20)])["node"] == pytest.approx(0.2)


def test_a_run_too_short_to_tell_says_nothing():
    assert shares([]) is None
    assert shares([1.0]) is None


def test_a_process_that_ends_counts_while_it_was_there():
    watch = ProcessorWatch(0.0, read=lambda pid: None if pid == 0 else 2.0 * pid)
    for k, pids in enumerate(({"a": 1, "b": 0}, {"a": 2, "b": 0}, {"a": 0, "b": 0})):
        watch.look(float(k), pids)
    assert watch.shares() == {"a": 2.0}


def test_time_of_a_process_that_computes_and_of_one_that_waits():
    assert processor_s(os.getpid()) == pytest.approx(time.process_time(), abs=0.05)
    before = processor_s(os.getpid())
    begin = time.process_time()
    while time.process_time() < begin + 0.3:
        pass
    assert processor_s(os.getpid()) - before == pytest.approx(0.3, abs=0.05)


def test_none_of_a_process_that_has_ended():
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    assert processor_s(process.pid) is None
