"""The shortened campaign on the whole graph; ``make pose-faults`` runs all of it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("snake_interfaces")

from poses.rig import Rig
from poses.rows import ROWS, Row


@pytest.fixture(scope="module")
def rig() -> Iterator[Rig]:
    with Rig() as rig:
        yield rig


@pytest.mark.parametrize("row", [row for row in ROWS if row.short], ids=lambda row: row.name)
def test_the_robot_stops_where_it_must_and_goes_on(rig: Rig, row: Row) -> None:
    outcome = rig.run(row)
    assert not outcome.failures, outcome
