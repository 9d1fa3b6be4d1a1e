"""Sub-tasks and weights: presets, lists of one's own, and what contradicts itself."""

from __future__ import annotations

import dataclasses

import pytest

from snake_control.config import Circle, ControllerConfig, load
from snake_control.errors import ConfigError


def composition(c: ControllerConfig) -> tuple:
    head = dict(zip(c.head_sub_tasks, c.head_weights, strict=True))
    base = dict(zip(c.base_sub_tasks, c.base_weights, strict=True))
    return c.a_h, head, c.a_b, base, c.scp_law


CASE_3 = (1e5, {"manipulability": 1.0}, 1.0, {"singularity": 1e-11, "fall": 3.0}, "gradient")


def test_case_3_written_out_is_case_3():
    written = ControllerConfig(
        head_sub_tasks=("manipulability",),
        head_weights=(1.0,),
        base_sub_tasks=("singularity", "fall"),
        base_weights=(1e-11, 3.0),
    )
    assert composition(ControllerConfig()) == CASE_3
    assert composition(written) == CASE_3
    assert written == ControllerConfig()


@pytest.mark.parametrize("preset", ["paper", "scale_free"])
@pytest.mark.parametrize("case", [1, 2, 3])
def test_a_snapshot_given_as_a_whole_is_itself(preset, case):
    """So that parameters saved from a running node start the next one."""
    controller = ControllerConfig(case=case, preset=preset)
    assert dataclasses.replace(controller) == controller


def test_case_1_is_still_in_every_preset():
    for preset in ("paper", "scale_free"):
        controller = ControllerConfig(case=1, preset=preset)
        assert (controller.a_h, controller.a_b, controller.scp_law) == (0.0, 0.0, "gradient")


def test_scale_free_cases_have_the_purposes_of_the_papers():
    case_2 = ControllerConfig(case=2, preset="scale_free")
    case_3 = ControllerConfig(case=3, preset="scale_free")
    assert case_3.base_sub_tasks == ("wheel_axes", "relative_fall", "joint_range")
    assert case_2.base_weights == (case_3.base_weights[0], 0.0, case_3.base_weights[2])
    assert case_3.head_sub_tasks == ("log_manipulability", "joint_range")
    assert case_3.scp_law == "projection"
    assert (case_3.a_prime, case_3.b_prime) == (0.0, 0.0)


def test_a_list_without_weights_gets_what_suits_each():
    controller = ControllerConfig(
        case=1,
        head_sub_tasks=("manipulability", "joint_range"),
        base_sub_tasks=("wheel_axes", "fall", "my_package.my_module:Mine"),
    )
    a_h, head, a_b, base, law = composition(controller)
    assert a_h * head["manipulability"] == pytest.approx(1e5)
    assert a_h * head["joint_range"] == pytest.approx(0.1)
    assert (a_b, base["wheel_axes"], base["fall"]) == (1.0, 0.1, 3.0)
    assert base["my_package.my_module:Mine"] == 1.0
    assert law == "gradient"


def test_weights_alone_replace_those_of_the_case():
    controller = ControllerConfig(case=2, base_weights=(2e-11, 1.0))
    assert controller.base_sub_tasks == ("singularity", "fall")
    assert (controller.a_prime, controller.b_prime) == (2e-11, 1.0)


def test_the_papers_names_weigh_its_sub_tasks_in_a_list_too():
    controller = ControllerConfig(base_sub_tasks=("fall", "joint_range"), b_prime=5.0)
    assert controller.base_weights == (5.0, 0.1)
    assert controller.a_prime == 0.0


def test_none_is_no_sub_task():
    controller = ControllerConfig(
        head_sub_tasks=("none",), base_sub_tasks=("none",), base_weights=(0.0,)
    )
    assert controller.head_sub_tasks == controller.base_sub_tasks == ()
    assert controller.head_weights == controller.base_weights == ()


