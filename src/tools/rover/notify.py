# SPDX-License-Identifier: LGPL-2.1-or-later
"""systemd's notify protocol (sd_notify): READY with the first frame, WATCHDOG only while frames pass."""
import contextlib
import os
import socket
import time


class Watchdog:
    def __init__(self):
        self.address = os.environ.pop('NOTIFY_SOCKET', '')
        ours = os.environ.get('WATCHDOG_PID') in (None, str(os.getpid()))
        self.every = int(os.environ.get('WATCHDOG_USEC', 0)) / 1e6 / 4 if ours else 0
        self.frames, self.fed, self.told = 0, 0.0, None

    def send(self, text):
        if not self.address:
            return
        # A leading @ means the zero byte of an abstract address.
        address = '\0' + self.address[1:] if self.address.startswith('@') else self.address
        # systemd notices missing messages.
        with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.sendto(text.encode(), address)

    def tick(self, frames, problem):
        """Call several times a second with the number of frames so far."""
        now = time.monotonic()
        status = f'camera: {problem}' if problem else 'frames pass'
        if status != self.told:
            self.told = status
            self.send(f'STATUS={status}')
        if frames == self.frames:
            return
        if not self.frames:
            self.send('READY=1')
        if self.every and now - self.fed >= self.every:
            self.send('WATCHDOG=1')
            self.fed = now
        self.frames = frames
