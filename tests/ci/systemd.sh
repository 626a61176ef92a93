#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The unit terrainseg-rover.service under a real systemd: PID 1 of a clean Debian in namespaces of its own, installed as docs/tasks/at-boot.md says.
# usage: tests/ci/systemd.sh [FOLDER]
#   FOLDER    where the root lies (default: /var/tmp/terrainseg-systemd; with PACKAGES another one)
#   BUILD     a build for the prefix /usr/local (default: build-systemd, which it makes)
#   PACKAGES  a folder of this version's Debian packages, which are installed in place of the build
# Ends with "N passed, N failed"; with 77 (skipped) where no systemd can be run: no root rights, namespaces or cgroup2.
set -uo pipefail
cd "$(dirname "$0")/../.."

# Becomes PID 1: this script again, in namespaces of its own. Nothing that it mounts or sets is seen outside.
if [ "${1:-}" = --init ]; then
  set -e
  root=$2
  mount --bind "$root" "$root"
  cd "$root"
  mount -t proc proc proc
  mount --bind proc/sys proc/sys && mount -o remount,bind,ro proc/sys
  [ ! -e proc/sysrq-trigger ] || mount --bind /dev/null proc/sysrq-trigger
  mount -t sysfs -o ro sysfs sys
  mount -t cgroup2 cgroup2 sys/fs/cgroup
  mount -t tmpfs -o mode=755 dev dev
  for node in null zero full random urandom tty console; do : >"dev/$node"; done
  for node in null zero full random urandom tty; do mount --bind "/dev/$node" "dev/$node"; done
  mount --bind /dev/null dev/console
  mknod -m 666 dev/kmsg-like c 1 11 # a device that the unit does not name
  mkdir dev/shm dev/pts
  mount -t tmpfs shm dev/shm
  mount -t devpts -o newinstance,ptmxmode=0666 devpts dev/pts
  ln -s pts/ptmx dev/ptmx
  ln -s /proc/self/fd dev/fd
  mount -t tmpfs -o mode=755 run run
  mount -t tmpfs tmp tmp
  hostname rover
  pivot_root . .
  umount -l .
  exec env -i container=terrainseg PATH=/usr/sbin:/usr/bin:/sbin:/bin \
    setpriv --bounding-set -sys_module,-sys_time,-sys_rawio /lib/systemd/systemd
fi

. tests/ci/debian_root.sh
skip() { echo "systemd.sh: skipped: $*"; exit 77; }
[ "$(id -u)" -eq 0 ] || skip "a root with systemd needs root rights"
hierarchy=$(findmnt -n -l -o TARGET -t cgroup2 | head -n 1)
[ -n "$hierarchy" ] || skip "no cgroup2 is mounted"
group=$hierarchy$(sed -n 's/^0:://p' /proc/self/cgroup)
group=${group%/}/terrainseg-systemd.$$
mkdir "$group" 2>/dev/null || skip "no right to make a control group"
rmdir "$group"
unshare --fork --pid --mount --uts --ipc --net --cgroup true 2>/dev/null || skip "no right to make namespaces"

