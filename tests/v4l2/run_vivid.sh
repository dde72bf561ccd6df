#!/usr/bin/env bash
# Runs the camera tests on a real kernel with virtual cameras, in User-Mode Linux: vivid for all that a driver can do,
# v4l2loopback for a colon that is captured and mapped from end to end. No hardware, no root, one to two minutes. The guest's
# clock is a virtual one that stands still while it computes: however busy this machine is, a picture is never late. Exit
# code 77: skipped, there is no such kernel, or it does not start here.
#
#     tests/v4l2/run_vivid.sh [BUILD [PART]]  BUILD: build folder, default build/release; PART: vivid (default) or loopback
#
# The kernel is named by HAUSTRA_VIVID_KERNEL (also packed, as .xz), or lies in build/vivid-kernel/linux, where
# tests/v4l2/build_vivid_kernel.sh puts it. The guest sees this machine's own files, read-only,
# but for /tmp, which is its own.
set -euo pipefail

part="${2:-vivid}"
[ "$part" = vivid ] || [ "$part" = loopback ] || { sed -n 2,9p "${BASH_SOURCE[0]}" >&2; exit 64; }
source_folder="$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)"
build="$(realpath -- "${1:-$source_folder/build/release}")"
kernel="${HAUSTRA_VIVID_KERNEL:-$source_folder/build/vivid-kernel/linux}"
if [ ! -x "$kernel" ] && [[ "$kernel" != *.xz || ! -e "$kernel" ]]; then
  echo "run_vivid.sh: skipped: no kernel with vivid at $kernel; tests/v4l2/build_vivid_kernel.sh builds one"
  exit 77
fi
for program in tests/v4l2/test_v4l2_vivid tests/v4l2/haustra_loopback_feed tools/haustra platform/daemon/haustrad; do
  if [ ! -x "$build/$program" ]; then
    echo "run_vivid.sh: $build/$program is missing: build test_v4l2_vivid, haustra_loopback_feed, haustra and haustrad" >&2
    exit 1
  fi
done
if [ ! -w /dev/shm ]; then
  echo "run_vivid.sh: skipped: the guest's memory needs /dev/shm"
  exit 77
fi

case "$build/:$source_folder/" in
  /tmp/*|*:/tmp/*)
    echo "run_vivid.sh: skipped: the guest has a /tmp of its own, so build and sources must lie elsewhere"
    exit 77
    ;;
esac

scratch="$(mktemp -d)"
trap 'rm -rf --one-file-system -- "${scratch:?}"' EXIT
log="$scratch/log"
if [[ "$kernel" == *.xz ]]; then
  command -v xz > /dev/null || { echo "run_vivid.sh: skipped: xz is not installed"; exit 77; }
  xz -dc -- "$kernel" > "$scratch/linux"
  chmod +x "$scratch/linux"
  kernel="$scratch/linux"
fi
ulimit -c 0
# Two inputs: a webcam and HDMI. One capture node, nothing else of the driver.
TMPDIR=/dev/shm timeout "${HAUSTRA_VIVID_TIMEOUT:-300}" "$kernel" mem=1G root=/dev/root rootfstype=hostfs rootflags=/ ro \
  init="$source_folder/tests/v4l2/guest.sh" HAUSTRA_BUILD="$build" HAUSTRA_SOURCE="$source_folder" HAUSTRA_PART="$part" \
  con=null con0=null,fd:1 quiet time-travel=inf-cpu vivid.node_types=0x1 vivid.num_inputs=2 vivid.input_types=0xc \
  v4l2loopback.card_label=loopback < /dev/null 2>&1 | grep -v --line-buffered 'Kernel panic\|^$' | tee "$log" || true
if grep -q '^guest: passed' "$log"; then exit 0; fi
if grep -q '^guest: skipped' "$log"; then exit 77; fi
if ! grep -q '^guest: ' "$log"; then
  echo "run_vivid.sh: skipped: the kernel does not start here"
  exit 77
fi
echo "run_vivid.sh: failed; what the guest said stands above" >&2
exit 1
