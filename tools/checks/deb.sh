#!/usr/bin/env bash
# Proves that the .deb installs, runs and goes away again on a machine that has only Debian's essential packages, systemd and
# procps.
#
#     tools/checks/deb.sh PACKAGE.deb [ROOT]
#
# ROOT (default build/deb-root): the bare file system; made with mmdebstrap when it is not there. It is only read: what is
# installed goes to a layer in temporary memory, in namespaces that end with this script. Needs root or user namespaces, and
# cc for the example client.
set -euo pipefail

source_folder="$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)"
source "$source_folder/tools/checks/bare_root.sh"
[ "$#" -ge 1 ] && [ "$#" -le 2 ] || fail "usage: deb.sh PACKAGE.deb [ROOT]"
package="$(realpath -e -- "$1")" || fail "$1: no such package"
bare_root_at "${2:-$source_folder/build/deb-root}" systemd procps

scratch="$(mktemp -d)"
trap 'rm -rf --one-file-system -- "${scratch:?}"' EXIT

# What is in it, and what asks for more than it should.
dpkg-deb -c "$package" > "$scratch/contents"
for file in /usr/bin/haustra /usr/bin/haustrad /usr/include/haustra_depth_table.h /usr/include/haustra_pose_ring.h /usr/include/haustra_view_ring.h \
  /usr/lib/systemd/system/haustrad.service \
  /usr/lib/sysusers.d/haustra.conf /etc/haustra/haustra.yaml /usr/share/doc/haustra/copyright \
  /usr/share/man/man1/haustra-run.1 /usr/share/man/man5/haustra.yaml.5 /usr/share/man/man8/haustrad.8 \
  /usr/share/bash-completion/completions/haustra /usr/share/bash-completion/completions/haustrad \
  /usr/share/zsh/vendor-completions/_haustra /usr/share/zsh/vendor-completions/_haustrad \
  /opt/haustra/licences/SOUP.md /opt/haustra/licences/sbom.spdx.json /opt/haustra/examples/pose_client.c; do
  grep -Eq " \.$file( |\$)" "$scratch/contents" || fail "$file is not in the package"
done
if grep -v ' root/root ' "$scratch/contents"; then fail "these belong to somebody else than root"; fi
if grep -E '^-.......w' "$scratch/contents"; then fail "these may be written by everybody"; fi
dpkg-deb -f "$package" Package Version Architecture Depends Recommends

# The C client builds from what is in the package.
dpkg-deb -x "$package" "$scratch/files"
cc -std=c11 -D_POSIX_C_SOURCE=200809L -Wall -Wextra -Werror -I "$scratch/files/opt/haustra/include" \
  "$scratch/files/opt/haustra/examples/pose_client.c" -o "$scratch/pose_client"

cat > "$scratch/inside" <<'SCRIPT'
set -euo pipefail
package="$1" root="$2" scratch="$3"
mkdir "$scratch/memory"
mount -t tmpfs none "$scratch/memory"
mkdir "$scratch/memory/upper" "$scratch/memory/work" "$scratch/memory/root"
mount -t overlay -o "lowerdir=$root,upperdir=$scratch/memory/upper,workdir=$scratch/memory/work" none "$scratch/memory/root"
root="$scratch/memory/root"
mount -t proc none "$root/proc"
cp -- "$package" "$root/haustra.deb"
cp -- "$scratch/pose_client" "$root/pose_client"
exec chroot "$root" /bin/bash -c '
  set -euo pipefail
  export PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root
  said() { echo "deb.sh: $*" >&2; exit 1; }
  dpkg -i /haustra.deb > /dev/null
  [ "$(dpkg-query -W -f "\${Status}" haustra)" = "install ok installed" ] || said "dpkg does not call it installed"
  getent passwd haustra > /dev/null || said "the user of the service was not made"
  dpkg-query -W -f "\${Conffiles}" haustra | grep -q /etc/haustra/haustra.yaml || said "the configuration is no conffile"
  systemd-analyze verify --man=no /usr/lib/systemd/system/haustrad.service
  haustra --help > /dev/null
  haustrad --config /etc/haustra/haustra.yaml --check-config

  # The service without a service manager, on a colon of its own making, as its C client sees it.
  cd /root
  haustra render colon --seconds 1 --size 240x180 --events none --quiet
  mkdir state run
  haustrad --source colon --set files.state_folder=state --set files.runtime_folder=run \
    --set procedure.begin_at_start=true --set memory.max_keyframes=100 --set features.max=400 2> log &
  for _ in $(seq 300); do [ ! -e run/control ] || break; sleep 0.1; done
  timeout 60 /pose_client run/poses 5 > poses || { cat log >&2; said "the C client got no poses"; }
  [ "$(grep -c "^pose " poses)" -ge 5 ] || said "the C client got no poses"
  haustra control end --folder run
  kill "$!"
  wait "$!" || said "haustrad did not stop with success"

  echo "# changed here" >> /etc/haustra/haustra.yaml
  dpkg -i /haustra.deb > /dev/null
  grep -q "changed here" /etc/haustra/haustra.yaml || said "an upgrade replaced the configuration"
  dpkg -r haustra > /dev/null
  [ ! -e /usr/bin/haustrad ] && [ ! -e /opt/haustra ] || said "something stays when it is removed"
  [ -e /etc/haustra/haustra.yaml ] || said "the configuration went with the removal"
  dpkg -P haustra > /dev/null
  [ ! -e /etc/haustra ] || said "the configuration stays when it is purged"
'
SCRIPT
in_namespaces "$scratch/inside" "$package" "$root" "$scratch"
echo "the package installs, runs and goes away"
