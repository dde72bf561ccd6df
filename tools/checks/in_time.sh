#!/usr/bin/env bash
# Runs a check, and gives it up when it is not done in time.
#
#     tools/checks/in_time.sh SECONDS NAME COMMAND...
#
# Its time ends after so many seconds, or at HAUSTRA_DONE_BEFORE (seconds since 1970) if that is given and sooner. Exit codes:
# that of the command, or 77: skipped, it was not done in time, or less than a minute was left and it was not begun.
set -euo pipefail
[ "$#" -ge 3 ] && [[ "$1" =~ ^[0-9]+$ ]] || { sed -n 2,7p "${BASH_SOURCE[0]}" >&2; exit 64; }
end="$(($(date +%s) + $1))"
name="$2"
shift 2
skip() {
  echo "skipped: $name: this machine was too slow to be done in time"
  exit 77
}

if [ "${HAUSTRA_DONE_BEFORE:-$end}" -lt "$end" ]; then
  end="$HAUSTRA_DONE_BEFORE"
  if [ "$((end - $(date +%s)))" -lt 60 ]; then skip; fi
fi
left="$((end - $(date +%s)))"
if [ "$left" -le 0 ]; then skip; fi  # for timeout 0 is no limit
status=0
timeout --kill-after=20 "$left" "$@" || status="$?"
# 124: ended by timeout; 137: killed, by timeout if time is over, by somebody else if it is not.
if [ "$status" -eq 124 ] || { [ "$status" -eq 137 ] && [ "$(date +%s)" -ge "$end" ]; }; then skip; fi
exit "$status"
