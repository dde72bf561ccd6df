#!/usr/bin/env bash
# Builds the kernel for run_vivid.sh from Debian 12's linux-source-6.1 and v4l2loopback-dkms: User-Mode Linux with the
# virtual cameras vivid and v4l2loopback built in. Needs about 1.5 GB of disk and ten minutes of processor time; nothing is
# installed.
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
apt-get download -qq linux-source-6.1 v4l2loopback-dkms
dpkg-deb -x linux-source-6.1_*.deb package
dpkg-deb -x v4l2loopback-dkms_*.deb package
rm -f -- linux-source-6.1_*.deb v4l2loopback-dkms_*.deb
mkdir source
tar -xJf package/usr/src/linux-source-6.1.tar.xz -C source --strip-components=1
# Not a part of the kernel's source: it goes in beside vivid.
mkdir source/drivers/media/test-drivers/v4l2loopback
cp package/usr/src/v4l2loopback-*/*.[ch] source/drivers/media/test-drivers/v4l2loopback/
echo 'obj-y += v4l2loopback.o' > source/drivers/media/test-drivers/v4l2loopback/Makefile
echo 'obj-y += v4l2loopback/' >> source/drivers/media/test-drivers/Makefile
rm -rf --one-file-system -- "${folder:?}/package"
cd source
KCONFIG_ALLCONFIG="$source_folder/tests/v4l2/vivid_kernel.config" make ARCH=um allnoconfig > /dev/null
for option in VIDEO_VIVID HOSTFS DEVTMPFS DMABUF_HEAPS_SYSTEM; do
  grep -q "^CONFIG_$option=y" .config || { echo "build_vivid_kernel.sh: this source has no $option" >&2; exit 1; }
done
make ARCH=um -j "$(nproc)" linux > ../build.log 2>&1 || { tail -20 ../build.log >&2; exit 1; }
strip -o ../linux linux
cd ..
rm -rf --one-file-system -- "${folder:?}/source"
ls -l "$folder/linux"
