#!/usr/bin/env bash
# Builds everything and runs all tests with the sanitizers of addresses and undefined behaviour, then with that of threads.
# About ten times as slow as tools/test.sh. Names a preset to run that one only: tools/check_sanitizers.sh tsan
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
bash tools/setup.sh
if [ "$#" -eq 0 ]; then set -- asan-ubsan tsan; fi
for preset in "$@"; do
  cmake --preset "$preset" > /dev/null
  cmake --build --preset "$preset"
  ctest --preset "$preset" -j "$(nproc)"
done
