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
check "$haustra" run /tmp/recording --set memory.profile=small --out /tmp/replayed
check timeout --preserve-status -s INT 5 "$haustra" run v4l2:vivid,size=640x360,input=0 --calibration /tmp/camera.yaml \
  --mode realtime --set memory.profile=small --out /tmp/live
check test "$(grep -c '' /tmp/live/frames.csv)" -gt 20

# A colon through a camera, from end to end. In the guest's time all computing takes none, so no frame comes too late.
device="$(grep -l loopback /sys/class/video4linux/*/name | head -1)"
if [ -z "$device" ]; then
  echo "guest: skipped: this kernel has no v4l2loopback"
else
  device="/dev/$(basename "$(dirname "$device")")"
  check "$haustra" render /tmp/colon --seconds 8 --size 360x270 --events none --quiet
  "$HAUSTRA_BUILD/tests/v4l2/haustra_loopback_feed" /tmp/colon "$device" /tmp/groundtruth.txt &
  feed="$!"
  sleep 0.5
  check timeout --preserve-status -s INT 10 "$haustra" run "v4l2:$device" --calibration /tmp/colon/calib.yaml \
    --mode realtime --set memory.profile=small --out /tmp/mapped
  check wait "$feed"
  check "$haustra" evaluate /tmp/mapped --groundtruth /tmp/groundtruth.txt --table /tmp/figures.csv
  # All 200 frames came through, one map has them, and it is as good as that of a recording (error in mm).
  check awk -F, '{ figure[$1] = $2 }
    END { exit !(figure["frames"] >= 200 && figure["coverage"] >= 95 && figure["maps"] == 1 && figure["dropped"] == 0 &&
                 figure["rms_ate"] > 0 && figure["rms_ate"] < 0.5) }' /tmp/figures.csv
fi
echo "guest: passed"
