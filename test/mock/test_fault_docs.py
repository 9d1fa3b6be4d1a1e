"""docs/faults.md lists the kinds that there are."""

from pathlib import Path

from snake_control.mock.fault_kinds import KINDS, Concerns

TAKES = {
    Concerns.REPLIES: "ids, probability",
    Concerns.SERVOS: "ids",
    Concerns.LINE: "the line",
}


def test_the_table_of_the_docs_is_the_table_of_the_code():
    text = (Path(__file__).parents[2] / "docs" / "faults.md").read_text()
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in text.splitlines()
        if line.startswith("| `")
    ]
    kinds = rows[: len(KINDS)]
    assert kinds == [
        [
            f"`{kind.name}`",
            TAKES[kind.concerns],
            kind.does,
            f"{kind.value}, {kind.low:g} to {kind.high:g}" if kind.value else "",
            f"{kind.default:g}" if kind.value else "",
        ]
        for kind in KINDS.values()
    ]
