#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Runs a pipeline and sends the vehicle's attitude to its terrainseg: MAVLink ATTITUDE by UDP in, `terrainseg-pose` events out.

usage: attitude_to_pose.py [--listen 127.0.0.1:14551] [--mount height=0.5,pitch=10deg] [--delay-ms 0] PIPELINE

MAVLink's attitude is the vehicle's, front-right-down: positive pitch = nose up. The pose is the camera's, front-left-up:
positive pitch = it looks down. The signs of pitch and yaw are therefore reversed, and the angles of the mount are added.
Only messages of a vehicle's autopilot (component 1) are used. Signed frames are read; their signature is not checked.
"""
import argparse
import math
import socket
import struct
import sys
import threading

import gi

gi.require_version('Gst', '1.0')
from gi.repository import GLib, GObject, Gst  # noqa: E402

ATTITUDE, CRC_EXTRA, AUTOPILOT = 30, 39, 1
PATIENCE = 3  # seconds without ATTITUDE until that is said


def checksum(data):
    """CRC-16/MCRF4XX."""
    crc = 0xFFFF
    for byte in data:
        byte ^= crc & 0xFF
        byte = (byte ^ byte << 4) & 0xFF
        crc = crc >> 8 ^ byte << 8 ^ byte << 3 ^ byte >> 4
    return crc & 0xFFFF


def attitudes(datagram):
    """(roll, pitch, yaw) in radians, front-right-down, of each whole ATTITUDE in a datagram; anything else is passed over."""
    at = 0
    while at + 8 <= len(datagram):
        second = datagram[at] == 0xFD
        header = 10 if second else 6
        if datagram[at] not in (0xFD, 0xFE) or at + header + 2 > len(datagram):
            at += 1
            continue
        end = at + header + datagram[at + 1]
        frame = datagram[at:end + 2]
        sender = frame[6] if second else frame[4]
        message = int.from_bytes(frame[7:10], 'little') if second else frame[5]
        if message != ATTITUDE or len(frame) < end + 2 - at or \
                checksum(frame[1:-2] + bytes([CRC_EXTRA])) != int.from_bytes(frame[-2:], 'little'):
            at += 1  # not to be trusted, and neither is its length
            continue
        if sender == AUTOPILOT:
            payload = frame[header:-2].ljust(28, b'\0')  # zeros at the end are not sent
            yield struct.unpack_from('<3f', payload, 4)
        at = end + 2


def rotation(roll, pitch, yaw):
    """Rz(yaw) Ry(pitch) Rx(roll)."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return [[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr]]


def camera_pose(roll, pitch, mount):
    """(roll, pitch, yaw) of the camera, front-left-up and yaw from the vehicle's nose, for a vehicle's roll and pitch, front-right-down."""
    vehicle, camera = rotation(roll, -pitch, 0), rotation(mount.get('roll', 0), mount.get('pitch', 0), mount.get('yaw', 0))
    r = [[sum(vehicle[i][k] * camera[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
    return math.atan2(r[2][1], r[2][2]), math.asin(max(-1, min(1, -r[2][0]))), math.atan2(r[1][0], r[0][0])


def parse_mount(text):
    """`height=0.5,pitch=10deg` as a dictionary in metres and radians."""
    mount = {}
    for item in filter(None, text.split(',')):
        name, _, value = item.partition('=')
        mount[name.strip()] = math.radians(float(value[:-3])) if value.endswith('deg') else float(value)
    return mount


def listen(sock, pipeline, filters, mount, delay, heard):
    """Sends a pose to each of the filters for each attitude that arrives, until the socket is closed; sets `heard` at the first."""
    while True:
        try:
            datagram = sock.recv(65536)
        except OSError:
            return
        clock = pipeline.get_clock()
        if clock is None:
            continue  # not playing yet
        time = clock.get_time() - pipeline.get_base_time() - delay
        for roll, pitch, _ in attitudes(datagram):
            if not all(map(math.isfinite, (roll, pitch))) or time < 0:
                continue
            heard.set()
            pose = camera_pose(roll, pitch, mount)
            for element in filters:
                fields = Gst.Structure.new_empty('terrainseg-pose')
                for name, value in zip(('roll', 'pitch', 'yaw'), pose):
                    fields.set_value(name, float(value))
                fields.set_value('running-time', GObject.Value(GObject.TYPE_UINT64, time))  # a plain int has 32 bits
                element.get_static_pad('sink').send_event(Gst.Event.new_custom(Gst.EventType.CUSTOM_DOWNSTREAM_OOB, fields))


def tell_silence(heard, address):
    if not heard.is_set():
        print(f'attitude_to_pose.py: no ATTITUDE of an autopilot (component 1) came to {address} so far: ranges use the mount alone. '
              'Does the router send to this address, and does the autopilot send ATTITUDE (SR2_EXTRA1)?', file=sys.stderr)
    return GLib.SOURCE_REMOVE


def all_elements(pipeline):
    iterator = pipeline.iterate_recurse()
    while True:
        result, element = iterator.next()
        if result != Gst.IteratorResult.OK:
            return
        yield element


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--listen', default='127.0.0.1:14551', metavar='HOST:PORT')
    parser.add_argument('--mount', default='', help="as terrainseg's property mount in its text form; roll, pitch and yaw are used")
    parser.add_argument('--delay-ms', type=float, default=0, help='delay of ATTITUDE on its way, milliseconds')
    parser.add_argument('pipeline', nargs='+')
    options = parser.parse_args()
    try:
        mount = parse_mount(options.mount)
        host, _, port = options.listen.rpartition(':')
        sock = socket.socket(type=socket.SOCK_DGRAM)
        sock.bind((host, int(port)))
    except ValueError as error:
        parser.error(f'--mount and --listen take height=0.5,pitch=10deg and HOST:PORT: {error}')
    except OSError as error:
        sys.exit(f'attitude_to_pose.py: {options.listen}: {error.strerror}; another program listens there, or the address is not this machine\'s')
    Gst.init(None)
    try:
        pipeline = Gst.parse_launch(' '.join(options.pipeline))
    except GLib.Error as error:
        sys.exit(f'attitude_to_pose.py: the pipeline cannot be built: {error.message}')
    filters = [element for element in all_elements(pipeline) if element.get_factory() and element.get_factory().get_name() == 'terrainseg']
    if not filters:
        sys.exit('attitude_to_pose.py: there is no terrainseg in the pipeline')
    loop = GLib.MainLoop()
    status = []

    def on_message(_, message):
        if message.type == Gst.MessageType.ERROR:
            error, details = message.parse_error()
            print(f'{error.message}\n{details}', file=sys.stderr)
            status.append(1)
        elif message.type == Gst.MessageType.WARNING:
            print(message.parse_warning()[0].message, file=sys.stderr)
        if message.type in (Gst.MessageType.ERROR, Gst.MessageType.EOS):
            loop.quit()

    bus = pipeline.get_bus()
    bus.add_signal_watch()
    bus.connect('message', on_message)
    GLib.unix_signal_add(GLib.PRIORITY_DEFAULT, 2, lambda: pipeline.send_event(Gst.Event.new_eos()))
    pipeline.set_state(Gst.State.PLAYING)
    heard = threading.Event()
    threading.Thread(target=listen, args=(sock, pipeline, filters, mount, int(options.delay_ms * Gst.MSECOND), heard), daemon=True).start()
    GLib.timeout_add_seconds(PATIENCE, tell_silence, heard, options.listen)
    loop.run()
    pipeline.set_state(Gst.State.NULL)
    return 1 if status else 0


if __name__ == '__main__':
    sys.exit(main())
