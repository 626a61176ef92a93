# SPDX-License-Identifier: LGPL-2.1-or-later
# Builds with Clang; tests/run.sh and tests/fuzz/run.sh source this.

# with_clang COMMAND...: configures or builds with Clang, through ccache where it is: Meson looks for it only where no compiler is named. A
# precompiled header of Clang holds the path of its source, which ccache does not see: what one clone has built is of no use to another.
with_clang() {
  local cache=
  ! command -v ccache >/dev/null || cache='ccache '
  CCACHE_NAMESPACE=$PWD CC="${cache}clang" CXX="${cache}clang++" "$@"
}
