#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""terrainseg-rover over HTTP: who may ask, what a page can do, slow viewers, lost cameras, and the datagrams to systemd."""
import contextlib
import http.client
import json
import os
import pathlib
import shutil
import signal
import socket
import ssl
import subprocess
import sys
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from rover_process import CHEAP, ROVER, TOP, rover, sender, settled  # noqa: E402
from tap import Skip, contains, equal, main  # noqa: E402

signal.signal(signal.SIGHUP, signal.SIG_DFL)  # as a terminal has it: programs that nohup starts inherit that it is ignored

CASES = []


def case(function):
    CASES.append(function)
    return function


class Viewer(threading.Thread):
    """Reads a multipart stream: counts pictures, keeps the last of each kind."""

    def __init__(self, run, path='live'):
        super().__init__(daemon=True)
        self.connection = http.client.HTTPConnection('127.0.0.1', run.port, timeout=20)
        self.connection.request('GET', f'/{path}', headers={'Authorization': f'Bearer {run.token}'})
        self.reply = self.connection.getresponse()
        self.pictures, self.status, self.picture = 0, {}, b''
        equal(self.reply.status, 200, path)
        self.start()

    def run(self):
        with contextlib.suppress(OSError, ValueError, http.client.HTTPException):
            while line := self.reply.readline():
                if line.startswith(b'Content-Length:'):
                    self.reply.readline()
                    data = self.reply.read(int(line.split()[1]))
                    if data.startswith(b'\xff\xd8'):
                        self.pictures, self.picture = self.pictures + 1, data
                    else:
                        self.status = json.loads(data)

    def close(self):
        self.reply.close()
        self.connection.close()


def at_least(value, least, what=''):
    assert value >= least, f'{what}: {value} and not at least {least}'


@case
def who_may_ask(folder):
    with rover(folder, source=CHEAP) as run:
        host = f'127.0.0.1:{run.port}'
        equal(oct((run.folder / 'token').stat().st_mode & 0o777), '0o600', 'the token is for its user alone')
        for path in '', 'live', 'status', 'page.js', 'recordings/x', 'nothing':
            equal(run.ask(path, Authorization=None)[0], 401, path)
            equal(run.ask(path, Authorization='Bearer wrong')[0], 401, path)
        equal(run.ask('?token=wrong', Authorization=None)[0], 401)
        equal(run.ask('status?token=' + run.token, Authorization=None)[0], 401, 'a token in an address is for the page only')
        for wrong in 'evil.example', f'evil.example:{run.port}', '192.0.2.1', '', '[':
            equal(run.ask('status', Host=wrong)[0], 403, f'Host {wrong}')
        for right in host, 'localhost:9999', '[::1]:80':  # ssh -L has other ports
            equal(run.ask('status', Host=right)[0], 200, f'Host {right}')
        for wrong in 'http://evil.example', 'null', f'http://localhost:{run.port}', f'http://127.0.0.1:{run.port + 1}':
            equal(run.ask('window', b'null', Origin=wrong)[0], 403, f'Origin {wrong}')
            equal(run.ask('status', Origin=wrong)[0], 403, f'Origin {wrong}')
        equal(run.ask('live', Sec_Fetch_Site='same-site')[0], 403, 'a picture in the page of another port')
        # With the cookie, as a browser.
        connection = http.client.HTTPConnection('127.0.0.1', run.port, timeout=10)
        connection.request('GET', '/?token=' + run.token, headers={'Sec-Fetch-Site': 'cross-site'})
        reply = connection.getresponse()
        equal((reply.status, reply.getheader('Location')), (303, '/'), 'the token leaves the address bar')
        given = reply.getheader('Set-Cookie')
        for word in 'HttpOnly', 'SameSite=Lax':
            contains(given, word)
        cookie = given.split(';')[0]
        equal(run.ask('', Authorization=None, Cookie=cookie)[0], 200, 'page')
        equal(run.ask('status', Authorization=None, Cookie='a="b; ' + cookie)[0], 401, 'a cookie that cannot be read')
        equal(run.ask('window', b'null', Authorization=None, Cookie=cookie)[0], 403, 'a browser names its Origin')
        equal(run.ask('window', b'null', Authorization=None, Cookie=cookie, Origin=f'http://{host}')[0], 200)
        # The same token after a restart: a telephone's bookmark goes on.
        before = run.token
        run.restart()
        equal(run.token, before, 'token')


