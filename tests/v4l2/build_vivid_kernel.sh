#!/usr/bin/env bash
# Builds the kernel for run_vivid.sh from Debian 12's linux-source-6.1: User-Mode Linux with vivid built in. Needs about
# 1.5 GB of disk and ten minutes of processor time; nothing is installed.
#
#     tests/v4l2/build_vivid_kernel.sh [FOLDER]      default build/vivid-kernel
#
# Needs build-essential, bc, flex, bison, xz-utils, and a package source of Debian 12.
set -euo pipefail

source_folder="$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)"
folder="$(realpath -m -- "${1:-$source_folder/build/vivid-kernel}")"
readonly marker=.haustra-vivid-kernel
if [ -d "$folder" ] && [ ! -e "$folder/$marker" ] && [ -n "$(ls -A -- "$folder")" ]; then
  echo "build_vivid_kernel.sh: $folder is not empty and was not made by this script" >&2
  exit 1
fi
mkdir -p -- "$folder"
touch -- "$folder/$marker"
cd "$folder"
rm -rf --one-file-system -- "${folder:?}/package" "${folder:?}/source"
apt-get download -qq linux-source-6.1
dpkg-deb -x linux-source-6.1_*.deb package
mkdir source
tar -xJf package/usr/src/linux-source-6.1.tar.xz -C source --strip-components=1
rm -rf --one-file-system -- "${folder:?}/package"
cd source
KCONFIG_ALLCONFIG="$source_folder/tests/v4l2/vivid_kernel.config" make ARCH=um allnoconfig > /dev/null
for option in VIDEO_VIVID HOSTFS DEVTMPFS; do
  grep -q "^CONFIG_$option=y" .config || { echo "build_vivid_kernel.sh: this source has no $option" >&2; exit 1; }
done
make ARCH=um -j "$(nproc)" linux > ../build.log 2>&1 || { tail -20 ../build.log >&2; exit 1; }
strip -o ../linux linux
cd ..
rm -rf --one-file-system -- "${folder:?}/source"
ls -l "$folder/linux"
