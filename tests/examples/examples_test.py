#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""The examples as users run them. READ_MASK, CORE_ONLY and SUPERVISE are the built programs."""
import contextlib
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import termios
import time

from example_runs import EXAMPLES, PYTHON, launch, module, reference_lines, run, scene
from ffmpeg import ffmpeg, mark_turned
from ports import free_port
from tap import Skip, contains, equal, installing, main

CASES = []


def case(function):
    CASES.append(function)
    return function


@case
def mask_to_numpy_gives_the_mask(folder):
    module_ = module('mask_to_numpy')
    source = 'terrainscenesrc num-buffers=12 ! video/x-raw,format=I420,width=97,height=65'
    launch(f'{source} ! terrainseg ! terrainextract ! video/x-raw,format=GRAY8 ! multifilesink location=%02d.gray')
    lines = reference_lines(source)
    frames = list(module_.frames(source, picture=True))
    equal(len(frames), 12, 'frames')
    for index, (frame, line) in enumerate(zip(frames, lines)):
        equal(frame['mask'].shape, (65, 97), 'shape')
        rows = pathlib.Path(f'{index:02d}.gray').read_bytes()
        stride = len(rows) // 65
        expected = b''.join(rows[y * stride:y * stride + 97] for y in range(65))
        assert frame['mask'].tobytes() == expected, f'mask {index} differs'
        equal(frame['horizon'], line['horizon']['row'], 'horizon')
        equal(frame['frame'], index, 'frame')
        equal(len(frame['boundary']), 97, 'boundary')
        sure = frame['confidence-map']
        assert sure.ndim == 2 and 8 <= sure.shape[1] <= 97 and sure.min() >= 0 and 0.3 < sure.max() <= 1, sure
        equal(frame['picture'].shape, (65, 97, 3), 'picture')
        assert abs(frame['traversable'] - line['traversable']) < 0.0011


@case
def a_detector_takes_ground_away(folder):
    import numpy
    mask_to_numpy, veto = module('mask_to_numpy'), module('veto')
    source = 'terrainscenesrc num-buffers=8 ! video/x-raw,format=I420,width=160,height=120'

    def masks(detect, settings='veto-roi-types=person'):
        return [mask_to_numpy.estimate_of(sample.get_buffer()) for _, sample in veto.frames(source, detect, settings)]

    free, boxed, unnamed = masks(lambda _: []), masks(lambda _: [(-10, 80, 50, 900)]), masks(lambda _: [(-10, 80, 50, 900)], '')
    equal((len(free), len(boxed)), (8, 8), 'frames')
    for before, after, other in zip(free, boxed, unnamed):
        equal(after['mask'][80:, :40].max(), 0, 'under the box')
        equal(after['boundary'][:40].min(), 120, 'boundary')
        assert numpy.array_equal(before['mask'], other['mask']), 'a type that is not named is no veto'
    assert free[-1]['mask'][80:, :40].max() == 255 and boxed[-1]['mask'][80:, 60:100].min() == 255, 'road'
    lines = run(PYTHON, EXAMPLES / 'python/veto.py', '--detector', '0,0,320,180').stdout.splitlines()
    equal((len(lines), lines[-1]), (60, 'frame 59: 1 person, 0.0 % traversable'))
    for wrong in '1,2,3', '1,2,0,4', 'dogs':
        contains(run(PYTHON, EXAMPLES / 'python/veto.py', '--detector', wrong, code=2).stderr, 'use people, or X,Y,W,H')


@case
def a_mask_from_python_is_a_veto(folder):
    import numpy
    mask_to_numpy, veto = module('mask_to_numpy'), module('veto')
    shape = numpy.zeros((12, 16), numpy.uint8)
    shape[8:, :5] = 255  # of 160 x 120: columns up to 49 from row 80 on
    attach_box = veto.attach_box
    veto.attach_box = lambda buffer, _kind, _box: veto.attach_mask(buffer, shape)
    try:
        source = 'terrainscenesrc num-buffers=3 ! video/x-raw,format=I420,width=160,height=120'
        for boxes, sample in veto.frames(source, lambda _: [None]):
            mask = mask_to_numpy.estimate_of(sample.get_buffer())['mask']
            equal((boxes, int(mask[80:, :50].max())), (1, 0))
            equal(int(mask[100:, 60:100].min()), 255)
    finally:
        veto.attach_box = attach_box


