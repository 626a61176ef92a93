#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""The rover's view in a real browser: examples/webrtc/webrtc_sender.py against headless Chromium on this machine.

usage: browser.py BUILD_FOLDER [SCREENSHOT.png]

Counts the frames and JSON lines that arrive in the page, compares the picture with the one that was sent, lets two
browsers look at a time and one come back, and asks for an offer without answering it.
Packages: chromium gstreamer1.0-nice gir1.2-gst-plugins-bad-1.0.
"""
import base64
import contextlib
import json
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from ports import free_port  # noqa: E402
from tap import contains, equal, main  # noqa: E402

TOP = pathlib.Path(__file__).resolve().parents[2]
SIZE = (320, 180)
SCENE = f'terrainscenesrc is-live=true motion=still ! video/x-raw,width={SIZE[0]},height={SIZE[1]},framerate=15/1'
SCREENSHOT = None
WAIT = 60
ANSWER_LIMIT = 20  # as webrtc_sender.py has it


@contextlib.contextmanager
def sender(report):
    port = free_port()
    process = subprocess.Popen(['/usr/bin/python3', str(TOP / 'examples/webrtc/webrtc_sender.py'), '--host', '127.0.0.1',
                                '--port', str(port), '--report', str(report), '--source', SCENE],
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        address = process.stdout.readline().strip()
        equal(address, f'http://127.0.0.1:{port}/', 'address')
        yield process, address
    finally:
        process.kill()
        process.communicate()


@contextlib.contextmanager
def browser(address, *arguments, tools=None):
    program = shutil.which('chromium') or shutil.which('chromium-browser')
    assert program, 'chromium is missing: apt-get install chromium'
    with tempfile.TemporaryDirectory(prefix='terrainseg-profile-', ignore_cleanup_errors=True) as profile:
        process = subprocess.Popen(
            [program, '--headless', '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
             '--disable-background-networking', '--disable-component-update', '--disable-sync',
             '--autoplay-policy=no-user-gesture-required', f'--user-data-dir={profile}', *arguments, address],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            preexec_fn=tools.give_to_browser if tools else None, close_fds=tools is None)
        try:
            yield process
        finally:
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def report_with(path, frames, process, viewer=1):
    """That viewer's report as soon as its page has seen `frames` frames and lines."""
    deadline, report = time.monotonic() + WAIT, {}
    while time.monotonic() < deadline:
        assert process.poll() is None, process.stderr.read()
        with contextlib.suppress(OSError, ValueError):
            report = json.loads(path.read_text())
            if report['viewer'] == viewer and report['frames'] >= frames and report['lines'] >= frames and report['picture']:
                return report
        time.sleep(0.2)
    raise AssertionError(f'after {WAIT} s: { {key: value for key, value in report.items() if key != "picture"} }')


def pixels(path):
    return subprocess.run(['ffmpeg', '-v', 'error', '-i', str(path), '-frames:v', '1', '-f', 'rawvideo', '-pix_fmt',
                           'rgb24', '-'], capture_output=True, check=True).stdout


def mean_difference(one, other):
    equal(len(one), len(other), 'size of the pictures')
    return sum(abs(a - b) for a, b in zip(one, other)) / len(one)


