#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Every row of docs/tasks/troubleshooting.md: what one sees is made to happen, then what the row says is done."""
import json
import os
import pathlib
import re
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from ffmpeg import ffmpeg, mark_turned  # noqa: E402
from tap import Skip, contains, equal, main  # noqa: E402

EXAMPLES = pathlib.Path(os.environ['TERRAINSEG_EXAMPLES'])
PAGE = EXAMPLES.parent / 'docs' / 'tasks' / 'troubleshooting.md'
SCENE = 'terrainscenesrc num-buffers=30 ! video/x-raw,format=I420,width=320,height=180,framerate=30/1'
TRIALS = {}


def row(*beginnings):
    """The trial of the rows whose first cell begins so."""
    def keep(function):
        for beginning in beginnings:
            TRIALS[beginning] = function
        return function
    return keep


def launch(text, code=0, limit=60, **environment):
    try:
        result = subprocess.run(['gst-launch-1.0', '-e', *text.split()], capture_output=True, text=True, timeout=limit if code == 0 else 15,
                                stdin=subprocess.DEVNULL, env={**os.environ, **environment})
    except subprocess.TimeoutExpired as hung:
        # gst-launch-1.0 1.22 that fails before it plays may tell of the error and never end, with stock elements too (2 of 96).
        output = ((hung.stdout or b'') + (hung.stderr or b'')).decode()
        if code == 0 or 'ERROR: ' not in output:
            raise
        return output
    output = result.stdout + result.stderr
    assert (result.returncode != 0) == (code != 0), f'{text}: exit {result.returncode}: {output}'
    return output


def lines(text):
    launch(f'{text} ! application/x-ndjson ! filesink location=lines')
    return [json.loads(line) for line in open('lines')]


def masks(text):
    """The last mask, rows of bytes; 320 x 180."""
    launch(f'{text} ! terrainextract ! video/x-raw,format=GRAY8 ! filesink location=masks')
    last = pathlib.Path('masks').read_bytes()[-320 * 180:]
    return [last[at:at + 320] for at in range(0, len(last), 320)]


def share(rows, value=255):
    return sum(each.count(value) for each in rows) / sum(map(len, rows))


@row('`no element "terrainseg"`')
def no_element(folder):
    plain = {'GST_PLUGIN_PATH': '', 'GST_REGISTRY': str(folder / 'registry')}
    if not subprocess.run(['gst-inspect-1.0', 'terrainseg'], capture_output=True, env={**os.environ, **plain}).returncode:
        raise Skip('the plugin is installed on this machine')
    contains(launch('videotestsrc num-buffers=1 ! terrainseg ! fakesink', code=1, **plain), 'no element "terrainseg"')
    launch('videotestsrc num-buffers=1 ! terrainseg ! fakesink')


@row('`not-negotiated`')
def not_negotiated(folder):
    for caps, remedy in (('format=GRAY16_BE', 'videoconvert'), ('format=Y444_10LE', 'videoconvert'),
                         ('format=I420,interlace-mode=interleaved', 'deinterlace')):
        source = f'videotestsrc num-buffers=3 ! video/x-raw,{caps} ! identity'
        output = launch(f'{source} ! terrainseg ! fakesink', code=1)
        assert re.search('not-negotiated|could not link|interlaced', output), output
        launch(f'{source} ! {remedy} ! terrainseg ! fakesink')


@row('`not-linked`')
def not_linked(folder):
    launch('audiotestsrc num-buffers=20 ! wavenc ! filesink location=sound.wav')
    launch(f'{SCENE} ! x264enc ! mux. audiotestsrc num-buffers=20 ! opusenc ! matroskamux name=mux ! filesink location=both.mkv')
    reader = 'uridecodebin uri={} ! videoconvert ! terrainseg ! fakesink'
    contains(launch(reader.format((folder / 'sound.wav').as_uri()), code=1), 'not-linked')
    launch(reader.format((folder / 'both.mkv').as_uri()))


@row('a warning that the training window')
def window_does_not_fit(folder):
    contains(launch(f'{SCENE} ! terrainseg window-bottom=5000 ! fakesink'), 'does not fit a frame of 320 x 180')
    assert 'WARNING' not in launch(f'{SCENE} ! terrainseg window-rect=0.3,0.7,0.4,0.2 ! fakesink')


