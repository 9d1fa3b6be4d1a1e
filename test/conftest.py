"""What holds for all tests."""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

_REAL_TIME = ("nodes", "cli", "faults", "heads", "poses", "launch_files")
_ANY_TIME = (
    "cli/test_demo_arguments.py",
    "cli/test_evaluate.py",
    "cli/test_experiment.py",
    "cli/test_memory.py",
    "cli/test_processor.py",
    "cli/test_progress.py",
    "cli/test_recording.py",
    "cli/test_scp_study.py",
    "faults/test_check.py",
    "heads/test_campaign.py",
    "nodes/test_bus_decision.py",
    "nodes/test_bus_driver_parts.py",
    "nodes/test_conversions.py",
    "nodes/test_head_messages.py",
    "nodes/test_inputs.py",
    "nodes/test_layouts.py",
    "nodes/test_markers.py",
    "nodes/test_message_definitions.py",
    "nodes/test_pose_sources.py",
    "nodes/test_process.py",
)
"""Of these folders, what does not mind waiting."""
_ALONE = (
    "cli/test_demo.py",
    "faults/",
    "heads/",
    "nodes/test_bus_session.py",
    "nodes/test_follow_head_trajectory.py",
    "nodes/test_posture_actions.py",
    "nodes/test_two_robots.py",
    "nodes/test_whole_graph.py",
    "poses/",
)
"""Of the others, what needs a machine for itself: a whole robot, or a measured time."""
_JUDGE_THEMSELVES = ("faults/", "poses/")
"""They see whether the machine stood still, and try again by themselves."""
_MORE_TRIES, _AFTER_S = 3, 3


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark tests of whole processes in real time, and give them further tries, which are shown.

    A busy machine may withhold the processor for longer than a watchdog allows; the nodes are right
    to stop then, and the test has shown nothing. Whole robots, of six processes, meet that first,
    and such moments last seconds: tries that follow each other at once meet the same one.
    """
    here = Path(__file__).parent
    for item in items:
        path = item.path.relative_to(here)
        if path.parts[0] in _REAL_TIME and path.as_posix() not in _ANY_TIME:
            item.add_marker(pytest.mark.real_time)
            if path.as_posix().startswith(_ALONE):
                item.add_marker(pytest.mark.alone)
            if config.pluginmanager.hasplugin("rerunfailures"):
                name = path.as_posix()
                patient = name.startswith(_ALONE) and not name.startswith(_JUDGE_THEMSELVES)
                more = _MORE_TRIES if patient else 1
                item.add_marker(pytest.mark.flaky(reruns=more, reruns_delay=_AFTER_S))


@pytest.fixture
def own_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], None]]:
    """Write the text of ``my_package.my_module``, which is importable during the test."""
    monkeypatch.syspath_prepend(tmp_path)
    directory = tmp_path / "my_package"
    directory.mkdir()
    (directory / "__init__.py").write_text("")

    def write(text: str) -> None:
        (directory / "my_module.py").write_text(textwrap.dedent(text))

    yield write
    for name in [name for name in sys.modules if name.partition(".")[0] == "my_package"]:
        del sys.modules[name]