def frames_and_lines_arrive(folder):
    report_file = folder / 'report.json'
    with sender(report_file) as (process, address):
        with browser(address + '?report'):
            report = report_with(report_file, 90, process)
    equal((report['width'], report['height']), SIZE, 'size of the video')
    equal(report['state'], 'connected', 'state')
    equal(report['error'], None, 'error')
    first, last = report['first']['frame'], report['last']['frame']
    equal(report['lines'], last - first + 1, 'lines of the frames between the first and the last')
    # The page may skip frames when the machine is busy; it must not skip half of them.
    assert report['frames'] > report['lines'] / 2, (report['frames'], report['lines'])
    print(f"# {report['frames']} frames and {report['lines']} lines in the page")

    picture = folder / 'page.png'
    picture.write_bytes(base64.b64decode(report['picture'].split(',')[1]))
    number = last + 1  # a still scene: what differs from frame to frame is only what was learned
    subprocess.run(['gst-launch-1.0', '-q', *f'terrainscenesrc motion=still num-buffers={number} ! video/x-raw,width={SIZE[0]},'
                    f'height={SIZE[1]},framerate=15/1 ! videoconvert ! video/x-raw,format=I420 ! terrainseg ! terrainoverlay '
                    '! videoconvert ! pngenc ! multifilesink location=sent.png'.split()], check=True)
    subprocess.run(['gst-launch-1.0', '-q', *f'terrainscenesrc motion=still num-buffers=1 ! video/x-raw,width={SIZE[0]},'
                    f'height={SIZE[1]} ! videoconvert ! pngenc ! filesink location=plain.png'.split()], check=True)
    # The sky is the same whatever was learned; how far the tint reaches depends on which frames a busy machine dropped.
    sky = SIZE[0] * (SIZE[1] // 5) * 3
    shown, sent, plain = pixels(picture), pixels('sent.png'), pixels('plain.png')
    above = mean_difference(shown[:sky], sent[:sky])
    below, undrawn = mean_difference(shown[sky:], sent[sky:]), mean_difference(shown[sky:], plain[sky:])
    print(f'# mean difference in grey levels: sky {above:.1f}; below it {below:.1f}, without the mask {undrawn:.1f}')
    assert above < 8, above
    assert below < 0.75 * undrawn, (below, undrawn)


def ends(process, viewers):
    """Ctrl-C ends the server, which tells how many have looked."""
    process.send_signal(2)
    text = process.communicate(timeout=20)[0]
    equal(process.returncode, 0, 'exit code')
    frames, seen = (int(word) for word in text.split() if word.isdigit())
    equal(seen, viewers, 'viewers')
    return frames


def viewers_come_and_go(folder):
    report_file = folder / 'report.json'
    with sender(report_file) as (process, address):
        with browser(address + '?report'):
            report_with(report_file, 20, process)
            with browser(address + '?report'):  # a second one that looks at the same time, and goes
                report_with(report_file, 20, process, viewer=2)
            lines = report_with(report_file, 21, process)['lines']
            report_with(report_file, lines + 20, process)
        with browser(address + '?report'):
            report_with(report_file, 20, process, viewer=3)
        assert ends(process, viewers=3) > 60


def who_never_answers_is_given_up(folder):
    with sender(folder / 'report.json') as (process, address):
        offer = urllib.request.Request(address + 'offer', b'')
        equal(json.load(urllib.request.urlopen(offer, timeout=30))['viewer'], 1, 'the first')
        time.sleep(ANSWER_LIMIT + 2)
        equal(json.load(urllib.request.urlopen(offer, timeout=30))['viewer'], 2, 'the next')
        # Frames are counted where all others are served: nothing has held that up.
        assert ends(process, viewers=2) > 15 * ANSWER_LIMIT


class DevTools:
    """Chromium's DevTools protocol over --remote-debugging-pipe: JSON between zero bytes on its files 3 and 4."""

    def __init__(self):
        self.browser_in, self.out = os.pipe()
        self.in_, self.browser_out = os.pipe()
        self.number, self.data = 0, b''

    def give_to_browser(self):
        # Runs in the child: away from 3 and 4 first, so that one does not overwrite the other.
        one, two = os.dup2(self.browser_in, 50), os.dup2(self.browser_out, 51)
        os.dup2(one, 3)
        os.dup2(two, 4)

    def call(self, method, session=None, **parameters):
        self.number += 1
        message = {'id': self.number, 'method': method, 'params': parameters}
        if session:
            message['sessionId'] = session
        os.write(self.out, json.dumps(message).encode() + b'\0')
        while True:
            while b'\0' not in self.data:
                self.data += os.read(self.in_, 1 << 20)
            text, self.data = self.data.split(b'\0', 1)
            reply = json.loads(text)
            if reply.get('id') == self.number:
                assert 'error' not in reply, reply
                return reply['result']

    def screenshot(self):
        target = next(each for each in self.call('Target.getTargets')['targetInfos'] if each['type'] == 'page')
        session = self.call('Target.attachToTarget', targetId=target['targetId'], flatten=True)['sessionId']
        return base64.b64decode(self.call('Page.captureScreenshot', session, format='png')['data'])


def a_screenshot_shows_the_page(folder):
    report_file, shot, tools = folder / 'report.json', folder / 'shot.png', DevTools()
    with sender(report_file) as (process, address):
        with browser(address + '?report', '--remote-debugging-pipe', '--window-size=640,480', tools=tools):
            report_with(report_file, 20, process)
            shot.write_bytes(tools.screenshot())
    if SCREENSHOT:
        shutil.copyfile(shot, SCREENSHOT)
    width, height = struct.unpack('!II', shot.read_bytes()[16:24])
    data = pixels(shot)
    equal(len(data), width * height * 3, 'size of the screenshot')
    # The upper part is the video: not the black of an empty player.
    upper = data[:width * (height // 2) * 3]
    bright = sum(value > 60 for value in upper) / len(upper)
    print(f'# {width}x{height}, {100 * bright:.0f} % of the upper half is brighter than an empty player')
    assert bright > 0.4, bright


def the_server_survives_bad_requests(folder):
    with sender(folder / 'report.json') as (process, address):
        for path, body, code in (('answer', b'{', 400), ('answer', b'{}', 400), ('answer', b'[1]', 400),
                                 ('answer', b'{"viewer": 99, "sdp": "x"}', 204), ('nothing', b'', 404)):
            try:
                equal(urllib.request.urlopen(address + path, body, 20).status, code, path)
            except urllib.error.HTTPError as error:
                equal(error.code, code, path)
        offer = json.load(urllib.request.urlopen(address + 'offer', b'', 30))
        contains(offer['sdp'], 'VP8/90000')
        assert offer['candidates'], offer
        for sdp in 'not an sdp', '':
            urllib.request.urlopen(urllib.request.Request(
                address + 'answer', json.dumps({'viewer': offer['viewer'], 'sdp': sdp}).encode()), timeout=20)
        time.sleep(1)
        equal(process.poll(), None, 'the server runs')


if __name__ == '__main__':
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    build = pathlib.Path(sys.argv.pop(1)).resolve()
    os.environ.update(GST_PLUGIN_PATH=str(build / 'gst'), GST_REGISTRY=str(build / 'registry-browser.bin'))
    SCREENSHOT = pathlib.Path(sys.argv.pop(1)).resolve() if len(sys.argv) > 1 and sys.argv[1].endswith('.png') else None
    main([frames_and_lines_arrive, viewers_come_and_go, who_never_answers_is_given_up, a_screenshot_shows_the_page, the_server_survives_bad_requests])
