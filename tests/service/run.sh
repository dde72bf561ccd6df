#!/usr/bin/env bash
# The service under a real systemd, in a container of this machine's own /usr (systemd-nspawn): ready, reload, hang and
# kill -9 of the worker and of the service, stop in time, end of a procedure, clock jumps, full disk, wrong
# configuration. About two minutes.
#
#     sudo tests/service/run.sh BUILD [SEQUENCE]      BUILD: build/release; SEQUENCE: a folder of frames, default: it renders one
#
# Needs root, systemd-container and libfaketime. Exit codes: 0 all checks hold, 1 some do not, 77 this machine cannot.
set -euo pipefail

skip() {
  echo "skipped: $1"
  exit 77
}
[ "$#" -eq 1 ] || [ "$#" -eq 2 ] || { sed -n 2,9p "$0"; exit 64; }
build=$(realpath "$1")
here=$(cd "$(dirname "$0")" && pwd)
root_of_tree=$(cd "$here/../.." && pwd)
for program in "$build/platform/daemon/haustrad" "$build/tools/haustra"; do
  [ -x "$program" ] || { echo "$program: not built"; exit 66; }
done
sequence=${2:+$(realpath -- "$2")}
[ -z "$sequence" ] || [ -d "$sequence/frames" ] || { echo "$sequence: not a folder with frames/"; exit 66; }
[ "$(id -u)" -eq 0 ] || skip "needs root"
command -v systemd-nspawn > /dev/null || skip "systemd-nspawn is not installed (package systemd-container)"
[ -x /usr/lib/systemd/systemd ] || skip "systemd is not installed"
[ -L /bin ] || skip "/usr is not merged"
faketime=$(find /usr/lib -name libfaketime.so.1 | head -1)
[ -n "$faketime" ] || skip "libfaketime is not installed"

work=$(mktemp -d "${TMPDIR:-/tmp}/haustra-service.XXXXXX")
[ -n "$work" ] && [ -d "$work" ] || exit 70
trap 'rm -rf --one-file-system "${work:?}"' EXIT
if [ -z "$sequence" ]; then
  sequence="$work/colon"
  "$build/tools/haustra" render "$sequence" --seconds 30 --size 360x270 --events none --quiet
fi

# A tree without a system of its own: this machine's programs, nothing of its configuration.
root="$work/root"
mkdir -p "$root"/{dev,etc/systemd/system/multi-user.target.wants,etc/systemd/system-preset,etc/haustra,opt/haustra,proc,root}
mkdir -p "$root"/{results,run,sequence,sys,tmp,usr/lib,var/lib,var/log/journal}
# systemd-nspawn looks for it before /usr is mounted.
cp -L /usr/lib/os-release "$root/usr/lib/"
for link in bin sbin lib lib32 lib64; do
  if [ -L "/$link" ]; then ln -s "usr/$link" "$root/$link"; fi
done
cp -a /etc/alternatives /etc/ld.so.cache "$root/etc/"
ln -s ../usr/lib/os-release "$root/etc/os-release"
printf 'root:x:0:0:root:/root:/bin/bash\nnobody:x:65534:65534::/:/usr/sbin/nologin\n' > "$root/etc/passwd"
printf 'root:x:0:\nnogroup:x:65534:\n' > "$root/etc/group"
printf 'passwd: files\ngroup: files\n' > "$root/etc/nsswitch.conf"
printf 'disable *\n' > "$root/etc/systemd/system-preset/00-none.preset"
head -c 16 /dev/urandom | od -An -tx1 | tr -d ' \n' > "$root/etc/machine-id"
cp "$build/platform/daemon/haustrad" "$build/tools/haustra" "$here/guest.sh" "$root/opt/haustra/"
cp "$root_of_tree/config/service/haustra.sysusers" "$root/opt/haustra/"
cc -O1 -o "$root/opt/haustra/hold_thread" "$here/hold_thread.c"
# The unit as it is shipped, but for the place of the program.
sed 's|/usr/bin/haustrad|/opt/haustra/haustrad|' "$root_of_tree/config/service/haustrad.service" \
  > "$root/etc/systemd/system/haustrad.service"
# A recording that lasts; small pools; limits that a machine under load keeps.
cat > "$root/etc/haustra/haustra.yaml" << 'YAML'
source:
  path: /sequence
  rate: 0.1
  halve: false
features:
  max: 800
memory:
  max_keyframes: 200
  max_map_points: 20000
checkpoint:
  interval_s: 600
watchdog:
  tracking_limit_ms: 8000
  capture_limit_ms: 8000
  worker_limit_ms: 8000
YAML
cat > "$root/etc/systemd/system/test.service" << UNIT
[Unit]
After=multi-user.target
[Service]
Type=idle
Environment=FAKETIME=$faketime STOP_LIMIT_S=${STOP_LIMIT_S:-1.0}
ExecStart=/bin/bash /opt/haustra/guest.sh
UNIT
ln -s ../test.service "$root/etc/systemd/system/multi-user.target.wants/test.service"
mkdir "$work/results"

timeout 600 systemd-nspawn --quiet --directory="$root" --register=no --keep-unit --capability=all --private-network \
  --bind-ro=/usr --bind-ro="$sequence:/sequence" --bind="$work/results:/results" --boot systemd.show_status=no \
  < /dev/null > "$work/console" 2>&1 || { cat "$work/console"; skip "systemd does not boot in a container here"; }
[ -s "$work/results/log" ] || { cat "$work/console"; skip "systemd does not boot in a container here"; }
cat "$work/results/log"
if [ -n "${KEEP_LOG:-}" ]; then cp "$work/results/log" "$KEEP_LOG"; fi
grep -q '^failures: 0$' "$work/results/log"
