#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Makes a release of what is committed: the Debian packages, the source as .tar.xz, and their checksums.
# usage: tools/release.sh [FOLDER]     FOLDER: where they are left (default: release)
# Refuses when the version in meson.build, debian/changelog and CHANGELOG.md is not the same, or something is not committed.
# The tag is yours to set, after a look: git tag -s vVERSION.
set -euo pipefail
cd "$(dirname "$0")/.."
case "${1:-}" in --help | -h) sed -n '3,6s/^# //p' "$0"; exit ;; esac
. examples/heartbeat.sh
fail() { echo "release.sh: $*" >&2; exit 1; }

version=$(sed -n "s/^  version: '\(.*\)',$/\1/p" meson.build)
packaged=$(sed -n '1s/.*(\([^)-]*\).*/\1/p' debian/changelog)
[ "$version" = "$packaged" ] || fail "meson.build says $version and debian/changelog $packaged"
grep -q "^## $version\b" CHANGELOG.md || fail "CHANGELOG.md has no section $version"
[ -z "$(git status --porcelain)" ] || fail "something is not committed: git status"

out=$(realpath -m "${1:-release}")
mkdir -p "$out"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
git archive --prefix="terrainseg-$version/" HEAD | tar -x -C "$work"
tar -C "$work" --sort=name --mtime="@$(git log -1 --format=%ct)" --owner=0 --group=0 -cJf "$work/terrainseg-$version.tar.xz" "terrainseg-$version"
if [ "${SOURCE_ONLY:-0}" != 1 ]; then
  ./install-dependencies.sh build slow
  echo "building the packages of $version, some minutes"
  heartbeat "$out/build.log" env -C "$work/terrainseg-$version" dpkg-buildpackage -b -us -uc ||
    { tail -n 20 "$out/build.log" >&2; fail "the packages could not be built; the whole log is $out/build.log"; }
  rm -f "$out/build.log"
  mv "$work"/*.deb "$out/"
fi
mv "$work/terrainseg-$version.tar.xz" "$out/"
(cd "$out" && shopt -s nullglob && sha256sum -- *_"$version"[_-]*.deb "terrainseg-$version.tar.xz" >SHA256SUMS) # not those of another version
ls -l "$out"
