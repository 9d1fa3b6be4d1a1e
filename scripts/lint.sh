#!/usr/bin/env bash
# Style, types and import rules; all of them, also when one fails.
set -u
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export PATH=$PWD/.venv/bin:$PATH
failed=()
check() { # label, command...
  local label=$1 output
  shift
  if output=$("$@" 2>&1); then
    echo "lint: $label passed"
  else
    printf '%s\n' "$output"
    echo "lint: $label FAILED"
    failed+=("$label")
  fi
}
check "ruff check" ruff check .
check "ruff format" ruff format --check --diff .
check "mypy" mypy
check "import-linter" lint-imports --no-logo
if [ "${#failed[@]}" -gt 0 ]; then
  (IFS=,; echo "lint: failed: ${failed[*]}" >&2)
  exit 1
fi
