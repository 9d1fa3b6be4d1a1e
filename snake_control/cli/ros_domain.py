"""A ROS domain of one's own, so that runs on one machine or network do not hear each other."""

from __future__ import annotations

import fcntl
import os
import random
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# Beyond 101 DDS's ports meet those that Linux hands out by itself.
_DOMAINS = range(1, 102)


@contextmanager
def own_domain() -> Iterator[None]:
    """Set ROS_DOMAIN_ID to a random domain on this machine alone, unless the user has set one.

    A lock file per domain keeps other runs on this machine off it while the context lasts.

    Raises:
        OSError: every domain is in use.
    """
    if os.environ.get("ROS_DOMAIN_ID"):
        yield
        return
    for domain in random.SystemRandom().sample(_DOMAINS, len(_DOMAINS)):
        path = Path(tempfile.gettempdir()) / f"snake_control_domain_{domain}.lock"
        try:
            lock = path.open("w")
        except OSError:
            continue
        with lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            os.environ["ROS_DOMAIN_ID"] = str(domain)
            os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
            try:
                yield
            finally:
                del os.environ["ROS_DOMAIN_ID"]
            return
    raise OSError("every ROS domain from 1 to 101 is in use")
