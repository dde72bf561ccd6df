#!/usr/bin/env bash
# Installs what is missing, builds everything and runs all tests; ends with ctest's summary. HAUSTRA_CMAKE_ARGS: more
# arguments for cmake, separated by spaces.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
bash tools/setup.sh
read -ra arguments <<< "${HAUSTRA_CMAKE_ARGS:-}"
cmake --preset release "${arguments[@]}" > /dev/null
cmake --build --preset release
ctest --preset release -j "$(nproc)"
