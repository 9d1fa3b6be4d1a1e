#!/usr/bin/env bash
# Says in one line what to install when a tool is missing that pip cannot bring.
set -u
missing=()
packages=()
need() { # command, what it is, apt package
  command -v "$1" >/dev/null 2>&1 || { missing+=("$2"); packages+=("$3"); }
}
need "${CC:-cc}" "a C compiler" build-essential
need "${CXX:-c++}" "a C++ compiler" build-essential
need cmake "cmake" cmake
if [ "${#missing[@]}" -gt 0 ]; then
  list=$(printf '%s, ' "${missing[@]}")
  unique=$(printf '%s\n' "${packages[@]}" | awk '!seen[$0]++' | paste -sd ' ' -)
  echo "Missing: ${list%, }; install: sudo apt install $unique" >&2
  exit 1
fi
