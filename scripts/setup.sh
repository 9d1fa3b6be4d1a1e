#!/usr/bin/env bash
# setup.sh WORLD: makes .venv, or brings it up to date with requirements/.
set -eu
cd "$(dirname "${BASH_SOURCE[0]}")/.."
root=$PWD
world=$1
wanted="$world $root"
log=$root/.venv/setup.log

# A ROS that is not on this machine's PATH must not leak into the environment that is made here.
[ "$world" = jazzy ] || unset PYTHONPATH AMENT_PREFIX_PATH CMAKE_PREFIX_PATH

scripts/check_tools.sh
if [ "$world" = jazzy ]; then
  # ROS's modules are compiled for the system's Python.
  python=$(PYTHON=${PYTHON:-/usr/bin/python3} scripts/find_python.sh)
  "$python" scripts/check_ros.py
else
  case "$(uname -sm)" in
    "Linux x86_64") ;;
    *) echo "The ROS 2 wheels are for Linux on x86-64; on $(uname -sm), install ROS 2 Jazzy and source its setup.bash first." >&2
       exit 1 ;;
  esac
  python=$(scripts/find_python.sh)
fi

version_of() { "$1" -c 'import sys; print(sys.version.split()[0])' 2>/dev/null || true; }
if [ "$(cat .venv/world 2>/dev/null)" != "$wanted" ] ||
   { [ -n "${PYTHON:-}" ] && [ "$(version_of .venv/bin/python)" != "$(version_of "$python")" ]; }; then
  # What was built for another Python, another ROS or another folder is of no use here.
  rm -rf .venv build install log
  options=()
  [ "$world" = jazzy ] && options=(--system-site-packages)
  echo "Making .venv with Python $(version_of "$python") ($python)"
  "$python" -m venv "${options[@]}" .venv
  echo "$wanted" >.venv/world
  # colcon must not look for packages in there.
  touch .venv/COLCON_IGNORE
  echo >.venv/python
fi
[ -z "${PYTHON:-}" ] || echo "$PYTHON" >.venv/python

files=(-r requirements/dev.txt)
[ "$world" = jazzy ] || files+=(-r requirements/runtime.txt -r requirements/ros.txt)
scripts/quietly.sh "$log" "Installing the pinned packages (once; about two minutes)" \
  .venv/bin/python -m pip install --disable-pip-version-check --no-input "${files[@]}"
[ "$world" = jazzy ] || .venv/bin/python scripts/localise_cmake.py
