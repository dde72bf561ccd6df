#!/usr/bin/env bash
# Whether the main program of the tests (tests/main.cc) tells skipped, passed, failed and empty runs apart.
#
#     main_program.sh PROGRAM    (of the three sources beside this file)
set -euo pipefail
program="$1"

expect() {  # STATUS ARGUMENT...
  local wanted="$1" status=0
  shift
  "$program" "$@" > /dev/null 2>&1 || status=$?
  if [ "$status" -ne "$wanted" ]; then
    echo "'$*' ended with $status instead of $wanted"
    exit 1
  fi
}

expect 77 skipped_parts.cc
expect 0 passing_parts.cc
expect 0 passing_parts.cc skipped_parts.cc
expect 1 failing_parts.cc
expect 1 failing_parts.cc skipped_parts.cc
expect 1 no_such_parts.cc
expect 64 --gtest_filter=Passing* passing_parts.cc