@row('a warning that the window does not change')
def window_shows_the_vehicle(folder):
    def pipeline(setting):
        return ('compositor name=c sink_1::ypos=130 ! video/x-raw,format=I420,width=320,height=180 '
                f'! terrainseg {setting} ! fakesink terrainscenesrc scene=trail num-buffers=150 '
                '! video/x-raw,width=320,height=180,framerate=30/1 ! c. '
                'videotestsrc pattern=circular num-buffers=150 ! video/x-raw,width=320,height=50,framerate=30/1 ! c.')
    contains(launch(pipeline('window-bottom=0')), 'The training window does not change')
    for remedy in 'window-bottom=50', 'window-rect=0.35,0.55,0.3,0.15':
        assert 'does not change' not in launch(pipeline(remedy)), remedy


@row('everything is grey')
def everything_is_grey(folder):
    for setting in 'learning=false', 'near-clear=false':
        equal(share(masks(f'{SCENE} ! terrainseg {setting}'), 128), 1.0, setting)
    assert share(masks(f'{SCENE} ! terrainseg'), 128) < 0.5


@row('everything is green')
def everything_is_green(folder):
    source = 'videotestsrc num-buffers=30 pattern=snow ! video/x-raw,format=I420,width=320,height=180'
    assert share(masks(f'{source} ! terrainseg')) > 0.9, 'everything looks like the window'
    equal(share(masks(f'{source} ! terrainseg near-clear=false')), 0.0, 'with the sensor saying so')


@row('a warning that the pictures have no colour')
def pictures_without_colour(folder):
    camera = 'videotestsrc num-buffers=90 ! video/x-raw,format={},width=320,height=180,framerate=30/1 ! {}terrainseg ! fakesink'
    contains(launch(camera.format('GRAY8', 'videoconvert ! video/x-raw,format=NV12 ! ')), 'infrared')
    for format in 'NV12', 'GRAY8':
        assert 'pictures have none' not in launch(camera.format(format, '')), format


@row('the bonnet is green')
def the_bonnet_is_green(folder):
    source = f'{SCENE} ! videocrop bottom=40 ! videobox bottom=-40 fill=red ! video/x-raw,format=I420,width=320,height=180'
    assert share(masks(f'{source} ! terrainseg')[150:]) > 0.5, 'learned as ground'
    lifted = masks(f'{source} ! terrainseg window-bottom=42 ignore-regions=<<(int)0,(int)140,(int)320,(int)40>>')
    equal(share(lifted[150:], 128), 1.0, 'ignored')
    assert share(lifted[90:140]) > 0.3, 'the ground is learned'


@row('frames are missing behind a slow sink')
def missing_frames(folder):
    # A sink that is slow beside a busy machine, too.
    scene, slow = SCENE.replace('num-buffers=30', 'num-buffers=15'), 'terrainextract ! identity sleep-time=300000'
    leak = 'queue leaky=downstream max-size-buffers=1'
    assert len(lines(f'{scene} ! terrainseg ! {leak} ! {slow}')) < 15
    equal(len(lines(f'{scene} ! terrainseg ! queue ! {slow}')), 15, 'lines')


def frames_seen(setting):
    """How many of 30 frames the filter saw in front of a sink that is always late."""
    import gi
    gi.require_version('Gst', '1.0')
    from gi.repository import Gst
    Gst.init(None)
    pipeline = Gst.parse_launch(f'{SCENE} ! terrainseg name=t {setting} ! identity sleep-time=90000 ! '
                                'fakesink sync=true qos=true max-lateness=20000000')
    pipeline.set_state(Gst.State.PLAYING)
    message = pipeline.get_bus().timed_pop_filtered(30 * Gst.SECOND, Gst.MessageType.EOS | Gst.MessageType.ERROR)
    seen = pipeline.get_by_name('t').get_property('stats').get_value('frames')
    pipeline.set_state(Gst.State.NULL)
    equal(message.type, Gst.MessageType.EOS, 'end')
    return seen


@row('frames are missing with `qos=true`')
def quality_of_service(folder):
    equal(frames_seen(''), 30, 'qos is off')
    assert frames_seen('qos=true') < 30, 'qos=true drops late frames'


@row('no masks after `videocrop`', 'the file behind `terrainextract` is empty')
def metadata_is_dropped(folder):
    output = launch(f'{SCENE} ! terrainseg ! videocrop top=20 ! terrainextract ! application/x-ndjson ! filesink location=lines')
    contains(output, 'No terrain metadata')
    equal(os.path.getsize('lines'), 0, 'bytes')
    contains(launch(f'{SCENE} ! terrainseg ! videocrop top=20 ! terrainoverlay ! fakesink'), 'so nothing is drawn')
    equal(len(lines(f'{SCENE} ! videocrop top=20 ! terrainseg ! terrainextract')), 30, 'lines')


