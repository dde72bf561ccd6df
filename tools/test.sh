#!/usr/bin/env bash
# Installs what is missing, builds everything and runs all tests. Ends with ctest's summary, or with the requirements of
# which no test ran. HAUSTRA_CMAKE_ARGS: more arguments for cmake, separated by spaces.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
bash tools/setup.sh
read -ra arguments <<< "${HAUSTRA_CMAKE_ARGS:-}"
cmake --preset release "${arguments[@]}" > /dev/null
cmake --build --preset release
ctest --preset release -j "$(nproc)" --output-junit "$PWD/build/release/tests.xml" --test-output-size-passed 10000000
traced=build/release/requirements.txt
python3 tools/checks/trace.py --ran build/release/tests.xml > "$traced" 2>&1 || { cat "$traced"; exit 1; }
