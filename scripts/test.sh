#!/usr/bin/env bash
# All tests: those in simulated time on all processors, then those of single nodes two at a time, for
# they mostly wait, and those of whole robots one at a time: nodes rightly stop when a machine keeps
# them waiting.
#   scripts/test.sh [pytest options]
# Not -u: the scripts that colcon makes read unset variables.
cd "$(dirname "${BASH_SOURCE[0]}")/.." || exit
. scripts/env.sh || exit
failed=0 selected=$#
run() { # pytest options...; of a selection, a part may have no tests (exit code 5)
  local code=0
  python -m pytest "$@" || code=$?
  if [ "$code" -ne 0 ] && ! { [ "$code" -eq 5 ] && [ "$selected" -gt 0 ]; }; then failed=$code; fi
}
run -m "not real_time" -n auto "$@"
[ "$failed" -le 1 ] || exit "$failed"
run -m "real_time and not alone" -n 2 --dist loadfile "$@"
[ "$failed" -le 1 ] || exit "$failed"
run -m "real_time and alone" "$@"
exit "$failed"