root=${1:-/var/tmp/terrainseg-systemd${PACKAGES:+-packages}}
build=${BUILD:-build-systemd}
work=$(mktemp -d)
log=$work/log
starter="" init=""
# boot: the root's systemd in a control group of its own; its process is $init.
boot() {
  mkdir -p "$group"
  (
    echo "$BASHPID" >"$group/cgroup.procs"
    exec unshare --fork --kill-child --pid --mount --uts --ipc --net --cgroup "$PWD/tests/ci/systemd.sh" --init "$root" >"$work/init" 2>&1
  ) &
  starter=$!
  within 10 has_begun && within 30 inside systemctl is-system-running --wait
}
has_begun() {
  init=$(cat "/proc/$starter/task/$starter/children" 2>/dev/null) && init=${init%% *}
  [ -n "$init" ] && [ "$(cat "/proc/$init/comm")" = systemd ]
}
shut_down() {
  if [ -n "$init" ]; then
    kill -s RTMIN+4 "$init" 2>/dev/null # power off
    within 20 has_ended
  fi
  [ ! -e "$group/cgroup.kill" ] || echo 1 >"$group/cgroup.kill"
  [ -z "$starter" ] || wait "$starter" 2>/dev/null
  init="" starter=""
  find "$group" -depth -type d -exec rmdir {} + 2>/dev/null
}
has_ended() { ! kill -0 "$starter" 2>/dev/null; }
cleanup() { shut_down; leave_root "$root"; rm -rf "$work"; }
trap cleanup EXIT
# within SECONDS COMMAND...: repeats it until it succeeds.
within() {
  local end=$((SECONDS + $1))
  shift
  until "$@" >/dev/null 2>&1; do
    [ "$SECONDS" -lt "$end" ] || { echo "not within the time: $*"; return 1; }
    sleep 0.2
  done
}
inside() {
  nsenter -t "$init" -m -p -u -i -n -C \
    env -i HOME=/root LANG=C.UTF-8 PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin "$@"
}
unit=terrainseg-rover
property() { inside systemctl show -P "$1" "$unit"; }
is() { [ "$(property "$1")" = "$2" ]; }
# main: its process inside, and a failure where there is none.
main() { property MainPID | grep -v '^0$'; }
journal() { inside journalctl -q --no-pager -o cat -u "$unit" "$@"; }
said() { journal "${@:2}" | grep -e "$1" >/dev/null; } # not -q, which ends before journalctl: a failure with pipefail
state=/var/lib/terrainseg-rover
# ask PATH [BODY]: a request to the page, as a program makes it.
ask() {
  nsenter -t "$init" -n /usr/bin/python3 - "$(inside cat $state/token)" "$@" <<'PY'
import sys, urllib.request as web
token, path, *body = sys.argv[1:]
request = web.Request(f'http://127.0.0.1:8080/{path}', body[0].encode() if body else None, {'Authorization': f'Bearer {token}'} if token else {})
print(web.urlopen(request, timeout=10).read().decode())
PY
}
# of_status EXPRESSION: of the page's status, as Python writes it.
of_status() { ask status | /usr/bin/python3 -c "import json, sys; status = json.load(sys.stdin); print($1)"; }
caution_is() { [ "$(of_status "status['settings']['caution']")" = "$1" ]; }
configure() { printf '%s\n' "$@" >"$root/etc/terrainseg/rover.conf"; }
scene='terrainscenesrc is-live=true ! video/x-raw,format=I420,width=320,height=180,framerate=15/1'
camera='tcpclientsrc host=127.0.0.1 port=7000 ! gdpdepay'

# ---- a clean root, and what the page says -------------------------------------------------------------------------
command -v debootstrap >/dev/null || ./install-dependencies.sh slow || exit 1
. /etc/os-release
debian_root "$VERSION_CODENAME" "$root" || exit 1
packages=(systemd systemd-sysv gstreamer1.0-tools gstreamer1.0-plugins-base gstreamer1.0-plugins-good gstreamer1.0-plugins-bad
          gstreamer1.0-plugins-ugly python3-gi gir1.2-gst-plugins-base-1.0 libyaml-cpp-dev libzstd1)
if ! in_root "$root" dpkg -s "${packages[@]}" >/dev/null 2>&1; then
  check "packages" in_root "$root" sh -c "apt-get update && apt-get install -y --no-install-recommends ${packages[*]}" || exit 1
fi
rm -rf "$root/etc/terrainseg" "$root/etc/systemd/system/$unit.service.d" "$root/etc/systemd/system/multi-user.target.wants/$unit.service" \
  "$root/var/lib/private" "$root$state" "$root/var/cache/private" "$root/var/cache/$unit" "$root/var/log/journal"
