"""A sub-task of somebody else's, in a module of its own, and what can be wrong with it."""

from __future__ import annotations

import sys
import textwrap

import numpy as np
import pytest

from snake_control.config import ControllerConfig, load
from snake_control.control.scp_controller import ScpController
from snake_control.control.sub_tasks import Composition
from snake_control.errors import ConfigError
from snake_control.model.posture import Posture
from support.robots import CONFIG, PAPER, random_q

STRAIGHT = """
    import numpy as np
    from snake_control.control.sub_tasks import SubTask

    class Straight(SubTask):
        def value(self, posture):
            base = posture.g.q[6 + self.robot.head_links :]
            return -0.5 * float(base @ base)

        def gradient(self, posture):
            by_q = np.zeros(len(posture.g.q))
            first = 6 + self.robot.head_links
            by_q[first:] = -posture.g.q[first:]
            return by_q
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Write modules of a package that is importable during the test."""
    monkeypatch.syspath_prepend(tmp_path)
    directory = tmp_path / "my_package"
    directory.mkdir()
    (directory / "__init__.py").write_text("")

    def write(text: str) -> None:
        (directory / "my_module.py").write_text(textwrap.dedent(text))

    yield write
    for name in [name for name in sys.modules if name.partition(".")[0] == "my_package"]:
        del sys.modules[name]


def gains(name: str = "my_package.my_module:Straight", **values) -> ControllerConfig:
    return ControllerConfig(base_sub_tasks=(name,), **values)


def test_a_yaml_file_brings_it_into_the_controller(package, tmp_path):
    package(STRAIGHT)
    path = tmp_path / "straight.yaml"
    path.write_text(
        "/**: {ros__parameters: {controller: {\n"
        "  base_sub_tasks: [fall, 'my_package.my_module:Straight'], base_weights: [3.0, 0.5]}}}\n"
    )
    controller = load(CONFIG / "paper_robot.yaml", path).controller
    posture = Posture(PAPER, random_q(PAPER, 1))
    found = Composition(PAPER, controller).velocities(posture, np.zeros(6))[1:]
    s, by_phi = posture.k.s, 3.0 * posture.support.gradient[6:]
    by_phi[5:] -= 0.5 * posture.g.q[11:]
    F_3b = posture.k.F_bar[len(s.theta_h) :, 7:]
    np.testing.assert_allclose(found, by_phi[s.scp_b] + by_phi[s.theta_b] @ F_3b, rtol=1e-9)


def test_without_a_weight_it_weighs_1(package):
    package(STRAIGHT)
    assert gains().base_weights == (1.0,)
    assert gains().a_b == 1.0


@pytest.mark.parametrize(
    ("text", "name", "says"),
    [
        (STRAIGHT, "my_package.other:Straight", "cannot import my_package.other"),
        (STRAIGHT, "nowhere:Straight", "No module named 'nowhere'"),
        (STRAIGHT, "my_package.my_module:Bent", "has no class Bent"),
        (STRAIGHT, "my_package.my_module:np", "must derive from"),
        ("class Straight: pass", "my_package.my_module:Straight", "must derive from"),
        ("def broken(:", "my_package.my_module:Straight", "SyntaxError"),
        ("1 / 0", "my_package.my_module:Straight", "ZeroDivisionError"),
        (
            STRAIGHT.replace("def gradient", "def slope"),
            "my_package.my_module:Straight",
            "Straight lacks gradient",
        ),
        (
            STRAIGHT.replace("return by_q", "return by_q[6:]"),
            "my_package.my_module:Straight",
            "fails: ValueError: its gradient has shape (11,), it must have (17,)",
        ),
        (
            STRAIGHT.replace("-0.5 *", "undefined_name *"),
            "my_package.my_module:Straight",
            "fails: NameError",
        ),
    ],
)
def test_what_is_no_sub_task_is_refused_at_the_start(package, text, name, says):
    package(text)
    with pytest.raises(ConfigError) as caught:
        ScpController(PAPER, gains(name))
    assert caught.value.field == "controller.base_sub_tasks[0]"
    assert caught.value.value == name
    assert says in str(caught.value)