@case
def what_cannot_be_is_refused(folder):
    with rover(folder, source=CHEAP) as run:
        for path in 'nothing', 'recordings/', 'recordings/../token', 'recordings/%2e%2e/token', 'token', 'page.html', '../token', 'settings/file':
            equal(run.ask(path)[0], 404, path)
        equal(run.ask('nothing', b'null')[0], 404)
        equal(run.ask('window', b'x' * 65537)[0], 413)
        equal(run.ask('window', b'x' * 3_000_000)[0], 413)
        equal(run.ask('window', b'{')[0], 400)
        equal(run.ask('window', b'[' * 60000)[0], 400)
        equal(run.ask('window', b'', Content_Length='-1')[0], 413)
        for path, bodies in (('window', ([], [0, 0, 1], [0, 0, 2, 1], [0, 0, 'a', 1], [0, 0, 0.001, 1], {}, True, [float('nan')] * 4)),
                             ('ignore', (None, [0, 0, 0, 0], [0, 0, True, 1])), ('unignore', (None, [0], [2, 0])), ('horizon', (2, 'a', [])),
                             ('learning', (None, 1)), ('terrain/load', (None,)),
                             ('set', (None, {}, {'name': 'settings-location', 'value': '/etc/passwd'}, {'name': 'caution', 'value': 101},
                                      {'name': 'caution', 'value': '101'}, {'name': 'preset', 'value': 'default ! fakesink'}, {'name': 'preset', 'value': '/'}))):
            for body in bodies:
                equal(run.post(path, body)[0], 400, f'{path} {body}')
        equal(run.status()['changed'], [], 'nothing was changed')
        # A request that never ends keeps no place, and there is an end to places.
        idle = [socket.create_connection(('127.0.0.1', run.port)) for _ in range(40)]
        begun = time.monotonic()
        with contextlib.suppress(ConnectionError):
            equal(idle[-1].recv(1), b'', 'one too many')
        assert time.monotonic() - begun < 5, 'it was not turned away'
        settled(lambda: equal(run.ask('status')[0], 200), 25)
        for each in idle:
            each.close()


@case
def settings_terrain_and_recording(folder):
    with rover(folder, 'camera-info=' + camera(folder), 'mount=height=1.35,pitch=2.75deg') as run:
        viewer = Viewer(run)
        settled(lambda: at_least(viewer.pictures, 10))
        settled(lambda: at_least(viewer.status['metres']['value'], 1, 'metres'))
        equal((viewer.status['lesson'], viewer.status['size']), ('', [320, 180]))
        keys = json.loads(run.ask('settings')[1])['keys']
        equal(len(keys), 10, 'settings that are offered')
        for path, body in (('set', {'name': 'caution', 'value': '4'}), ('set', {'name': 'overlay-style', 'value': 'contour'}), ('window', [0.3, 0.8, 0.4, 0.15]),
                           ('ignore', [0, 0, 0.25, 0.1]), ('ignore', [0.5, 0, 0.2, 0.1]), ('unignore', [0.6, 0.05]), ('horizon', 0.40003), ('learning', False)):
            equal(run.post(path, body), (200, b'null'), path)
        settled(lambda: equal(viewer.status['window'], [0.3, 0.8, 0.4, 0.15], 'window'))
        status = run.status()
        equal((status['regions'], status['changed'], status['settings']['caution']), ([[0, 0, 0.25, 0.1]], ['caution', 'overlay-style'], '4'))
        contains(status['lesson'], 'switched off')
        equal(status['hint'], 0.4, 'the same value as in tune.sh and in the file')
        for path in 'settings/save', 'terrain/save', 'record/start', 'terrain/load':
            equal(run.post(path), (200, b'null'), path)
        kept = (run.folder / 'terrainseg.settings').read_text()
        for line in 'caution=4', 'window-rect=0.3,0.8,0.4,0.15', 'ignore-regions=<<(int)0,(int)0,(int)80,(int)18>>', 'overlay-style=contour', 'horizon-hint=0.4\n', 'camera-info=':
            contains(kept, line)
        equal(run.ask('settings/file')[1].decode(), kept, 'download of the settings')
        run.post('window', None)
        run.post('set', {'name': 'caution', 'value': None})
        run.post('horizon', None)
        settled(lambda: equal(viewer.status['hint'], None, 'the filter finds the horizon'))
        settled(lambda: equal(viewer.status['window'], [0.35, 0.85, 0.3, 0.15], 'window of the preset'))
        equal(run.post('settings/load'), (200, b'null'))
        settled(lambda: equal((viewer.status['window'], viewer.status['settings']['caution']), ([0.3, 0.8, 0.4, 0.15], '4')))
        equal(run.status()['hint'], 0.4, 'from the file')
        settled(lambda: at_least(viewer.status['metres']['value'], 1, 'metres'))
        equal(run.status()['learning'], False, 'loading settings does not switch learning')
        run.post('learning', True)
        run.post('forget')
        settled(lambda: equal(viewer.status['lesson'], '', 'learning'))
        settled(lambda: at_least(viewer.status['recording']['seconds'], 2))
        run.post('record/stop')
        (name, size), = run.status()['recordings']
        data = run.ask(f'recordings/{name}')[1]
        equal(len(data), size, 'size of the recording')
        if name.endswith('.mcap'):
            equal((data[:8], data[-8:]), (b'\x89MCAP0\r\n',) * 2, 'magic')
            assert b'/terrain/scan' in data, 'the recording has no metres'
        viewer.close()
        equal(os.listdir(run.folder / 'recordings'), [name], 'no part is left')
    # The next run begins with what was saved.
    with rover(folder) as run:
        settled(lambda: equal(run.status()['window'], [0.3, 0.8, 0.4, 0.15], 'window'))


