#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""examples/tune.sh in a window of a real X server (Xvfb), with a real pointer and keys (xdotool)."""
import configparser
import contextlib
import json
import os
import pathlib
import shlex
import shutil
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from ffmpeg import drive, ffmpeg  # noqa: E402
from tap import Skip, contains, equal, main  # noqa: E402

EXAMPLES = pathlib.Path(os.environ['TERRAINSEG_EXAMPLES'])
TUNE = str(EXAMPLES / 'tune.sh')
CASES = []


def case(function):
    CASES.append(function)
    return function


def run(*arguments, code=0):
    result = subprocess.run([str(each) for each in arguments], capture_output=True, text=True, timeout=100, stdin=subprocess.DEVNULL)
    assert result.returncode == code, f'{arguments}: exit {result.returncode}: {result.stderr}{result.stdout}'
    return result


def video(frames=90, size=(640, 360)):
    run('gst-launch-1.0', '-q', '-e', *f'terrainscenesrc num-buffers={frames} ! video/x-raw,format=I420,width={size[0]},'
        f'height={size[1]},framerate=30/1 ! x264enc speed-preset=ultrafast ! mp4mux ! filesink location=drive.mp4'.split())
    return 'drive.mp4'


def lines_with(properties):
    """What the filter finds in the video, without what a clock says."""
    run('gst-launch-1.0', '-q', '-e', *'uridecodebin'.split(), f'uri={pathlib.Path("drive.mp4").resolve().as_uri()}',
        *f'! videoconvert ! terrainseg {properties} ! terrainextract ! application/x-ndjson ! filesink location=lines'.split())
    return [json.loads(line) for line in open('lines')]


@contextlib.contextmanager
def display():
    for program in 'Xvfb', 'xdotool':
        if not shutil.which(program):
            raise Skip(f'{program} is not installed')
    if subprocess.run(['gst-inspect-1.0', '--exists', 'ximagesink']).returncode:
        raise Skip('there is no ximagesink')
    reader, writer = os.pipe()
    # Without -noreset the server restarts whenever its only client leaves, and turns away who comes meanwhile: each
    # look of xdotool for the window is such a client.
    server = subprocess.Popen(['Xvfb', '-noreset', '-displayfd', str(writer), '-screen', '0', '1280x800x24'], pass_fds=[writer],
                              stderr=subprocess.DEVNULL)
    os.close(writer)
    try:
        number = os.read(reader, 16).decode().strip()
        assert number, 'Xvfb did not start'
        os.environ['DISPLAY'] = f':{number}'
        yield
    finally:
        os.environ.pop('DISPLAY', None)
        os.close(reader)
        server.terminate()
        server.wait(20)


def pointer(*commands):
    for command in commands:
        run('xdotool', *command.split())
        time.sleep(0.15)


@contextlib.contextmanager
def tuning(*arguments):
    """tune.sh with its window up; the block's last key has to leave."""
    errors = open('errors', 'w+')
    process = subprocess.Popen([TUNE, *map(str, arguments)], stdout=subprocess.PIPE, stderr=errors, text=True)
    try:
        deadline = time.monotonic() + 30
        # The root window is one of those that are found.
        while len(subprocess.run(['xdotool', 'search', '--onlyvisible', '--name', '.*'], capture_output=True).stdout.split()) < 2:
            assert process.poll() is None and time.monotonic() < deadline, open('errors').read()
            time.sleep(0.1)
        time.sleep(1)
        pointer('mousemove 300 200')
        yield process
        process.out, _ = process.communicate(timeout=30)
        equal(process.returncode, 0, open('errors').read())
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()


def settings(path='terrainseg.settings'):
    parser = configparser.ConfigParser(comment_prefixes='#')
    parser.read(path)
    return {group: dict(parser[group]) for group in parser.sections()}


