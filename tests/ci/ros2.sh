#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# terrainros2sink beside the other implementation of DDS, Fast DDS, in a network namespace of its own: scans and masks byte for byte,
# readers of every kind, before and after the sink, one that stops, poses and hostile messages, a second interface and a second machine,
# and the processor time without a reader.
# usage: tests/ci/ros2.sh [BUILD_FOLDER]
#   BUILD_FOLDER  a build that is there (default: build-release, else build)
# Without Fast DDS or the right to make a network namespace it says so and ends with 77: skipped.
set -euo pipefail
cd "$(dirname "$0")/../.."
build=${1:-build-release}
[ -d "$build" ] || build=build
build=$(cd "$build" && pwd)
for need in gst/libgstterrainseg.so gst/libgstterrainmcap.so gst/libgstterrainros2.so; do
  [ -e "$build/$need" ] || { echo "ros2.sh: $build holds no $need: ninja -C $build $need (cyclonedds-dev, libzstd-dev)" >&2; exit 1; }
done
if [ "${IN_NAMESPACE:-}" != yes ]; then
  [ "$(id -u)" -ne 0 ] || ./install-dependencies.sh ros2
  [ -e /usr/include/fastdds ] || { echo "ros2.sh: skipped: no Fast DDS (./install-dependencies.sh ros2)"; exit 77; }
  folder=$(mktemp -d)
  trap 'rm -rf "$folder"' EXIT
  library=fastdds
  [ ! -e /usr/include/fastrtps/fastrtps_dll.h ] || library=fastrtps # its name up to version 2
  g++ -std=c++20 -O1 tests/ros2/fastdds_peer.cpp -o "$folder/peer" -l$library -lfastcdr -lzstd -pthread
  cp tests/ros2/rover.py "$folder"
  namespace=(unshare -rn)
  "${namespace[@]}" true 2>/dev/null || namespace=(unshare -n) # in a chroot only root may
  "${namespace[@]}" true 2>/dev/null || { echo "ros2.sh: skipped: no right to make a network namespace"; exit 77; }
  status=0
  IN_NAMESPACE=yes FOLDER=$folder "${namespace[@]}" "$0" "$build" || status=$?
  exit "$status"
fi