def camera(folder):
    (folder / 'camera.yaml').write_text('image_width: 320\nimage_height: 180\ncamera_matrix: {rows: 3, cols: 3, data: [262.4, 0, 159.5, 0, 262.4, 89.5, 0, 0, 1]}\n')
    return str(folder / 'camera.yaml')


@case
def without_mcap_a_recording_is_lines_with_masks(folder):
    plain = folder / 'plugins'
    plain.mkdir()
    (plain / 'libgstterrainseg.so').symlink_to(pathlib.Path(os.environ['TERRAINSEG_PLUGIN']))
    with rover(folder, source=CHEAP, GST_PLUGIN_PATH=str(plain), GST_REGISTRY=str(folder / 'registry.bin')) as run:
        run.post('record/start')
        frames = run.status()['frames']
        settled(lambda: at_least(run.status()['frames'], frames + 10))
        run.post('record/stop')
        (name, size), = run.status()['recordings']
        assert name.endswith('.jsonl') and size, name
        lines = [json.loads(line) for line in run.ask(f'recordings/{name}')[1].splitlines()]
        assert len(lines) > 5 and all(line['mask']['runs'] for line in lines), len(lines)


def webrtc(run):
    return json.loads(run.ask('settings')[1])['webrtc']


@case
def without_nice_there_is_no_webrtc_and_the_rover_lives(folder):
    known = pathlib.Path(subprocess.run(['pkg-config', '--variable=pluginsdir', 'gstreamer-1.0'], capture_output=True, text=True, check=True).stdout.strip())
    (folder / 'system').mkdir()
    for plugin in known.glob('*.so'):
        if plugin.name != 'libgstnice.so':
            (folder / 'system' / plugin.name).symlink_to(plugin)
    with rover(folder, source=CHEAP, GST_PLUGIN_SYSTEM_PATH=str(folder / 'system'), GST_REGISTRY=str(folder / 'registry.bin')) as run:
        equal((webrtc(run), run.ask('offer', b'null')[0]), (False, 404), 'WebRTC')
        viewer = Viewer(run)
        settled(lambda: at_least(viewer.pictures, 5))
        viewer.close()


