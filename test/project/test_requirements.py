"""What set-up installs is pinned, all of it."""

import importlib.metadata
import re
import sys
import sysconfig
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PIN = re.compile(r"(?P<name>[A-Za-z0-9_.-]+)==(?P<version>[A-Za-z0-9_.+]+)(?P<marker> *;.*)?")
FILES = ("runtime", "dev", "ros", "bench")


def _lines(name: str) -> list[str]:
    text = (ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8")
    return [line for line in text.splitlines() if line and not line.startswith("#")]


def _canonical(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def _pins() -> dict[str, set[str]]:
    pins: dict[str, set[str]] = {}
    for line in (line for name in FILES for line in _lines(name)):
        match = PIN.fullmatch(line)
        assert match is not None, line
        pins.setdefault(_canonical(match["name"]), set()).add(match["version"])
    return pins


@pytest.mark.parametrize("name", FILES)
def test_every_line_is_an_exact_pin(name):
    lines = _lines(name)
    assert lines
    assert [line for line in lines if not PIN.fullmatch(line)] == []


def test_files_do_not_contradict_each_other():
    several = {name: sorted(versions) for name, versions in _pins().items() if len(versions) > 1}
    marked = {
        _canonical(match["name"])
        for name in FILES
        for line in _lines(name)
        if (match := PIN.fullmatch(line)) and match["marker"]
    }
    assert set(several) - marked == set()


def test_what_is_installed_is_what_is_pinned():
    world = Path(sys.prefix, "world")
    if not (world.is_file() and world.read_text(encoding="utf-8").startswith("wheels ")):
        pytest.skip("not an environment with the ROS wheels that set-up made")
    pins = _pins()
    wrong = {}
    for distribution in importlib.metadata.distributions():
        # The wheels also bring metadata of the ament packages inside them; pip installed none.
        if (distribution.read_text("INSTALLER") or "").strip() != "pip":
            continue
        # setuptools carries copies of others inside itself.
        if Path(str(distribution.locate_file(""))) != Path(sysconfig.get_path("purelib")):
            continue
        name = _canonical(distribution.name)
        if name != "pip" and distribution.version not in pins.get(name, set()):
            wrong[name] = distribution.version
    assert wrong == {}