@case
def pointer_and_keys_end_in_a_line_and_a_file(folder):
    video()
    with display(), tuning('drive.mp4', 'doubtful=-12') as process:
        # The picture is 800 wide: 0.8 pixels of the frame to one of the screen.
        pointer('mousemove 250 300', 'mousedown 1', 'mousemove 400 350', 'mousemove 500 400', 'mouseup 1',
                'mousemove 10 10', 'mousedown 3', 'mousemove 60 40', 'mousemove 210 60', 'mouseup 3',
                'mousemove 600 10', 'mousedown 3', 'mousemove 650 40', 'mousemove 700 60', 'mouseup 3',
                'mousemove 650 30', 'click 3',
                'mousemove 300 100', 'mousedown 2', 'mousemove 300 120', 'mousemove 300 180', 'mouseup 2', 'mousemove 300 300',
                'key 2', 'key plus', 'key plus', 'key 6', 'key plus', 'key 0', 'key plus', 'key BackSpace', 'key q')
    kept = settings()['terrainseg']
    # In fractions: in pixels it would lie somewhere else in frames of another size.
    assert not [name for name in kept if name.startswith('window-') and name != 'window-rect'], kept
    rect = [float(side) for side in kept['window-rect'].split(',')]
    for side, wanted, whole in zip(rect, (200, 240, 200, 80), (640, 360) * 2):
        assert abs(side * whole - wanted) <= 2, kept
    assert abs(float(kept['horizon-hint']) - 180 / 450) <= 0.005 and len(kept['horizon-hint']) <= 6, kept
    equal({name: kept.get(name) for name in ('caution', 'connected-ground', 'doubtful', 'overlay-style')},
          {'caution': '4', 'connected-ground': 'false', 'doubtful': '-12', 'overlay-style': None}, 'values')
    region = [int(number) for number in kept['ignore-regions'].replace('(int)', '').strip('<>').split(',')]
    assert len(region) == 4 and all(abs(a - b) <= 2 for a, b in zip(region, (8, 8, 160, 40))), kept
    # The line runs, and line and file mean the same.
    line = process.out.strip().replace('autovideosink', 'fakesink')
    run(*shlex.split(line))
    arguments = shlex.split(line)
    begin = arguments.index('terrainseg') + 1
    by_line = lines_with(' '.join(arguments[begin:arguments.index('overlay=true')]))
    by_file = lines_with('settings-location=terrainseg.settings')
    assert by_line == by_file and by_line != lines_with(''), 'line and file differ, or have no effect'


@case
def the_line_is_set_by_key_and_removed(folder):
    video(30)
    with display(), tuning('drive.mp4', 'horizon-hint=0.25', '--settings', 'one.settings'):
        pointer('mousemove 300 240', 'mousemove 300 225', 'key h', 'key q')
    assert abs(float(settings('one.settings')['terrainseg']['horizon-hint']) - 0.5) <= 0.005, settings('one.settings')
    with display(), tuning('drive.mp4', '--settings', 'one.settings'):
        pointer('key n', 'key q')
    equal(settings('one.settings')['terrainseg'].get('horizon-hint'), None)


@case
def a_file_is_where_it_begins_and_the_rest_of_it_stays(folder):
    video(30)
    pathlib.Path('my.settings').write_text('# by hand\n[other]\nkey=1\n[terrainseg]\nwindow-rect=0.3,0.8,0.4,0.15\n'
                                           'ignore-regions=<<0,0,20,10>>\n')
    with display(), tuning('drive.mp4', '--settings', 'my.settings'):
        pointer('key 2', 'key minus', 'key space', 'key period', 'key r', 'key Escape')
    equal(settings('my.settings'), {'other': {'key': '1'}, 'terrainseg': {
        'window-rect': '0.3,0.8,0.4,0.15', 'caution': '-2', 'ignore-regions': '<<(int)0,(int)0,(int)20,(int)10>>'}}, 'file')
    contains(pathlib.Path('my.settings').read_text(), '# by hand')


@case
def paused_a_step_is_one_frame(folder):
    """The program itself, without a window."""
    sys.path.insert(0, str(EXAMPLES / 'python'))
    sys.argv[0] = 'tune.py'
    import tune
    import types
    tune.find_plugin.init()
    Gst, GLib = tune.Gst, tune.GLib
    tuner = tune.Tuner(types.SimpleNamespace(what=video(60, (320, 180)), properties=[], settings='none', width=320,
                                             sink='fakesink sync=true'))

    def settle(seconds):
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            while GLib.MainContext.default().iteration(False):
                pass
            time.sleep(0.01)

    def position():
        return tuner.pipeline.query_position(Gst.Format.TIME)[1]

    try:
        tuner.pipeline.set_state(Gst.State.PLAYING)
        settle(0.7)
        tuner.on_key('space')
        settle(0.5)
        before = position()
        settle(0.3)
        equal(position(), before, 'it stands')
        tuner.on_key('period')
        settle(0.5)
        # It was paused somewhere within a frame; a step ends where the next one begins.
        assert 0 < position() - before < Gst.SECOND / 30 + Gst.SECOND / 100, (before, position())
        frame = tuner.fields.get_value('frame')
        tuner.on_key('2')
        tuner.on_key('plus')
        settle(0.5)
        assert tuner.fields.get_value('frame') > frame, 'the frame was not looked at again'
        contains('\n'.join(tuner.value_lines()), '>2 caution          2*')
        contains('\n'.join(tuner.number_lines()), 'paused, frame ')
        tuner.on_key('space')
        settle(3)
        assert not tuner.ended, 'a file begins again at its end'
    finally:
        tuner.pipeline.set_state(Gst.State.NULL)


