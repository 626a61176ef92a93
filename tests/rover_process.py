# SPDX-License-Identifier: LGPL-2.1-or-later
"""terrainseg-rover as a process, and a camera that can be stopped and killed, for the tests of the rover's page."""
import contextlib
import json
import os
import pathlib
import subprocess
import sys
import time
import urllib.error
import urllib.request

from ports import free_port

TOP = pathlib.Path(__file__).resolve().parent.parent
ROVER = str(TOP / 'src/tools/rover/terrainseg-rover')
RAW = 'video/x-raw,format=I420,width=320,height=180,framerate=30/1'
LIVE_SCENE = f'terrainscenesrc is-live=true ! {RAW}'
CHEAP = f'videotestsrc is-live=true ! {RAW}'  # a scene takes a third of a core


def settled(check, wait=10):
    """Repeats a check until it holds, and what it looks at is there."""
    deadline = time.monotonic() + wait
    while True:
        try:
            return check()
        except (AssertionError, ConnectionError, KeyError, TypeError):
            if time.monotonic() > deadline:
                raise
            time.sleep(0.1)


def processor_time(process):
    """Seconds that a process has taken, its threads together."""
    fields = pathlib.Path(f'/proc/{process.pid}/stat').read_text().rsplit(')', 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


class Run:
    def __init__(self, folder, source, arguments, environment):
        self.folder, self.port = folder / 'state', free_port()
        self.command = [sys.executable, ROVER, '--source', source, '--port', str(self.port), '--folder', str(self.folder), *arguments]
        self.environment = environment
        self.errors = folder / 'errors'
        self.start()

    def start(self):
        self.process = subprocess.Popen(self.command, stdout=subprocess.PIPE, stderr=open(self.errors, 'a'), text=True, env={**os.environ, **self.environment})
        self.address = self.process.stdout.readline().strip()
        assert '?token=' in self.address, self.errors.read_text()
        self.base, self.token = self.address.split('?token=')

    def stop(self):
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(15)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        self.process.stdout.close()
        return self.process.returncode

    def restart(self):
        self.stop()
        self.start()

    def ask(self, path, body=None, method=None, timeout=20, **headers):
        """Status and body of a request with the right token, unless the headers say otherwise."""
        headers = {name.replace('_', '-'): value for name, value in {'Authorization': f'Bearer {self.token}', **headers}.items() if value is not None}
        data = body if body is None or isinstance(body, bytes) else json.dumps(body).encode()
        request = urllib.request.Request(self.base + path.lstrip('/'), data, headers, method=method)
        try:
            with urllib.request.urlopen(request, timeout=timeout) as reply:
                return reply.status, reply.read()
        except urllib.error.HTTPError as error:
            return error.code, error.read()

    def post(self, path, body=None):
        return self.ask(path, json.dumps(body).encode())

    def status(self):
        return json.loads(self.ask('status')[1])

    def feeds(self):
        return self.status()['feeds']



@contextlib.contextmanager
def rover(folder, *arguments, source=LIVE_SCENE, first_frame=True, **environment):
    run = Run(folder, source, arguments, environment)
    try:
        if first_frame:
            def has_frames():
                assert run.status()['frames'] > 2, run.errors.read_text()
            settled(has_frames, 40)
        yield run
    finally:
        run.stop()


class Camera:
    """Frames over TCP from another process: stopped it is silent, killed it is gone."""

    def __init__(self):
        self.port = free_port()
        self.source = f'tcpclientsrc host=127.0.0.1 port={self.port} ! gdpdepay'
        self.start()

    def start(self):
        self.process = subprocess.Popen(['gst-launch-1.0', '-q', *f'{LIVE_SCENE} ! gdppay ! tcpserversink sync-method=latest-keyframe '
                                         f'recover-policy=keyframe host=127.0.0.1 port={self.port}'.split()])

    def kill(self):
        self.process.kill()
        self.process.wait()


@contextlib.contextmanager
def sender():
    camera = Camera()
    try:
        yield camera
    finally:
        camera.kill()
