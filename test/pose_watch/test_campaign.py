"""The campaign runs, and its table counts what was named right."""

from __future__ import annotations

import json
from pathlib import Path

from pose_watch.campaign import Outcome, Trial, main, table

from snake_control.control.pose_hypotheses import Cause
from support.watched_robot import Planted


def test_it_writes_its_table(tmp_path: Path) -> None:
    kinds = ["at rest"]
    arguments = ["--seeds", "1", "--long-s", "1.0", "--processes", "1", "--out", str(tmp_path)]
    assert main([*arguments, "--robots", "planar snake", "--kinds", *kinds]) == 0
    (row,) = json.loads((tmp_path / "pose_watch.json").read_text())
    assert row["right"]
    assert row["named"] == "nothing"
    assert "| at rest | 1 | 1 |" in (tmp_path / "pose_watch.md").read_text()


def test_the_table_tells_right_from_wrong() -> None:
    trial = Trial("", "swap", Cause.SWAPPED_JOINTS, (2, 4), Planted(swapped=(2, 4)), 0, 1.0)
    none = (0.0, 0.0, 0.0)
    outcomes = [
        Outcome(trial, Cause.SWAPPED_JOINTS, (2, 4), 3.0, (), 5.0, none),
        Outcome(trial, Cause.SWAPPED_JOINTS, (2, 6), 2.0, (), 5.0, none),
        Outcome(trial, Cause.WHEEL_SLIP, (), 2.0, (), 5.0, none),
        Outcome(trial, Cause.SWAPPED_JOINTS, (2, 4), 2.0, ("wheel_slip []",), 5.0, none),
    ]
    assert [outcome.right for outcome in outcomes] == [True, False, False, False]
    expected = (
        "| swap | 4 | 1 | 3.0, 3.0 | swapped_joints, other joints 1, wheel_slip 1, changed 1 |"
    )
    assert expected in table(outcomes)
