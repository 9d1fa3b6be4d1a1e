"""Outcomes on disk, one JSON line each, so that a study that was stopped goes on."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

from snake_control.errors import StudyError
from snake_control.experiment.study.candidates import Candidate
from snake_control.experiment.study.trial import Outcome


class OutcomeStore:
    """A file of outcomes by the key of their trial; every line is written at once.

    Of several lines with one key the last counts: a trial that failed may be tried again.
    """

    def __init__(self, path: Path) -> None:
        """Open a store, reading what is there.

        A last line without an end, as a killed process leaves it, is dropped.

        Raises:
            StudyError: another line is damaged.
            OSError: the file cannot be read or made.
        """
        self._path = path
        self._outcomes: dict[str, Outcome] = {}
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        lines = text.split("\n")
        whole, rest = lines[:-1], lines[-1]
        for number, line in enumerate(whole, start=1):
            try:
                key, outcome = _from_json(line)
            except (ValueError, KeyError, TypeError) as error:
                raise StudyError(
                    f"{path}, line {number} is damaged ({error}); remove it or the file"
                ) from error
            self._outcomes[key] = outcome
        if rest:
            path.write_text("".join(f"{line}\n" for line in whole), encoding="utf-8")

    def __contains__(self, key: str) -> bool:
        return key in self._outcomes

    def __getitem__(self, key: str) -> Outcome:
        return self._outcomes[key]

    def add(self, key: str, outcome: Outcome) -> None:
        """Keep an outcome; it is on disk when this returns.

        Raises:
            OSError: it cannot be written.
        """
        with self._path.open("a", encoding="utf-8") as stream:
            stream.write(_to_json(key, outcome) + "\n")
        self._outcomes[key] = outcome


def _to_json(key: str, outcome: Outcome) -> str:
    fields = dataclasses.asdict(outcome)
    # JSON knows no infinity.
    for name, value in fields.items():
        if isinstance(value, float) and math.isinf(value):
            fields[name] = "inf"
    return json.dumps({"key": key, **fields}, allow_nan=False)


def _from_json(line: str) -> tuple[str, Outcome]:
    fields: dict[str, Any] = json.loads(line)
    key = fields.pop("key")
    chosen = fields.pop("candidate")
    candidate = Candidate(tuple(chosen["wheelless_links"]), tuple(chosen["head_scp_joints"]))
    numbers: dict[str, Any] = {
        name: math.inf if value == "inf" else value for name, value in fields.items()
    }
    return key, Outcome(candidate=candidate, **numbers)
