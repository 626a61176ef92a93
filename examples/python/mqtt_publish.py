#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Publishes JSON lines to an MQTT broker, and loses none while the broker is away. Needs python3-paho-mqtt (1.6 or 2).

usage: ... ! terrainextract ! application/x-ndjson ! fdsink | mqtt_publish.py --topic rover/terrain
       mqtt_publish.py --host BROKER --spool terrain.spool < lines.jsonl

Every line goes to the spool file first, and from there to the broker with QoS 1. A line is delivered when the broker has
acknowledged it. While the broker is down, the spool grows up to --limit lines; then the oldest are dropped and counted.
A program that was killed continues where it stopped. A line may arrive twice (that is QoS 1): compare "frame".
The program ends when the input has ended and everything is acknowledged.
"""
import argparse
import collections
import os
import select
import sys
import time

import paho.mqtt.client as mqtt

KEEP_ALIVE = 30  # seconds
IN_FLIGHT = 32   # published, not yet acknowledged


def new_client(name):
    """paho 2 needs the version of its callbacks; the callbacks here accept the arguments of either version."""
    if hasattr(mqtt, 'CallbackAPIVersion'):
        return mqtt.Client(mqtt.CallbackAPIVersion.VERSION2, client_id=name)
    return mqtt.Client(client_id=name)


class Broker:
    """One connection, a clean session: the spool remembers, not the broker. Raises OSError when it is lost."""

    def __init__(self, options):
        self.acknowledged = set()  # message numbers
        self.answer = None
        self.client = new_client(options.client)
        self.client.on_connect = lambda client, data, flags, code, *more: setattr(self, 'answer', code)
        self.client.on_publish = lambda client, data, number, *more: self.acknowledged.add(number)
        self.client.max_inflight_messages_set(IN_FLIGHT)
        if options.user:
            self.client.username_pw_set(options.user, options.password)
        self.client.connect(options.host, options.port, KEEP_ALIVE)
        deadline = time.monotonic() + 5
        while self.answer is None:
            self.exchange(0.1)
            if time.monotonic() >= deadline:
                raise ConnectionError('the broker does not answer')
        self.check_answer()

    def check_answer(self):
        if getattr(self.answer, 'is_failure', self.answer != 0):
            said = mqtt.connack_string(self.answer) if isinstance(self.answer, int) else self.answer
            raise ConnectionError(f'the broker refuses the connection: {said}')

    def publish(self, topic, payload, retain):
        """The message's number, which `acknowledged` will hold."""
        return self.client.publish(topic, payload, qos=1, retain=retain).mid

    def exchange(self, timeout):
        """Sends and receives for `timeout` seconds at most."""
        code = self.client.loop(timeout)
        if code != mqtt.MQTT_ERR_SUCCESS:
            if self.answer is not None:
                self.check_answer()
            raise ConnectionError(f'the broker is gone: {mqtt.error_string(code)}')

    def close(self):
        self.client.disconnect()


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
        self.in_flight = collections.deque()  # numbers of the messages that hold the oldest lines, oldest first
        self.input_open = True
        self.rest = b''
        self.delivered = 0

    def say(self, message):
        print(f'mqtt_publish: {message}', file=sys.stderr, flush=True)

    def waiting(self):
        lines = len(self.spool.lines)
        return '1 line waits' if lines == 1 else f'{lines} lines wait'

    def connect(self):
        if self.broker or time.monotonic() < self.next_try or not (self.spool.lines or self.input_open):
            return
        try:
            self.broker = Broker(self.options)
            self.say(f'connected, {self.waiting()}')
        except OSError as error:
            self.say(f'{self.options.host}:{self.options.port}: {error}; trying again')
            self.next_try = time.monotonic() + self.options.retry

    def disconnect(self, error):
        self.say(f'{error}; {self.waiting()} for the broker')
        self.broker.close()
        self.broker = None
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

    def exchange(self, timeout):
        while len(self.in_flight) < min(IN_FLIGHT, len(self.spool.lines)):
            line = self.spool.lines[len(self.in_flight)]
            self.in_flight.append(self.broker.publish(self.options.topic, line, self.options.retain))
        self.broker.exchange(timeout)
        while self.in_flight and self.in_flight[0] in self.broker.acknowledged:
            self.broker.acknowledged.discard(self.in_flight.popleft())
            self.spool.acknowledge()
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
    parser.add_argument('--password', default=os.environ.get('MQTT_PASSWORD'), help='safer: set MQTT_PASSWORD')
    parser.add_argument('--retain', action='store_true', help='the broker keeps the newest line for new subscribers')
    parser.add_argument('--spool', default='terrain.spool', help='file for undelivered lines')
    parser.add_argument('--limit', type=int, default=1_000_000, help='maximum number of lines in the spool')
    parser.add_argument('--retry', type=float, default=1.0, help='seconds between two attempts to connect')
    options = parser.parse_args()
    if not 1 <= options.port <= 65535:
        parser.error(f'{options.port} is not a port: 1 to 65535')
    sys.exit(Publisher(options).run())


if __name__ == '__main__':
    main()
