#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Sourced by the slow checks that need a clean Debian: a root made by debootstrap from this machine's own mirror.
. examples/heartbeat.sh

passed=0
failed=0
# check NAME COMMAND...: runs the command and counts it in $passed or $failed. Its output goes to the file $log.
check() {
  local name=$1 begin=$SECONDS
  shift
  if heartbeat "$log" "$@"; then
    passed=$((passed + 1)); echo "ok: $name ($((SECONDS - begin)) s)"
  else
    failed=$((failed + 1)); echo "FAILED: $name"; tail -n 20 "$log"
    return 1
  fi
}

debian_mirror() {
  echo "${DEBIAN_MIRROR:-$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 2>/dev/null | grep -E '/debian/?$' | head -n 1)}"
}

# debian_archive RELEASE FILE: what debootstrap makes, as an archive; or the one that is there.
debian_archive() {
  local release=$1 archive=$2 mirror
  [ ! -e "$archive" ] || return 0
  [ "$(id -u)" -eq 0 ] || { echo "a clean Debian root needs root rights: run this with sudo" >&2; return 1; }
  mirror=$(debian_mirror)
  [ -n "$mirror" ] || { echo "no Debian mirror is known: set DEBIAN_MIRROR" >&2; return 1; }
  rm -rf --one-file-system "$archive.root"
  heartbeat "$archive.log" debootstrap --variant=minbase "$release" "$archive.root" "$mirror" ||
    { tail -n 20 "$archive.log"; echo "debootstrap of $release failed" >&2; return 1; }
  echo "deb $mirror $release main" >"$archive.root/etc/apt/sources.list"
  tar -C "$archive.root" --numeric-owner -cf "$archive.part" . && mv "$archive.part" "$archive" && rm -rf --one-file-system "$archive.root"
}

# debian_root RELEASE FOLDER: makes the root, or takes the one that is there. The archive that it comes from stays beside it, for the next.
debian_root() {
  local release=$1 root=$2 archive
  archive=$(dirname "$root")/terrainseg-$release.tar
  [ "$(id -u)" -eq 0 ] || { echo "a clean Debian root needs root rights: run this with sudo" >&2; return 1; }
  if [ ! -x "$root/usr/bin/apt-get" ] || [ ! -e "$root/.complete" ]; then
    debian_archive "$release" "$archive" || return 1
    rm -rf --one-file-system "$root"
    mkdir -p "$root" && tar -C "$root" --numeric-owner -xpf "$archive" || return 1
    cp /etc/resolv.conf "$root/etc/resolv.conf" 2>/dev/null || true
    echo force-unsafe-io >"$root/etc/dpkg/dpkg.cfg.d/unsafe-io" # a root that can be made again needs no sync after each file
    touch "$root/.complete"
  fi
  mountpoint -q "$root/proc" || mount -t proc proc "$root/proc" || return 1
  # A terminal for the tests that need one.
  mkdir -p "$root/dev/pts"
  mountpoint -q "$root/dev/pts" || mount -t devpts -o newinstance,ptmxmode=0666 devpts "$root/dev/pts" || return 1
  ln -sf pts/ptmx "$root/dev/ptmx"
  mountpoint -q "$root/dev/shm" || mount -t tmpfs tmpfs "$root/dev/shm" 2>/dev/null || true
}

# in_root FOLDER COMMAND...: runs inside, with a clean environment.
in_root() {
  local root=$1
  shift
  chroot "$root" env -i HOME=/root PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive "$@"
}

# leave_root FOLDER: unmounts; the folder stays for the next run unless KEEP_ROOT=0.
leave_root() {
  umount "$1/dev/shm" 2>/dev/null || true
  umount "$1/dev/pts" 2>/dev/null || true
  umount "$1/proc" 2>/dev/null || true
  [ "${KEEP_ROOT:-1}" = 1 ] || rm -rf --one-file-system "$1"
}

# copy_source FOLDER: what is committed and what is about to be; never a build folder. What an earlier copy left goes, but for its builds.
copy_source() {
  find "$1" -mindepth 1 -maxdepth 1 ! -name 'build*' -exec rm -rf --one-file-system {} + || return 1
  git ls-files -co --exclude-standard -z | tar -c --ignore-failed-read --null --verbatim-files-from -T - | tar -x -C "$1"
}
