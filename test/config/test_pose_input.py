"""Parameters of pose_input that do not fit together."""

import pytest

from snake_control.config import PoseInputConfig, from_parameters
from snake_control.errors import ConfigError


@pytest.mark.parametrize("source", ["rigid_bodies", "named_poses", "tf"])
def test_a_source_of_many_bodies_needs_a_name(source):
    with pytest.raises(ConfigError, match=r"body = .*name the one of the head"):
        from_parameters("pose_input", {"source": source})
    config = from_parameters("pose_input", {"source": source, "body": "head"})
    assert config.pose_input.body == "head"


@pytest.mark.parametrize("name", ["marker_position_m", "marker_rpy_rad"])
def test_a_mount_has_three_numbers(name):
    with pytest.raises(ConfigError, match=f"{name}.*give 3 numbers"):
        PoseInputConfig(**{name: (0.0, 0.1)})


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("source", "poses", "pose, pose_with_covariance, transform"),
        ("unstamped", "guess", "refuse, arrival"),
        ("new_place_after_poses", 1, "2 to 100000"),
        ("clock_tolerance_s", 0.1, "0 to 0.005"),
        ("pose_frames", [1], "a text"),
    ],
)
def test_what_is_allowed_is_said(name, value, allowed):
    with pytest.raises(ConfigError) as caught:
        from_parameters("pose_input", {name: value})
    assert caught.value.field.startswith(name)
    assert allowed in caught.value.allowed
