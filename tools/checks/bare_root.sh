# Sourced by the checks of what is installed: a bare root file system to install into, and namespaces to do it in.

fail() {
  echo "${0##*/}: $*" >&2
  exit 1
}

# bare_root_at FOLDER PACKAGE...: sets `root` to a root file system of Debian's essential packages and those named. It is
# made with mmdebstrap when FOLDER has none, and used as it is otherwise.
bare_root_at() {
  [ -n "$1" ] || fail "the name of the bare root is empty"
  root="$(realpath -m -- "$1")"
  shift
  [ "$root" != / ] || fail "the bare root is the root of this machine"
  if [ -e "$root/etc/os-release" ]; then return; fi
  command -v mmdebstrap > /dev/null || fail "mmdebstrap is not installed (apt install mmdebstrap), and $root is no root"
  [ ! -e "$root" ] || [ -z "$(ls -A -- "$root")" ] || fail "$root is neither empty nor a root file system"
  mkdir -p -- "$root"
  mmdebstrap --quiet --mode="$([ "$(id -u)" -eq 0 ] && echo root || echo unshare)" --variant=essential \
    ${1:+--include="$(IFS=,; echo "$*")"} bookworm "$root"
}

# in_namespaces SCRIPT ARGUMENT...: nothing that the script mounts is seen outside, nothing that it starts is left behind.
# Its user is root, here or in a namespace of users.
in_namespaces() {
  local users=()
  if [ "$(id -u)" -ne 0 ]; then users=(--map-auto --map-root-user); fi
  unshare "${users[@]}" --mount --pid --fork --propagation private bash "$@"
}
