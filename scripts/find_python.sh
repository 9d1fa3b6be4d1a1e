#!/usr/bin/env bash
# Prints a Python 3.11, 3.12 or 3.13 that can make virtual environments and build extensions, or
# says in one line what to install. PYTHON=... asks for one in particular.
set -u

check='
import sys
if not (3, 11) <= sys.version_info[:2] <= (3, 13):
    sys.exit(3)
try:
    import ensurepip, venv
except ImportError:
    sys.exit(4)
import os, sysconfig
if not os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h")):
    sys.exit(5)
print(sys.executable)
'

lacking=0
if [ -n "${PYTHON:-}" ]; then
  candidates=("$PYTHON")
else
  candidates=(python3 python3.12 python3.11 python3.13
              /usr/bin/python3 /usr/bin/python3.12 /usr/bin/python3.11 /usr/bin/python3.13)
fi
# Run each: a version manager's shim may be on PATH and yet fail.
for candidate in "${candidates[@]}"; do
  found=$("$candidate" -c "$check" 2>/dev/null)
  status=$?
  if [ "$status" -eq 0 ] && [ -n "$found" ]; then
    echo "$found"
    exit 0
  fi
  if [ "$status" -eq 4 ] || [ "$status" -eq 5 ]; then
    lacking=$status
    version=$("$candidate" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null)
  fi
done

case "$lacking" in
  4) echo "Python $version cannot make virtual environments; install it: sudo apt install python$version-venv" ;;
  5) echo "The C headers of Python $version are missing; install them: sudo apt install python$version-dev" ;;
  *) if [ -n "${PYTHON:-}" ]; then
       echo "PYTHON=$PYTHON does not run as Python 3.11, 3.12 or 3.13; install one: sudo apt install python3 python3-venv python3-dev"
     else
       echo "No Python 3.11, 3.12 or 3.13 found; install one: sudo apt install python3 python3-venv python3-dev (or give PYTHON=path)"
     fi ;;
esac >&2
exit 1
