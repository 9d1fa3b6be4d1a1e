#!/usr/bin/env bash
# quietly.sh LOG LABEL COMMAND...: runs COMMAND with its output in LOG, with a sign of life every
# 15 s on the console, and the end of LOG there if the command fails.
set -u
log=$1 label=$2
shift 2
mkdir -p "$(dirname "$log")"
printf '%s\n' "$label"
SECONDS=0
said=0
"$@" >"$log" 2>&1 </dev/null &
child=$!
trap 'kill "$child" 2>/dev/null' INT TERM
while kill -0 "$child" 2>/dev/null; do
  sleep 0.5
  if [ "$((SECONDS - said))" -ge 15 ]; then
    said=$SECONDS
    printf '    ... %s s\n' "$said"
  fi
done
wait "$child"
status=$?
if [ "$status" -ne 0 ]; then
  # pip says this for every package and every local folder it was told to look into.
  grep -v 'is ignored: it is neither a file nor a directory' "$log" | tail -n 40 >&2
  printf 'failed with exit code %s; the whole output is in %s\n' "$status" "$log" >&2
  exit "$status"
fi
printf '    done in %s s\n' "$SECONDS"
