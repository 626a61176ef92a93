# shellcheck shell=bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The slow checks, one a row, for .ci/run and tests/night.sh to source: minutes on two cores from a clean clone | the paths whose
# changes concern it | command. A row that exits with 77 has been skipped.
slow_checks=(
  "2|src/exchange tests/ci/mavlink.sh tests/ci/mavlink_check.mjs|tests/ci/mavlink.sh"
  "2|src/recording gst/recording tests/ci/mcap.sh tests/ci/mcap_check.mjs|tests/ci/mcap.sh"
  "4|gst tests/stress tests/ci/stress.sh|tests/ci/stress.sh 60 12916"
  "5|gst/elements/terraincombine.cpp tests/transport|meson test -C build-release --no-rebuild --print-errorlogs lying-links lying-links-stamped"
  "6|src/kernels src/coarse src/base src/motion tests/aarch64 tests/ci/aarch64.sh|env BUILD=build-release tests/ci/aarch64.sh"
  "9|gst src/segmenter.cpp src/base tests/tsan tests/ci/tsan.sh|tests/ci/tsan.sh 60 12916"
  "11|src/exchange src/recording src/metric src/tools/process src/freespace src/motion gst tests/fuzz|tests/fuzz/run.sh check"
  "9|.clang-tidy tests/ci/tidy.sh|tests/ci/tidy.sh --turn"
  "4|examples src/tools/rover tests/rover_process.py tests/ci/browser.py tests/ci/browser.sh|env BUILD=build-release tests/ci/browser.sh"
  "3|lab/eval lab/reference lab/evaluation src/paper|env BUILD=build-release OUT=build-release/paper LIMIT=5 lab/evaluation/reproduce.sh"
  "4|src/recording src/ros2 gst/ros2 tests/ros2 tests/ci/ros2.sh|tests/ci/ros2.sh"
  "14|debian meson.build meson_options.txt install-dependencies.sh tests/ci/packages.sh|tests/ci/packages.sh"
  "17|tests/ci/debian13.sh tests/ci/debian_root.sh|tests/ci/debian13.sh"
  "9|Containerfile install-dependencies.sh tests/ci/containerfile.sh|tests/ci/containerfile.sh"
  "20|examples install-dependencies.sh tools/after_install.sh meson.build tests/ci/installs.sh|tests/ci/installs.sh"
  "5|src/tools/rover tests/ci/debian_root.sh tests/ci/systemd.sh|env BUILD=build-release tests/ci/systemd.sh"
  "4|tests/ci/soak.sh tests/stress/soak.cpp|tests/ci/soak.sh"
)
passed=0
failed=0
# check COMMAND...: counts one check.
check() {
  local status=0
  echo "== $* ($((SECONDS / 60)) min)"
  "$@" || status=$?
  case $status in
    0) passed=$((passed + 1)) ;;
    77) echo "== skipped: $*" ;;
    *) failed=$((failed + 1)); echo "FAILED: $*" ;;
  esac
}
