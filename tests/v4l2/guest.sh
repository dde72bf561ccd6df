#!/bin/bash
# The first process of the guest that run_vivid.sh boots: runs the tests, says "guest: passed" when all went well. When
# it ends the kernel panics, as Linux does without a first process, and that ends User-Mode Linux. HAUSTRA_BUILD comes from
# the kernel's command line.
export PATH=/usr/bin:/bin:/usr/sbin:/sbin
if [ "$$" -ne 1 ]; then
  echo "guest.sh is started by run_vivid.sh, in a guest" >&2
  exit 64
fi
mount -t proc none /proc
mount -t sysfs none /sys
mount -t tmpfs none /tmp
haustra="$HAUSTRA_BUILD/tools/haustra"

check() {
  echo "guest: $*"
  "$@" || { echo "guest: failed: $*"; exit 1; }
}
check "$HAUSTRA_BUILD/tests/v4l2/test_v4l2_vivid" --gtest_color=no --gtest_brief=1
check "$haustra" capture
# What is recorded can be read again, and a camera can be mapped: the picture stands still, so no map can be begun.
printf '%s\n' 'model: kannala_brandt' 'width_px: 640' 'height_px: 360' 'intrinsics: {fx: 300, fy: 300, cx: 320, cy: 180}' \
  'coefficients: {k1: 0, k2: 0, k3: 0, k4: 0}' > /tmp/camera.yaml
check "$haustra" capture vivid,size=640x360,input=0 --calibration /tmp/camera.yaml --frames 20 --out /tmp/recording
check test "$(ls /tmp/recording/frames | wc -l)" -eq 20
check "$haustra" run /tmp/recording --out /tmp/replayed
check timeout --preserve-status -s INT 5 "$haustra" run v4l2:vivid,size=640x360,input=0 --calibration /tmp/camera.yaml \
  --mode realtime --out /tmp/live
check test "$(grep -c '' /tmp/live/frames.csv)" -gt 20
echo "guest: passed"