@case
def webrtc_survives_invalid_answers(folder):
    with rover(folder, source=CHEAP) as run:
        if not webrtc(run):
            raise Skip('webrtcbin, nicesrc, x264enc or the bindings are missing')
        for body in None, {}, [1], {'viewer': 'x', 'sdp': ''}, {'viewer': 1}:
            equal(run.post('answer', body)[0], 404 if not isinstance(body, dict) else 400, f'answer {body}')
        equal(run.post('answer', {'viewer': 99, 'sdp': 'x'})[0], 200, 'of a viewer that is not there')
        offers = [json.loads(run.post('offer')[1]) for _ in range(2)]
        for each in offers:
            contains(each['sdp'], 'H264/90000')
            assert each['candidates'], each
        equal(run.feeds(), ['webrtc'])
        run.post('answer', {'viewer': offers[0]['viewer'], 'sdp': 'not an sdp'})
        # The other one never answers. Both are given up, and nothing is encoded any more.
        settled(lambda: equal((run.status()['viewers'], run.feeds()), (0, [])), 35)
        run.post('leave', json.loads(run.post('offer')[1])['viewer'])
        settled(lambda: equal(run.feeds(), []))


@case
def a_recording_that_fails_costs_no_frame(folder):
    with rover(folder, source=CHEAP) as run:
        (run.folder / 'recordings').rmdir()
        (run.folder / 'recordings').symlink_to('/proc')  # a folder in which nothing can be made
        run.post('record/start')
        settled(lambda: contains(run.status()['note'], 'rover-'))
        settled(lambda: equal(run.status()['recording'], None))
        settled(lambda: equal(run.feeds(), []))
        frames = run.status()['frames']
        settled(lambda: at_least(run.status()['frames'], frames + 10))
        equal((run.status()['problem'], run.errors.read_text().count('camera')), (None, 1), 'the camera')


@case
def a_slow_viewer_delays_no_other(folder):
    # Pictures that cost little, and of which few fill what the kernel keeps for one who does not read.
    with rover(folder, source='videotestsrc is-live=true pattern=snow ! video/x-raw,format=I420,width=640,height=360,framerate=30/1') as run:
        equal(run.feeds(), [], 'nothing is encoded without viewers')
        sleeper = socket.create_connection(('127.0.0.1', run.port))
        sleeper.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        sleeper.sendall(f'GET /live HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {run.token}\r\n\r\n'.encode())
        viewers = [Viewer(run), Viewer(run, 'video')]
        settled(lambda: at_least(min(each.pictures for each in viewers), 5))
        frames, before, begun = run.status()['frames'], [each.pictures for each in viewers], time.monotonic()
        time.sleep(3)
        came = run.status()['frames'] - frames
        assert came > 20 * (time.monotonic() - begun) / 3, f'the camera gave {came} frames'
        for each, was in zip(viewers, before):
            assert each.pictures - was > 0.6 * came, f'{each.pictures - was} pictures of {came} frames'
        equal((run.status()['viewers'], run.feeds()), (3, ['pictures']))
        settled(lambda: equal(run.status()['viewers'], 2, 'who does not read is given up'), 20)
        for each in viewers:
            each.close()
        settled(lambda: equal(run.feeds(), [], 'nothing is encoded'), 15)
        sleeper.close()
        many = [Viewer(run) for _ in range(8)]
        equal(run.ask('live')[0], 503, 'the ninth')
        for each in many:
            each.close()


@case
def a_lost_camera_shows_and_comes_back(folder):
    with sender() as source, rover(folder, source=source.source) as run:
        viewer = Viewer(run)
        settled(lambda: equal(viewer.status.get('problem', 'x'), None))
        run.post('record/start')
        settled(lambda: at_least(viewer.status['recording']['seconds'], 1))
        source.process.send_signal(signal.SIGSTOP)
        stopped = time.monotonic()
        settled(lambda: at_least(viewer.status['age'], 1), 2)
        print(f'# shown after {time.monotonic() - stopped:.1f} s')
        settled(lambda: contains(viewer.status['problem'] or '', 'no frame'), 10)
        source.kill()
        settled(lambda: equal(viewer.status['recording'], None, 'the recording ends with the camera'))
        source.start()
        settled(lambda: equal(viewer.status['problem'], None), 20)
        pictures = viewer.pictures
        settled(lambda: at_least(viewer.pictures, pictures + 5))
        settled(lambda: at_least(len(viewer.status['recording'] or ()), 2, 'a new recording goes on'))
        equal(len(run.status()['recordings']), 1, 'and the first is whole')
        viewer.close()


