#!/usr/bin/env bash
# Prints where ROS 2 comes from: "jazzy", an installed and sourced ROS 2 Jazzy, or "wheels", the
# packages that set-up puts into .venv.
if [ -z "${ROS_DISTRO:-}" ]; then
  echo wheels
elif [ "$ROS_DISTRO" = jazzy ]; then
  echo jazzy
else
  echo "ROS 2 $ROS_DISTRO is sourced, but this project needs Jazzy: use a shell without it." >&2
  exit 1
fi
