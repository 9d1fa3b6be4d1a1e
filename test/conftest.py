"""What holds for all tests."""

from __future__ import annotations

from pathlib import Path

import pytest

_REAL_TIME = ("nodes", "cli")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Give tests of whole processes in real time a second try, which the report shows.

    A busy machine may withhold the processor for longer than a watchdog allows; the nodes are right
    to stop then, and the test has shown nothing.
    """
    if not config.pluginmanager.hasplugin("rerunfailures"):
        return
    here = Path(__file__).parent
    for item in items:
        if item.path.relative_to(here).parts[0] in _REAL_TIME:
            item.add_marker(pytest.mark.flaky(reruns=1))
