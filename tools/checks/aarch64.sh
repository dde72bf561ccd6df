#!/usr/bin/env bash
# Builds for 64-bit Arm and runs it under emulation. Makes the sysroot if there is none.
#
#     tools/checks/aarch64.sh tests     the tests of all libraries: half an hour of processor time
#     tools/checks/aarch64.sh small     of these hal, kernels and geometry, without what takes minutes under emulation
#     tools/checks/aarch64.sh colon     end to end: a colon rendered on this machine is mapped there, and as well as here
#     tools/checks/aarch64.sh engine    the tests of the engine, without what takes minutes under emulation
#     tools/checks/aarch64.sh rest      those of capture, platform and tools, likewise
#     tools/checks/aarch64.sh sysroot   nothing more than what comes before: the packages and the sysroot
#
# Default: tests and colon. Exit code 77: skipped, this machine lacks what it needs and cannot install it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
if [ "$#" -eq 0 ]; then set -- tests colon; fi
for part in "$@"; do
  case "$part" in
    tests | small | colon | engine | rest | sysroot) ;;
    *) echo "aarch64.sh: '$part' is not one of tests, small, colon, engine, rest, sysroot" >&2; exit 64 ;;
  esac
done
skip() {
  echo "skipped: aarch64 ($*): $reason"
  exit 77
}
reason="g++-aarch64-linux-gnu, qemu-user-static or mmdebstrap cannot be installed here"
bash tools/setup.sh g++-aarch64-linux-gnu qemu-user-static mmdebstrap || skip "$@"
reason="a sysroot of arm64 packages cannot be made here; the cause stands above"
if [ -z "${HAUSTRA_SYSROOT:-}" ] && ! grep -qs complete build/sysroot-aarch64/.haustra-sysroot; then
  toolchains/make_sysroot.sh || skip "$@"
fi
cmake --preset aarch64 > /dev/null

left_out='-'
# A test that dies on purpose starts itself again, which needs the kernel to know the emulator (binfmt_misc).
if [ ! -e /proc/sys/fs/binfmt_misc/qemu-aarch64 ]; then
  echo "aarch64.sh: left out: tests of what ends the program (*DeathTest*)"
  left_out+='*DeathTest*:'
fi

run_sysroot() { :; }

run_tests() {
  cmake --build --preset aarch64
  GTEST_FILTER="$left_out" ctest --preset aarch64 -j "$(nproc)"
}

# Of extraction, the best instruction set on one thread is left.
run_small() {
  local slow='*/VisionDeviceContract.Extract*/ThreeThreads:*/VisionDeviceContract.Extract*/Portable:*RotationAndScaling*'
  cmake --build --preset aarch64 --target tests/hal/all tests/kernels/all tests/geometry/all
  GTEST_FILTER="$left_out$slow" ctest --preset aarch64 -j "$(nproc)" -R '^(hal|kernels|geometry)/' \
    -E '^geometry/(two_view|sim3|pose_optimizer)$'
}

# Left out are whole sessions on a simulated colon, which pass, too, and take 2 to 9 minutes each, and calibration, which
# takes a minute without an emulator.
run_engine() {
  cmake --build --preset aarch64 --target tests/engine/all
  GTEST_FILTER="$left_out" ctest --preset aarch64 -j "$(nproc)" -R '^engine/' \
    -E '^engine/(calibration|scheduler|system|second_session|merging_thread)$'
}

run_rest() {
  cmake --build --preset aarch64 --target tests/capture/all tests/platform/all tests/tools/all
  GTEST_FILTER="$left_out" ctest --preset aarch64 -j "$(nproc)" -R '^(capture|platform|tools)/' \
    -E '^(platform/(session|warm_up|restart|fixed_memory)|tools/(run_figures|vocabulary_command))$'
}

map_colon() {  # map_colon NAME PROGRAM...
  local name="$1"
  shift
  "$@" run build/aarch64/colon --out "build/aarch64/colon_$name" --device cpu > "build/aarch64/colon_$name.log" 2>&1 ||
    { cat "build/aarch64/colon_$name.log" >&2; return 1; }
  build/release/tools/haustra evaluate "build/aarch64/colon_$name" --groundtruth build/aarch64/colon/groundtruth.txt \
    --table "build/aarch64/colon_$name.csv" > /dev/null
  # Coverage in percent, error in millimetres, of a depth of 32: two seconds of so small a picture give 0.16 to 0.45 by seed.
  awk -F, -v name="$name" '{ figure[$1] = $2 }
    END {
      printf "%s: %d frames, coverage %s %%, %d map, %d keyframes, %d points, RMS ATE %s mm\n", name, figure["frames"],
        figure["coverage"], figure["maps"], figure["keyframes"], figure["map_points"], figure["rms_ate"]
      exit !(figure["frames"] == 50 && figure["coverage"] >= 95 && figure["maps"] == 1 && figure["rms_ate"] < 0.8)
    }' "build/aarch64/colon_$name.csv" || { echo "aarch64.sh: $name did not map the colon" >&2; return 1; }
}

run_colon() {
  if [ ! -x build/release/tools/haustra ]; then
    cmake --preset release > /dev/null
    cmake --build --preset release --target haustra
  fi
  cmake --build --preset aarch64 --target haustra
  rm -rf --one-file-system -- build/aarch64/colon build/aarch64/colon_*
  build/release/tools/haustra render build/aarch64/colon --seconds 2 --size 240x180 --events none --quiet
  map_colon x86-64 build/release/tools/haustra
  map_colon aarch64 qemu-aarch64-static -cpu max -L "${HAUSTRA_SYSROOT:-build/sysroot-aarch64}" build/aarch64/tools/haustra
}

for part in "$@"; do "run_$part"; done