# ---- in the namespace -----------------------------------------------------------------------------------------
cd "$FOLDER"
ip link set lo up
export GST_PLUGIN_PATH=$build/gst GST_REGISTRY=$FOLDER/registry.bin
unset ROS_DOMAIN_ID ROS_AUTOMATIC_DISCOVERY_RANGE ROS_LOCALHOST_ONLY ROS_STATIC_PEERS CYCLONEDDS_URI
cat >camera.yaml <<'YAML'
image_width: 320
image_height: 180
camera_matrix: {rows: 3, cols: 3, data: [262.4, 0, 159.5, 0, 262.4, 89.5, 0, 0, 1]}
YAML
gst-inspect-1.0 terrainros2sink >/dev/null # makes the registry
metres=(camera-info=camera.yaml mount=height=1.35,pitch=0.045)
source=(terrainscenesrc is-live=true ! video/x-raw,width=320,height=180,framerate=30/1)
failed=0 passed=0
mark() { # mark STATUS WHAT
  if [ "$1" -eq 0 ]; then passed=$((passed + 1)); else failed=$((failed + 1)); echo "ros2.sh: failed: $2"; fi
}
# rover RECORDING [PROPERTY...]: the sink, and beside it a recording of the same frames; its process is $rover.
rover() {
  recording=$1
  shift
  ./rover.py "$recording.counts" "${source[@]}" ! terrainseg start-time="$(date +%s%N)" "${metres[@]}" ! tee name=t \
    t. ! queue ! terrainros2sink name=ros2 "${metres[@]}" "$@" t. ! queue ! terrainmcapsink "${metres[@]}" location="$recording" &
  rover=$!
}
# count NUMBER: of its frames (1), messages dropped (2), taken (3) and refused (4).
count() {
  until [ -s "$recording.counts" ]; do sleep 0.1; done
  cut -d ' ' -f "$1" "$recording.counts"
}
# Before it records it has no handler, and the signal would be lost.
halt() {
  until [ -s "$recording.part" ]; do sleep 0.2; done
  kill -INT "$rover"
  wait "$rover"
}
reads() { ./peer read "${DOMAIN:-0}" "rt$1" "$2" "$3" "$4" "${5:-}" >"$4.count" & readers+=($!); }
readers=()
gather() { [ ${#readers[@]} -eq 0 ] || wait "${readers[@]}"; readers=(); }
scan=sensor_msgs::msg::dds_::LaserScan_ grid=nav_msgs::msg::dds_::OccupancyGrid_ image=sensor_msgs::msg::dds_::Image_

[ "$(ip -o link show | grep -c MULTICAST)" -eq 0 ] && status=0 || status=1
mark $status "an interface has multicast, which these are to do without"

echo "== readers before the sink"
reads /terrain/scan "$scan" 5 early.bin
reads /terrain/mask "$image" 5 mask.bin
reads /terrain/scan "$scan" 5 careless.bin best-effort
sleep 1
rover early.mcap
gather
halt
for file in early careless; do
  status=0; ./peer compare early.mcap /terrain/scan $file.bin 95 || status=$?; mark $status "scans of $file.bin"
done
status=0; ./peer compare early.mcap /terrain/mask mask.bin 95 || status=$?; mark $status masks

echo "== readers after the sink, a late one of the grid; one stands still for 5 s"
rover late.mcap
sleep 3
reads /terrain/scan "$scan" 10 late.bin
reads /terrain/grid "$grid" 4 grid.bin late
./peer read 0 rt/terrain/mask "$image" 10 still.bin >still.count & still=$!
frames=$(count 1)
sleep 3
moved=$(($(count 1) - frames))
memory() { awk '/VmRSS/ { print $2 }' "/proc/$rover/status"; }
before=$(memory) frames=$(count 1)
kill -STOP "$still"
sleep 5
after=$(memory) stood=$(($(count 1) - frames))
kill -CONT "$still"
gather
wait "$still"
halt
echo "a reader of masks stood still for 5 s: resident memory of the sink's process $before kB before, $after kB after"
[ $((after - before)) -lt 4000 ] && status=0 || status=1; mark $status "memory"
echo "frames that passed: $moved in 3 s before, $stood in those 5 s; $(count 2) messages dropped"
[ $((stood * 3 * 10)) -ge $((moved * 5 * 9)) ] && [ "$(count 2)" -eq 0 ] && status=0 || status=1
mark $status "a reader that stands still costs frames"
status=0; ./peer compare late.mcap /terrain/scan late.bin 95 || status=$?; mark $status "scans while another reader stood still"
# Its first grid is up to two seconds old: the frames between it and the next were not sent.
status=0; ./peer compare late.mcap /terrain/grid grid.bin 80 late || status=$?; mark $status "a late reader of the grid"
status=0; ./peer compare late.mcap /terrain/mask still.bin 40 || status=$?; mark $status "masks of the reader that stood still"

echo "== another domain sees nothing"
rover other.mcap
DOMAIN=7 PATIENCE=4 reads /terrain/scan "$scan" 4 other.bin
gather
halt
[ "$(cat other.bin.count)" = 0 ] && status=0 || status=1; mark $status "domain 7 read $(cat other.bin.count) scans of domain 0"

echo "== poses, between hostile messages"
reads /tf tf2_msgs::msg::dds_::TFMessage_ 4 tf.bin
rover poses.mcap pose-topic=pose pose-type=pose-stamped
./peer pose 0 rt/pose 60 hostile & poses=$!
gather
kill "$poses"
halt
status=0; ./peer compare poses.mcap /tf tf.bin 90 || status=$?; mark $status "transforms with the pose"
echo "poses: $(count 3) taken, $(count 4) refused"
[ "$(count 3)" -gt 20 ] && [ "$(count 4)" -gt 60 ] && status=0 || status=1; mark $status "hostile messages are refused, others taken"

echo "== a second interface"
if ip link add second type dummy 2>/dev/null || ip link add second type veth peer name third 2>/dev/null ||
  ip tuntap add dev second mode tap 2>/dev/null; then
  ip address add 10.77.0.1/24 dev second
  ip link set second up
  ip link set third up 2>/dev/null || true
  reads /terrain/scan "$scan" 5 second.bin
  rover second.mcap
  sleep 2
  reads /terrain/scan "$scan" 4 second-late.bin
  gather
  halt
  for file in second second-late; do
    status=0; ./peer compare second.mcap /terrain/scan $file.bin 95 || status=$?; mark $status "scans of $file.bin"
  done
else
  echo "left out: this kernel makes none (dummy, veth, tap)"
fi

echo "== a second machine, with multicast and without"
unshare -n sleep 600 & machine=$!
far() { nsenter -t "$machine" -n "$@"; }
until [ "$(readlink /proc/$machine/ns/net)" != "$(readlink /proc/self/ns/net)" ]; do sleep 0.1; done
ip link delete second 2>/dev/null || true
if ip link add wire type veth peer name far 2>/dev/null && ip link set far netns "$machine"; then
  ip address add 10.78.0.1/24 dev wire
  far ip address add 10.78.0.2/24 dev far
  ip link set wire up
  far ip link set lo up
  far ip link set far up
  for way in multicast peers; do
    if [ $way = peers ]; then
      ip link set wire multicast off
      far ip link set far multicast off
    fi
    far ./peer read 42 rt/terrain/scan "$scan" 5 $way.bin >$way.bin.count & readers+=($!)
    export ROS_DOMAIN_ID=42
    case $way in
      multicast) ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET rover $way.mcap ;;
      peers) ROS_STATIC_PEERS=10.78.0.2 rover $way.mcap ;;
    esac
    unset ROS_DOMAIN_ID
    gather
    halt
    status=0; ./peer compare $way.mcap /terrain/scan $way.bin 95 || status=$?; mark $status "scans on another machine, by $way"
  done
else
  echo "left out: this kernel makes no veth"
fi
kill "$machine"

echo "== without a reader: processor time at 30 frames/s, side by side, after the start, the median of five times 4 s"
runs() {
  gst-launch-1.0 -q videotestsrc is-live=true ! video/x-raw,format=I420,width=320,height=180,framerate=30/1 \
    ! terrainseg "${metres[@]}" ! "$@" &
}
spent() { cat "/proc/$1/task"/*/schedstat | awk '{ sum += $1 } END { printf "%d\n", sum / 1000 }'; } # microseconds
runs fakesink sync=true
plain=$!
runs terrainros2sink "${metres[@]}"
sink=$!
sleep 3
for _ in 1 2 3; do # a busy machine gets three tries
  for _ in 1 2 3 4 5; do
    a=$(spent $plain) b=$(spent $sink)
    sleep 4
    echo "$(($(spent $plain) - a)) $(($(spent $sink) - b))" | awk '{ printf "%.2f %.2f %.2f\n", ($2 - $1) / 40000, $1 / 40000, $2 / 40000 }'
  done | sort -n | sed -n 3p >median
  read -r more nothing taken <median
  echo "fakesink $nothing %, terrainros2sink $taken % of a core: $more more"
  awk -v more="$more" 'BEGIN { exit !(more < 0.5) }' && status=0 || status=1
  [ $status -ne 0 ] || break
done
kill $plain $sink
wait $plain $sink || true
mark $status "without a reader the sink takes $taken % instead of $nothing %"

echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
