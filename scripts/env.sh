# Source this in bash: it opens .venv, ROS 2 and what colcon built, for one shell.
#   source scripts/env.sh
_snake_root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
if [ ! -x "$_snake_root/.venv/bin/python" ]; then
  echo "No .venv yet: run make setup first." >&2
  unset _snake_root
  return 1
fi
_snake_world=$(bash "$_snake_root/scripts/world.sh") || { unset _snake_root _snake_world; return 1; }
export VIRTUAL_ENV=$_snake_root/.venv
case ":$PATH:" in
  *":$VIRTUAL_ENV/bin:"*) ;;
  *) export PATH=$VIRTUAL_ENV/bin:$PATH ;;
esac
if [ "$_snake_world" = wheels ]; then
  # The environment itself is the ament prefix.
  export AMENT_PREFIX_PATH=$VIRTUAL_ENV CMAKE_PREFIX_PATH=$VIRTUAL_ENV
  unset COLCON_PREFIX_PATH PYTHONPATH
fi
# A robot on the same network must not hear the mock's commands.
export ROS_AUTOMATIC_DISCOVERY_RANGE=${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}
if [ -f "$_snake_root/install/local_setup.bash" ]; then
  # shellcheck disable=SC1091
  . "$_snake_root/install/local_setup.bash"
fi
unset _snake_root _snake_world
