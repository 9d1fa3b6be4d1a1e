import os

import pytest

from snake_control.cli.memory import MemoryWatch, anonymous_bytes

MB = 1_000_000


def watched(sizes_mb, step_s=0.5):
    """Look every ``step_s`` seconds at a process that has these sizes, one per second."""
    now = 0.0
    watch = MemoryWatch(warm_up_s=5.0, read=lambda _: round(sizes_mb[int(now)] * MB))
    while now < len(sizes_mb):
        watch.look(100.0 + now, {"node": 1})
        now += step_s
    return watch.growth()


def test_growth_counts_from_the_end_of_the_warm_up():
    sizes = [10.0, 20.0, 30.0, 40.0, 50.0, *(60.0 for _ in range(12)), *(63.0 for _ in range(12))]
    assert watched(sizes) == {
        "node": {
            "after_warm_up_bytes": pytest.approx(60 * MB),
            "growth_bytes": pytest.approx(3 * MB),
        }
    }


def test_a_single_peak_is_no_growth():
    sizes = [60.0] * 40
    sizes[-1] = 200.0
    assert watched(sizes)["node"]["growth_bytes"] == 0.0


def test_a_run_too_short_to_tell_says_nothing():
    assert watched([60.0] * 15) is None


def test_processes_that_ended_are_left_out():
    watch = MemoryWatch(warm_up_s=0.0, read=lambda pid: None if pid == 2 else MB)
    for k in range(30):
        watch.look(float(k), {"node": 1, "dead": 2})
    assert set(watch.growth()) == {"node"}


def test_memory_of_a_process_that_takes_some_is_seen():
    before = anonymous_bytes(os.getpid())
    block = bytearray(os.urandom(50 * MB))
    assert anonymous_bytes(os.getpid()) - before == pytest.approx(len(block), rel=0.1)
    assert anonymous_bytes(2**22 + 1) is None