@case
def without_a_camera_the_page_says_so(folder):
    with rover(folder, source='v4l2src device=/dev/no-such-camera ! decodebin', first_frame=False) as run:
        settled(lambda: contains(run.status()['problem'] or '', "/dev/no-such-camera"))
        equal(run.ask('')[0], 200, 'the page is there')
        contains(run.errors.read_text(), '/dev/no-such-camera')
    equal(run.errors.read_text().count('no-such-camera'), 1, 'logged once')


@case
def words_that_cannot_be_are_refused(folder):
    (folder / 'rover.conf').write_text('# comment\n\n--source videotestsrc ! nonsense\n--port 0\n--folder state\n')
    for words, code, reason in ((['@rover.conf'], 2, 'no element "nonsense"'), (['--port', '99999'], 2, 'not a port'), (['--key', 'x'], 2, 'both'),
                                (['caution=101', '--folder', 'state'], 2, 'caution = 101'), (['--source', 'scene', '--folder', '/proc/x'], 1, '/proc/x'),
                                (['--certificate', 'no.pem', '--key', 'no.pem', '--folder', 'state'], 1, 'no.pem: No such file'),
                                (['--certificate', 'rover.conf', '--key', 'rover.conf', '--folder', 'state'], 2, 'PEM files that belong together'),
                                (['--host', '192.0.2.1', '--folder', 'state'], 1, '192.0.2.1')):
        result = subprocess.run([sys.executable, ROVER, *words], capture_output=True, text=True, timeout=60)
        equal(result.returncode, code, result.stderr)
        contains(result.stderr, reason)
        assert 'Traceback' not in result.stderr, result.stderr


@case
def a_service_looks_for_its_plugins_again(folder):
    environment = {name: value for name, value in os.environ.items() if name not in ('GST_REGISTRY', 'GST_PLUGIN_PATH')}
    environment.update(XDG_CACHE_HOME=str(folder), CACHE_DIRECTORY=str(folder))
    if not subprocess.run(['gst-inspect-1.0', 'terrainseg'], capture_output=True, env=environment).returncode:
        raise Skip('the plugin is installed on this machine')
    assert list(folder.glob('gstreamer-1.0/registry.*.bin')), 'GStreamer keeps no registry there'
    result = subprocess.run([sys.executable, ROVER, '--source', 'scene', '--folder', 'state'], capture_output=True, text=True, env=environment, timeout=60)
    equal(result.returncode, 1, result.stderr)
    contains(result.stderr, 'GStreamer has no terrainseg')
    equal(list(folder.glob('gstreamer-1.0/registry.*.bin')), [], 'a plugin that did not load would stay unusable')


@case
def tls_with_a_certificate(folder):
    if not shutil.which('openssl'):
        raise Skip('openssl is not installed')
    subprocess.run('openssl req -x509 -newkey rsa:2048 -nodes -keyout key.pem -out cert.pem -days 2 -subj /CN=localhost -addext '
                   'subjectAltName=IP:127.0.0.1'.split(), check=True, capture_output=True)
    with rover(folder, '--certificate', 'cert.pem', '--key', 'key.pem', first_frame=False) as run:
        contains(run.address, 'https://127.0.0.1')
        context = ssl.create_default_context(cafile='cert.pem')
        mute = socket.create_connection(('127.0.0.1', run.port))  # its handshake never comes; others are served
        connection = http.client.HTTPSConnection('127.0.0.1', run.port, context=context, timeout=10)
        connection.request('GET', '/?token=' + run.token)
        contains(connection.getresponse().getheader('Set-Cookie'), 'Secure')
        mute.close()


@contextlib.contextmanager
def notifications(folder, abstract):
    """A socket as systemd has it; yields what came so far, as (seconds, text)."""
    name = f'terrainseg-{os.getpid()}' if abstract else str(folder / 'notify')
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind('\0' + name if abstract else name)
        receiver.settimeout(0.2)
        came, going = [], True

        def read():
            while going:
                with contextlib.suppress(socket.timeout):
                    came.append((time.monotonic(), receiver.recv(4096).decode()))
        reader = threading.Thread(target=read)
        reader.start()
        try:
            yield ('@' if abstract else '') + name, came
        finally:
            going = False
            reader.join()


