#!/usr/bin/env bash
# Builds and runs tests with the sanitizers of addresses and undefined behaviour, then with that of threads.
#
#     tools/checks/sanitizers.sh                            everything with both: ten times as long as tools/test.sh
#     tools/checks/sanitizers.sh PRESET                     everything with one: asan-ubsan, tsan
#     tools/checks/sanitizers.sh PRESET [-L LABEL] NAME...  the tests of the programs test_NAME; with the label, these only
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
bash tools/setup.sh
if [ "$#" -eq 0 ]; then
  for preset in asan-ubsan tsan; do bash tools/checks/sanitizers.sh "$preset"; done
  exit 0
fi
preset="$1"
shift
tests=(--no-tests=error)
if [ "${1:-}" = -L ]; then
  tests+=(-L "^${2:?a label is missing}\$")
  shift 2
fi
programs=()
cuda=AUTO
if [ "$#" -gt 0 ]; then
  programs=(--target "${@/#/test_}")
  # No sanitizer looks at the GPU's code.
  cuda=OFF
  tests+=(-L "^test_($(IFS='|'; echo "$*"))\$")
fi
cmake --preset "$preset" -DHAUSTRA_CUDA="$cuda" > /dev/null
cmake --build --preset "$preset" "${programs[@]}"
ctest --preset "$preset" -j "$(nproc)" "${tests[@]}"
