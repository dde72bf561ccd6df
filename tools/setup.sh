#!/usr/bin/env bash
# Installs from the distribution's packages (Debian 12, Ubuntu 22.04 and later) what haustra is built with, and the packages
# named. Installs only what is missing.
#
#     tools/setup.sh [PACKAGE...]
set -euo pipefail

packages=(
  build-essential cmake ninja-build ccache pkg-config python3
  libeigen3-dev libceres-dev libyaml-cpp-dev libcli11-dev nlohmann-json3-dev
  libsystemd-dev libpng-dev libjpeg-dev libturbojpeg0-dev libpugixml-dev zlib1g-dev libgtest-dev libgmock-dev libbenchmark-dev
  libavformat-dev libavcodec-dev libswscale-dev libavutil-dev
  libcpp-httplib-dev libjs-chart.js libjs-three
  "$@"
)

missing=()
for package in "${packages[@]}"; do
  if [ "$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)" != installed ]; then
    missing+=("$package")
  fi
done
if [ "${#missing[@]}" -eq 0 ]; then exit 0; fi

sudo=()
if [ "$(id -u)" -ne 0 ]; then sudo=(sudo); fi
echo "installing: ${missing[*]}"
"${sudo[@]}" apt-get update -qq
"${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" > /dev/null
