#!/usr/bin/env bash
# Installs what is missing, builds everything and runs all tests; ends with ctest's summary. HAUSTRA_CMAKE_ARGS: one more
# argument for cmake.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
bash tools/setup.sh
cmake --preset release ${HAUSTRA_CMAKE_ARGS:+"$HAUSTRA_CMAKE_ARGS"} > /dev/null
cmake --build --preset release
ctest --preset release -j "$(nproc)"
