import re

import pytest

from snake_control.mock.faults import Fault
from snake_control.mock.scenario import ScenarioError, load_scenario
from support.graph import CONFIG


def write(tmp_path, text):
    path = tmp_path / "faults.yaml"
    path.write_text(text)
    return path


def test_times_and_faults_are_read(tmp_path):
    path = write(
        tmp_path,
        "faults:\n"
        "  - {at: 2, fault: late_reply, ids: [3, 4], duration: 0.5, value: 0.1, probability: 0.5}\n"
        "  - {at: 1.5, fault: unplug}\n",
    )
    assert load_scenario(path) == [
        (2.0, Fault("late_reply", (3, 4), 0.5, 0.1, 0.5)),
        (1.5, Fault("unplug")),
    ]


def test_the_example_is_one():
    assert len(load_scenario(CONFIG / "faults_example.yaml")) == 4


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("faults: [", "no YAML"),
        ("[]", "give one key, faults"),
        ("faults: 3", "faults = 3: give a list"),
        ("faults: [3]", "faults[0] = 3: give at, fault"),
        ("faults: [{fault: echo}]", "faults[0].at is missing"),
        ("faults: [{at: 1}]", "faults[0].fault is missing"),
        ("faults: [{at: 1, fault: echo, id: 3}]", "faults[0].id: known are at, fault, ids"),
        ("faults: [{at: -1, fault: echo}]", "faults[0].at = -1.0: give 0 or more"),
        ("faults: [{at: .nan, fault: echo}]", "faults[0].at = nan: give a finite number"),
        ("faults: [{at: 1, fault: echo}, {at: 1, fault: x}]", "faults[1].fault = 'x': known are"),
        ("faults: [{at: 1, fault: no_reply, ids: 3}]", "faults[0].ids = 3: give a list of ids"),
        ("faults: [{at: 1, fault: no_reply, ids: [300]}]", "faults[0].ids = [300]"),
        ("faults: [{at: 1, fault: overheat, value: hot}]", "faults[0].value = 'hot'"),
    ],
)
def test_mistakes_are_named(tmp_path, text, reason):
    path = write(tmp_path, text)
    with pytest.raises(ScenarioError, match=re.escape(f"{path}: {reason}")):
        load_scenario(path)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ScenarioError, match=r"none\.yaml: No such file"):
        load_scenario(tmp_path / "none.yaml")