@case
def people_are_found_where_opencv_is(folder):
    try:
        detect = module('veto').people()
    except ImportError:
        raise Skip('python3-opencv is not installed') from None
    import numpy
    equal(detect(numpy.full((240, 320, 3), 90, numpy.uint8)), [], 'a picture without people')
    equal(detect(numpy.zeros((20, 20, 3), numpy.uint8)), [], 'too small')


@case
def a_reader_that_leaves_gets_no_traceback(folder):
    for program in 'mask_to_numpy', 'metres', 'steer':
        result = run('bash', '-c', f'{PYTHON} {EXAMPLES}/python/{program}.py | head -n 1')
        contains(result.stdout, 'frame 0')
        equal(result.stderr, '', program)


@case
def the_newest_build_is_found_and_named(folder):
    """A source tree with builds, and a GStreamer that knows no plugin of ours."""
    plain = {key: value for key, value in os.environ.items() if key != 'GST_PLUGIN_PATH'}
    plain['GST_REGISTRY'] = str(folder / 'registry')
    if not subprocess.run(['gst-inspect-1.0', 'terrainseg'], capture_output=True, env=plain).returncode:
        raise Skip('the plugin is installed on this machine')
    shutil.copytree(EXAMPLES, 'tree/examples')
    for program in ['tree/examples/camera.sh', '--self-test'], [PYTHON, 'tree/examples/python/steer.py']:
        result = run(*program, code=1, env=plain)
        contains(result.stderr, 'run examples/quickstart.sh')
    for name, age in (('build', 100), ('build-release', 50), ('build-quickstart', 200)):
        os.makedirs(f'tree/{name}/gst')
        plugin = pathlib.Path(f'tree/{name}/gst/libgstterrainseg.so')
        plugin.symlink_to(os.path.join(os.environ['GST_PLUGIN_PATH'].split(':')[0], plugin.name))
        os.utime(plugin, (time.time() - age,) * 2, follow_symlinks=False)
    for program in ['tree/examples/camera.sh', '--self-test'], [PYTHON, 'tree/examples/python/steer.py']:
        contains(run(*program, env=plain).stderr, 'uses the plugin in build')


@case
def the_installed_plugin_is_found_and_named(folder):
    """Examples without a build beside them, and a plugin where GStreamer looks by itself."""
    built = pathlib.Path(os.environ['GST_PLUGIN_PATH'].split(':')[0], 'libgstterrainseg.so')
    installed = folder / 'data/gstreamer-1.0/plugins'
    os.makedirs(installed)
    (installed / built.name).symlink_to(built)
    shutil.copytree(EXAMPLES, 'tree/examples')
    plain = {key: value for key, value in os.environ.items() if key != 'GST_PLUGIN_PATH'}
    plain.update(XDG_DATA_HOME=str(folder / 'data'), GST_REGISTRY=str(folder / 'registry'))
    contains(run('tree/examples/camera.sh', '--self-test', env=plain).stderr, 'uses the plugin that is installed')
    contains(run(PYTHON, 'tree/examples/python/steer.py', env=plain).stdout, 'frame 0')


@case
def a_fleet_on_one_machine_says_what_is_wrong(folder):
    parallel = EXAMPLES / 'fleet/parallel.sh'
    pathlib.Path('list').write_text('drive.mp4\n')
    contains(run(parallel, code=2).stdout, 'LIST OUT SHARDS')
    contains(run(parallel, 'list', 'out', 'eight', code=2).stderr, "not 'eight'")
    contains(run(parallel, 'none', 'out', 2, code=2).stderr, 'cannot read the list none')
    for name in 'bash', 'env':
        os.symlink(f'/usr/bin/{name}', name)
    contains(run(parallel, 'list', 'out', 2, code=3, env={'PATH': str(folder)}).stderr, 'apt-get install parallel')
    assert not os.path.exists('out'), 'a folder was made for nothing'


@case
def mask_to_numpy_is_a_program_too(folder):
    os.rename(scene('drive.mp4'), 'dri ve.mp4')
    lines = run(PYTHON, EXAMPLES / 'python/mask_to_numpy.py', 'dri ve.mp4').stdout.splitlines()
    equal(len(lines), 20, 'lines')
    contains(lines[-1], 'frame 19: 96x64 mask')
    contains(run(PYTHON, EXAMPLES / 'python/mask_to_numpy.py', '--help').stdout, 'VIDEO')
    for program in 'mask_to_numpy', 'steer':
        contains(run(PYTHON, EXAMPLES / f'python/{program}.py', 'absent.mp4', code=1).stderr, 'absent.mp4')


