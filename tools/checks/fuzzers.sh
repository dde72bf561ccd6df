#!/usr/bin/env bash
# Runs every fuzzer of tests/fuzz on its corpus, as many at once as there are processors.
#
#     tools/checks/fuzzers.sh [SECONDS [NAME...]]      default: 600 seconds for each; NAME: atlas_reader, image, ...
#
# Built with clang, AddressSanitizer and UndefinedBehaviorSanitizer in build/fuzz. New inputs that reach new code stay in
# build/fuzz/corpus, inputs that fail in build/fuzz/failures; the corpus in the tree stays as it is. Needs clang with
# libFuzzer (Debian: clang, libclang-rt-14-dev).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
seconds="${1:-600}"
[[ "$seconds" =~ ^[0-9]+$ ]] || { echo "fuzzers.sh: '$seconds' is no number of seconds" >&2; exit 64; }
shift || true
command -v clang++ > /dev/null || { echo "fuzzers.sh: clang++ is missing: apt install clang" >&2; exit 1; }

cmake --preset fuzz > /dev/null
mapfile -t targets < <(cmake --build --preset fuzz --target help | sed -n 's/^\(fuzz_[a-z_0-9]*\): phony$/\1/p' |
  grep -v '^fuzz_make_corpus$')
[ "${#targets[@]}" -gt 0 ] || { echo "fuzzers.sh: the build has no fuzzers" >&2; exit 1; }
if [ "$#" -gt 0 ]; then targets=("${@/#/fuzz_}"); fi
cmake --build --preset fuzz --target "${targets[@]}"

fuzz() {
  local target="$1" name="${1#fuzz_}" log="build/fuzz/${1#fuzz_}.log" verdict=clean
  # The corpus of atlas_reader is called atlas, that of control_protocol control.
  local seeds="tests/fuzz/corpus/$name"
  if [ ! -d "$seeds" ]; then seeds="tests/fuzz/corpus/${name%_*}"; fi
  mkdir -p "build/fuzz/corpus/$name" build/fuzz/failures
  "build/fuzz/tests/fuzz/$target" -max_total_time="$seconds" -timeout=25 -rss_limit_mb=3000 -max_len=16384 \
    -verbosity=0 -print_final_stats=1 -artifact_prefix="build/fuzz/failures/$name-" "build/fuzz/corpus/$name" "$seeds" \
    > "$log" 2>&1 || verdict="failed"
  echo "$name: $verdict, $(sed -n 's/^stat::number_of_executed_units: *//p' "$log") runs"
  [ "$verdict" = clean ] || { tail -40 "$log"; return 1; }
}
export -f fuzz
export seconds
if ! printf '%s\n' "${targets[@]}" | xargs -P "$(nproc)" -I{} bash -c 'fuzz {}'; then
  echo "fuzzers.sh: failed; see build/fuzz/failures" >&2
  exit 1
fi
echo "all fuzzers are clean"
