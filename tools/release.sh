#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Makes a release of what is committed: the Debian packages, the source as .tar.xz, the API pages, their checksums, and the tag.
# usage: tools/release.sh [--tag] [FOLDER]     FOLDER: where they are left (default: release)
# Refuses when the version in meson.build, debian/changelog and CHANGELOG.md differs, or something is not committed.
# --tag: sets the tag vVERSION in the end, signed where git has a key. It is not pushed.
set -euo pipefail
cd "$(dirname "$0")/.."
. examples/heartbeat.sh
fail() { echo "release.sh: $*" >&2; exit 1; }
tag=0 out=
for word; do
  case $word in
  --help | -h) sed -n '3,6s/^# //p' "$0"; exit ;;
  --tag) tag=1 ;;
  -*) fail "unknown option $word: see tools/release.sh --help" ;;
  *) [ -z "$out" ] || fail "two folders, $out and $word: name one"
    out=$word ;;
  esac
done

version=$(sed -n "s/^  version: '\(.*\)',$/\1/p" meson.build)
packaged=$(sed -n '1s/.*(\([^)-]*\).*/\1/p' debian/changelog)
[ "$version" = "$packaged" ] || fail "meson.build says $version and debian/changelog $packaged"
grep -q "^## $version\b" CHANGELOG.md || fail "CHANGELOG.md has no section $version"
[ -z "$(git status --porcelain)" ] || fail "something is not committed: git status"
if [ "$tag" = 1 ]; then
  ! grep -q "^## $version - not released" CHANGELOG.md || fail "CHANGELOG.md calls $version not released: write the date there and commit"
  ! git rev-parse -q --verify "refs/tags/v$version" >/dev/null || fail "the tag v$version already exists"
fi

out=$(realpath -m "${out:-release}")
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

# The pages of the public headers, the same bytes for the same commit. hotdoc is not in Debian, and gi-docgen reads no C++.
command -v doxygen >/dev/null || ./install-dependencies.sh release
(cd "$work/terrainseg-$version" && doxygen - >"$work/doxygen.log" 2>&1 <<DOXYGEN
PROJECT_NAME = terrainseg
PROJECT_NUMBER = $version
INPUT = include
RECURSIVE = YES
FILE_PATTERNS = *.h *.hpp
EXTRACT_ALL = YES
GENERATE_LATEX = NO
HTML_TIMESTAMP = NO
HTML_OUTPUT = terrainseg-$version-api
QUIET = YES
DOXYGEN
) || { tail -n 20 "$work/doxygen.log" >&2; fail "the API pages could not be made"; }
tar -C "$work/terrainseg-$version" --sort=name --mtime="@$(git log -1 --format=%ct)" --owner=0 --group=0 -cJf "$out/terrainseg-$version-api.tar.xz" "terrainseg-$version-api"
(cd "$out" && shopt -s nullglob && sha256sum -- *_"$version"[_-]*.deb "terrainseg-$version.tar.xz" "terrainseg-$version-api.tar.xz" >SHA256SUMS) # not those of another version
ls -l "$out"
[ "$tag" = 0 ] || git tag "$(git config --get user.signingkey >/dev/null && echo -s || echo -a)" -m "terrainseg $version" "v$version"
