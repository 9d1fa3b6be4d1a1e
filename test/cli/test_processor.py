import os
import subprocess
import sys
import time

import pytest

from snake_control.cli.processor import ProcessorWatch, processor_s

_WARM_UP_S = 5.0


def share(duration_s, pid_at=lambda t: 1, taken_at=None):
    """Watch a node that takes all of a core for 5 s and a fifth of one from then on."""
    time_s = 0.0

    def taken(pid):
        return min(time_s, _WARM_UP_S) + 0.2 * max(0.0, time_s - _WARM_UP_S)

    watch = ProcessorWatch(_WARM_UP_S, read=taken if taken_at is None else taken_at)
    while time_s <= duration_s:
        watch.look(100.0 + time_s, {"node": pid_at(time_s)})
        time_s += 0.5
    return watch.shares()


def test_what_is_taken_after_the_warm_up_counts():
    assert share(20.0) == {"node": pytest.approx(0.2)}


def test_a_run_too_short_to_tell_says_nothing():
    assert share(2.0) is None
    assert share(_WARM_UP_S) is None


def test_a_process_that_is_started_anew_counts_anew():
    taken = {1: iter([50.0, 51.0, 52.0]), 2: iter([0.0, 0.1, 0.2])}
    found = share(
        11.0, lambda t: 1 if t < 8.0 else 2, lambda pid: next(taken[pid], 0.3 if pid == 2 else 52.0)
    )
    assert found == {"node": pytest.approx(0.1)}


def test_a_process_that_has_ended_counts_while_it_was_there():
    times = iter([1.0, 1.5, 2.0])
    assert share(20.0, taken_at=lambda _: next(times, None)) == {"node": pytest.approx(0.5)}


def test_time_of_a_process_that_computes():
    assert processor_s(os.getpid()) == pytest.approx(time.process_time(), abs=0.05)
    before = processor_s(os.getpid())
    begin = time.process_time()
    while time.process_time() < begin + 0.3:
        pass
    assert processor_s(os.getpid()) - before == pytest.approx(0.3, abs=0.05)


def test_a_process_that_waits_takes_none_and_one_that_has_ended_is_not_there():
    code = "import sys; print(flush=True); sys.stdin.read()"
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", code], stdin=pipe, stdout=pipe) as process:
        process.stdout.readline()
        before = processor_s(process.pid)
        begin = time.process_time()
        while time.process_time() < begin + 0.2:
            pass
        assert processor_s(process.pid) - before < 0.05
        process.stdin.close()
    assert processor_s(process.pid) is None