@case
def a_turned_video_is_read_upright(folder):
    """As a phone records it: the pixels lie on their side, and a tag says so. ffmpeg turns the same pixels for good."""
    scene('drive.mp4', frames=12)
    mark_turned('drive.mp4', 90, 'turned.mp4')
    ffmpeg('-i', 'turned.mp4', '-c:v', 'ffv1', 'upright.mkv')
    # A calibration of another shape would be refused.
    pathlib.Path('camera.yaml').write_text('image_width: 64\nimage_height: 96\n'
                                           'camera_matrix: {rows: 3, cols: 3, data: [79, 0, 31.5, 0, 79, 47.5, 0, 0, 1]}\n')
    calibration = '--camera-info', 'camera.yaml', '--mount', 'height=1.35,pitch=0.045'
    for program in ([PYTHON, EXAMPLES / 'python/mask_to_numpy.py'], [PYTHON, EXAMPLES / 'python/steer.py'],
                    [PYTHON, EXAMPLES / 'python/metres.py', *calibration], [os.environ['READ_MASK']]):
        # Before the first picture comes, steer.py says so, on a busy machine more than once.
        turned, upright = ([line for line in run(*program, name).stdout.splitlines() if line != 'stop: no picture']
                           for name in ('turned.mp4', 'upright.mkv'))
        assert len(upright) >= 12, (program, upright)
        equal(turned, upright, program)


@case
def a_video_of_any_kind_is_read(folder):
    scene('drive.mp4', frames=12)
    ffmpeg('-i', 'drive.mp4', '-pix_fmt', 'yuv422p', '-c:v', 'ffv1', '422.mkv')  # 8 bits in planes: not turned by videoflip
    ffmpeg('-i', 'drive.mp4', '-pix_fmt', 'yuv411p', '-c:v', 'ffv1', '411.mkv')
    ffmpeg('-i', 'drive.mp4', '-flags', '+ildct+ilme', '-x264opts', 'interlaced=1', '-c:v', 'libx264', 'interlaced.mp4')
    ffmpeg('-i', 'drive.mp4', '-vf', 'scale=97:65', '-c:v', 'ffv1', 'odd.mkv')
    ffmpeg('-i', 'drive.mp4', '-vf', 'scale=12:8', '-c:v', 'ffv1', 'small.mkv')
    for name in '422.mkv', '411.mkv', 'interlaced.mp4', 'odd.mkv', 'small.mkv':
        for program in ([PYTHON, EXAMPLES / 'python/mask_to_numpy.py'], [PYTHON, EXAMPLES / 'python/steer.py'],
                        [PYTHON, EXAMPLES / 'python/metres.py'], [os.environ['READ_MASK']]):
            frames = [line for line in run(*program, name).stdout.splitlines() if line.startswith('frame ')]
            equal(len(frames), 12, f'{program} {name}')
        run(EXAMPLES / 'file.sh', name, 'annotated.mp4')
        frames = run('ffprobe', '-v', 'error', '-count_frames', '-show_entries', 'stream=nb_read_frames', '-of', 'csv=p=0', 'annotated.mp4')
        equal(frames.stdout.strip(), '12', name)
        run(EXAMPLES / 'tune.sh', name, '--picture', 'look.png', '--frames', '5')