@case
def only_frames_feed_the_watchdog(folder):
    for abstract in False, True:
        with notifications(folder, abstract) as (address, came), sender() as source, \
                rover(folder, source=source.source, NOTIFY_SOCKET=address, WATCHDOG_USEC='2000000') as run:
            def count(text):
                return sum(each == text for _, each in came)
            settled(lambda: at_least(count('WATCHDOG=1'), 3))
            equal(count('READY=1'), 1, 'ready once')
            source.process.send_signal(signal.SIGSTOP)
            time.sleep(1.5)  # what was on its way
            before = count('WATCHDOG=1')
            time.sleep(2.5)
            equal(count('WATCHDOG=1'), before, 'the watchdog without frames')
            settled(lambda: at_least(sum('no frame' in text for _, text in came), 1))
            source.process.send_signal(signal.SIGCONT)
            settled(lambda: at_least(count('WATCHDOG=1'), before + 1), 20)
            run.stop()
            settled(lambda: equal(count('STOPPING=1'), 1))


@case
def a_reload_applies_all_or_nothing(folder):
    conf = folder / 'rover.conf'
    conf.write_text('caution=4\n')
    with notifications(folder, False) as (address, _), rover(folder, f'@{conf}', source=CHEAP, NOTIFY_SOCKET=address) as run:
        def reload(text, said):
            conf.write_text(text)
            before = len(run.errors.read_text())
            run.process.send_signal(signal.SIGHUP)
            settled(lambda: contains(run.errors.read_text()[before:], said))
            return run.status()['settings']
        equal(run.status()['settings']['caution'], '4')
        frames = run.status()['frames']
        equal(reload('caution=6\ndoubtful=9\n', 'were read again')['caution'], '6')
        for wrong, said in (('caution=2\nodd-spots=maybe\n', "odd-spots = 'maybe'"), ('caution=2\n--nonsense\n', 'previous values are kept'),
                            ('caution=2\nno-such=1\n', 'no property no-such')):
            now = reload(wrong, said)
            equal((now['caution'], now['doubtful']), ('6', '9'), wrong)
        equal(reload('caution=2\n--width 320\n', '--width takes effect at the next start')['caution'], '2')
        (run.folder / 'terrainseg.settings').write_text('[terrainseg]\ncaution=8\n')
        equal(reload('', 'were read again')['caution'], '8', 'from the settings file')
        settled(lambda: at_least(run.status()['frames'], frames + 10, 'the camera goes on'))
        equal(run.errors.read_text().count('frames of'), 1, 'and was not restarted')
    with rover(folder, source=CHEAP) as run:
        run.process.send_signal(signal.SIGHUP)
        equal(run.process.wait(10), -signal.SIGHUP, 'a terminal that is closed ends it')


@case
def the_unit_is_one_that_systemd_takes(folder):
    if not shutil.which('systemd-analyze'):
        raise Skip('systemd-analyze is not installed')
    unit = pathlib.Path(os.environ['TERRAINSEG_UNIT']).read_text()
    start, = [line for line in unit.splitlines() if line.startswith('ExecStart=')]
    contains(start, '/terrainseg-rover @')
    (folder / 'terrainseg-rover.service').write_text(unit.replace(start, f'ExecStart={ROVER}'))
    result = subprocess.run(['systemd-analyze', 'verify', '--man=no', 'terrainseg-rover.service'], capture_output=True, text=True, timeout=60)
    equal((result.returncode, [line for line in result.stderr.splitlines() if 'terrainseg' in line]), (0, []), result.stderr)
    # The file of arguments that comes with it: as it is, and with every line that it offers.
    given = (TOP / 'src/tools/rover/rover.conf').read_text()
    offered = '\n'.join(line.removeprefix('#') if line.startswith('#--') else line for line in given.splitlines())
    for text in given, offered:
        (folder / 'rover.conf').write_text(text)
        result = subprocess.run([sys.executable, ROVER, '@rover.conf', '--port', '99999'], capture_output=True, text=True, timeout=60)
        contains(result.stderr, '99999 is not a port')


if __name__ == '__main__':
    main(CASES, at_once=4)
