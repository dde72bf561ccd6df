#!/bin/sh
# Whether every source file stands as .clang-format says. Exit codes: 0 yes, 1 no (the places are printed), 77 skipped: the
# answer depends on the version of clang-format, and the one that the project is written with is not installed.
set -u
required_major=14
cd "$(dirname "$0")/../.." || exit 70

for candidate in "clang-format-$required_major" clang-format; do
  if command -v "$candidate" > /dev/null &&
      "$candidate" --version | grep -q "version $required_major\."; then
    find hal kernels capture engine platform tools tests \( -name '*.[ch]' -o -name '*.cc' -o -name '*.cu' -o -name '*.cuh' \) -print0 |
      xargs -0 "$candidate" --dry-run --Werror || exit 1
    echo "format: clean"
    exit 0
  fi
done
echo "format: skipped, clang-format $required_major is not installed"
exit 77
