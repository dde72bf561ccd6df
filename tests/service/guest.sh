#!/bin/bash
# Runs inside the container as a unit, as root; each check prints "ok" or "FAILED". See run.sh.
# req: DMN-002,DMN-003,DMN-004,DMN-005,DMN-009,DATA-001
set -uo pipefail
exec >> /results/log 2>&1

failures=0
check() {  # check TEXT COMMAND...
  local text="$1"
  shift
  if "$@"; then echo "ok: $text"; else echo "FAILED: $text"; failures=$((failures + 1)); fi
}
show() { systemctl show haustrad -p "$1" --value; }
ask() { /opt/haustra/haustra control "$@"; }
status_has() { ask status | grep -q "^$1"; }
wait_for() {  # wait_for SECONDS COMMAND...
  local end=$((SECONDS + $1))
  shift
  until "$@"; do
    [ "$SECONDS" -lt "$end" ] || return 1
    sleep 0.1
  done
}
restarts_above() { [ "$(show NRestarts)" -gt "$1" ]; }
is_active() { [ "$(show ActiveState)" = active ]; }
is_new_main() { is_active && [ "$(show MainPID)" != "$1" ]; }
worker() { ask status | sed -n 's/^worker //p'; }
has_other_worker() { local now; now=$(worker); [ -n "$now" ] && [ "$now" != "$1" ]; }
is_gone() { [ ! -e "/proc/$1" ]; }
seconds_of() { local begin end; begin=$(date +%s%N); "$@" > /dev/null 2>&1; end=$(date +%s%N); awk "BEGIN { printf \"%.2f\", ($end - $begin) / 1e9 }"; }
at_most() { awk "BEGIN { exit !($1 <= $2) }"; }

echo "== $(systemctl --version | head -1), $(systemd-detect-virt)"
systemd-sysusers /opt/haustra/haustra.sysusers

echo "== ready"
check "start returns when the service is ready" systemctl start haustrad
check "active, status says idle" test "$(show StatusText)" = "idle: no procedure"
check "runs as the user haustra" test "$(stat -c %U "/proc/$(show MainPID)")" = haustra
check "so does its worker" test "$(stat -c %U "/proc/$(worker)")" = haustra
check "no capability is left" grep -q "^CapEff:.0000000000000000$" "/proc/$(show MainPID)/status"
check "the supervisor has given rights away" bash -c "journalctl -u haustrad --no-pager | grep -q 'own_rights system_calls=taken'"
check "poses are readable by the group" test "$(stat -c '%a %G' /run/haustra/poses)" = "640 haustra"
check "nobody else enters" test "$(stat -c '%a' /run/haustra) $(stat -c '%a' /var/lib/haustra/)" = "750 700"
check "a procedure begins" ask begin case-1
check "and is mapped" wait_for 90 status_has "maps 1"
check "the procedure was not interrupted meanwhile" test "$(show NRestarts)" = 0
if prlimit --rtprio=80:80 true 2> /dev/null; then
  check "the real-time limit is granted" grep -q "^Max realtime priority *80 " "/proc/$(worker)/limits"
else
  echo "skipped: this machine lets nobody raise the real-time limit (tests/v4l2 looks at it on a kernel of its own)"
fi

echo "== reload"
sed -i 's/interval_s: .*/interval_s: 1/' /etc/haustra/haustra.yaml
check "reload" systemctl reload haustrad
check "the new interval holds" wait_for 30 status_has checkpoint_age_s
check "active" is_active

echo "== hang of the tracking thread"
main=$(show MainPID)
first=$(worker)
before=$(show NRestarts)
/opt/haustra/hold_thread "$first" tracking &
check "another worker takes its place" wait_for 60 has_other_worker "$first"
check "because of that thread" status_has "last_fault tracking thread hangs"
check "the procedure goes on" wait_for 30 status_has "label case-1"
check "in its map" wait_for 60 status_has "tracking tracking"
check "the service lives on" test "$(show MainPID) $(show NRestarts)" = "$main $before"

echo "== hang of the capture thread, the second one of the procedure"
/opt/haustra/hold_thread "$(worker)" capture &
check "restarted" wait_for 60 restarts_above "$before"
check "with its exit code" bash -c "journalctl -u haustrad --no-pager | grep -q 'status=69'"
check "active again" wait_for 30 is_new_main "$main"
check "the procedure goes on" wait_for 30 status_has "label case-1"
check "in its map" wait_for 60 status_has "tracking tracking"

echo "== kill -9 of the worker"
check "a checkpoint comes" wait_for 60 status_has checkpoint_age_s
main=$(show MainPID)
before=$(show NRestarts)
first=$(worker)
kill -s KILL "$first"
check "another worker takes its place" wait_for 60 has_other_worker "$first"
check "the procedure goes on" wait_for 30 status_has "label case-1"
check "in its map" wait_for 60 status_has "tracking tracking"
check "the service lives on" test "$(show MainPID) $(show NRestarts)" = "$main $before"

