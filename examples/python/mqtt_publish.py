#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Publishes JSON lines to an MQTT broker, and loses none while the broker is away. Only Python's standard library.

usage: ... ! terrainextract ! application/x-ndjson ! fdsink | mqtt_publish.py --topic rover/terrain
       mqtt_publish.py --host BROKER --spool terrain.spool < lines.jsonl

Every line goes to the spool file first and from there to the broker with QoS 1; it counts as delivered when the broker
has acknowledged it. While the broker is down the spool grows, up to --limit lines (then the oldest go, and are
counted). A program that was killed goes on where it stopped. A line may arrive twice (that is QoS 1): tell by "frame".
Ends when the input ended and everything is acknowledged.
"""
import argparse
import collections
import os
import select
import socket
import struct
import sys
import time

CONNECT, CONNACK, PUBLISH, PUBACK, PINGREQ, PINGRESP = 1, 2, 3, 4, 12, 13
KEEP_ALIVE = 30  # seconds
IN_FLIGHT = 32   # published, not yet acknowledged


def text(value):
    data = value.encode()
    return struct.pack('!H', len(data)) + data


def packet(kind, flags, body):
    """MQTT 3.1.1, chapter 2: type and flags, the length in groups of 7 bits, the body."""
    length, coded = len(body), bytearray()
    while True:
        length, group = divmod(length, 128)
        coded.append(group | (0x80 if length else 0))
        if not length:
            return bytes([kind << 4 | flags]) + bytes(coded) + body


class Broker:
    """One connection. Raises OSError when it is lost."""

    def __init__(self, options):
        self.socket = socket.create_connection((options.host, options.port), timeout=5)
        flags, payload = 0x02, text(options.client)  # clean session: the spool remembers, not the broker
        if options.user:
            flags |= 0x80 | (0x40 if options.password else 0)
            payload += text(options.user) + (text(options.password) if options.password else b'')
        self.received = bytearray()
        self.last_sent = 0.0
        self.send(packet(CONNECT, 0, text('MQTT') + struct.pack('!BBH', 4, flags, KEEP_ALIVE) + payload))
        deadline = time.monotonic() + 5
        while True:
            for kind, body in self.read(max(0.0, deadline - time.monotonic())):
                if kind == CONNACK and len(body) == 2 and body[1] == 0:
                    return
                raise ConnectionError(f'the broker refuses the connection (code {body[1] if len(body) > 1 else "?"})')
            if time.monotonic() >= deadline:
                raise ConnectionError('the broker does not answer')

    def send(self, data):
        self.socket.sendall(data)
        self.last_sent = time.monotonic()

    def publish(self, topic, number, payload, retain, again):
        flags = 0x02 | (0x01 if retain else 0) | (0x08 if again else 0)
        self.send(packet(PUBLISH, flags, text(topic) + struct.pack('!H', number) + payload))

    def keep_alive(self):
        if time.monotonic() - self.last_sent > KEEP_ALIVE / 2:
            self.send(packet(PINGREQ, 0, b''))

    def read(self, timeout):
        """Packets that arrive within `timeout` seconds."""
        if not select.select([self.socket], [], [], timeout)[0]:
            return []
        data = self.socket.recv(65536)
        if not data:
            raise ConnectionError('the broker closed the connection')
        self.received += data
        packets = []
        while True:
            length, shift, index = 0, 0, 1
            while index < len(self.received) and index <= 4:
                group = self.received[index]
                length, shift, index = length | (group & 0x7f) << shift, shift + 7, index + 1
                if not group & 0x80:
                    break
            else:
                return packets
            if len(self.received) < index + length:
                return packets
            packets.append((self.received[0] >> 4, bytes(self.received[index:index + length])))
            del self.received[:index + length]

    def close(self):
        self.socket.close()


class Spool:
    """Lines that are not acknowledged yet, on disk: one line each, and beside it how many bytes are done."""

    def __init__(self, path, limit):
        self.path, self.limit = path, limit
        self.dropped = 0
        self.lines = collections.deque()
        self.done = 0
        try:
            self.done = int(open(path + '.done').read() or 0)
        except (OSError, ValueError):
            pass
        self.file = open(path, 'a+b')
        self.file.seek(0)
        content = self.file.read()
        if self.done > len(content):  # a spool that was deleted
            self.done = 0
        whole = content[:content.rfind(b'\n') + 1]  # a killed program may have left half a line
        self.file.truncate(len(whole))
        self.lines.extend(whole[self.done:].splitlines())
        self.file.seek(0, os.SEEK_END)

    def append(self, line):
        self.file.write(line + b'\n')
        self.file.flush()
        self.lines.append(line)
        if len(self.lines) > self.limit:
            self.acknowledge()
            self.dropped += 1
            return True
        return False

    def acknowledge(self):
        """The oldest line is done."""
        self.done += len(self.lines.popleft()) + 1
        if not self.lines:
            self.file.truncate(0)
            self.done = 0
        temporary = self.path + '.done.part'
        with open(temporary, 'w') as file:
            file.write(str(self.done))
        os.replace(temporary, self.path + '.done')

    def remove(self):
        self.file.close()
        for path in (self.path, self.path + '.done'):
            if os.path.exists(path):
                os.remove(path)


class Publisher:
    def __init__(self, options):
        self.options = options
        self.spool = Spool(options.spool, options.limit)
        self.broker = None
        self.next_try = 0.0
        self.in_flight = collections.deque()  # packet numbers and whether acknowledged, oldest first
        self.next_number = 1
        self.sent_before = 0  # of the oldest lines, sent over an earlier connection
        self.input_open = True
        self.rest = b''
        self.delivered = 0

    def say(self, message):
        print(f'mqtt_publish: {message}', file=sys.stderr, flush=True)

    def connect(self):
        if self.broker or time.monotonic() < self.next_try or not (self.spool.lines or self.input_open):
            return
        try:
            self.broker = Broker(self.options)
            self.say(f'connected, {len(self.spool.lines)} lines waiting')
        except OSError as error:
            self.say(f'{self.options.host}:{self.options.port}: {error}; trying again')
            self.next_try = time.monotonic() + self.options.retry

    def disconnect(self, error):
        self.say(f'{error}; {len(self.spool.lines)} lines wait for the broker')
        self.broker.close()
        self.broker = None
        self.sent_before = len(self.in_flight)
        self.in_flight.clear()
        self.next_try = time.monotonic() + self.options.retry

    def take_input(self, timeout):
        if not self.input_open:
            return
        if not select.select([0], [], [], timeout)[0]:
            return
        data = os.read(0, 65536)
        self.input_open = bool(data)
        lines = (self.rest + data).split(b'\n')
        self.rest = lines.pop()
        if not data and self.rest:
            lines.append(self.rest)
        for line in filter(None, lines):
            if self.spool.append(line):
                if self.in_flight:
                    self.in_flight.popleft()
                self.sent_before = max(0, self.sent_before - 1)

    def exchange(self, timeout):
        while len(self.in_flight) < min(IN_FLIGHT, len(self.spool.lines)):
            index = len(self.in_flight)
            self.broker.publish(self.options.topic, self.next_number, self.spool.lines[index], self.options.retain,
                                again=index < self.sent_before)
            self.in_flight.append([self.next_number, False])
            self.next_number = self.next_number % 65535 + 1
        self.broker.keep_alive()
        for kind, body in self.broker.read(timeout):
            if kind == PUBACK and len(body) >= 2:
                number = struct.unpack('!H', body[:2])[0]
                for entry in self.in_flight:
                    if entry[0] == number:
                        entry[1] = True
        while self.in_flight and self.in_flight[0][1]:
            self.in_flight.popleft()
            self.spool.acknowledge()
            self.sent_before = max(0, self.sent_before - 1)
            self.delivered += 1

    def run(self):
        while self.input_open or self.spool.lines:
            self.connect()
            self.take_input(0 if self.broker and self.in_flight else 0.05)
            if not self.broker:
                time.sleep(0 if self.input_open else 0.05)
                continue
            try:
                self.exchange(0.05 if self.in_flight else 0)
            except OSError as error:
                self.disconnect(error)
        if self.broker:
            self.broker.send(packet(14, 0, b''))  # DISCONNECT
            self.broker.close()
        self.spool.remove()
        self.say(f'{self.delivered} lines delivered, {self.spool.dropped} dropped')
        return 1 if self.spool.dropped else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--host', default='127.0.0.1')
    parser.add_argument('--port', type=int, default=1883)
    parser.add_argument('--topic', default='rover/terrain')
    parser.add_argument('--client', default=f'terrainseg-{os.getpid()}', help='name of this client at the broker')
    parser.add_argument('--user')
    parser.add_argument('--password', default=os.environ.get('MQTT_PASSWORD'), help='better: in MQTT_PASSWORD')
    parser.add_argument('--retain', action='store_true', help='the broker keeps the newest line for new subscribers')
    parser.add_argument('--spool', default='terrain.spool', help='file for lines that are not delivered yet')
    parser.add_argument('--limit', type=int, default=1_000_000, help='lines that the spool holds at most')
    parser.add_argument('--retry', type=float, default=1.0, help='seconds between two attempts to connect')
    sys.exit(Publisher(parser.parse_args()).run())


if __name__ == '__main__':
    main()
