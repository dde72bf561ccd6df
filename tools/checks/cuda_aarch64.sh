#!/usr/bin/env bash
# Compiles every CUDA source for the boards (Jetson Orin: sm_87, Jetson Thor: sm_110) with the cross compiler as its host
# compiler, and links the device code. Nothing is run, and no CUDA library of the board is needed. Exit code 77: skipped,
# nvcc or the cross compiler is not there.
#
#     tools/checks/cuda_aarch64.sh [SOURCE...]      default: kernels/cuda/*.cu
#
# CUDACXX names another nvcc; it must be of CUDA 13 for sm_110, else only sm_87 is compiled (CUDA 12.6 of JetPack 6).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
nvcc="${CUDACXX:-$(command -v nvcc || echo /usr/local/cuda/bin/nvcc)}"
for program in "$nvcc" aarch64-linux-gnu-g++; do
  if ! command -v "$program" > /dev/null; then
    echo "cuda_aarch64.sh: skipped: $program is missing"
    exit 77
  fi
done
if [ "$#" -gt 0 ]; then sources=("$@"); else sources=(kernels/cuda/*.cu); fi

architectures=()
known="$("$nvcc" --list-gpu-code)"
for architecture in 87 110; do
  if [[ $'\n'"$known"$'\n' == *$'\n'"sm_$architecture"$'\n'* ]]; then
    architectures+=(-gencode "arch=compute_$architecture,code=sm_$architecture")
    echo "for sm_$architecture"
  fi
done
[ "${#architectures[@]}" -gt 0 ] || { echo "cuda_aarch64.sh: $nvcc knows neither sm_87 nor sm_110" >&2; exit 1; }

objects="$(mktemp -d)"
trap 'rm -rf --one-file-system -- "${objects:?}"' EXIT
include="$(dirname "$(dirname "$(realpath "$(command -v "$nvcc")")")")/include"
for source in "${sources[@]}"; do
  echo "$source"
  "$nvcc" -ccbin aarch64-linux-gnu-g++ -std=c++20 -O2 -I. -I"$include" "${architectures[@]}" -c "$source" \
    -o "$objects/$(basename "$source").o"
  aarch64-linux-gnu-objdump -f "$objects/$(basename "$source").o" | grep -q 'elf64-littleaarch64'
done
"$nvcc" -ccbin aarch64-linux-gnu-g++ -I"$include" "${architectures[@]}" -dlink "$objects"/*.o -o "$objects/device_link.o"
echo "CUDA compiles and links for aarch64: ${#sources[@]} sources"