@case
def what_was_there_stays_until_its_successor_is_whole(folder):
    whole = pathlib.Path(scene('drive.mp4', frames=12)).read_bytes()
    pathlib.Path('broken.mp4').write_bytes(whole[:len(whole) // 8])
    pathlib.Path('before.mp4').write_bytes(whole)
    contains(run(EXAMPLES / 'file.sh', 'drive.mp4', './drive.mp4', code=1).stderr, 'is the video itself')
    equal(pathlib.Path('drive.mp4').read_bytes(), whole)
    contains(run(EXAMPLES / 'file.sh', 'broken.mp4', 'before.mp4', code=1).stderr, 'no video came out of broken.mp4')
    equal(pathlib.Path('before.mp4').read_bytes(), whole)
    run(EXAMPLES / 'file.sh', 'drive.mp4', 'before.mp4')
    assert pathlib.Path('before.mp4').read_bytes() != whole
    equal(sorted(p.name for p in pathlib.Path('.').iterdir()), ['before.mp4', 'broken.mp4', 'drive.mp4'])


@case
def numbers_that_are_wrong_are_refused_and_not_replaced(folder):
    """gst-launch-1.0 warns of them and goes on with its defaults: another port, another vehicle."""
    for port in '0', '65536', '99999', 'seven':
        for script, *arguments in (('stream_rtp', '127.0.0.1', port), ('stream_udp_ts', '127.0.0.1', port), ('stream_srt', port),
                                   ('ardupilot', f'127.0.0.1:{port}'), ('ground_station', f'udp://:{port}')):
            result = run(EXAMPLES / f'{script}.sh', *arguments, code=1, env={**os.environ, 'SOURCE': 'videotestsrc num-buffers=1'})
            contains(result.stderr.lower(), 'port')
            assert 'GLib' not in result.stderr, result.stderr
    contains(run(PYTHON, EXAMPLES / 'python/mqtt_publish.py', '--port', '99999', code=2).stderr, '99999')
    for name, value in (('SYSTEM_ID', '300'), ('SYSTEM_ID', '0'), ('LAYOUT', 'fien')):
        result = run(EXAMPLES / 'ardupilot.sh', '--scene', code=1, env={**os.environ, name: value})
        contains(result.stderr, f"{name} '{value}'")
    for script, argument in (('stream_srt', '7001'), ('ground_station', 'srt://127.0.0.1:7001')):
        result = run(EXAMPLES / f'{script}.sh', argument, code=1, env={**os.environ, 'SRT_PASSPHRASE': 'short'})
        contains(result.stderr, 'SRT takes 10 to 79')


@case
def metres_are_those_of_the_lines(folder):
    metres = module('metres')
    pathlib.Path('camera.yaml').write_text(metres.SCENE)
    settings = 'camera-info=camera.yaml mount=height=1.35,pitch=0.045'
    lines = reference_lines('terrainscenesrc num-buffers=60 ! video/x-raw,width=640,height=360', settings)
    told = run(PYTHON, EXAMPLES / 'python/metres.py', '--start-time', '2026-11-22T20:00:00Z').stdout.splitlines()
    equal(len(told), 60, 'lines')
    measured = 0
    for index, (text, line) in enumerate(zip(told, lines)):
        clock = f'20:00:{index // 30:02d}.{index % 30 * 1000 // 30:03d}'
        assert text.startswith(f'frame {index} {clock} '), (text, clock)
        metric = line['metric']
        columns = [(far, free) for far, free, bearing in zip(metric['ranges'], metric['free'], metric['bearings'])
                   if bearing is None or abs(bearing) <= math.radians(5)]
        if any(far is None for far, _ in columns):
            assert text.endswith('unknown'), text
            continue
        wanted = min((far, free) for far, free in columns)
        match = re.search(r'ahead (free to )?([\d.]+) m', text)
        equal(bool(match[1]), wanted[1], text)
        if not wanted[1]:
            equal(float(match[2]), wanted[0], text)
            measured += 1
    assert measured > 20, measured
    lines = run(PYTHON, EXAMPLES / 'python/metres.py', scene('drive.mp4', frames=3)).stdout.splitlines()
    equal(lines, [f'frame {n} unknown' for n in range(3)], 'without a calibration there are no metres')
    contains(run(PYTHON, EXAMPLES / 'python/metres.py', '--camera-info', 'absent.yaml', '--mount', 'height=1', 'drive.mp4',
                 code=1).stderr, 'metres: ')


@case
def what_is_not_known_is_no_free_way(folder):
    nearest = module('metres').nearest
    free, unknown = float('inf'), float('nan')

    def columns(ranges, bearings):
        return {'ranges': ranges, 'low': ranges, 'high': ranges, 'bearings': bearings}
    equal(nearest(columns([3, 2, free], [0.2, 0, -0.2]))[0], 2, 'the nearest')
    equal(nearest(columns([1, 2, free], [0.2, 0, -0.2]), 0.1)[0], 2, 'the nearest ahead')
    equal(nearest(columns([free, free, free], [0.2, 0, -0.2]))[0], free, 'free')
    equal(nearest(columns([1, unknown, free], [0.2, 0, -0.2])), None, 'unknown')
    equal(nearest(columns([1, unknown, free], [0.2, unknown, -0.2]), 0.3), None, 'unknown in an unknown direction')


@case
def steering_follows_the_widest_space(folder):
    steer = module('steer').steer
    height, none = 100, 100
    equal(steer([none] * 20, height, 0.25), None, 'nothing is free')
    equal(steer([80] * 20, height, 0.25), None, 'free, but not deep enough')
    angle, speed = steer([40] * 20, height, 0.25)
    equal(angle, 0.0, 'all free: straight on')
    assert speed == 1.0, speed
    angle, _ = steer([40] * 6 + [none] * 14, height, 0.25)
    assert abs(angle + 0.7) < 1e-9, angle
    angle, _ = steer([40] * 4 + [none] * 6 + [40] * 10, height, 0.25)
    assert abs(angle - 0.5) < 1e-9, 'the wider of two'
    angle, _ = steer([40] * 4 + [none] * 4 + [40] * 4 + [none] * 4 + [40] * 4, height, 0.25)
    assert abs(angle) < 1e-9, 'the middle one of equals'
    slow, fast = (steer([row] * 4 + [none] * 16, height, 0.1)[1] for row in (85, 40))
    assert slow < fast, 'a short way is driven slowly'
    for depth in '0', '1.5', '-0.1', 'nan':  # with 0 everything is free
        contains(run(PYTHON, EXAMPLES / 'python/steer.py', f'--depth={depth}', code=2).stderr, 'more than 0 and at most 1')


@case
def steering_stops_when_nothing_is_known(folder):
    program = EXAMPLES / 'python/steer.py'
    # On a busy machine a picture may take its time.
    lines = [line for line in run(PYTHON, program).stdout.splitlines() if line != 'stop: no picture']
    equal(len(lines), 90, 'commands')
    assert all(re.fullmatch(r'frame \d+ (steer [+-]\d\.\d{3} speed \d\.\d\d|stop: .*)', line) for line in lines), lines
    assert sum('steer' in line for line in lines) > 45, 'on an open road it drives'
    lines = [line for line in run(PYTHON, program, '--settings', 'learning=false').stdout.splitlines()
             if line.startswith('frame')]
    equal({line.split(' ', 2)[2] for line in lines}, {'stop: blocked'}, 'without knowledge')


@case
def c_reads_what_the_lines_say(folder):
    source = 'terrainscenesrc num-buffers=60 ! video/x-raw,width=320,height=180'
    expected = reference_lines(source)
    lines = run(os.environ['READ_MASK']).stdout.splitlines()
    equal(len(lines), 60, 'lines')
    for line, want in zip(lines, expected):
        frame, horizon, share, counted, ahead = map(int, re.match(
            r'frame (\d+) horizon (-?\d+) traversable (\d+) counted (\d+) ahead (\d+)', line).groups())
        row = want['horizon']['row']
        equal((frame, horizon), (want['frame'], -1 if row is None else row), 'frame and horizon')
        assert abs(share - 1000 * want['traversable']) <= 1.01 and abs(share - counted) <= 1, line
        assert abs(180 - ahead - 180 * want['boundary'][160]) < 1, (line, want['boundary'][160])
    contains(run(os.environ['READ_MASK'], 'absent.mp4', code=1).stderr, 'absent.mp4')


@case
def c_is_compiled_as_its_comment_says(folder):
    """With pkg-config alone, against an installation."""
    build = os.environ['TERRAINSEG_BUILD']
    with installing(build):
        run('meson', 'install', '-C', build, '--no-rebuild', '--destdir', folder / 'root')
    os.mkdir('pc')
    for description in (folder / 'root').rglob('*.pc'):
        text = description.read_text()
        prefix = re.search('^prefix=(.*)$', text, re.M).group(1)
        pathlib.Path('pc', description.name).write_text(text.replace(prefix, f'{folder}/root{prefix}', 1))
    library = next((folder / 'root').rglob('libterrainseg.so')).parent
    environment = dict(os.environ, PKG_CONFIG_PATH=str(folder / 'pc'))
    for source, compiler, modules in (
            (EXAMPLES / 'c/read_mask.c', ['cc'],
             ['gstreamer-terrainseg-1.0', 'gstreamer-app-1.0']),
            (EXAMPLES / 'cpp/core_only.cpp', ['c++', '-std=c++20'], ['terrainseg'])):
        assert f"$(pkg-config --cflags --libs {' '.join(modules)})" in source.read_text(), source
        flags = run('pkg-config', '--cflags', '--libs', *modules, env=environment).stdout.split()
        run(*compiler, source, '-o', 'program', *flags, f'-Wl,-rpath,{library}')
        equal(run('./program', 'absent', 'x', code=1 if 'c/' in str(source) else 2).stdout, '', 'it starts')


@case
def the_uninstalled_tree_compiles_them_as_their_comments_say(folder):
    for source in 'c/read_mask.c', 'c/supervise.c', 'cpp/core_only.cpp':
        command, = re.findall(r'^(?: \*|//) (c(?:c|\+\+) .*)$', (EXAMPLES / source).read_text(), re.M)
        shutil.copy(EXAMPLES / source, folder)
        plain = {key: value for key, value in os.environ.items() if key not in ('GST_PLUGIN_PATH', 'PKG_CONFIG_PATH', 'CPATH')}
        run('meson', 'devenv', '-C', os.environ['TERRAINSEG_BUILD'], 'sh', '-c', f'cd {folder} && {command}', env=plain)
        assert os.access(pathlib.Path(source).stem, os.X_OK), command


@case
def core_alone_gives_the_same_masks_as_the_element(folder):
    size = (96, 66)
    source = f'terrainscenesrc num-buffers=10 ! video/x-raw,format=I420,width={size[0]},height={size[1]},framerate=30/1'
    launch(f'{source} ! filesink location=frames.i420')
    launch(f'{source} ! terrainseg caution=2 ! terrainextract ! video/x-raw,format=GRAY8 ! filesink location=masks')
    frames, masks = pathlib.Path('frames.i420').read_bytes(), pathlib.Path('masks').read_bytes()
    equal(len(frames), 10 * size[0] * size[1] * 3 // 2, 'bytes without padding')
    result = run(os.environ['CORE_ONLY'], f'{size[0]}x{size[1]}', input=frames, stdin=None, text=False)
    header = b'P5\n%d %d\n255\n' % size
    pictures = result.stdout.split(header)
    equal((pictures[0], len(pictures)), (b'', 11), 'masks')
    assert b''.join(pictures[1:]) == masks, 'masks of core and element differ'
    equal(len(result.stderr.splitlines()), 10, 'lines')


@case
def core_alone_reads_ppm_and_refuses_half_pictures(folder):
    launch('terrainscenesrc num-buffers=3 ! video/x-raw,width=64,height=48 ! videoconvert ! pnmenc ! '
           'filesink location=pictures.ppm')
    pictures = pathlib.Path('pictures.ppm').read_bytes()
    result = run(os.environ['CORE_ONLY'], input=pictures, stdin=None, text=False)
    equal(len(result.stdout), 3 * (len(b'P5\n64 48\n255\n') + 64 * 48), 'bytes')
    for broken in pictures[:-1], b'P6\n64 x', b'P5\n4 4\n255\n' + bytes(16), b'P6 99999999999 1 255\n':
        result = run(os.environ['CORE_ONLY'], input=broken, stdin=None, text=False, code=1)
        contains(result.stderr, b'truncated')
    for arguments in ['0x4'], ['64'], ['64x48x2'], ['64x48', '0'], ['64x48', '30', 'x']:
        contains(run(os.environ['CORE_ONLY'], *arguments, code=2).stderr, 'usage')


def write_png(path, rows, depth):
    """Rows of bytes as they lie in a PNG: 8-bit RGB, or 16-bit grey for depth."""
    import struct
    import zlib

    def chunk(kind, data):
        return struct.pack('>I', len(data)) + kind + data + struct.pack('>I', zlib.crc32(kind + data))

    width = len(rows[0]) // (2 if depth else 3)
    header = struct.pack('>IIBBBBB', width, len(rows), 16 if depth else 8, 0 if depth else 2, 0, 0, 0)
    path.write_bytes(b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', header) +
                     chunk(b'IDAT', zlib.compress(b''.join(b'\0' + row for row in rows))) + chunk(b'IEND', b''))


@case
def depth_says_what_the_ground_is(folder):
    """A red mat hides the ground in the window on the right; the range sensor sees floor on the left, where it is grey."""
    import math
    width, height, frames = 160, 120, 4
    for n in range(frames):
        rows, depths = [], []
        for y in range(height):
            floor = 1000 * math.exp(0.9 * (height - 0.5 - y) / height)
            row, millimetres = b'', b''
            for x in range(width):
                # Above row 40 a blue wall; on the right a red box that stands on the floor, nearer than it.
                box = x >= 104 and y >= 48
                noise = (x * 7 + y * 13 + n) % 9
                colour = (20, 30, 200) if y < 40 else (200, 30, 20) if box else (100, 100, 100)
                row += bytes(min(255, c + noise) for c in colour)
                millimetres += int(floor * (0.5 if box else 1) if y >= 40 else 9000).to_bytes(2, 'big')
            rows.append(row)
            depths.append(millimetres)
        write_png(folder / f'picture{n:04d}.png', rows, False)
        write_png(folder / f'depth{n:04d}.png', depths, True)
    # The window is put where the box stands: alone, the filter would learn the box.
    window = ['window-x=112', 'window-width=40', 'window-height=24', 'preset=paper', 'pyramid-levels=1']
    told = run(os.environ['SUPERVISE'], 'picture%04d.png', 'depth%04d.png', 'lines.jsonl', *window, cwd=folder)
    contains(told.stdout, f'{frames} frames, {frames} of them supervised')
    with_depth = [json.loads(line) for line in open(folder / 'lines.jsonl')]
    launch(f'multifilesrc location={folder}/picture%04d.png caps=image/png,framerate=5/1 ! pngdec ! videoconvert ! '
           f'video/x-raw,format=I420 ! terrainseg {" ".join(window)} ! terrainextract json-mask=true ! '
           f'application/x-ndjson ! filesink location={folder}/alone.jsonl')
    alone = [json.loads(line) for line in open(folder / 'alone.jsonl')]
    equal(len(with_depth), frames)
    grey, red = (60, 100), (130, 80)
    equal([pixel(line, *grey) for line in with_depth], [255] * frames)
    equal([pixel(line, *red) for line in with_depth], [0] * frames)
    equal(pixel(alone[-1], *red), 255)
    equal(pixel(alone[-1], *grey), 0)


def pixel(line, x, y):
    """The mask of a JSON line at a pixel: runs of [value, length], row by row."""
    mask, at = line['mask'], 0
    place = y * mask['height'] // line['height'] * mask['width'] + x * mask['width'] // line['width']
    for value, length in zip(mask['runs'][::2], mask['runs'][1::2]):
        at += length
        if place < at:
            return value


@case
def supervising_wants_its_arguments(folder):
    contains(run(os.environ['SUPERVISE'], code=2).stderr, 'usage: supervise')
    contains(run(os.environ['SUPERVISE'], 'none%d.png', 'none%d.png', 'x.jsonl', cwd=folder, code=1).stderr, 'none')


@case
def nothing_in_an_address_or_a_name_is_run(folder):
    for uri in ('udp://:$(touch run)7000', 'srt://a;touch run:7001', 'srt://`touch run`:7001', 'udp://:7000 ! filesink location=run',
                'srt://rover', 'http://rover:80'):
        contains(run(EXAMPLES / 'ground_station.sh', uri, code=1).stderr, 'srt://ROVER:PORT')
    name = 'a  $(touch run) \\ "b".mp4'
    run(EXAMPLES / 'file.sh', scene('drive.mp4'), name)
    assert os.path.getsize(name) > 1000
    for target in '$(touch run):1', 'a;touch run:1', 'a ! filesink location=run:1', 'host', 'host:port':
        contains(run(EXAMPLES / 'ardupilot.sh', '--scene', target, code=1).stderr, 'is not HOST:PORT')
    assert not os.path.exists('run'), 'a word was run'


@case
def an_autopilot_on_a_serial_port(folder):
    """A pseudo-terminal, which arrives with line editing on: every byte must come out as it is. It holds 4 kB."""
    for baud in '', ':57600':
        ours, theirs = os.openpty()
        run(EXAMPLES / 'ardupilot.sh', '--scene', os.ttyname(theirs) + baud,
            env={**os.environ, 'ATTITUDE': '', 'SCENE': 'terrainscenesrc num-buffers=20 ! video/x-raw,width=320,height=180,framerate=15/1'})
        equal(termios.tcgetattr(ours)[5], termios.B57600 if baud else termios.B921600, 'speed')
        os.set_blocking(ours, False)
        data, kinds = b'', []
        with contextlib.suppress(BlockingIOError):
            while True:
                data += os.read(ours, 65536)
        while data:
            equal(data[0], 0xFD, 'the first byte of a message')
            kinds.append(int.from_bytes(data[7:10], 'little'))
            data = data[12 + data[1]:]
        assert kinds.count(330) >= 10 and kinds.count(0) >= 1, kinds # a busy machine drops frames
        os.close(ours)
        os.close(theirs)
    contains(run(EXAMPLES / 'ardupilot.sh', '--scene', '/dev/ttyAbsent', code=1).stderr, 'there is no serial port /dev/ttyAbsent')
    contains(run(EXAMPLES / 'ardupilot.sh', '--scene', '/dev/ptmx:77', code=1).stderr, '77 baud')


@case
def a_camera_and_a_display_that_are_absent_are_named(folder):
    bare = {key: value for key, value in os.environ.items() if key not in ('DISPLAY', 'WAYLAND_DISPLAY', 'XDG_RUNTIME_DIR')}
    for arguments, absent in ((['camera.sh', '/dev/no-such'], '/dev/no-such'), (['stream_udp_ts.sh', '127.0.0.1', str(free_port())], '/dev/video0')):
        if os.path.exists(absent):
            continue
        said = run(EXAMPLES / arguments[0], *arguments[1:], code=1, env=bare).stderr
        contains(said, f'there is no camera {absent}')
        contains(said, "SOURCE='terrainscenesrc is-live=true")
    if list(pathlib.Path('/dev').glob('dri/card*')) or os.path.exists('/run/wayland-0'):
        return
    said = run(EXAMPLES / 'camera.sh', code=1, env={**bare, 'SOURCE': 'videotestsrc'}).stderr
    contains(said, 'there is no display')
    # What it says to do.
    run(EXAMPLES / 'camera.sh', env={**bare, 'SOURCE': 'terrainscenesrc num-buffers=20 ! video/x-raw,width=160,height=96', 'VIEW': re.search("VIEW='([^']+)'", said)[1]})
    assert os.path.getsize('seen.mp4') > 1000


@case
def scripts_explain_themselves(folder):
    for script in EXAMPLES.glob('*.sh'):
        if os.access(script, os.X_OK):
            contains(run(script, '--help').stdout, f'usage: examples/{script.name}')


@case
def make_pictures_makes_every_picture(folder):
    if not os.access(pathlib.Path(os.environ['TERRAINSEG_BUILD']) / 'src/tools/terrainseg-calibrate', os.X_OK):
        raise Skip('built without terrainseg-calibrate')
    run(EXAMPLES / 'make_pictures.sh', folder / 'pictures', env={**os.environ, 'MAX_FRAMES': '2'})
    made = {path.name: path.read_bytes() for path in (folder / 'pictures').iterdir()}
    committed = {path.name for path in (EXAMPLES.parent / 'docs' / 'images').iterdir() if path.is_file()}
    equal(sorted(set(made)), sorted(committed), 'what is made and what is in docs/images')
    kinds = {'.jpg': (b'\xff\xd8', b'\xff\xd9'), '.webp': (b'RIFF', b'')}
    for name, content in made.items():
        first, last = kinds[os.path.splitext(name)[1]]
        assert content.startswith(first) and content.endswith(last), f'{name} is no such file'
        assert 1000 < len(content) < 200000, f'{name} has {len(content)} bytes'
    # What the evaluation makes of real recordings.
    for folder, makers in (('docs/images/gallery', ['lab/evaluation/gallery.sh']),
                           ('lab/images/paper', ['lab/eval/paper_figures.cpp', 'lab/eval/paper_error_rates.cpp',
                                                 'lab/eval/paper_training.cpp'])):
        text = ''.join((EXAMPLES.parent / maker).read_text() for maker in makers)
        unmade = [path.name for path in (EXAMPLES.parent / folder).iterdir() if path.name not in text and not re.search(rf'^sets=.*\b{path.stem}\b', text, re.M)]
        equal(unmade, [], f'pictures of {folder} that no command makes')
    page = (EXAMPLES.parent / 'docs' / 'gallery.md').read_text()
    shown = re.findall(r'\(images/([^)/]+)\)', page)
    equal(shown, re.findall(r'([\w.]+)\n```$', page, re.M), 'each is followed by the command that makes it')
    assert sum(name.endswith('.webp') for name in shown) >= 4, shown


if __name__ == '__main__':
    main(CASES)
