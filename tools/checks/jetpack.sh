#!/usr/bin/env bash
# Configures the JetPack presets and compiles their CUDA device without a board: for the sysroot of Debian's packages
# (toolchains/make_sysroot.sh), with a stand-in in the place of the board's CUDA runtime, whose functions all fail. Proves the
# presets, the toolchain files and the code; what is linked against it is of no use on a board. Exit code 77: skipped, a
# program is missing.
#
#     tools/checks/jetpack.sh [6|7...]      default: those that nvcc knows
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
toolkit="$(dirname "$(dirname "$(realpath "${CUDACXX:-$(command -v nvcc || echo /usr/local/cuda/bin/nvcc)}")")")"
for program in "$toolkit/bin/nvcc" aarch64-linux-gnu-g++ cmake; do
  if ! command -v "$program" > /dev/null; then
    echo "jetpack.sh: skipped: $program is missing"
    exit 77
  fi
done
if [ "$#" -eq 0 ]; then
  known=$'\n'"$("$toolkit/bin/nvcc" --list-gpu-code)"$'\n'
  if [[ "$known" == *$'\n'sm_87$'\n'* ]]; then set -- "$@" 6; fi
  if [[ "$known" == *$'\n'sm_110$'\n'* ]]; then set -- "$@" 7; fi
fi
if ! grep -qs complete build/sysroot-aarch64/.haustra-sysroot; then toolchains/make_sysroot.sh; fi

# The sysroot again, with the runtime: links to files cost next to nothing.
sysroot="$PWD/build/sysroot-jetpack-stand-in"
rm -rf --one-file-system -- "${sysroot:?}"
cp -al build/sysroot-aarch64 "$sysroot"
target="$sysroot/usr/local/cuda/targets/aarch64-linux"
mkdir -p "$target/lib"
cp -a "$(realpath "$toolkit/include")" "$target/include"
for library in cudart_static cudadevrt; do
  {
    nm -g --defined-only "$(find -L "$toolkit" -name "lib$library.a" -print -quit)" 2> /dev/null |
      awk '$2 == "T" && $3 ~ /^[A-Za-z_][A-Za-z0-9_]*$/ && !seen[$3]++ {
        print ".globl " $3 "\n.type " $3 ",%function\n" $3 ": mov w0, #999\n ret" }'
  } | aarch64-linux-gnu-gcc -x assembler -c - -o "$target/lib/$library.o"
  aarch64-linux-gnu-ar rcs "$target/lib/lib$library.a" "$target/lib/$library.o"
done
aarch64-linux-gnu-gcc -shared -nostdlib "$target/lib/cudart_static.o" -o "$target/lib/libcudart.so"

for version in "$@"; do
  preset="aarch64-jetpack$version"
  folder="build/check-jetpack$version"
  HAUSTRA_SYSROOT="$sysroot" CUDACXX="$toolkit/bin/nvcc" cmake --preset "$preset" -B "$folder" > /dev/null
  cmake --build "$folder" --target haustra_kernels_cuda
  for library in "$folder"/kernels/cuda/*.a; do
    file="$(aarch64-linux-gnu-objdump -f "$library" | grep -c 'elf64-littleaarch64')"
    [ "$file" -gt 0 ] || { echo "jetpack.sh: $library is not for aarch64" >&2; exit 1; }
  done
  echo "$preset: configured, and its CUDA device compiled"
done
