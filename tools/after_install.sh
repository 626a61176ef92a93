#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# What an installation still needs, done or said. Called by `meson install`.
# usage: after_install.sh PLUGINS_DIR LIBDIR GSTREAMERS_PLUGINS_DIR
set -euo pipefail
plugins=$1 libraries=$2 searched=$3
[ -z "${DESTDIR:-}" ] || exit 0 # a package: its own scripts do this
# The loader's cache knows the folders of the whole machine only.
# Read whole: grep -q behind a pipe would end ldconfig by SIGPIPE, which pipefail takes for "not listed".
export PATH=$PATH:/usr/sbin:/sbin
folders=$(ldconfig -v -N 2>/dev/null) || true
listed() { grep -qE "^$1:" <<<"$folders"; }
if [ "$(id -u)" -eq 0 ] && listed "$libraries"; then
  ldconfig
else
  listed "$libraries" || echo "programs that link libterrainseg need:  export LD_LIBRARY_PATH=$libraries\${LD_LIBRARY_PATH:+:\$LD_LIBRARY_PATH}"
fi
[ "$plugins" = "$searched" ] ||
  echo "GStreamer does not look there by itself:  export GST_PLUGIN_PATH=$plugins\${GST_PLUGIN_PATH:+:\$GST_PLUGIN_PATH}"
