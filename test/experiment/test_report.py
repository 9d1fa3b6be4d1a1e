"""The report is one file that needs no other, whatever was run."""

from __future__ import annotations

import base64
import html.parser
import re

import pytest

from snake_control.experiment.cases import load_case
from snake_control.experiment.facts import Facts
from snake_control.experiment.findings import findings
from snake_control.experiment.internal_motion import internal_motions
from snake_control.experiment.report import figures_of_merit, symbols, write_report
from snake_control.experiment.run import Settings, run_case
from support.robots import CONFIG
from support.runs import paper_facts


class Page(html.parser.HTMLParser):
    """Collects what a page shows and refers to; refuses tags left open."""

    VOID = {"meta", "img", "br", "link", "input"}

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.sources: list[str] = []
        self.tags: list[str] = []
        self.words: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.sources += [v for k, v in attrs if k in ("src", "href", "data") and v is not None]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] != "style":
            self.words.append(data)


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Page:
    path = tmp_path_factory.mktemp("report") / "report.html"
    facts = {case: paper_facts(case) for case in (1, 2, 3)}
    motions = internal_motions(paper_facts(1).run.config.robot, phases=(-0.1, 0.0, 0.1))
    write_report(facts, findings(facts), motions, path)
    return Page(path.read_text(encoding="utf-8"))


def test_nothing_is_fetched_and_no_script_runs(page):
    assert len(page.sources) == 9
    for source in page.sources:
        kind, data = source.split(",", 1)
        assert kind == "data:image/png;base64"
        assert base64.b64decode(data, validate=True).startswith(b"\x89PNG")
    assert not {"script", "link", "iframe", "object"} & set(page.tags)


def test_verdicts_and_numbers_of_all_cases_are_there(page):
    text = re.sub(r"\s+", " ", "".join(page.words))
    assert text.count("as in the paper") == 1 + 13
    assert text.count("differs") >= 4
    for words in ("Case 1: SCPs still", "lowest tenth 25..60 s", "perfect servos", "head block"):
        assert (words in text) == (words != "head block")
    assert "This is not the paper's robot" not in text


def test_symbols_are_set_and_everything_else_escaped():
    assert symbols("phi_7 < V_b1") == "<i>&phi;</i><sub>7</sub> &lt; <i>V</i><sub>b1</sub>"
    assert symbols("d_min, x_h") == "<i>d</i><sub>min</sub>, <i>x</i><sub>h</sub>"
    assert symbols("2.5e+08 and 1e-3") == "2.5&middot;10<sup>8</sup> and 1&middot;10<sup>-3</sup>"
    assert symbols("A_hat loses rank") == "A_hat loses rank"
    assert symbols("<script>") == "&lt;script&gt;"


def test_figures_of_merit_have_a_value_for_each_case():
    rows = figures_of_merit([paper_facts(case) for case in (1, 2, 3)])
    assert all(len(row.values) == 3 for row in rows)
    by_name = {row.name: row.values for row in rows}
    assert by_name["fell"] == ["no", "no", "no"]
    assert by_name["V_b1 below 2% of its start"][1:] == ["never", "never"]


def test_one_short_run_of_another_robot(tmp_path):
    config = load_case([CONFIG / "planar_snake.yaml"], None)
    run = run_case(config, Settings(duration_s=0.1, plant_step_s=0.02, servos="limited"))
    facts = {2: Facts(run)}
    path = tmp_path / "report.html"
    write_report(facts, findings(facts), internal_motions(config.robot, phases=(0.0, 0.1)), path)
    text = re.sub(r"\s+", " ", "".join(Page(path.read_text(encoding="utf-8")).words))
    assert "This is not the paper's robot" in text
    assert "Case 1 was not run" in text
    assert "limited servos" in text
