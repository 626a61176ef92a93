#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""What a user's first contact with the plugin depends on.

usage: check_plugin.py libraries|inspect|leaks PLUGIN
  libraries  it loads with fewer than 30 shared libraries, and without OpenCV
  inspect    gst-inspect-1.0 answers for the plugin and each element, without a warning or a critical
  leaks      pipelines leave no object behind (the leaks tracer)
"""
import os
import re
import subprocess
import sys

MOST_LIBRARIES = 29
CAPS = 'video/x-raw,format=I420,width=160,height=120'
PIPELINES = [
    f'videotestsrc num-buffers=20 ! {CAPS} ! terrainseg ! fakesink',
    f'videotestsrc num-buffers=20 ! {CAPS} ! terrainseg overlay=true post-messages=true ! fakesink',
    f'videotestsrc num-buffers=20 ! {CAPS} ! tee name=t t. ! queue ! terrainseg ! videoconvert ! '
    'video/x-raw,format=RGB ! videoscale ! video/x-raw,width=64,height=64 ! fakesink t. ! queue ! fakesink',
    f'videotestsrc num-buffers=20 ! {CAPS} ! terrainseg mask-level=2 preset=paper ! x264enc ! h264parse ! '
    'avdec_h264 ! fakesink',
    f'videotestsrc num-buffers=20 ! {CAPS} ! terrainseg ! terrainextract ! video/x-raw,format=GRAY8 ! fakesink',
    f'videotestsrc num-buffers=20 ! {CAPS} ! terrainseg ! terrainextract ! application/x-ndjson ! fakesink',
    f'videotestsrc num-buffers=20 ! {CAPS} ! terrainseg ! terrainextract ! meta/x-klv,parsed=true ! fakesink',
    f'videotestsrc num-buffers=20 ! {CAPS} ! terrainseg ! terrainoverlay ! fakesink',
    'terrainscenesrc num-buffers=10 ! terrainseg ! fakesink',
    # One that fails: errors must not leak either.
    f'videotestsrc num-buffers=3 ! {CAPS} ! terrainseg training-models=5 ! fakesink',
]


TRACE = {'GST_TRACERS': 'leaks', 'GST_DEBUG': 'GST_TRACER:7', 'GST_DEBUG_NO_COLOR': '1'}
LEAK = """
import ctypes
gst = ctypes.CDLL('libgstreamer-1.0.so.0')
gst.gst_init(None, None)
gst.gst_bin_new.restype = ctypes.c_void_p
gst.gst_bin_new(b'left')
gst.gst_deinit()
"""


def alive(log):
    """What the tracer lists, without the line that explains its format."""
    return re.findall(r'object-alive, type-name=\(string\)(?!%s)(.{0,160})', log)


def run(command, **more):
    environment = dict(os.environ, G_DEBUG='fatal-criticals', **more)
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)


def launch(pipeline, **more):
    """gst-launch-1.0 of GStreamer 1.22 now and then waits for ever when an element, any element, fails while it
    prerolls (identity error-after=1 does it too): then another try."""
    command = ['timeout', '--signal=KILL', '15', 'gst-launch-1.0', *pipeline.split()]
    for _ in range(5):
        done = run(command, **more)
        if done.returncode not in (-9, 124, 137):
            break
    return done


def elements():
    from gi import require_version
    require_version('Gst', '1.0')
    from gi.repository import Gst
    Gst.init(None)
    return [f.get_name() for f in Gst.Registry.get().get_feature_list_by_plugin('terrainseg')]


def libraries(plugin):
    lines = run(['ldd', plugin]).stdout.splitlines()
    names = [line.split()[0] for line in lines]
    print(len(names), 'shared libraries')
    heavy = [n for n in names if re.search('opencv|eigen|python|gtk|Qt|zstd|mcap|ddsc|iceoryx', n)]
    return (['ldd says nothing'] if len(names) < 3 else []) + \
           ([f'{len(names)} shared libraries, more than {MOST_LIBRARIES}'] if len(names) > MOST_LIBRARIES else []) + \
           [f'it pulls in {n}' for n in heavy]


def inspect(plugin):
    wrong = []
    for what in [plugin, 'terrainseg', *elements()]:
        done = run(['gst-inspect-1.0', what])
        if done.returncode != 0 or 'terrainseg' not in done.stdout:
            wrong.append(f'gst-inspect-1.0 {what} ended with {done.returncode}: {done.stderr}')
        if re.search('CRITICAL|WARNING', done.stderr):
            wrong.append(f'gst-inspect-1.0 {what} says: {done.stderr}')
    blacklist = run(['gst-inspect-1.0', '-b']).stdout
    return wrong + ([f'blacklisted: {blacklist}'] if 'terrainseg' in blacklist else [])


def leaks(_):
    wrong, ran, known = [], 0, set(elements())
    for pipeline in PIPELINES:
        ours = set(re.findall(r'\bterrain[a-z]+\b', pipeline))
        if not ours <= known or ('x264enc' in pipeline and run(['gst-inspect-1.0', 'x264enc']).returncode):
            continue
        done = launch(pipeline, **TRACE)
        ran += 1
        fails = 'training-models=5' in pipeline
        if (done.returncode != 0) != fails:
            wrong.append(f'{pipeline}: ended with {done.returncode}: {done.stderr[-500:]}')
        wrong += [f'{pipeline}: leaves {what}' for what in alive(done.stderr)[:5]]
    print(ran, 'pipelines')
    leak = run([sys.executable, '-c', LEAK], **TRACE)
    if not any('GstBin' in what for what in alive(leak.stderr)):
        wrong.append(f'the tracer does not see a bin that is left behind: {leak.stderr[-300:]}')
    return wrong + ([] if ran >= 3 else ['too few pipelines could be run'])


def main():
    checks = {'libraries': libraries, 'inspect': inspect, 'leaks': leaks}
    if len(sys.argv) != 3 or sys.argv[1] not in checks:
        sys.exit(__doc__)
    wrong = checks[sys.argv[1]](sys.argv[2])
    for line in wrong:
        print(line)
    sys.exit(1 if wrong else 0)


if __name__ == '__main__':
    main()