@case
def a_value_that_the_filter_does_not_take_is_refused(folder):
    drive = video(5)
    for words, reason in ((['--try', 'caution=-180:0'], 'caution = -180: must be -100..100'), (['--try', 'preset=foo:default'], "preset = 'foo' is not"),
                          (['caution=a'], "caution = 'a' is not"), (['stages=foo'], "stages = 'foo' is not")):
        contains(run(TUNE, drive, *words, '--picture', 'out.png', code=1).stderr, reason)
        assert not os.path.exists('out.png'), words
    run(TUNE, drive, 'overlay-color=0x8000ff00', 'ignore-regions=<<0,0,10,10>>', 'stages=texture+refine', '--picture', 'out.png')


@case
def a_picture_of_real_clips(folder):
    """The frame that ffmpeg shows, but for the drawn ground and the label; the same bytes each time."""
    import cv2
    for codec, size, name in ('libx264', (640, 360), 'a.mp4'), ('libx265', (360, 640), 'b.mkv'):
        drive(name, size, 40, codec)
        height = 480 * size[1] // size[0]
        for shown, words in (25, ('--frames', '25')), (40, ()):
            run(TUNE, name, '--picture', 'out.png', '--width', '480', *words)
            first = pathlib.Path('out.png').read_bytes()
            run(TUNE, name, '--picture', 'out.png', '--width', '480', *words)
            assert pathlib.Path('out.png').read_bytes() == first, f'{name}: another picture the second time'
            ffmpeg('-i', name, '-vf', f'select=eq(n\\,{shown - 1}),scale=480:{height}:flags=bilinear', '-frames:v', 1, 'frame.png')
            seen, frame = (cv2.imread(file).astype(int) for file in ('out.png', 'frame.png'))
            equal(seen.shape, (height, 480, 3), name)
            # From below the label to above the horizon nothing is drawn.
            rows = slice(40, height * 3 // 8)
            assert abs(seen[rows] - frame[rows]).mean() < 4, f'{name}, frame {shown}: {abs(seen[rows] - frame[rows]).mean():.1f}'
            ground = seen[height * 5 // 6:] - frame[height * 5 // 6:]
            assert ground[..., 1].mean() > ground[..., 0].mean() + 10, f'{name}, frame {shown}: no green ground'


@case
def without_a_display_three_values_lie_side_by_side(folder):
    import numpy
    import cv2
    run(TUNE, video(20), '--picture', 'out.png', '--try', 'caution=-32:0:32', '--width', '240')
    picture = cv2.imread('out.png').astype(int)
    equal(picture.shape, (135, 720, 3), 'size')
    thirds = [picture[30:, 240 * i:240 * i + 240] for i in range(3)]
    green = [numpy.mean(third[..., 1] > third[..., 2] + 25) for third in thirds]
    assert green[0] > green[2], f'caution has no effect: {green}'
    yellow = [numpy.sum((third[..., 0] + 40 < third[..., 1]) & (third[..., 2] > 120)) for third in thirds]
    assert min(yellow) > 50, f'the window is not drawn: {yellow}'
    contains(run(TUNE, 'drive.mp4', code=1).stderr, '--picture')


@case
def what_is_wrong_is_said(folder):
    contains(run(TUNE, 'absent.mp4', '--picture', 'x.png', code=1).stderr, 'absent.mp4 cannot be read')
    refused = run(TUNE, 'scene', '--frames', '2', '--picture', 'absent/x.png', code=1).stderr
    assert 'tune.sh: absent/x.png cannot be written' in refused and 'Traceback' not in refused, refused
    contains(run(TUNE, 'scene', '--picture', 'x.jpg', code=2).stderr, 'x.jpg: a picture is a PNG')
    contains(run(TUNE, 'scene', 'no-such=1', '--picture', 'x.png', code=1).stderr, 'no property no-such')
    contains(run(TUNE, code=2).stdout, 'usage: examples/tune.sh')


if __name__ == '__main__':
    os.environ.pop('DISPLAY', None)
    main(CASES)
