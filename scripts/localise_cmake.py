"""Points the CMake files of the ROS wheels to this environment's headers.

The wheels export include directories of the machine that built them, such as
/opt/python/cp311-cp311/include/python3.11, and CMake refuses targets whose directories do not
exist. Run with the environment's own Python; a second run finds nothing to change.
"""

from __future__ import annotations

import re
import sys
import sysconfig
from pathlib import Path

import numpy

BUILDER = r"/opt/python/cp3\d+-cp3\d+"
PYTHON_HEADERS = re.compile(BUILDER + r"/include/python3\.\d+")
NUMPY_HEADERS = re.compile(BUILDER + r"/lib/python3\.\d+/site-packages/numpy/_?core/include")


def main() -> None:
    """Rewrite share/**/cmake/*.cmake below ``sys.prefix``."""
    python_headers = sysconfig.get_path("include")
    numpy_headers = numpy.get_include()
    for path in Path(sys.prefix, "share").glob("**/cmake/*.cmake"):
        text = path.read_text(encoding="utf-8")
        # Functions, so that a backslash in a path is not read as a group reference.
        local = PYTHON_HEADERS.sub(lambda _: python_headers, text)
        local = NUMPY_HEADERS.sub(lambda _: numpy_headers, local)
        if local != text:
            path.write_text(local, encoding="utf-8")


if __name__ == "__main__":
    main()
