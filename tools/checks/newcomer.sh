#!/usr/bin/env bash
# Does what the first screen of README.md says, as somebody would who has a clone, a bare Debian 12 and a video: the demo, then
# the video in four steps. What is typed and what is answered goes to standard output; newcomer.md is such a transcript.
#
#     tools/checks/newcomer.sh VIDEO.mp4 [ROOT]
#
# ROOT (default build/newcomer-root): the bare file system, made with mmdebstrap when it is not there. It is only read: what is
# installed and built goes to a layer in a temporary folder, which goes away with this script. The clone has what is committed.
# Needs root, the network, and half an hour of two cores.
set -euo pipefail

source_folder="$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)"
source "$source_folder/tools/checks/bare_root.sh"
[ "$#" -ge 1 ] && [ "$#" -le 2 ] || fail "usage: newcomer.sh VIDEO.mp4 [ROOT]"
[ "$(id -u)" -eq 0 ] || fail "only root can mount what is wanted"
video="$(realpath -e -- "$1")" || fail "$1: no such video"

# What is typed below stands in the first screen.
first_screen="$(sed '/^## Results/q' "$source_folder/README.md")"
for words in "bash tools/demo.sh" "build/release/tools/haustra" "haustra run VIDEO.mp4 --out OUT" "OUT/report.html" \
  "haustra export OUT --format"; do
  grep -qF -- "$words" <<< "$first_screen" || fail "the first screen of README.md does not say: $words"
done
bare_root_at "${2:-$source_folder/build/newcomer-root}" apt ca-certificates

scratch="$(mktemp -d)"
trap 'rm -rf --one-file-system -- "${scratch:?}"' EXIT
cat > "$scratch/typed" <<'SCRIPT'
say() {
  printf '\n# %s\n' "$*"
}
type_in() {
  printf '\n$ %s\n' "$*"
  eval "$*"
}
say "a bare $(. /etc/os-release && echo "$PRETTY_NAME"), $(nproc) cores, $(dpkg-query -W | wc -l) packages; compilers: $(command -v cc c++ cmake || echo none)"
cd ~/haustra
type_in bash tools/demo.sh
say "my own video, four steps"
type_in 'PATH="$PATH:$PWD/build/release/tools"'
cd ~
type_in haustra run VIDEO.mp4 --out OUT
type_in ls OUT
say "what the page loads from elsewhere"
type_in "grep -cE '(src|href)=\"(https?:)?//' OUT/report.html || true"
type_in haustra export OUT --format tum --out FILES
type_in head -n 3 FILES/map_0000.tum
SCRIPT

cat > "$scratch/inside" <<'SCRIPT'
set -euo pipefail
root="$1" scratch="$2" source_folder="$3" video="$4"
mkdir "$scratch/upper" "$scratch/work" "$scratch/root"
mount -t overlay -o "lowerdir=$root,upperdir=$scratch/upper,workdir=$scratch/work" none "$scratch/root"
root="$scratch/root"
mount -t proc none "$root/proc"
mount --rbind /dev "$root/dev"
cp -- /etc/resolv.conf "$root/etc/resolv.conf"
mkdir "$root/home/me"
git clone --quiet -- "$source_folder" "$root/home/me/haustra"
cp -- "$video" "$root/home/me/VIDEO.mp4"
cp -- "$scratch/typed" "$root/typed"
exec chroot "$root" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/home/me LANG=C.UTF-8 bash -euo pipefail /typed 2>&1
SCRIPT
in_namespaces "$scratch/inside" "$root" "$scratch" "$source_folder" "$video"
