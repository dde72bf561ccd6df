#!/usr/bin/env bash
# Runs clang-tidy with the checks of .clang-tidy over the product, several files of a target at once.
#
#     tools/checks/tidy.sh [PART/PARTS]     2/4: the second of every four pieces; default: all
#
# Exit codes: 0 clean, 1 not (the places are printed), 77 skipped: the answer depends on the version of clang-tidy, and the one
# that the project is written with is not installed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
[[ "${1:-1/1}" =~ ^([1-9][0-9]?)/([1-9][0-9]?)$ ]] && [ "${BASH_REMATCH[1]}" -le "${BASH_REMATCH[2]}" ] ||
  { sed -n 2,7p "${BASH_SOURCE[0]}" >&2; exit 64; }
part="${BASH_REMATCH[1]}" parts="${BASH_REMATCH[2]}"
required_major=14
for program in "clang-tidy-$required_major" "run-clang-tidy-$required_major" clang++; do
  if ! command -v "$program" > /dev/null; then
    echo "tidy: skipped, $program is not installed"
    exit 77
  fi
done

cmake --preset tidy > /dev/null
# Made by the build, with data only.
touch build/tidy/platform/version.cc build/tidy/tools/report/page_assets.cc build/tidy/tools/view/view_assets.cc
# Neighbours take about as long as each other, so every so many is a fair share.
mapfile -t pieces < <(sed -n 's/^  "file": "\(.*\)",\?$/\1/p' build/tidy/compile_commands.json | sort -u |
  awk -v part="$part" -v parts="$parts" 'NR % parts == part % parts { gsub(/[.+]/, "[&]"); print "^" $0 "$" }')
[ "${#pieces[@]}" -gt 0 ] || { echo "tidy: nothing to look at in part $part of $parts" >&2; exit 1; }
log="$(mktemp)"
trap 'rm -f -- "$log"' EXIT
if "run-clang-tidy-$required_major" -clang-tidy-binary "clang-tidy-$required_major" -p build/tidy -quiet -j "$(nproc)" \
    "${pieces[@]}" > "$log" 2>&1; then
  echo "tidy: ${#pieces[@]} pieces are clean"
  exit 0
fi
sed -i -e 's/\x1b\[[0-9;]*m//g' -e "s#$PWD/##g" "$log"
grep -E '(warning|error):' "$log" | sort -u || tail -40 "$log"
exit 1
