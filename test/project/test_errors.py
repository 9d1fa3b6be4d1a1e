"""Errors say what they said in the process that raised them."""

import pickle

import pytest

from snake_control.errors import ConfigError, NotReadyError, ServoError, SnakeError


@pytest.mark.parametrize(
    "error",
    [
        SnakeError("plain"),
        ConfigError("robot.links", 3, "allowed: 6 to 200"),
        NotReadyError("the next step", 2.0, "nothing came"),
        ServoError(["servo 3 is missing", "servo 4 is hot"]),
    ],
    ids=lambda error: type(error).__name__,
)
def test_an_error_passes_between_processes(error):
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is type(error)
    assert str(copy) == str(error)
    assert vars(copy) == vars(error)
