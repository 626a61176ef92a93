#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""The rover's page in a real browser: terrainseg-rover against headless Chromium on this machine, over the DevTools protocol.

usage: browser.py BUILD_FOLDER [FOLDER]     FOLDER: for screenshots of desktop and telephone size

Packages: chromium gstreamer1.0-nice gir1.2-gst-plugins-bad-1.0.
"""
import base64
import contextlib
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from rover_process import TOP, processor_time, rover, sender, settled  # noqa: E402
from tap import contains, equal, main  # noqa: E402

SHOTS = None
READER = """import sys, urllib.request as web
reply = web.urlopen(web.Request(sys.argv[1], headers={'Authorization': sys.argv[2]}))
while reply.read1(65536): pass"""
WAIT = 40


class DevTools:
    """Chromium's DevTools protocol over --remote-debugging-pipe: JSON between zero bytes on its files 3 and 4."""

    def __init__(self):
        self.browser_in, self.out = os.pipe()
        self.in_, self.browser_out = os.pipe()
        self.number, self.data, self.requests = 0, b'', []

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
            if reply.get('method') == 'Network.requestWillBeSent':
                self.requests.append(reply['params']['request']['url'])
            if reply.get('id') == self.number:
                assert 'error' not in reply, reply
                return reply['result']

    def page(self, address, width=1280, height=800, telephone=False):
        target = self.call('Target.createTarget', url='about:blank', newWindow=True)['targetId']
        session = self.call('Target.attachToTarget', targetId=target, flatten=True)['sessionId']
        page = Page(self, session)
        page.call('Network.enable')
        page.call('Emulation.setDeviceMetricsOverride', width=width, height=height, deviceScaleFactor=2 if telephone else 1, mobile=telephone)
        if telephone:
            page.call('Emulation.setTouchEmulationEnabled', enabled=True)
        page.call('Page.navigate', url=address)
        page.until("typeof seen !== 'undefined' && seen.pictures > 0 && status && status.window && $('settings').children.length > 9")
        return page


class Page:
    def __init__(self, tools, session):
        self.tools, self.session = tools, session

    def call(self, method, **parameters):
        return self.tools.call(method, self.session, **parameters)

    def value(self, expression):
        result = self.call('Runtime.evaluate', expression=expression, returnByValue=True, awaitPromise=True)
        assert 'exceptionDetails' not in result, result
        return result['result'].get('value')

    def until(self, expression, wait=WAIT):
        deadline = time.monotonic() + wait
        while not self.value(expression):
            assert time.monotonic() < deadline, f'{expression}: not within {wait} s; the page says {self.value("document.body.innerText")!r}'
            time.sleep(0.05)

    def click(self, selector):
        self.value(f"document.querySelector('{selector}').click()")

    def box(self):
        self.value("scrollTo(0, 0)")
        return self.value("(b => [b.left, b.top, b.width, b.height])($('view').getBoundingClientRect())")

    def points(self, *shares):
        left, top, width, height = self.box()
        return [(left + x * width, top + y * height) for x, y in shares]

    def mouse(self, *shares):
        points = self.points(*shares)
        for kind, (x, y) in [('mousePressed', points[0]), *(('mouseMoved', point) for point in points), ('mouseReleased', points[-1])]:
            self.call('Input.dispatchMouseEvent', type=kind, x=x, y=y, button='left', buttons=0 if kind == 'mouseReleased' else 1, clickCount=1)

    def finger(self, *shares):
        points = self.points(*shares)
        for kind, point in [('touchStart', points[0]), *(('touchMove', point) for point in points[1:]), ('touchEnd', None)]:
            self.call('Input.dispatchTouchEvent', type=kind, touchPoints=[{'x': point[0], 'y': point[1]}] if point else [])

    def screenshot(self, name):
        if SHOTS:
            data = self.call('Page.captureScreenshot', format='png', captureBeyondViewport=False)['data']
            (SHOTS / name).write_bytes(base64.b64decode(data))


@contextlib.contextmanager
def chromium():
    program = shutil.which('chromium') or shutil.which('chromium-browser')
    assert program, 'chromium is missing: apt-get install chromium'
    tools = DevTools()
    with tempfile.TemporaryDirectory(prefix='terrainseg-profile-', ignore_cleanup_errors=True) as profile:
        process = subprocess.Popen(
            [program, '--headless', '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking',
             '--disable-component-update', '--disable-sync', '--remote-debugging-pipe', f'--user-data-dir={profile}', 'about:blank'],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, preexec_fn=tools.give_to_browser, close_fds=False)
        try:
            yield tools
        finally:
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def near(actual, wanted, what):
    assert len(actual) == len(wanted) and all(abs(a - b) <= 0.01 for a, b in zip(actual, wanted)), f'{what}: {actual} instead of {wanted}'


