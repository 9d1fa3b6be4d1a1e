#!/usr/bin/env bash
# Builds both packages into install/.
set -e
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. scripts/env.sh
python=$PWD/.venv/bin/python
[ "$(bash scripts/world.sh)" = wheels ] || python=$(command -v python3)
mkdir -p build
scripts/quietly.sh build/colcon.log "Building snake_interfaces and snake_control (about half a minute)" \
  colcon build --base-paths . snake_interfaces --cmake-args "-DPython3_EXECUTABLE=$python"
