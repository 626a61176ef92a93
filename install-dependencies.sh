#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Installs the Debian packages that a purpose needs and that are missing; asks nothing, does nothing when all are there.
# usage: install-dependencies.sh PURPOSE...
#   PURPOSE: plugin | process | build | run | rover | preview | tune | test | browser | ros2 | slow | container | fleet | release | list
set -euo pipefail
. "$(dirname "$0")/examples/heartbeat.sh"

# What compiling the plugin and the library takes; what the tools take on top.
plugin=(build-essential meson ninja-build pkg-config libgstreamer1.0-dev libgstreamer-plugins-base1.0-dev libhwy-dev libyaml-cpp-dev)
build=("${plugin[@]}" libopencv-dev libeigen3-dev nlohmann-json3-dev libzstd-dev cyclonedds-dev)
# What terrainseg-process takes on top of the plugin; its recordings take zstd.
process=(nlohmann-json3-dev libzstd-dev)
# What the contact sheet of the quickstart takes.
preview=(ffmpeg)
# What the pipelines of README and examples take: decoders, encoders, muxers, bindings for Python.
run=(gstreamer1.0-tools gstreamer1.0-plugins-base gstreamer1.0-plugins-good gstreamer1.0-plugins-bad
     gstreamer1.0-plugins-ugly gstreamer1.0-libav python3-gi gir1.2-gstreamer-1.0 gir1.2-gst-plugins-base-1.0
     python3-numpy)
# What terrainseg-rover takes on top of run, for its H.264 button.
rover=(gstreamer1.0-nice gir1.2-gst-plugins-bad-1.0)
# What examples/tune.sh takes on top of run: a window and letters in it.
tune=(gstreamer1.0-x)
# What tests/run.sh takes on top, all its parts: GoogleTest, the second compiler with its sanitizers, style, oracles, a broker, a screen.
test=(libgtest-dev libgmock-dev libbenchmark-dev clang libclang-rt-14-dev llvm clang-format clang-tidy ffmpeg git
      python3-opencv python3-matplotlib python3-jsonschema python3-yaml binutils abigail-tools procps libgstreamer-plugins-bad1.0-dev libgstrtspserver-1.0-dev
      mosquitto mosquitto-clients python3-paho-mqtt xvfb xdotool doxygen "${tune[@]}")
# What the check in a real browser takes on top.
browser=(chromium "${rover[@]}")
# What tests/ros2.sh takes on top: the other implementation of DDS, network namespaces.
ros2=(libfastrtps-dev libfastcdr-dev libasio-dev libtinyxml2-dev iproute2)
# What the slow checks take on top.
slow=(debootstrap devscripts debhelper lintian fakeroot dpkg-dev gstreamer1.0-opencv
      g++-aarch64-linux-gnu qemu-user linux-perf)
# What tools/release.sh takes on top of build and slow.
release_tools=(doxygen)
# What tests/ci/containerfile.sh takes.
container=(debootstrap buildah)
# What tests/ci/fleet.sh takes on top: a Slurm of one node, GNU parallel.
fleet=(munge slurmctld slurmd slurm-client parallel python3-yaml)

# Names that only one of the Debian releases has.
release=$(. /etc/os-release && echo "${VERSION_CODENAME:-}")
if [ "$release" != bookworm ]; then
  test=("${test[@]/libclang-rt-14-dev/libclang-rt-dev}")
fi

[ $# -gt 0 ] || { sed -n '3,5s/^# //p' "$0"; exit 2; }
wanted=()
for purpose in "$@"; do
  case "$purpose" in
    plugin) wanted+=("${plugin[@]}") ;;
    process) wanted+=("${process[@]}") ;;
    preview) wanted+=("${preview[@]}") ;;
    tune) wanted+=("${run[@]}" "${tune[@]}") ;;
    build) wanted+=("${build[@]}") ;;
    run) wanted+=("${run[@]}") ;;
    rover) wanted+=("${run[@]}" "${rover[@]}") ;;
    test) wanted+=("${build[@]}" "${run[@]}" "${test[@]}") ;;
    browser) wanted+=("${run[@]}" "${browser[@]}") ;;
    fleet) wanted+=("${run[@]}" "${fleet[@]}") ;;
    release) wanted+=("${build[@]}" "${slow[@]}" "${release_tools[@]}") ;;
    container) wanted+=("${container[@]}") ;;
    ros2) wanted+=("${build[@]}" "${run[@]}" "${ros2[@]}") ;;
    slow) wanted+=("${browser[@]}" "${slow[@]}") ;;
    list) printf '%s\n' "${build[@]}" "${run[@]}" "${test[@]}" "${browser[@]}" "${ros2[@]}" "${slow[@]}" "${container[@]}" "${fleet[@]}" "${release_tools[@]}"; exit 0 ;;
    *) echo "install-dependencies.sh: unknown purpose '$purpose'; known are plugin, process, build, run, rover, preview, tune, test, browser, ros2, slow, container, fleet, release, list" >&2; exit 2 ;;
  esac
done

missing=()
for package in "${wanted[@]}"; do
  dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null | grep -qx installed || missing+=("$package")
done
[ ${#missing[@]} -gt 0 ] || exit 0

root=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || { echo "install-dependencies.sh: missing packages: ${missing[*]}; run this as root or install sudo" >&2; exit 1; }
  root=(sudo)
fi
# With what they depend on; not known while the list of packages is absent.
all=$(apt-get install -s --no-install-recommends "${missing[@]}" 2>/dev/null | grep -c '^Inst') || all=0
with=""
[ "$all" -le "${#missing[@]}" ] || with=" and $((all - ${#missing[@]})) that they depend on"
echo "installing ${#missing[@]} Debian packages$with: ${missing[*]}"
log=$(mktemp)
trap 'rm -f "$log"' EXIT
install() {
  heartbeat "$log" "${root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "${missing[@]}"
}
# The list of packages may be old or absent: fetch it only when the first try says so.
install || { heartbeat "$log" "${root[@]}" apt-get update || true; install; } || {
  tail -n 20 "$log" >&2
  echo "install-dependencies.sh: apt-get could not install: ${missing[*]}" >&2
  exit 1
}