@row('`mpegtsmux` waits for ever')
def muxer_waits(folder):
    def pipeline(queue):
        return (f'{SCENE} ! terrainseg ! tee name=t t. ! {queue} x264enc ! mpegtsmux name=m ! fakesink '
                f't. ! {queue} terrainextract ! meta/x-klv,parsed=true ! m.')
    try:
        launch(pipeline(''), limit=6)
        raise AssertionError('it ended')
    except subprocess.TimeoutExpired:
        pass
    launch(pipeline('queue max-size-buffers=0 max-size-time=0 max-size-bytes=0 !'))


@row('`x264enc` makes a file')
def players_refuse(folder):
    for caps, wanted in (('', 'yuv444p'), ('! videoconvert ! video/x-raw,format=I420', 'yuv420p')):
        launch(f'terrainscenesrc num-buffers=5 ! videoconvert ! video/x-raw,format=Y444 ! terrainseg {caps} ! x264enc ! mp4mux ! '
               'filesink location=out.mp4')
        found = subprocess.run('ffprobe -v error -show_entries stream=pix_fmt -of csv=p=0 out.mp4'.split(), capture_output=True,
                               text=True, check=True).stdout.strip()
        equal(found, wanted, caps)


@row('a pipeline that reads a moving GIF')
def moving_gif(folder):
    ffmpeg('-f', 'lavfi', '-i', 'testsrc2=size=64x48:rate=10', '-frames:v', 12, 'moving.gif')
    behind = '! decodebin ! videoconvert ! terrainseg'
    try:
        launch(f'filesrc location=moving.gif {behind} ! fakesink', limit=6)
        raise Skip('this GStreamer reads it to its end')
    except subprocess.TimeoutExpired:
        pass
    subprocess.run('ffmpeg -nostdin -v error -i moving.gif -c:v ffv1 moving.mkv'.split(), check=True)
    equal(len(lines(f'filesrc location=moving.mkv {behind} ! terrainextract')), 12, 'lines')
    result = processed('moving.gif')
    equal(result.returncode, 0, result.stderr)
    equal(len(open('out/moving.jsonl').readlines()), 12, 'lines of terrainseg-process')


@row('the colours of an MP4 or MOV')
def range_of_an_mp4(folder):
    launch(f'{SCENE},colorimetry=1:3:5:1 ! x264enc ! mp4mux ! filesink location=full.mp4')
    ffmpeg('-i', 'full.mp4', '-c', 'copy', 'full.mkv')

    def all_masks(name, remedy=''):
        masks(f'filesrc location={name} ! decodebin ! {remedy}terrainseg motion=off')  # the times of an MKV are rounded
        return pathlib.Path('masks').read_bytes()
    right = all_masks('full.mkv')
    remedy, = re.findall('`(capssetter [^`]+)`', PAGE.read_text())
    remedied = all_masks('full.mp4', remedy.replace('"', '') + ' ! ')
    if all_masks('full.mp4') == remedied:
        raise Skip('this GStreamer reads the range')
    equal(remedied == right, True, 'masks with the remedy are those of the MKV')


@row('the picture lies on its side')
def turned(folder):
    launch(f'{SCENE} ! x264enc ! mp4mux ! filesink location=flat.mp4')
    mark_turned('flat.mp4', 90, 'phone.mp4')
    source = 'filesrc location=phone.mp4 ! decodebin'
    size = [(line['width'], line['height']) for line in lines(f'{source} ! terrainseg ! terrainextract')][0]
    equal(size, (320, 180), 'as it lies in the file')
    size = [(line['width'], line['height']) for line in
            lines(f'{source} ! identity drop-allocation=true ! videoflip video-direction=auto ! terrainseg ! terrainextract')][0]
    equal(size, (180, 320), 'upright')


@row('a property has no effect')
def without_effect(folder):
    contains(launch(f'{SCENE} ! terrainseg threshold=2 ! fakesink'), 'threshold')
    assert 'WARNING' not in launch(f'{SCENE} ! terrainseg preset=paper threshold=2 ! fakesink')


@row('an error that names the settings file')
def settings_file(folder):
    pathlib.Path('my.settings').write_text('[terrainseg]\nno-such=1\n')
    output = launch(f'{SCENE} ! terrainseg settings-location=my.settings ! fakesink', code=1)
    contains(output, 'my.settings')
    contains(output, 'no-such')
    pathlib.Path('my.settings').write_text('[terrainseg]\ncaution=1\n')
    launch(f'{SCENE} ! terrainseg settings-location=my.settings ! fakesink')


