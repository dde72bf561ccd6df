#!/bin/bash
# The first process of the guest that run_vivid.sh boots: runs the tests of HAUSTRA_PART, says "guest: passed" when all went
# well, "guest: skipped: WHY" when they cannot run. When it ends the kernel panics, as Linux does without a first process, and
# that ends User-Mode Linux. HAUSTRA_BUILD, HAUSTRA_SOURCE and HAUSTRA_PART come from the kernel's command line.
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
if [ "$HAUSTRA_PART" = loopback ]; then
  # A colon through a camera, from end to end. In the guest's time all computing takes none, so no frame comes too late.
  device="$(grep -l loopback /sys/class/video4linux/*/name | head -1)"
  if [ -z "$device" ]; then
    echo "guest: skipped: this kernel has no v4l2loopback"
    exit
  fi
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
  echo "guest: passed"
  exit
fi

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

# The service's threads run in real time by the limits of its unit alone: no capability, not the superuser. (A container
# may not let anybody raise these limits, so tests/service cannot always look.)
haustrad="$HAUSTRA_BUILD/platform/daemon/haustrad"
unit="$HAUSTRA_SOURCE/config/service/haustrad.service"
priority="$(sed -n 's/^LimitRTPRIO=//p' "$unit")"
memory="$(sed -n 's/^LimitMEMLOCK=infinity$/unlimited/p' "$unit")"
with_limits() {  # with_limits PRIORITY MEMORY COMMAND... &, which is what $! names
  local priority="$1" memory="$2"
  shift 2
  exec prlimit --rtprio="$priority:$priority" --memlock="$memory:$memory" setpriv --reuid=65534 --regid=65534 --clear-groups \
    --inh-caps=-all --bounding-set=-all --no-new-privs "$@"
}
service=(
  "$haustrad" --source /tmp/recording --set source.rate=0.1 --set rt.require=true --set memory.max_keyframes=200
  --set memory.max_map_points=20000 --set features.max=800 --set rt.heap_prefault_mb=32
  --set files.state_folder=/tmp/state --set files.runtime_folder=/tmp/service
)
ask() { "$haustra" control --folder /tmp/service "$@" 2> /dev/null; }
is_granted() {  # is_granted PROCESS THREAD: the limit of the unit, SCHED_FIFO, no capability
  local task
  grep -q "^Max realtime priority *$priority " "/proc/$1/limits" && grep -q '^CapEff:.0*$' "/proc/$1/status" || return 1
  for task in "/proc/$1/task"/*; do
    if [ "$(cat "$task/comm")" = "$2" ]; then chrt --pid "$(basename "$task")" | grep -q SCHED_FIFO; return; fi
  done
  return 1
}
begun() { ask begin case | grep -q '^procedure '; }
chmod -R a+rX /tmp/recording
mkdir -m 0777 /tmp/state /tmp/service
with_limits "$priority" "$memory" "${service[@]}" &
daemon="$!"
for _ in $(seq 20); do begun && break; sleep 0.5; done
worker="$(ask status | sed -n 's/^worker //p')"
granted_soon() { for _ in $(seq 10); do is_granted "$@" && return; sleep 0.1; done; return 1; }
check granted_soon "$worker" tracking
check granted_soon "$worker" capture
kill "$daemon"
check wait "$daemon"
# Without the limit it does not do as if.
rm -rf --one-file-system /tmp/state /tmp/service
mkdir -m 0777 /tmp/state /tmp/service
with_limits 0 "$memory" "${service[@]}" > /tmp/refused 2>&1 &
daemon="$!"
for _ in $(seq 20); do begun && break; sleep 0.5; done
if wait "$daemon"; then
  echo "guest: failed: a service without the limit that it requires"
  exit 1
fi
check grep -q 'tracking thread: SCHED_FIFO 46 refused' /tmp/refused

echo "guest: passed"
