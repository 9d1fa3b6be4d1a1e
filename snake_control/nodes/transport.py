"""Keeps this process off Fast DDS's shared memory, on which one node can hold up another.

A writer that sends through shared memory opens the port of every reader that it meets, and waits
a third of a second, or a whole one, for one that is just starting, was killed or is frozen
(``healthy_check`` of Fast DDS 2.14). rclpy publishes with the interpreter's lock held, so that the
whole process stands still meanwhile: a bus without commands because somebody started ``ros2 topic
echo``. Through UDP, as quick for messages of this size, nothing is waited for.
"""

from __future__ import annotations

import os
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from xml.sax.saxutils import escape

from rclpy.utilities import get_rmw_implementation_identifier

from snake_control.errors import ConfigError

_BUILTIN = "FASTDDS_BUILTIN_TRANSPORTS"
_PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
_PROFILES_HERE = "DEFAULT_FASTRTPS_PROFILES.xml"
_NO_PROFILES_HERE = "SKIP_DEFAULT_XML_FILE"
_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_ONLY_HERE = "ROS_LOCALHOST_ONLY"
_PEERS = "ROS_STATIC_PEERS"
_SERVER = "ROS_DISCOVERY_SERVER"
# rcl takes whatever else is said as LOCALHOST.
_OTHER_RANGES = ("", "OFF", "SUBNET", "SYSTEM_DEFAULT")

_PARTICIPANTS_PER_HOST = 32
_LOCALHOST = "127.0.0.1"

_PROFILE = """<?xml version="1.0" encoding="UTF-8"?>
<dds><profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <transport_descriptors><transport_descriptor>
    <transport_id>udp</transport_id>
    <type>UDPv4</type>
    <maxInitialPeersRange>{participants}</maxInitialPeersRange>
  </transport_descriptor></transport_descriptors>
  <participant profile_name="no_shared_memory" is_default_profile="true"><rtps>
    <builtin>
      <metatrafficUnicastLocatorList><locator/></metatrafficUnicastLocatorList>
      <initialPeersList>{peers}</initialPeersList>
    </builtin>
    <userTransports><transport_id>udp</transport_id></userTransports>
    <useBuiltinTransports>false</useBuiltinTransports>
  </rtps></participant>
</profiles></dds>
"""
_PEER = "<locator><udpv4><address>{address}</address></udpv4></locator>"


@contextmanager
def without_shared_memory() -> Iterator[None]:
    """Have the participant that is made meanwhile, with its first node, talk through UDP alone.

    It must be the first one of the process: Fast DDS reads profiles once. It is left to other
    middlewares, and to users who chose transports or a profile themselves, what they do. Who is
    discovered stays as the environment says.

    Raises:
        ConfigError: a peer of ROS_STATIC_PEERS that has no address, or no place for a file.
    """
    if not get_rmw_implementation_identifier().startswith("rmw_fastrtps"):
        yield
    elif _on_localhost():
        if _profile_of_the_user() or os.environ.get(_SERVER):
            yield
        else:
            with _profile_for_localhost():
                yield
    elif os.environ.get(_BUILTIN):
        yield
    else:
        with _environment({_BUILTIN: "UDPv4"}):
            yield


@contextmanager
def _profile_for_localhost() -> Iterator[None]:
    """Say by a profile what rmw_fastrtps sets for this range, but for shared memory.

    It would add that whatever else is said.
    """
    addresses = [_LOCALHOST, *map(_address, _peers())]
    text = _PROFILE.format(
        participants=_PARTICIPANTS_PER_HOST,
        peers="".join(_PEER.format(address=escape(address)) for address in addresses),
    )
    try:
        directory = tempfile.TemporaryDirectory(prefix="fastdds_", ignore_cleanup_errors=True)
        file = Path(directory.name) / "profile.xml"
        file.write_text(text)
    except OSError as error:
        place = tempfile.gettempdir() if error.filename is None else error.filename
        raise ConfigError("TMPDIR", place, f"a directory to write to ({error})") from error
    values = {_RANGE: "SYSTEM_DEFAULT", _ONLY_HERE: None, _PROFILES: str(file)}
    with directory, _environment(values):
        yield


def _profile_of_the_user() -> bool:
    if os.environ.get(_PROFILES):
        return True
    return os.environ.get(_NO_PROFILES_HERE) != "1" and Path(_PROFILES_HERE).exists()


def _on_localhost() -> bool:
    return os.environ.get(_RANGE, "") not in _OTHER_RANGES or os.environ.get(_ONLY_HERE) == "1"


def _peers() -> list[str]:
    if os.environ.get(_ONLY_HERE) == "1":
        return []
    return [peer.strip() for peer in os.environ.get(_PEERS, "").split(";") if peer.strip()]


def _address(peer: str) -> str:
    try:
        return socket.gethostbyname(peer)
    except (OSError, UnicodeError) as error:
        raise ConfigError(_PEERS, peer, f"no address is known of it ({error})") from error


@contextmanager
def _environment(values: dict[str, str | None]) -> Iterator[None]:
    """Set variables for a time, or take them away; rcl and Fast DDS read them at start."""
    before = {name: os.environ.get(name) for name in values}
    _set(values)
    try:
        yield
    finally:
        _set(before)


def _set(values: dict[str, str | None]) -> None:
    for name, value in values.items():
        if value is None:
            with suppress(KeyError):
                del os.environ[name]
        else:
            os.environ[name] = value
