"""The study as people call it: in parallel, killed and continued, and on a Dask cluster."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from snake_control.cli.scp_study import main
from support.own_sub_tasks import LATE
from support.process import Process
from support.waiting import wait_for

ROOT = Path(__file__).parents[2]
SHORT = ("--duration", "0.4", "--sample", "4")


def command(out: Path, *arguments: str) -> list[str]:
    return [sys.executable, "-m", "snake_control.cli.scp_study", "--out", str(out), *arguments]


def run(out: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command(out, *arguments), cwd=ROOT, capture_output=True, text=True, timeout=100, check=False
    )


def test_a_short_study_leaves_its_results_and_does_nothing_twice(tmp_path):
    done = run(tmp_path, *SHORT)
    assert done.returncode == 0, done.stderr
    assert "The configured choice (links 7, 9, 11; phi 3)" in done.stdout
    assert (tmp_path / "ranking.png").stat().st_size > 10_000
    rows = (tmp_path / "ranking.csv").read_text().splitlines()
    outcomes = (tmp_path / "outcomes.jsonl").read_text()
    assert len(outcomes.splitlines()) == 3 * (len(rows) - 1)
    again = run(tmp_path, *SHORT)
    assert "12 of them done before" in again.stdout or "15 of them done before" in again.stdout
    assert (tmp_path / "outcomes.jsonl").read_text() == outcomes
    assert (tmp_path / "ranking.csv").read_text().splitlines() == rows


def test_killed_half_way_it_goes_on(tmp_path):
    arguments = ("--duration", "2", "--sample", "12", "--workers", "2")
    process = Process(
        "scp_study",
        command(tmp_path, *arguments),
        log=tmp_path / "log.txt",
        cwd=ROOT,
        environment=os.environ,
    )
    store = tmp_path / "outcomes.jsonl"

    def some() -> int:
        return len(store.read_text().splitlines()) if store.exists() else 0

    wait_for(lambda: some() >= 3 or not process.running, 60.0, "the first outcomes")
    workers = _children(process.pid)
    process.kill()
    process.wait()
    wait_for(lambda: not any(map(_alive, workers)), 20.0, "the end of the workers")
    kept = some()
    done = run(tmp_path, *arguments)
    assert done.returncode == 0, done.stderr
    assert f"{kept} of them done before" in done.stdout
    assert len({line[:40] for line in store.read_text().splitlines()}) == some()


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_keeps_what_was_done(tmp_path, number, code):
    # Started as a script's background job, which has SIGINT ignored.
    words = shlex.join(command(tmp_path, "--duration", "20", "--workers", "1"))
    process = Process(
        "scp_study",
        ["bash", "-c", f"trap '' INT; exec {words}"],
        log=tmp_path / "log.txt",
        cwd=ROOT,
        environment=os.environ,
    )
    store = tmp_path / "outcomes.jsonl"
    try:
        wait_for(
            lambda: (store.exists() and store.read_text()) or not process.running,
            60.0,
            "an outcome",
        )
        os.kill(process.pid, number)
        assert process.wait(60.0) == code, process.report()
    finally:
        process.kill()
    assert "goes on from here" in process.output()
    assert "Traceback" not in process.output()


def test_on_a_dask_cluster(tmp_path):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        protocol="tcp",
        host="127.0.0.1",
        dashboard_address=None,
    ) as cluster:
        done = run(tmp_path / "dask", *SHORT, "--scheduler", cluster.scheduler_address)
    assert done.returncode == 0, done.stderr
    here = run(tmp_path / "here", *SHORT)
    assert here.returncode == 0, here.stderr
    ranking = [(tmp_path / name / "ranking.csv").read_text() for name in ("dask", "here")]
    assert ranking[0] == ranking[1]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--params-file", "nowhere.yaml"), "nowhere.yaml: cannot be read"),
        (("--trajectories", "nowhere.yaml"), "nowhere.yaml: cannot be read"),
        (("--trajectories", "{tmp}/broken.yaml"), "broken.yaml: is not valid YAML"),
        (("--wheelless", "99"), "no choice with 99 of the links 6 to 11 wheelless"),
        (("--params-file", "{tmp}/own.yaml"), "cannot import nowhere"),
    ],
)
def test_a_mistake_gets_one_line_and_code_2(tmp_path, capsys, arguments, words):
    (tmp_path / "broken.yaml").write_text("a: [\n")
    parameters = {"controller": {"base_sub_tasks": ["nowhere:Mine"]}}
    (tmp_path / "own.yaml").write_text(yaml.dump({"/**": {"ros__parameters": parameters}}))
    given = [each.format(tmp=tmp_path) for each in arguments]
    assert main(["--out", str(tmp_path / "out"), *given]) == 2
    shown = capsys.readouterr()
    assert words in shown.err
    assert len(shown.err.splitlines()) == 1


@pytest.mark.parametrize(
    "wrong",
    [
        ("--scheduler", "nope"),
        ("--scheduler", "tcp://host"),
        ("--sample", "0"),
        ("--workers", "0"),
        ("--dt", "7"),
    ],
)
def test_wrong_command_lines_end_with_usage(tmp_path, capsys, wrong):
    with pytest.raises(SystemExit) as caught:
        main(["--out", str(tmp_path), *wrong])
    assert caught.value.code == 2
    assert wrong[0] in capsys.readouterr().err


def test_gains_are_scale_free_unless_the_files_own_are_wanted(tmp_path):
    # Its file has a weight of its own for the paper's preset.
    planar = ("--params-file", "config/planar_snake.yaml", "--duration", "0.4", "--sample", "1")
    done = run(tmp_path, *planar)
    assert done.returncode == 0, done.stderr
    assert "gains: preset scale_free: head log_manipulability" in done.stdout
    assert "tracking is not judged: the head is on its way" in done.stdout
    own = run(tmp_path, *planar, "--own-gains")
    assert "gains: preset paper: head manipulability 100000; base singularity 1.3e-12" in own.stdout
    assert ", 0 of them done before" in own.stdout


def test_a_sub_task_that_fails_is_counted_and_tried_again(tmp_path, own_package):
    own_package(LATE)
    parameters = {"controller": {"base_sub_tasks": ["my_package.my_module:Late"]}}
    (tmp_path / "own.yaml").write_text(yaml.dump({"/**": {"ros__parameters": parameters}}))
    path = os.pathsep.join((str(tmp_path), *sys.path))
    for _ in range(2):
        done = subprocess.run(
            command(tmp_path / "out", "--params-file", str(tmp_path / "own.yaml"), *SHORT),
            cwd=ROOT,
            env=os.environ | {"PYTHONPATH": path},
            capture_output=True,
            text=True,
            timeout=100,
            check=False,
        )
        assert done.returncode == 1
        assert "Traceback" not in done.stderr
        assert ", 0 of them done before" in done.stdout
        assert "could not be run to the end on 3 of the trajectories" in done.stdout
        assert "my_module:Late, gradient fails: KeyError: 'gone'" in done.stdout


def test_a_scheduler_that_is_not_there_is_named(tmp_path):
    pytest.importorskip("distributed")
    done = run(tmp_path, *SHORT, "--scheduler", "tcp://127.0.0.1:9")
    assert done.returncode == 1
    assert "no Dask scheduler answers at tcp://127.0.0.1:9" in done.stderr.splitlines()[-1]
    assert "Exception ignored" not in done.stderr


def _children(pid: int) -> list[int]:
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                stat = (entry / "stat").read_text()
            except OSError:
                continue
            if int(stat.rpartition(")")[2].split()[1]) == pid:
                found.append(int(entry.name))
    return found


def _alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
