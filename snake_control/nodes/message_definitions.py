"""The text of a message type with all that it is made of, as recordings carry it.

The format is that of the schema encoding ``ros2msg``: the type's own text, then each type that it
needs after a line of ``=`` and a line ``MSG: package/Name``.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

from snake_control.errors import SnakeError

_SEPARATOR = "=" * 80
# Names of message types begin with a capital, those of built-in types do not.
_FIELD = re.compile(r"\s*(?:(?P<package>[a-z]\w*)/)?(?:msg/)?(?P<name>[A-Z]\w*)(?:\[[^\]]*\])?\s")


class DefinitionError(SnakeError, LookupError):
    """A message type whose text is not installed."""


def installed_text(package: str, name: str) -> str:
    """Return the text of a message file that is installed.

    Raises:
        DefinitionError: there is none.
    """
    try:
        share = get_package_share_directory(package)
        return Path(share, "msg", f"{name}.msg").read_text(encoding="utf-8")
    except (PackageNotFoundError, OSError) as error:
        raise DefinitionError(f"no definition of {package}/msg/{name}: {error}") from error


def type_name(message_type: type) -> str:
    """Return the name of a message type, ``package/msg/Name``."""
    package, kind, _ = message_type.__module__.split(".", 2)
    return f"{package}/{kind}/{message_type.__name__}"


def definition(name: str, text_of: Callable[[str, str], str] = installed_text) -> str:
    """Return the full definition of a type.

    Args:
        name: of the type, ``package/msg/Name``.
        text_of: gives the text of a type by package and name.

    Raises:
        DefinitionError: the type, or one that it needs, is not installed.
    """
    package, _, own_name = name.split("/")
    wanted = [(package, own_name)]
    parts = []
    for owner, type_ in wanted:
        text = text_of(owner, type_)
        heading = f"{_SEPARATOR}\nMSG: {owner}/{type_}\n" if parts else ""
        parts.append(f"{heading}{text.rstrip()}\n")
        for needed in _needed(text, owner):
            if needed not in wanted:
                # The loop goes on to what is appended here.
                wanted.append(needed)
    return "".join(parts)


def _needed(text: str, package: str) -> list[tuple[str, str]]:
    matches = (_FIELD.match(line) for line in text.splitlines())
    return [(match["package"] or package, match["name"]) for match in matches if match]
