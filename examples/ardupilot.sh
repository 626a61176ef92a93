#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Sends the free space of a camera to an autopilot as obstacles: MAVLink OBSTACLE_DISTANCE and HEARTBEAT, by UDP or serial line.
# usage: examples/ardupilot.sh [--scene] [HOST:PORT | DEVICE[:BAUD]] | --self-test
#   HOST:PORT   where the autopilot, or a router in front of it, listens (default: 127.0.0.1:14552)
#   DEVICE      a serial port to the autopilot, such as /dev/ttyS1 or /dev/ttyAMA0:57600 (default: 921600 baud). No other
#               program may use the port; to share it, put a router in front of it
#   --scene     a rendered scene with its calibration instead of the camera; do not drive by it
# Set CAMERA_INFO and MOUNT (docs/tasks/calibration.md). Without them no range is known, and everything ahead is an obstacle.
#   CAMERA_INFO   a ROS camera_info file          MOUNT   a mount file, or height=0.5,pitch=10deg
#   ATTITUDE      HOST:PORT on which the autopilot's ATTITUDE arrives; MOUNT must then be text
#   SYSTEM_ID     the vehicle's (default: 1)      LAYOUT  fine (default), or portable, with which ArduPilot's simple
#                 avoidance sees half of what is ahead (docs/tasks/autopilot.md)
# Parameters of a Rover (ArduPilot 4.1 and later; PRX1_TYPE was PRX_TYPE before 4.2):
#   PRX1_TYPE 2         receive proximity by MAVLink. Restart the autopilot afterwards
#   AVOID_ENABLE 3      stop for proximity (2) and fences (1) in Acro, Steering, Loiter and Guided
#   AVOID_MARGIN 2      distance to keep, metres
#   OA_TYPE 1           BendyRuler: drive around obstacles in Auto, Guided and RTL
#   OA_BR_LOOKAHEAD 5   look-ahead of BendyRuler, metres: at most the range-max of the calibration
#   OA_MARGIN_MAX 2     distance that BendyRuler keeps, metres
#   SERIAL2_PROTOCOL 2  MAVLink 2 on the port that is connected to this program, with SERIAL2_BAUD 921
#   SR2_EXTRA1 50       ATTITUDE at 50 Hz on that port
. "$(dirname "$0")/common.sh"
camera_info=${CAMERA_INFO:-} mount=${MOUNT:-} target=127.0.0.1:14552
case "${1:-}" in
  --help) usage ;;
  --self-test)
    /usr/bin/python3 - "$0" <<'PYTHON'
import os, socket, subprocess, sys
heard = socket.socket(type=socket.SOCK_DGRAM)
heard.bind(('127.0.0.1', 0))
heard.settimeout(20)
sender = subprocess.Popen([sys.argv[1], '--scene', '127.0.0.1:%d' % heard.getsockname()[1]], env={**os.environ, 'ATTITUDE': ''})
messages, metres = {0: 0, 330: 0}, 0
while messages[330] < 40:  # of the 45 in three seconds
    data = heard.recv(2048)
    while data:
        kind, length = int.from_bytes(data[7:10], 'little'), data[1]
        messages[kind] += 1
        if kind == 330:
            distances = [int.from_bytes(data[18 + 2 * i:20 + 2 * i], 'little') for i in range(72)]
            near, far = (int.from_bytes(data[i:i + 2], 'little') for i in (162, 164))
            metres += any(near < d <= far + 1 for d in distances)
        data = data[12 + length:]
status = sender.wait(20)
print(f'ardupilot.sh: {messages[330]} OBSTACLE_DISTANCE, {metres} of them with metres, {messages[0]} HEARTBEAT')
sys.exit(status or metres < 20 or messages[0] < 2)
PYTHON
    exit ;;
  --scene)
    shift
    scene_folder=$(mktemp -d)
    camera_info=$scene_folder/camera.yaml mount=height=1.35,pitch=2.75deg
    cat >"$camera_info" <<'YAML'
image_width: 320
image_height: 180
camera_matrix: {rows: 3, cols: 3, data: [262.4, 0, 159.5, 0, 262.4, 89.5, 0, 0, 1]}
YAML
    SOURCE=${SCENE:-$test_source}
    ;;
esac
[ -z "${1:-}" ] || target=$1
if [[ $target =~ ^(/dev/[A-Za-z0-9._/-]+)(:([0-9]+))?$ ]]; then
  device=${BASH_REMATCH[1]} baud=${BASH_REMATCH[3]:-921600}
  [ -c "$device" ] || fail "there is no serial port $device: ls /dev/tty* /dev/serial/by-id/* lists the ports"
  { [ -r "$device" ] && [ -w "$device" ]; } || fail "no permission to read and write $device: run sudo adduser $(id -un) dialout, and log in again"
  # Bytes as they are, whatever a program before this one has set.
  stty -F "$device" "$baud" raw -echo -crtscts clocal cs8 -cstopb -parenb || fail "$device does not support $baud baud"
  sink="filesink location=$device buffer-mode=unbuffered"
elif [[ $target =~ ^[A-Za-z0-9._-]+:[0-9]+$ ]]; then
  check_port "${target##*:}"
  sink="udpsink host=${target%:*} port=${target##*:}"
else
  fail "'$target' is not HOST:PORT, nor a serial port such as /dev/ttyS1 or /dev/ttyS1:57600"
fi
SYSTEM_ID=${SYSTEM_ID:-1} LAYOUT=${LAYOUT:-fine}
{ [[ $SYSTEM_ID =~ ^[0-9]{1,3}$ ]] && [ "$((10#$SYSTEM_ID))" -ge 1 ] && [ "$((10#$SYSTEM_ID))" -le 255 ]; } || fail "SYSTEM_ID '$SYSTEM_ID': use 1 to 255"
[[ $LAYOUT =~ ^(fine|portable)$ ]] || fail "LAYOUT '$LAYOUT': use fine or portable"
[ -n "$camera_info" ] && [ -n "$mount" ] ||
  echo "ardupilot.sh: CAMERA_INFO or MOUNT is not set: ranges are unknown, and everything ahead is sent as an obstacle" >&2
text="$SOURCE ! videoconvert ! video/x-raw,format=NV12 ! queue leaky=downstream max-size-buffers=1 ! terrainseg ${camera_info:+camera-info=$(quoted "$camera_info")} \
  ${mount:+mount=$(quoted "$mount")} $SETTINGS ! terrainextract mavlink-layout=$LAYOUT system-id=$SYSTEM_ID \
  ! application/x-mavlink ! $sink sync=false async=false"
if [ -n "${ATTITUDE:-}" ]; then
  exec /usr/bin/python3 "$here/python/attitude_to_pose.py" --listen "$ATTITUDE" --mount "$mount" "$text"
fi
pipeline "$text"