def two_pages_get_pictures_and_nothing_else_is_asked(folder):
    with rover(folder) as run, chromium() as tools:
        pages = [tools.page(run.address), tools.page(run.base)]  # the second one by its cookie
        best = 0
        for _ in range(10):  # a busy machine may hold one try up
            before = [page.value('seen.pictures') for page in pages]
            time.sleep(2)
            best = max(best, min(page.value('seen.pictures') - was for page, was in zip(pages, before)))
            if best >= 30:
                break
        assert best >= 30, f'{best} pictures in 2 s'
        equal(run.status()['viewers'], 2, 'viewers')
        outside = [url for url in tools.requests if not url.startswith((run.base, 'data:', 'blob:'))]
        equal(outside, [], 'requests to others')
        assert any('/live' in url for url in tools.requests), tools.requests
        pages[0].until("!$('alarm').textContent")
        # The canvas shows the rendered scene with green ground, not black.
        light = pages[0].value("(d => d.reduce((a, b) => a + b) / d.length)([...canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data])")
        assert light > 90, light
        print(f'# {best} pictures in 2 s on both pages')


def mouse_and_finger_draw_and_the_file_is_that_of_tune(folder):
    with rover(folder) as run, chromium() as tools:
        desk, hand = tools.page(run.address), tools.page(run.address, 390, 844, telephone=True)
        desk.click('[data-tool=window]')
        desk.mouse((0.25, 0.7), (0.4, 0.8), (0.75, 0.95))
        settled(lambda: near(run.status()['window'], [0.25, 0.7, 0.5, 0.25], 'window by mouse'))
        desk.screenshot('desktop-window.png')
        hand.click('[data-tool=window]')
        hand.finger((0.3, 0.75), (0.5, 0.8), (0.7, 0.9))
        settled(lambda: near(run.status()['window'], [0.3, 0.75, 0.4, 0.15], 'window by finger'))
        hand.click('[data-tool=ignore]')
        for corners in ((0.0, 0.0), (0.1, 0.05), (0.2, 0.1)), ((0.6, 0.0), (0.7, 0.05), (0.8, 0.2)):
            hand.finger(*corners)
        settled(lambda: equal(len(run.status()['regions']), 2, 'regions'))
        near(run.status()['regions'][0], [0, 0, 0.2, 0.1], 'region')
        hand.finger((0.7, 0.1))
        settled(lambda: equal(len(run.status()['regions']), 1, 'regions after a tap'))
        desk.click('[data-tool=horizon]')
        desk.mouse((0.5, 0.3), (0.5, 0.42))
        settled(lambda: near([run.status()['hint'] or 0], [0.42], 'horizon'))
        desk.value("(f => { f.value = 6; f.onchange(); })($('set-caution'))")
        desk.value("(f => { f.value = 'false'; f.onchange(); })($('set-odd-spots'))")
        settled(lambda: equal(run.status()['changed'], ['caution', 'odd-spots'], 'changed'))
        hand.until("$('set-caution').value === '6'")  # the other page sees it
        hand.screenshot('telephone.png')
        desk.click('[data-post="/settings/save"]')
        kept = run.folder / 'terrainseg.settings'
        settled(lambda: contains(kept.read_text() if kept.exists() else '', 'caution=6'))
        values = [line for line in kept.read_text().splitlines() if '=' in line]
        tune = subprocess.Popen([sys.executable, str(TOP / 'examples/python/tune.py'), 'scene', *values, '--settings', 'tune.settings', '--sink', 'fakesink'],
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        time.sleep(4)
        tune.send_signal(signal.SIGINT)
        said = tune.communicate(timeout=30)[0]
        equal(tune.returncode, 0, said)
        equal(kept.read_text(), pathlib.Path('tune.settings').read_text(), 'file of tune.sh')
        desk.click('#reset')
        settled(lambda: equal(run.status()['hint'], None, 'horizon after reset'))
        desk.click('[data-post="/settings/load"]')
        settled(lambda: near([run.status()['hint'] or 0], [0.42], 'horizon from the file'))


def a_recording_is_downloaded_and_passes_the_check(folder):
    with rover(folder) as run, chromium() as tools:
        desk = tools.page(run.address)
        desk.click('#record')
        desk.until("status.recording")
        frames = desk.value("status.frames")  # a busy machine gives fewer a second
        desk.until(f"status.recording.seconds >= 4 && status.frames >= {frames + 60}")
        desk.screenshot('desktop.png')
        desk.click('#record')
        desk.until("!status.recording && !!document.querySelector('#files a')")
        name, data = desk.value("""(async () => { const link = document.querySelector('#files a'), bytes = new Uint8Array(await (await fetch(link.href)).arrayBuffer());
            let text = ''; for (const byte of bytes) text += String.fromCharCode(byte); return [link.download, btoa(text)]; })()""")
        data = base64.b64decode(data)
        equal(data, (run.folder / 'recordings' / name).read_bytes(), 'what was downloaded')
        if not name.endswith('.mcap'):
            assert json.loads(data.splitlines()[-1])['mask'], name
            return
        equal((data[:8], data[-8:]), (b'\x89MCAP0\r\n',) * 2, 'magic')
        pathlib.Path('check.mjs').write_bytes((TOP / 'tests/ci/mcap_check.mjs').read_bytes())
        pathlib.Path('drive.mcap').write_bytes(data)
        if subprocess.run('npm install --silent --no-audit --no-fund --ignore-scripts @mcap/core@2.2.2 @foxglove/rosmsg@5.0.5 '
                          '@foxglove/rosmsg2-serialization@3.1.0 fzstd@0.1.1', shell=True, capture_output=True).returncode:
            print('# npm cannot fetch the readers: only the magic was checked')
            return
        checked = subprocess.run(['node', 'check.mjs', 'finished', 'drive.mcap', '30'], capture_output=True, text=True)
        equal(checked.returncode, 0, checked.stdout + checked.stderr)


def a_dead_camera_and_a_dead_rover_are_shown_and_come_back(folder):
    with sender() as camera, rover(folder, source=camera.source) as run, chromium() as tools:
        desk = tools.page(run.address)
        desk.until("$('alarm').hidden")
        camera.process.send_signal(signal.SIGSTOP)
        stopped = time.monotonic()
        desk.until("!$('alarm').hidden")
        took = time.monotonic() - stopped
        assert took < 2, f'{took:.1f} s until the page shows it'
        print(f'# a camera that is silent is shown after {took:.1f} s')
        contains(desk.value("$('alarm').textContent"), 'No picture from the camera')
        camera.process.send_signal(signal.SIGCONT)
        desk.until("$('alarm').hidden")
        run.stop()
        desk.until("!$('alarm').hidden")
        run.start()
        desk.until("$('alarm').hidden")


def h264_plays_at_the_push_of_a_button(folder):
    with rover(folder) as run, chromium() as tools:
        desk = tools.page(run.address)
        desk.until("!$('h264').hidden")
        desk.click('#h264')
        desk.until("video.getVideoPlaybackQuality().totalVideoFrames > 30 && video.videoWidth === 320")
        equal(run.feeds(), ['webrtc'], 'what is encoded')
        desk.click('#h264')
        desk.until("!canvas.hidden")
        settled(lambda: equal(run.feeds(), ['pictures'], 'what is encoded'), 30)


def no_viewer_costs_little_and_three_little_more_than_one(folder):
    """Processor time beside the same filter in gst-launch-1.0, at the same time; a busy machine gets three tries."""
    subprocess.run('gst-launch-1.0 -q terrainscenesrc num-buffers=60 ! video/x-raw,format=I420,width=640,height=360,framerate=30/1 '
                   '! filesink location=scene.yuv'.split(), check=True)
    source = (f'multifilesrc location={folder}/scene.yuv loop=true blocksize=345600 ! rawvideoparse format=i420 width=640 height=360 '
              'framerate=30/1 ! identity sync=true')
    alone = subprocess.Popen(['gst-launch-1.0', '-q', *source.split(), '!', 'terrainseg', '!', 'fakesink', 'sync=false'])
    try:
        with rover(folder, source=source) as run:
            def cost(viewers):
                looking = [subprocess.Popen([sys.executable, '-c', READER, f'{run.base}live', f'Bearer {run.token}'])
                           for _ in range(viewers)]
                time.sleep(1)
                before = processor_time(run.process), processor_time(alone)
                time.sleep(8)
                after = processor_time(run.process), processor_time(alone)
                for each in looking:
                    each.kill()
                    each.wait()
                settled(lambda: equal(run.status()['viewers'], 0))
                return [100 * (b - a) / 8 for a, b in zip(before, after)]
            for _ in range(3):
                (none, filter_alone), (one, _), (three, _) = (cost(viewers) for viewers in (0, 1, 3))
                print(f'# % of a core: filter alone {filter_alone:.1f}, no viewer {none:.1f}, one viewer {one:.1f}, three {three:.1f}')
                if none - filter_alone < 2 and three < 1.5 * one:
                    return
        raise AssertionError('too much')
    finally:
        alone.kill()
        alone.wait()


if __name__ == '__main__':
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    build = pathlib.Path(sys.argv.pop(1)).resolve()
    os.environ.update(GST_PLUGIN_PATH=str(build / 'gst'), GST_REGISTRY=str(build / 'registry-browser.bin'))
    if len(sys.argv) > 1 and '/' in sys.argv[1]:
        SHOTS = pathlib.Path(sys.argv.pop(1)).resolve()
        SHOTS.mkdir(parents=True, exist_ok=True)
    main([two_pages_get_pictures_and_nothing_else_is_asked, mouse_and_finger_draw_and_the_file_is_that_of_tune,
          a_recording_is_downloaded_and_passes_the_check, a_dead_camera_and_a_dead_rover_are_shown_and_come_back, h264_plays_at_the_push_of_a_button,
          no_viewer_costs_little_and_three_little_more_than_one])
