#!/usr/bin/env bash
# Proves that an installed bundle is self-contained: starts it in a root file system that has only Debian's essential
# packages, in two places (it must not matter where it lies), and renders and maps a few frames of colon there.
#
#     tools/checks/bundle.sh BUNDLE [ROOT]
#
# BUNDLE: a folder made by `cmake --install BUILD --prefix BUNDLE`, or a .tar.gz or .deb made by cpack. ROOT (default
# build/bare-root): the bare file system; made with mmdebstrap when it is not there, used as it is otherwise. Nothing is
# written to it: the bundle and the results live in temporary memory. Needs root or user namespaces.
set -euo pipefail

source_folder="$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)"
source "$source_folder/tools/checks/bare_root.sh"
[ "$#" -ge 1 ] && [ "$#" -le 2 ] || fail "usage: bundle.sh BUNDLE [ROOT]"
bundle="$(realpath -e -- "$1")" || fail "$1: no such bundle"
bare_root_at "${2:-$source_folder/build/bare-root}"

inside="$(mktemp)"
trap 'rm -f -- "$inside"' EXIT
cat > "$inside" <<'SCRIPT'
set -euo pipefail
bundle="$1" root="$2"
mount -t tmpfs none "$root/mnt"
mount -t tmpfs none "$root/opt"
mount -t proc none "$root/proc"
case "$bundle" in
  *.deb) dpkg-deb -x "$bundle" "$root/mnt/deb" && mv "$root/mnt/deb/opt/haustra" "$root/opt/haustra" ;;
  *.tar.gz) mkdir "$root/opt/haustra" && tar -xzf "$bundle" -C "$root/opt/haustra" --strip-components=1 ;;
  *) cp -a "$bundle" "$root/opt/haustra" ;;
esac
exec chroot "$root" /bin/bash -c '
  set -euo pipefail
  export PATH=/usr/bin:/bin HOME=/mnt
  for place in /opt/haustra "/mnt/another place/haustra"; do
    if [ ! -e "$place" ]; then mkdir -p "${place%/*}"; mv /opt/haustra "$place"; fi
    for program in "$place"/bin/*; do
      "$program" --help > /dev/null
      # What is loaded comes from the bundle or is the C library.
      ldd "$program" | while read -r line; do
        path="${line#*=> }"
        case "${path% (0x*}" in
          "$place"/*) ;;
          "not found") echo "missing: $line"; exit 1 ;;
          */libc.so.6 | */libm.so.6 | */libmvec.so.1 | */libdl.so.2 | */librt.so.1 | */libpthread.so.0 | */libresolv.so.2) ;;
          /lib*/ld-linux*) ;;
          /*) echo "from the machine, not from the bundle: $line"; exit 1 ;;
        esac
      done
      echo "starts: $program"
    done
  done
  cd /mnt
  "$place/bin/haustra" render colon --seconds 2 --size 360x270 --events none --quiet
  "$place/bin/haustra" run colon --out result --device cpu --config "$place/config/colon.yaml" 2> /dev/null
  test -s result/trajectory/live.tum && test -s result/summary.json
'
SCRIPT
in_namespaces "$inside" "$bundle" "$root"

if [ -d "$bundle" ] && command -v objdump > /dev/null; then
  newest="$(objdump -p "$bundle"/bin/* "$bundle"/lib/* | grep -o 'GLIBC_[0-9.]*' | sort -uV | tail -1)"
  echo "oldest C library that will do: ${newest/_/ }"
fi
echo "the bundle is self-contained"