if [ -n "${PACKAGES:-}" ]; then
  rm -rf "$root/packages"
  mkdir "$root/packages" && cp "$PACKAGES"/*.deb "$root/packages/" && rm -f "$root"/packages/*dbgsym* || exit 1
  check "the packages install" in_root "$root" sh -c \
    'apt-get purge -y terrainseg-rover; apt-get install -y --no-install-recommends --reinstall /packages/*.deb' || exit 1
else
  if [ ! -f "$build/build.ninja" ]; then
    ./install-dependencies.sh build || exit 1
    meson setup "$build" -Dtests=disabled -Dlab=disabled -Dbench=disabled -Dunity-tools=true >"$log" || exit 1
  fi
  check "build" ninja -C "$build" || exit 1
  check "meson install" env DESTDIR="$root" meson install -C "$build" --no-rebuild || exit 1
  in_root "$root" ldconfig
  in_root "$root" install -D -m 644 /usr/local/share/terrainseg/rover/rover.conf /etc/terrainseg/rover.conf
fi
leave_root "$root"
# Of the root's own units, what has nothing to do here.
for other in console-getty systemd-modules-load systemd-sysctl; do ln -sf /dev/null "$root/etc/systemd/system/$other.service"; done

# ---- the checks ---------------------------------------------------------------------------------------------------
the_unit_is_sound() {
  [ -z "$(inside systemd-analyze verify --man=no $unit.service 2>&1 | grep "$unit" | tee /dev/stderr)" ] &&
    [ "$(inside systemctl is-enabled $unit)" = disabled ]
}
finds_what_is_installed_later() {
  local library
  library=$(find "$root/usr/lib" -name 'libyaml-cpp.so.0*' -type f) || return 1
  configure "--source $scene"
  mv "$library" "$library.away"
  ! inside systemctl start $unit && within 30 is NRestarts 1
  local status=$?
  mv "$library.away" "$library"
  [ $status -eq 0 ] && said 'GStreamer has no terrainseg' -p err && within 60 is ActiveState active && inside systemctl stop $unit
}
not_ready_without_frames() {
  configure "--source $camera"
  mkdir -p "$root/etc/systemd/system/$unit.service.d"
  printf '[Service]\nTimeoutStartSec=20\n' >"$root/etc/systemd/system/$unit.service.d/short.conf"
  inside systemctl daemon-reload && inside systemctl start --no-block $unit || return 1
  within 18 reports_the_camera || return 1
  is ActiveState activating || { property ActiveState; return 1; }
  within 40 said 'start operation timed out' && within 20 is NRestarts 1 || return 1
  said '^camera: .*trying again' -p err && ! said '^camera: .*trying again' -p crit
}
ready_with_the_first_frame() {
  rm "$root/etc/systemd/system/$unit.service.d/short.conf"
  configure "--source $scene" caution=4
  inside systemctl daemon-reload && inside systemctl restart $unit || return 1 # comes back when it is ready
  is ActiveState active && is StatusText 'frames pass' && said '^camera: frames of 320x180' && ! said Warning
}
without_root() {
  local pid
  pid=$(pid_outside) || return 1
  grep -E '^(Uid|Gid|Groups|NoNewPrivs|CapEff|CapBnd|Seccomp):' "/proc/$pid/status"
  [ "$(awk '/^Uid:/ { print ($2 > 0 && $2 == $3 && $3 == $4) }' "/proc/$pid/status")" = 1 ] &&
    grep -qP '^NoNewPrivs:\t1' "/proc/$pid/status" && grep -qP '^CapEff:\t0+$' "/proc/$pid/status" &&
    grep -qP '^CapBnd:\t0+$' "/proc/$pid/status" && grep -qP '^Seccomp:\t2' "/proc/$pid/status"
}
# The unit's process as this machine numbers it: the innermost number is systemd's.
pid_outside() {
  local main each
  main=$(main) || return 1
  for each in $(cat "$group/system.slice/$unit.service/cgroup.procs"); do
    [ "$(awk '/^NSpid:/ { print $NF }' "/proc/$each/status")" = "$main" ] && echo "$each" && return
  done
  return 1
}
writes_only_its_folders() {
  local pid mode
  pid=$(pid_outside) || return 1
  at() { nsenter -t "$pid" -m "$@"; }
  ! at touch /usr/here /etc/here /var/here || return 1
  [ -z "$(at ls /root 2>/dev/null; at ls /home 2>/dev/null)" ] || return 1
  mode=$(inside stat -L -c %a $state/token)
  [ "$mode" = 600 ] && [ "$(inside stat -L -c %a $state)" = 700 ] && inside test -L $state || return 1
  # A process in the unit's control group reads /dev/zero, and no device that the unit does not name.
  reads() { ( echo "$BASHPID" >"$group/system.slice/$unit.service/cgroup.procs" && exec nsenter -t "$init" -m dd "if=$1" of=/dev/null bs=1 count=1 iflag=nonblock ); }
  reads /dev/zero && ! reads /dev/kmsg-like 2>"$work/refused" || return 1
  grep 'Operation not permitted' "$work/refused"
}
has_limits() {
  local pid memory threads
  pid=$(pid_outside) || return 1
  is MemoryMax $((512 << 20)) && is TasksMax 128 && grep -qE '^Max open files +1024 +1024' "/proc/$pid/limits" || return 1
  memory=$(awk '/^VmRSS/ { print $2 }' "/proc/$pid/status") threads=$(awk '/^Threads/ { print $2 }' "/proc/$pid/status")
  echo "resident $memory kB, $threads threads"
  [ "$memory" -lt $((256 << 10)) ] && [ "$threads" -lt 64 ]
}
the_page_answers() {
  said "^http://127.0.0.1:8080/?token=$(inside cat $state/token)" && ask status && ! nsenter -t "$init" -n /usr/bin/python3 -c \
    'import urllib.request; urllib.request.urlopen("http://127.0.0.1:8080/status")' 2>"$work/refused" && grep 'HTTP Error 401' "$work/refused"
}
reloads() {
  local before
  before=$(main) || return 1
  caution_is 4 || return 1
  configure "--source $scene" caution=6
  inside systemctl reload $unit && within 10 caution_is 6 || return 1
  configure "--source $scene" caution=many
  inside systemctl reload $unit && within 10 said '^reload: the previous values are kept: caution' -p err || return 1
  caution_is 6 && is MainPID "$before" && is ActiveState active || return 1
  configure "--source $scene"
}
# comes_back MAIN_PID SECONDS: another process is there, and frames pass.
comes_back() { within "$2" another "$1"; }
another() { is ActiveState active && ! is MainPID "$1" && ! is MainPID 0; }
restarts_when_killed() {
  local before restarts
  before=$(main) restarts=$(property NRestarts) || return 1
  inside kill -KILL "$before"
  comes_back "$before" 30 && is NRestarts $((restarts + 1))
}
restarts_when_it_hangs() {
  local before
  before=$(main) || return 1
  inside kill -STOP "$before"
  sleep 10
  is MainPID "$before" || return 1
  # 15 s of the watchdog, 10 s until SIGKILL, 2 s, and a start.
  comes_back "$before" 60 && said 'Watchdog timeout' && said "Failed with result 'watchdog'"
}
reports_the_camera() { property StatusText | grep '^camera: '; }
restarts_without_frames() {
  local before restarts feed
  feed='gst-launch-1.0 -q terrainscenesrc is-live=true ! video/x-raw,format=I420,width=320,height=180,framerate=15/1 ! gdppay ! tcpserversink host=127.0.0.1 port=7000 sync-method=latest-keyframe recover-policy=keyframe'
  # shellcheck disable=SC2086
  inside systemd-run -q --unit=camera $feed || return 1
  configure "--source $camera"
  inside systemctl restart $unit || return 1
  before=$(main) restarts=$(property NRestarts) || return 1
  inside systemctl stop camera
  within 10 reports_the_camera || return 1
  sleep 5
  is MainPID "$before" || return 1 # the rover tries its camera again by itself first
  within 40 is NRestarts $((restarts + 1)) || return 1
  # shellcheck disable=SC2086
  inside systemd-run -q --unit=camera $feed
  comes_back "$before" 30
  local status=$?
  inside systemctl stop camera
  return $status
}
stops_and_finishes_its_recording() {
  local begin recorded
  configure "--source $scene"
  inside systemctl restart $unit && ask record/start null && sleep 4 || return 1
  begin=$SECONDS
  inside systemctl stop $unit
  [ $((SECONDS - begin)) -lt 10 ] && is ActiveState inactive && is Result success || return 1
  recorded=("$root/var/lib/private/terrainseg-rover/recordings/"*)
  ls -l "${recorded[@]}"
  [ ${#recorded[@]} -eq 1 ] && [[ ${recorded[0]} == *.mcap ]] && tail -c 8 "${recorded[0]}" | grep -q MCAP0 && said 'recording: ended'
}
begins_at_boot() {
  local token
  token=$(inside cat $state/token)
  inside systemctl enable $unit || return 1
  shut_down
  boot && within 30 is ActiveState active && [ "$(inside cat $state/token)" = "$token" ] && ask status
}

# try NAME FUNCTION: as check, but in this shell, for $init.
try() {
  local name=$1 begin=$SECONDS
  shift
  if "$@" >"$log" 2>&1; then
    passed=$((passed + 1)); echo "ok: $name ($((SECONDS - begin)) s)"
    sed 's/^/  /' "$log" | tail -n 8
  else
    failed=$((failed + 1)); echo "FAILED: $name"; tail -n 20 "$log"
    [ -z "$init" ] || { echo "-- journal:"; journal -n 20; }
    return 1
  fi
}

try "a clean Debian boots" boot || { cat "$work/init"; echo "$passed passed, $failed failed"; exit 1; }
try "the unit is sound, and not enabled" the_unit_is_sound
try "what is missing at the first start, and installed later, is found" finds_what_is_installed_later
try "not ready without frames; killed after TimeoutStartSec, and tried again" not_ready_without_frames
try "ready with the first frame (Type=notify)" ready_with_the_first_frame || { echo "$passed passed, $failed failed"; exit 1; }
try "without root, capabilities and new rights" without_root
try "writes only its own folders, opens only its devices" writes_only_its_folders
try "limits of memory, threads and files" has_limits
try "the address with the token is in the journal, and the page answers" the_page_answers
try "systemctl reload reads properties again, and refuses wrong ones" reloads
try "restarts when it is killed" restarts_when_killed
try "the watchdog restarts it when it hangs" restarts_when_it_hangs
try "the watchdog restarts it when no frame comes" restarts_without_frames
try "systemctl stop finishes the recording" stops_and_finishes_its_recording
try "an enabled unit begins at boot, with the same token" begins_at_boot
echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
