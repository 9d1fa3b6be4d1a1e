#!/usr/bin/env bash
# All tests: those in simulated time on all processors, then those of whole processes one at a time,
# because nodes rightly stop when a machine keeps them waiting.
#   scripts/test.sh [pytest options]
set -u
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. scripts/env.sh || exit
failed=0
python -m pytest -m "not real_time" -n auto "$@" || failed=$?
[ "$failed" -gt 1 ] && exit "$failed"
python -m pytest -m real_time "$@" || failed=$?
exit "$failed"
