#!/usr/bin/env bash
# Makes a sysroot of arm64 packages for the `aarch64` preset, from the package sources of this Debian 12 machine.
#
#     toolchains/make_sysroot.sh [FOLDER [PACKAGE...]]
#
# FOLDER (default build/sysroot-aarch64 in the source tree) must be new, empty, or a sysroot that this script made.
# PACKAGE... are put in as well, for example libavformat-dev libavcodec-dev libswscale-dev libavutil-dev to read recorded
# video. Needs mmdebstrap; no root, no change to the packages of this machine (libceres-dev cannot be installed
# for two architectures at once), and no program of the other architecture is run: packages are unpacked only, and what
# their install scripts would have set up is made here.
set -euo pipefail

source_folder="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
sysroot="${1:-$source_folder/build/sysroot-aarch64}"
if [ "$#" -gt 0 ]; then shift; fi
readonly marker=.haustra-sysroot
readonly triplet=aarch64-linux-gnu
readonly keyring=/usr/share/keyrings/debian-archive-keyring.gpg

packages=(
  libc6-dev libstdc++-12-dev libgcc-12-dev linux-libc-dev
  libeigen3-dev libceres-dev libopenblas-pthread-dev libyaml-cpp-dev libcli11-dev nlohmann-json3-dev
  libpng-dev libjpeg-dev libturbojpeg0-dev libpugixml-dev libgtest-dev libgmock-dev libbenchmark-dev
  "$@"
)

fail() {
  echo "make_sysroot.sh: $*" >&2
  exit 1
}

# Whatever is deleted below lies in a folder of our own.
[ -n "$sysroot" ] || fail "the name of the folder is empty"
sysroot="$(realpath -m -- "$sysroot")"
case "$sysroot" in
  / | /bin* | /boot* | /dev* | /etc* | /lib* | /proc* | /run* | /sbin* | /sys* | /usr* | "${HOME:-/}" | "$source_folder")
    fail "$sysroot is no place for a sysroot" ;;
esac
command -v mmdebstrap > /dev/null || fail "mmdebstrap is not installed (apt install mmdebstrap)"
[ -e "$keyring" ] || fail "$keyring is missing (apt install debian-archive-keyring)"
if [ -e "$sysroot/$marker" ]; then
  rm -rf --one-file-system -- "${sysroot:?}"
elif [ -d "$sysroot" ] && [ -n "$(ls -A -- "$sysroot")" ]; then
  fail "$sysroot is not empty and was not made by this script: nothing is deleted"
fi
mkdir -p -- "$sysroot"
touch -- "$sysroot/$marker"

# This machine's own Debian sources, as one-line entries.
sources="$(apt-get indextargets --format '$(REPO_URI) $(CODENAME) $(COMPONENT)' |
  awk -v keyring="$keyring" '$3 == "main" && $2 ~ /^bookworm/ && !seen[$1 $2]++ {
    print "deb [signed-by=" keyring "] " $1 " " $2 " main" }')"
[ -n "$sources" ] || fail "apt knows no source of Debian 12 (bookworm), component main"

# mmdebstrap wants an empty folder; the marker goes back at once.
rm -f -- "$sysroot/$marker"
mmdebstrap --mode="$([ "$(id -u)" -eq 0 ] && echo root || echo unshare)" --variant=extract --architectures=arm64 \
  --include="$(IFS=,; echo "${packages[*]}")" --aptopt='APT::Install-Recommends "false"' --skip=cleanup/apt \
  bookworm "$sysroot" - <<< "$sources" ||
  { touch -- "$sysroot/$marker"; fail "mmdebstrap failed; its message stands above"; }
touch -- "$sysroot/$marker"

libraries="$sysroot/usr/lib/$triplet"
[ -d "$libraries" ] || fail "$libraries is missing: the packages did not unpack"
# Nothing was installed, so dpkg knows of nothing. The list of licences of a bundle (tools/packaging/papers.py) asks it which
# package a library comes from, and in which version.
database="$sysroot/var/lib/dpkg"
mkdir -p -- "$database/info"
: > "$database/status"
echo 1 > "$database/info/format"
for archive in "$sysroot"/var/cache/apt/archives/*.deb; do
  name="$(dpkg-deb -f "$archive" Package)"
  if [ "$(dpkg-deb -f "$archive" Multi-Arch)" = same ]; then name="$name:arm64"; fi
  dpkg-deb -f "$archive" | sed '/^Package: /a Status: install ok installed' >> "$database/status"
  echo >> "$database/status"
  dpkg-deb --fsys-tarfile "$archive" | tar -t | sed 's#^\./#/#; s#/$##; /^$/d' > "$database/info/$name.list"
done
# What install scripts do through alternatives: one BLAS and LAPACK.
for library in "$libraries"/openblas-pthread/lib*; do
  ln -sfn -- "openblas-pthread/${library##*/}" "$libraries/${library##*/}"
done
# Links to absolute names would lead out of the sysroot.
rm -rf --one-file-system -- "${sysroot:?}/dev"
find "$sysroot" -xdev -type l -lname '/*' -print0 | while IFS= read -r -d '' link; do
  target="$(readlink -- "$link")"
  ln -sfn -- "$(realpath -ms --relative-to="$(dirname -- "$link")" "$sysroot$target")" "$link"
done
# So would the libraries that Debian's CMake files of Ceres name absolutely.
sed -i "s#\([;\"]\)/usr/lib/$triplet/#\1\${_IMPORT_PREFIX}/lib/$triplet/#g" "$libraries"/cmake/Ceres/CeresTargets*.cmake
# Not needed to build or to run.
for folder in usr/share/man usr/share/locale usr/share/info usr/share/lintian var/cache var/lib/apt; do
  rm -rf --one-file-system -- "${sysroot:?}/$folder"
done
find "$sysroot/usr/share/doc" -xdev -type f ! -name copyright -delete
echo complete > "$sysroot/$marker"
echo "sysroot: $sysroot ($(du -sh -- "$sysroot" | cut -f1))"
