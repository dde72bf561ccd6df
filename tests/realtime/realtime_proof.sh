#!/usr/bin/env bash
# The real-time session in virtual time: Debian's real-time and stock kernels in an emulated machine of one processor
# whose clock counts instructions (qemu -icount), so that what is measured is scheduling, and no other load of this
# machine. Runs realtime_skeleton with and without real-time settings beside hogs and a reader of /proc/kallsyms, and
# prints the figures side by side.
#   realtime_proof.sh BUILD_FOLDER WORK_FOLDER [FRAMES=1000] [CASES="rt-amd64:realtime rt-amd64:ordinary amd64:realtime"]
# BUILD_FOLDER holds tests/realtime/realtime_skeleton (cmake --build ... --target realtime_skeleton). WORK_FOLDER is made;
# kernels are downloaded into it, nothing is installed. Needs qemu-system-x86, cpio, python3 and Debian's packages.
# HAUSTRA_ICOUNT_SHIFT (1): an instruction takes 2^shift ns. With 1 the processor carries out 500 million a second, one in
# four cycles of a core of 2 GHz. Exit codes: 0 real time met every deadline, 1 it did not, 77 skipped: a tool or the
# kernels cannot be had here.
set -euo pipefail
build="${1:?build folder}"
work="${2:?work folder}"
frames="${3:-1000}"
cases="${4:-rt-amd64:realtime rt-amd64:ordinary amd64:realtime}"
shift_bits="${HAUSTRA_ICOUNT_SHIFT:-1}"
hogs=2
readers=1
skeleton="$(realpath "$build")/tests/realtime/realtime_skeleton"
[ -x "$skeleton" ] || { echo "realtime_proof: $skeleton is missing: build the target realtime_skeleton" >&2; exit 2; }
for tool in qemu-system-x86_64 cpio python3 apt-get dpkg-deb; do
  command -v "$tool" > /dev/null || { echo "realtime_proof: skipped, there is no $tool"; exit 77; }
done
mkdir -p "$work"
work="$(realpath "$work")"

# kernel FLAVOUR: $work/vmlinux-FLAVOUR, unpacked from Debian's package, so that the guest need not do it.
kernel() {
  [ -s "$work/vmlinux-$1" ] && return
  local package
  package="$(apt-cache depends "linux-image-$1" | awk '/Depends: linux-image-[0-9]/ { print $2; exit }')"
  [ -n "$package" ] || return 1
  (cd "$work" && apt-get download "$package" > /dev/null 2>&1) || return 1
  dpkg-deb -x "$work/$package"_*.deb "$work/unpacked-$1"
  python3 - "$work/unpacked-$1"/boot/vmlinuz-* "$work/vmlinux-$1" <<'PYTHON'
import lzma, struct, sys
image = open(sys.argv[1], 'rb').read()
setup_sectors = image[0x1f1] or 4                        # Linux boot protocol, header fields
offset, length = struct.unpack_from('<II', image, 0x248)
start = (setup_sectors + 1) * 512 + offset
open(sys.argv[2], 'wb').write(lzma.LZMADecompressor().decompress(image[start:start + length]))
PYTHON
}

# One file system in memory: the program, its libraries, and nothing else. It is the first process.
root="$(mktemp -d "$work/root.XXXXXX")"
trap 'case "$root" in "$work"/root.*) rm -rf -- "$root" ;; esac' EXIT
mkdir -p "$root/proc" "$root/dev"
cp "$skeleton" "$root/skeleton"
ldd "$skeleton" | awk '{ for (i = 1; i <= NF; ++i) if ($i ~ /^\//) print $i }' | sort -u | while read -r library; do
  mkdir -p "$root$(dirname "$library")"
  cp -L "$library" "$root$library"
done
${CC:-cc} -O1 -static -x c -o "$root/init" - <<'C'
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mount.h>
#include <sys/reboot.h>
#include <sys/wait.h>
#include <unistd.h>
int main(void) {
  static char* arguments[] = {"/skeleton", NULL, NULL, NULL, NULL, NULL};
  mount("proc", "/proc", "proc", 0, "");
  FILE* file = fopen("/proc/sys/kernel/kptr_restrict", "w");
  if (file) { fputs("0", file); fclose(file); }
  for (int i = 1; i < 5; ++i) {
    char name[8] = "arg1";
    name[3] = (char)('0' + i);
    arguments[i] = getenv(name);
  }
  const pid_t child = fork();
  if (child == 0) {
    execv(arguments[0], arguments);
    perror("execv");
    _exit(1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  printf("EXIT %d\n", WIFEXITED(status) ? WEXITSTATUS(status) : 128);
  fflush(stdout);
  reboot(RB_POWER_OFF);
  return 0;
}
C
(cd "$root" && find . | cpio -o -H newc --quiet) > "$work/initrd"

met=1
summary=""
for case in $cases; do
  flavour="${case%%:*}"
  scheduling="${case##*:}"
  kernel "$flavour" || { echo "realtime_proof: skipped, no kernel package linux-image-$flavour"; exit 77; }
  echo "== kernel $flavour, $scheduling, $frames frames, $hogs hogs, $readers reader(s) of /proc/kallsyms"
  log="$work/$flavour-$scheduling.log"
  # Unknown words of the command line become the environment of init.
  timeout "${HAUSTRA_PROOF_TIMEOUT:-7200}" qemu-system-x86_64 -M q35 -accel tcg,thread=single \
    -icount "shift=$shift_bits,sleep=off" -cpu max -m 1024 -smp 1 -kernel "$work/vmlinux-$flavour" -initrd "$work/initrd" \
    -append "console=ttyS0 panic=-1 quiet mitigations=off arg1=$frames arg2=$scheduling arg3=$hogs arg4=$readers" \
    -nodefaults -display none -serial stdio -no-reboot < /dev/null | stdbuf -oL tr -d '\r' | tee "$log"
  result="$(grep '^RESULT' "$log" || true)"
  summary+="$flavour $scheduling: ${result:-no result}"$'\n'
  if [ "$case" = "rt-amd64:realtime" ] && ! grep -q 'late 0, dropped 0,' <<< "$result"; then met=0; fi
done
echo "== side by side"
printf '%s' "$summary"
[ "$met" = 1 ]
