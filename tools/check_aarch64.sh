#!/usr/bin/env bash
# Builds for 64-bit Arm and runs the tests of the libraries under emulation. Makes the sysroot if there is none. Needs
# Debian's g++-aarch64-linux-gnu, qemu-user-static and mmdebstrap.
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
cmake --build --preset aarch64
ctest --preset aarch64 -j "$(nproc)"
