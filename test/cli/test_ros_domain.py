"""A ROS domain of one's own."""

from __future__ import annotations

import os

from snake_control.cli.ros_domain import own_domain


def test_domain_is_set_for_a_while_and_shared_with_nobody(monkeypatch):
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    taken = set()
    with own_domain():
        taken.add(os.environ.pop("ROS_DOMAIN_ID"))
        assert os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
        # A hundred tries of another run never meet ours.
        for _ in range(300):
            with own_domain():
                assert os.environ["ROS_DOMAIN_ID"] not in taken
        os.environ["ROS_DOMAIN_ID"] = taken.pop()
    assert "ROS_DOMAIN_ID" not in os.environ


def test_users_domain_is_kept(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    with own_domain():
        assert os.environ["ROS_DOMAIN_ID"] == "42"
        assert os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SUBNET"
