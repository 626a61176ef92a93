# SPDX-License-Identifier: LGPL-2.1-or-later
# Builds with Clang; tests/run.sh and tests/fuzz/run.sh source this.

# with_clang COMMAND...: configures with Clang, through ccache where it is: Meson looks for it only where no compiler is named.
with_clang() {
  local cache=
  ! command -v ccache >/dev/null || cache='ccache '
  CC="${cache}clang" CXX="${cache}clang++" "$@"
}
