"""Definitions of message types with all that they need."""

import pytest
from diagnostic_msgs.msg import DiagnosticArray

from snake_control.nodes.message_definitions import DefinitionError, definition, type_name

TEXTS = {
    ("a", "Outer"): (
        "# Comment: b/Not here\n"
        "uint8 KIND=1  # b/Nor here\n"
        'string NAME="b/Neither"\n'
        "b/Inner[<=3] many\n"
        "Own own\n"
        "b/msg/Inner again\n"
        "std/Other[2]   two\n"
        "float64[] numbers\n"
    ),
    ("b", "Inner"): "Own own\n",
    ("a", "Own"): "bool yes\n",
    ("b", "Own"): "bool no\n",
    ("std", "Other"): "string<=5 text\n",
}


def test_every_needed_type_follows_once_with_its_package():
    text = definition("a/msg/Outer", lambda package, name: TEXTS[package, name])
    head, *others = text.split("=" * 80 + "\n")
    assert head == TEXTS["a", "Outer"]
    assert [other.splitlines()[0] for other in others] == [
        "MSG: b/Inner",
        "MSG: a/Own",
        "MSG: std/Other",
        "MSG: b/Own",
    ]
    assert others[3] == "MSG: b/Own\nbool no\n"


def test_an_installed_type():
    name = type_name(DiagnosticArray)
    assert name == "diagnostic_msgs/msg/DiagnosticArray"
    headings = [line for line in definition(name).splitlines() if line.startswith("MSG: ")]
    assert set(headings) == {
        "MSG: std_msgs/Header",
        "MSG: builtin_interfaces/Time",
        "MSG: diagnostic_msgs/DiagnosticStatus",
        "MSG: diagnostic_msgs/KeyValue",
    }


@pytest.mark.parametrize("name", ["no_such_package/msg/X", "std_msgs/msg/NoSuch"])
def test_a_type_that_is_not_installed_is_named(name):
    with pytest.raises(DefinitionError, match=name):
        definition(name)