echo "== the service itself hangs"
kill -s STOP "$main"
check "restarted by the watchdog" wait_for 60 restarts_above "$before"
check "by the watchdog indeed" bash -c "journalctl -u haustrad --no-pager | grep -q 'Watchdog timeout'"
check "active again" wait_for 30 is_new_main "$main"
check "the procedure goes on" wait_for 30 status_has "label case-1"

echo "== kill -9 of the service"
check "a checkpoint comes" wait_for 60 status_has checkpoint_age_s
main=$(show MainPID)
first=$(worker)
kill -s KILL "$main"
check "its worker goes, too" wait_for 10 is_gone "$first"
check "active again" wait_for 30 is_new_main "$main"
check "the procedure goes on" wait_for 30 status_has "label case-1"
check "in its map" wait_for 60 status_has "tracking tracking"

echo "== stop"
stopped=$(seconds_of systemctl stop haustrad)
check "stopped in $stopped s" at_most "$stopped" "${STOP_LIMIT_S:-1.0}"
check "in order" test "$(show Result)" = success
check "its maps are saved" test -s /var/lib/haustra/checkpoint.atlas
check "whole" /opt/haustra/haustra atlas info /var/lib/haustra/checkpoint.atlas
check "nothing stays in /run" test ! -e /run/haustra

echo "== end of the procedure"
systemctl reset-failed haustrad  # this script starts it more often than its limit allows
check "start" systemctl start haustrad
check "waits to be told after a stop in order" status_has "interrupted yes"
check "resume" ask resume
check "the procedure goes on" status_has "label case-1"
check "end" ask end
check "only the lock is left" test "$(find /var/lib/haustra/ -type f -printf '%P ')" = "lock "

echo "== clock jumps"
mkdir -p /etc/systemd/system/haustrad.service.d /run/faketime
printf '[Service]\nEnvironment=LD_PRELOAD=%s\nEnvironment=FAKETIME_TIMESTAMP_FILE=/run/faketime/offset\n' \
  "$FAKETIME" > /etc/systemd/system/haustrad.service.d/clock.conf
printf 'Environment=FAKETIME_NO_CACHE=1\nEnvironment=DONT_FAKE_MONOTONIC=1\n' \
  >> /etc/systemd/system/haustrad.service.d/clock.conf
echo +0 > /run/faketime/offset
chmod -R a+rX /run/faketime
systemctl daemon-reload
systemctl reset-failed haustrad
check "start" systemctl restart haustrad
main=$(show MainPID)
check "begin" ask begin case-2
check "mapped" wait_for 60 status_has "maps 1"
for offset in +3650d -3650d +0; do
  echo "$offset" > /run/faketime/offset
  sleep 3
  check "alive with the wall clock at $offset" test "$(show MainPID)" = "$main"
done
check "it was this clock that jumped" bash -c "tr '\\0' '\\n' < /proc/$main/environ | grep -q LD_PRELOAD"
check "checkpoints go on" wait_for 30 bash -c "/opt/haustra/haustra control status | grep -Eq '^checkpoints ([2-9]|[1-9][0-9])'"
check "tracking" status_has "tracking"
check "end" ask end wipe
rm /etc/systemd/system/haustrad.service.d/clock.conf
systemctl daemon-reload

echo "== full disk"
systemctl stop haustrad
mount -t tmpfs -o size=1M,mode=0700,uid="$(id -u haustra)",gid="$(id -g haustra)" tmpfs /var/lib/haustra
check "start" systemctl start haustrad
main=$(show MainPID)
check "begin" ask begin case-3
check "checkpoints fail" wait_for 90 status_has "checkpoint_error.*No space left"
check "the service runs on" test "$(show MainPID)" = "$main"
check "and tracks" status_has "tracking "
check "nothing half written is left" test -z "$(find /var/lib/haustra/ -name '*.partial-*')"
check "with room again" mount -o remount,size=200M /var/lib/haustra
check "checkpoints come" wait_for 30 status_has checkpoint_age_s
check "end" ask end wipe

echo "== configuration"
systemctl stop haustrad
echo 'nonsense: 1' >> /etc/haustra/haustra.yaml
check "a wrong configuration does not start" bash -c '! systemctl start haustrad'
sleep 2
check "and is not tried again and again" test "$(show ExecMainStatus) $(show ActiveState)" = "78 failed"
sed -i '/^nonsense/d; s|^source:|source:\n  calibration: /etc/haustra/none.yaml|' /etc/haustra/haustra.yaml
systemctl reset-failed haustrad
check "nor is a calibration that is not there started with" bash -c '! systemctl start haustrad'
sleep 2
check "again and again" test "$(show ExecMainStatus) $(show ActiveState)" = "66 failed"

systemd-analyze security haustrad --no-pager | tail -1
echo "== journal"
journalctl -u haustrad --no-pager -o short-monotonic | tail -150
echo "failures: $failures"
systemctl poweroff