@row('the window of `tune.sh` does not open')
def no_display(folder):
    launch(f'{SCENE} ! x264enc ! mp4mux ! filesink location=drive.mp4')
    plain = {key: value for key, value in os.environ.items() if key != 'DISPLAY'}
    result = subprocess.run([EXAMPLES / 'tune.sh', 'drive.mp4'], capture_output=True, text=True, env=plain)
    equal(result.returncode, 1, 'exit code')
    contains(result.stderr, 'no display')
    subprocess.run([EXAMPLES / 'tune.sh', 'drive.mp4', '--picture', 'look.png', '--frames', '5'], check=True, capture_output=True)
    assert os.path.getsize('look.png') > 10000


@row('`Segmentation fault`, or an error of `autovideosink`')
def no_window(folder):
    bare = {key: value for key, value in os.environ.items() if key not in ('DISPLAY', 'WAYLAND_DISPLAY', 'XDG_RUNTIME_DIR')}
    scene = f'{SCENE} ! terrainseg overlay=true ! videoconvert !'.split()
    result = subprocess.run(['gst-launch-1.0', '-e', *scene, 'autovideosink'], capture_output=True, stdin=subprocess.DEVNULL, env=bare, timeout=60)
    if not result.returncode:
        raise Skip('this machine shows video without a display server')
    for instead in 'video/x-raw,format=I420 ! x264enc ! mp4mux ! filesink location=seen.mp4', 'fakesink':
        launch(f'{SCENE} ! terrainseg overlay=true ! videoconvert ! {instead}')
    assert os.path.getsize('seen.mp4') > 1000


def processed(*arguments):
    if not os.environ['TERRAINSEG_PROCESS']:
        raise Skip('this build has no terrainseg-process')
    return subprocess.run([os.environ['TERRAINSEG_PROCESS'], '-q', '-o', 'out', '--outputs', 'json', *arguments], capture_output=True,
                          text=True, stdin=subprocess.DEVNULL, timeout=60)


def made_anew(unread, words):
    """terrainseg-process fails on it with these words, and does what ffmpeg makes of it."""
    result = processed(unread)
    equal(result.returncode, 1, result.stderr)
    contains(result.stderr, words)
    subprocess.run(['ffmpeg', '-nostdin', '-v', 'error', '-y', '-i', unread, '-c:v', 'ffv1', 'converted.mkv'], check=True)
    equal(processed('converted.mkv').returncode, 0, 'converted')


@row('`terrainseg-process`: `the decoder crashed')
def decoder_crashes(folder):
    ffmpeg('-f', 'lavfi', '-i', 'testsrc=size=640x480:rate=10', '-t', 2, '-pix_fmt', 'nv12', '-c:v', 'rawvideo', 'raw.nut')
    if 'crashed' not in processed('raw.nut').stderr:
        raise Skip('this GStreamer does not crash on it')
    made_anew('raw.nut', 'raw.nut: the decoder crashed (signal ')


@row('`terrainseg-process`: `GStreamer does not know the codec')
def unknown_codec(folder):
    ffmpeg('-f', 'lavfi', '-i', 'testsrc=size=64x48', '-frames:v', 5, '-c:v', 'utvideo', '-pix_fmt', 'yuv420p', 'unread.avi')
    if not processed('unread.avi').returncode:
        raise Skip('this GStreamer reads it')
    made_anew('unread.avi', "unread.avi: GStreamer does not know the codec '")


@row('the result differs between two machines')
def the_same_everywhere(folder):
    kept = []
    for threads in 1, 4:
        lines(f'{SCENE} ! terrainseg n-threads={threads} ! terrainextract json-mask=true')
        kept.append(pathlib.Path('lines').read_bytes())
    equal(kept[0] == kept[1], True, 'bytes')


def every_row_has_a_trial(folder):
    cells = [line.split('|')[1].strip() for line in PAGE.read_text().splitlines()
             if line.startswith('|') and not line.startswith(('|---', '| what you see'))]
    assert len(cells) > 10, cells
    for cell in cells:
        equal(len([begin for begin in TRIALS if cell.startswith(begin)]), 1, f'trials of the row "{cell}"')
    for begin in TRIALS:
        equal(len([cell for cell in cells if cell.startswith(begin)]), 1, f'rows of the trial "{begin}"')


if __name__ == '__main__':
    main([every_row_has_a_trial, *dict.fromkeys(TRIALS.values())])
