#!/usr/bin/env bash
# Builds for 64-bit Arm and runs the tests of the libraries under emulation. Makes the sysroot if there is none. Needs
# Debian's g++-aarch64-linux-gnu, qemu-user-static and mmdebstrap.
#
#     tools/check_aarch64.sh             all of them
#     tools/check_aarch64.sh --small     what depends on the processor most: hal, kernels, geometry
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
for program in aarch64-linux-gnu-g++ qemu-aarch64-static mmdebstrap; do
  if ! command -v "$program" > /dev/null; then
    echo "check_aarch64.sh: $program is missing: apt install g++-aarch64-linux-gnu qemu-user-static mmdebstrap" >&2
    exit 1
  fi
done
if [ -z "${HAUSTRA_SYSROOT:-}" ] && [ ! -e build/sysroot-aarch64/.haustra-sysroot ]; then toolchains/make_sysroot.sh; fi
cmake --preset aarch64 > /dev/null
# A test that dies on purpose starts itself again, which needs the kernel to know the emulator (binfmt_misc).
if [ ! -e /proc/sys/fs/binfmt_misc/qemu-aarch64 ]; then
  echo "check_aarch64.sh: left out: tests of what ends the program (*DeathTest*)"
  export GTEST_FILTER='-*DeathTest*'
fi
if [ "${1:-}" = --small ]; then
  cmake --build --preset aarch64 --target tests/hal/all tests/kernels/all tests/geometry/all
  ctest --preset aarch64 -j "$(nproc)" -R '^(hal|kernels|geometry)/'
  exit
fi
cmake --build --preset aarch64
ctest --preset aarch64 -j "$(nproc)"
