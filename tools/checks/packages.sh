#!/usr/bin/env bash
# Builds the package that a vendor gets, and proves that it installs and runs on a bare system.
#
#     tools/checks/packages.sh [bundle|deb]...      default: both
#
# Exit code 77: skipped, this machine has no mmdebstrap, or may not make namespaces.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
if [ "$#" -eq 0 ]; then set -- bundle deb; fi
for part in "$@"; do
  case "$part" in
    bundle | deb) ;;
    *) echo "packages.sh: '$part' is neither bundle nor deb" >&2; exit 64 ;;
  esac
done
skip() {
  echo "skipped: packages ($1)"
  exit 77
}
command -v mmdebstrap > /dev/null || skip "mmdebstrap is not installed"
source tools/checks/bare_root.sh
in_namespaces -c "mount -t tmpfs none /mnt && mount -t proc none /proc" 2> /dev/null || skip "no namespaces with mounts here"

cmake --preset package > /dev/null
cmake --build --preset package
for part in "$@"; do
  case "$part" in
    bundle)
      bare_root_at build/bare-root || skip "no bare root can be made here"
      rm -rf --one-file-system -- build/package/bundle
      cmake --install build/package --prefix build/package/bundle > /dev/null
      tools/checks/bundle.sh build/package/bundle
      ;;
    deb)
      bare_root_at build/deb-root systemd procps || skip "no bare root can be made here"
      rm -f -- build/package/*.deb
      (cd build/package && cpack -G DEB > cpack.log) || { cat build/package/cpack.log >&2; exit 1; }
      packages=(build/package/*.deb)
      tools/checks/deb.sh "${packages[0]}"
      ;;
  esac
done