@pytest.mark.parametrize(
    ("values", "field", "says"),
    [
        ({"base_sub_tasks": ("fal",)}, "base_sub_tasks[0]", "singularity, log_singularity"),
        ({"base_sub_tasks": ("fall", "my_task")}, "base_sub_tasks[1]", "package.module:Class"),
        ({"base_sub_tasks": ("manipulability",)}, "base_sub_tasks[0]", "wheel_axes"),
        ({"head_sub_tasks": ("fall",)}, "head_sub_tasks[0]", "manipulability"),
        ({"base_sub_tasks": ("fall", "none")}, "base_sub_tasks[1]", "[none]"),
        ({"base_sub_tasks": ("fall", "fall")}, "base_sub_tasks[1]", "once"),
        ({"base_sub_tasks": ("a b:C",)}, "base_sub_tasks[0]", "package.module:Class"),
        ({"base_weights": (1.0,)}, "base_weights", "singularity, fall"),
        ({"head_sub_tasks": ("none",), "head_weights": (1.0,)}, "head_weights", "none"),
        (
            {"base_sub_tasks": ("joint_range",), "a_prime": 1e-11},
            "a_prime",
            "singularity, which is not among the base sub-tasks in force: joint_range",
        ),
        ({"preset": "scale_free", "b_prime": 3.0}, "b_prime", "wheel_axes"),
        ({"base_weights": (1e-11, 3.0), "b_prime": 4.0}, "b_prime", "not both"),
        ({"base_sub_tasks": ("obstacles",)}, "obstacles_file", "radius_m"),
    ],
)
def test_what_is_wrong_or_contradicts_itself_is_refused(values, field, says):
    with pytest.raises(ConfigError) as caught:
        ControllerConfig(**values)
    assert caught.value.field == f"controller.{field}"
    assert says in str(caught.value)


def write(tmp_path, text):
    path = tmp_path / "obstacles.yaml"
    path.write_bytes(text)
    parameters = tmp_path / "parameters.yaml"
    parameters.write_text(f"/**: {{ros__parameters: {{controller: {{obstacles_file: {path}}}}}}}\n")
    return parameters


def test_obstacles_come_from_a_file_of_their_own(tmp_path):
    path = write(
        tmp_path, b"- {x_m: 0.5, y_m: -1, radius_m: 5e-2}\n- {radius_m: 1, x_m: 0, y_m: 0}"
    )
    controller = load(path).controller
    assert controller.obstacles == (Circle(0.5, -1.0, 0.05), Circle(0.0, 0.0, 1.0))


def test_no_obstacle_at_all_is_a_list_too(tmp_path):
    assert load(write(tmp_path, b"[]")).controller.obstacles == ()
    assert load().controller.obstacles is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (b"- {x_m: 0.5, y_m: 0.0, radius_m: -1.0}", "obstacle 1: radius_m = -1.0"),
        (b"- {x_m: 0, y_m: 0, radius_m: 1}\n- {x_m: 0.5, y_m: 0.0}", "obstacle 2 is"),
        (b"- {x_m: 0.5, y_m: 0.0, radius_m: 1.0, z_m: 1.0}", "no more"),
        (b"- {x_m: .nan, y_m: 0.0, radius_m: 1.0}", "obstacle 1: x_m = nan"),
        (b"- {x_m: left, y_m: 0.0, radius_m: 1.0}", "give a number"),
        (b"- 5", "obstacle 1 is 5"),
        (b"x_m: 0.5", "a list"),
        (b"", "a list"),
        (b"[", "not valid YAML"),
        (b"\xff\xfe", "UTF-8"),
    ],
)
def test_a_wrong_obstacle_is_named(tmp_path, text, says):
    with pytest.raises(ConfigError) as caught:
        load(write(tmp_path, text))
    assert caught.value.field == "controller.obstacles_file"
    assert says in str(caught.value)


def test_a_missing_file_of_obstacles_is_named():
    with pytest.raises(ConfigError, match=r"obstacles_file.*nowhere\.yaml.*cannot be read"):
        ControllerConfig(obstacles_file="/nowhere.yaml")
