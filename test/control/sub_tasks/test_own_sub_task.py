"""A sub-task of somebody else's, in a module of its own, and what can be wrong with it."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from snake_control.config import ControllerConfig, load
from snake_control.control.scp_controller import ScpController
from snake_control.control.sub_tasks import Composition
from snake_control.errors import ConfigError, ModelError, SubTaskError
from snake_control.model.posture import Posture
from support.own_sub_tasks import STRAIGHT
from support.robots import CONFIG, PAPER, random_q


def gains(name: str = "my_package.my_module:Straight", **values) -> ControllerConfig:
    return ControllerConfig(base_sub_tasks=(name,), **values)


def test_a_yaml_file_brings_it_into_the_controller(own_package, tmp_path):
    own_package(STRAIGHT)
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


def test_without_a_weight_it_weighs_1(own_package):
    own_package(STRAIGHT)
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
            "gradient fails: its answer has shape (11,), it must have (17,)",
        ),
        (
            STRAIGHT.replace("-0.5 *", "undefined_name *"),
            "my_package.my_module:Straight",
            "value fails: NameError",
        ),
        (
            STRAIGHT
            + """
        def by_head(self, posture):
            return [0.0]
""",
            "my_package.my_module:Straight",
            "by_head fails: its answer has shape (1,), it must have (5,)",
        ),
        (
            STRAIGHT
            + """
        def by_base(self, posture):
            return None
""",
            "my_package.my_module:Straight",
            "by_base fails: TypeError",
        ),
    ],
)
def test_what_is_no_sub_task_is_refused_at_the_start(own_package, text, name, says):
    own_package(text)
    with pytest.raises(ConfigError) as caught:
        ScpController(PAPER, gains(name))
    assert caught.value.field == "controller.base_sub_tasks[0]"
    assert caught.value.value == name
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        ("{}['gone']", "KeyError: 'gone'"),
        ("1 / 0", "ZeroDivisionError: division by zero"),
        ("by_q[6:]", "its answer has shape (11,), it must have (17,)"),
        ("1j * by_q", "TypeError: it is made of complex128, not of real numbers"),
        ("[str(x) for x in by_q]", "not of real numbers"),
    ],
)
def test_what_it_does_wrong_later_is_one_error_with_its_name(own_package, answer, says):
    own_package(
        STRAIGHT.replace("return by_q", f"return by_q if posture.g.q[6] == -0.11 else {answer}")
    )
    task = Composition(PAPER, gains())
    with pytest.raises(SubTaskError) as caught:
        task.velocities(Posture(PAPER, random_q(PAPER, 1)), np.zeros(6))
    assert caught.value.name == "my_package.my_module:Straight"
    assert str(caught.value).startswith("sub-task my_package.my_module:Straight, gradient fails: ")
    assert says in str(caught.value)
    copy = pickle.loads(pickle.dumps(caught.value))
    assert (str(copy), vars(copy)) == (str(caught.value), vars(caught.value))


def test_an_error_of_this_package_passes_as_it_is(own_package):
    own_package(
        STRAIGHT.replace("return by_q", "return Posture(self.robot, by_q[1:]).g.q").replace(
            "import numpy as np",
            "import numpy as np\n    from snake_control.model.posture import Posture",
        )
    )
    task = Composition(PAPER, gains())
    with pytest.raises(ModelError):
        task.velocities(Posture(PAPER, random_q(PAPER, 1)), np.zeros(6))
