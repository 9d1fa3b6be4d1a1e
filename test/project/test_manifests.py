"""package.xml, setup.py and the message package say the same, and what the code says."""

import ast
import re
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
OURS = {"snake_control", "support", "benchmarks", "faults", "fuzz", "heads", "pose_watch", "poses"}
# module: key of rosdep, where the two differ
KEYS = {
    "hypothesis": "python3-hypothesis",
    "jinja2": "python3-jinja2",
    "matplotlib": "python3-matplotlib",
    "mpl_toolkits": "python3-matplotlib",
    "numpy": "python3-numpy",
    "pytest": "python3-pytest",
    "scipy": "python3-scipy",
    "serial": "python3-serial",
    "setuptools": "python3-setuptools",
    "tqdm": "python3-tqdm",
    "yaml": "python3-yaml",
}
# Not in apt; what uses them says so where they are missing.
OPTIONAL = {"mcap", "mcap_ros2", "zstandard"}
# Needed without being imported: what starts the launch files, what dynamixel_sdk does not declare,
# a plugin.
NOT_IMPORTED = {"ros2launch", "python3-serial", "python3-pytest-timeout"}


def _manifest(path: str) -> ElementTree.Element:
    return ElementTree.parse(ROOT / path).getroot()


def _declared(*tags: str) -> set[str]:
    root = _manifest("package.xml")
    return {element.text or "" for tag in tags for element in root.findall(tag)}


def _imported(*folders: str) -> set[str]:
    """Return the rosdep keys of the third-party modules that a folder's files import."""
    names = set()
    for path in (p for folder in folders for p in (ROOT / folder).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"), str(path))):
            if isinstance(node, ast.Import):
                names |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                names.add((node.module or "").split(".")[0])
    return {KEYS.get(n, n) for n in names - OURS - set(sys.stdlib_module_names)}


def test_every_import_of_the_package_is_declared():
    declared = _declared("depend", "exec_depend")
    assert _imported("snake_control", "launch") - declared - OPTIONAL == set()


def test_every_import_of_the_tests_is_declared():
    declared = _declared("depend", "exec_depend", "test_depend")
    # distutils is setuptools' own on the newer Pythons.
    # requirements/bench.txt has what benchmarks compare with, requirements/dev.txt the exact
    # arithmetic; where that is missing its test is skipped.
    found = _imported("test", "benchmarks") - declared
    others = {"distutils", "mpmath", "pink", "threadpoolctl"}
    assert found - OPTIONAL - others == set()


def test_nothing_is_declared_in_vain():
    declared = _declared("depend", "exec_depend", "test_depend")
    assert (
        declared - _imported("snake_control", "launch", "test", "benchmarks") - NOT_IMPORTED
        == set()
    )


@pytest.mark.parametrize("field", ["version", "license", "maintainer"])
def test_both_packages_agree(field):
    ours, messages = _manifest("package.xml"), _manifest("snake_interfaces/package.xml")
    assert ours.findtext(field) == messages.findtext(field)


@pytest.mark.parametrize("field", ["version", "license", "maintainer", "description"])
def test_setup_py_agrees_with_package_xml(field):
    text = (ROOT / "setup.py").read_text(encoding="utf-8")
    match = re.search(rf'^    {field}="(.*)",$', text, re.MULTILINE)
    assert match is not None
    assert match.group(1) == _manifest("package.xml").findtext(field)


def test_every_message_is_built():
    listed = re.findall(
        r'"((?:msg|srv|action)/\w+\.\w+)"',
        (ROOT / "snake_interfaces/CMakeLists.txt").read_text(encoding="utf-8"),
    )
    folder = ROOT / "snake_interfaces"
    present = [
        str(path.relative_to(folder))
        for kind in ("msg", "srv", "action")
        for path in folder.glob(f"{kind}/*.{kind}")
    ]
    assert sorted(listed) == sorted(present)
