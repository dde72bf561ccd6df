#!/usr/bin/env bash
# Runs clang-tidy with the checks of .clang-tidy over the product, several files of a target at once. Exit codes: 0 clean,
# 1 not (the places are printed), 77 skipped: the answer depends on the version of clang-tidy, and the one that the project
# is written with is not installed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
required_major=14
for program in "clang-tidy-$required_major" "run-clang-tidy-$required_major" clang++; do
  if ! command -v "$program" > /dev/null; then
    echo "tidy: skipped, $program is not installed"
    exit 77
  fi
done

cmake --preset tidy > /dev/null
touch build/tidy/tools/report/page_assets.cc  # is made by the build, and holds data only
log="$(mktemp)"
trap 'rm -f -- "$log"' EXIT
if "run-clang-tidy-$required_major" -clang-tidy-binary "clang-tidy-$required_major" -p build/tidy -quiet -j "$(nproc)" \
    > "$log" 2>&1; then
  echo "tidy: clean"
  exit 0
fi
grep -E '(warning|error):' "$log" | sort -u || tail -40 "$log"
exit 1
