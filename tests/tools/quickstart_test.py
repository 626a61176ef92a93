#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""examples/quickstart.sh with what people have. TERRAINSEG_BUILD is a build that is there already."""
import json
import os
import pathlib
import re
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from ffmpeg import ffmpeg, mark_turned  # noqa: E402
from tap import contains, equal, main  # noqa: E402

TOP = pathlib.Path(__file__).resolve().parent.parent.parent
RESULTS = ('annotated.mp4', 'masks.mkv', 'preview.png', 'terrain.jsonl')
CASES = []


def case(function):
    CASES.append(function)
    return function


def shell(command, code=0, cwd=None):
    environment = dict(os.environ, QUICKSTART_BUILD=os.environ['TERRAINSEG_BUILD'], QUICKSTART_RESULTS=os.path.abspath('results'))
    result = subprocess.run(command, capture_output=True, text=True, timeout=200, stdin=subprocess.DEVNULL, cwd=cwd,
                            env=environment, shell=isinstance(command, str))
    assert result.returncode == code, f'{command}: exit {result.returncode}: {result.stderr}{result.stdout}'
    return result


def quickstart(*arguments, code=0):
    return shell([str(TOP / 'examples/quickstart.sh'), *map(str, arguments)], code)


def video(name, *extra, size='160x96', frames=30, pixels='yuv420p'):
    ffmpeg('-f', 'lavfi', '-i', f'testsrc2=size={size}:rate=24', '-frames:v', frames, '-pix_fmt', pixels, *extra, name)
    return name


def size_of(path):
    text = subprocess.run(['ffprobe', '-v', 'error', '-select_streams', 'v', '-show_entries', 'stream=width,height', '-of',
                           'json', str(path)], capture_output=True, text=True, check=True).stdout
    stream, = json.loads(text)['streams']
    return stream['width'], stream['height']


def check(size, frames, prefix=''):
    equal(sorted(path.name for path in pathlib.Path('results').iterdir()), sorted(prefix + name for name in RESULTS), 'results')
    equal(size_of(f'results/{prefix}masks.mkv'), size, 'size of the masks')
    equal(len(open(f'results/{prefix}terrain.jsonl').readlines()), frames, 'lines')
    for name in RESULTS:
        os.remove(f'results/{prefix}{name}')


@case
def long_commands_are_never_silent(folder):
    script = f'. {TOP}/examples/heartbeat.sh; heartbeat log bash -c \'for i in 1 2 3; do echo "[$i/3] step"; sleep 4; done; exit 7\''
    process = subprocess.Popen(['bash', '-c', script], stdout=subprocess.PIPE, text=True)
    last, longest, lines = time.monotonic(), 0.0, []
    for line in process.stdout:
        longest, last = max(longest, time.monotonic() - last), time.monotonic()
        lines.append(line.strip())
    equal(process.wait(), 7, 'status')
    assert lines and lines[0] == '[2/3] step' and longest < 9, (lines, longest)
    # A step that runs is named, not the one that has ended before it.
    pathlib.Path('build.ninja').write_text('rule make\n command = sleep $seconds; touch -r build.ninja -- $out # -o $out \n'
                                           'build short.o: make\n seconds = 1\nbuild long.o: make | short.o\n seconds = 8\n')
    text = shell(['bash', '-c', f'. {TOP}/examples/heartbeat.sh; heartbeat log ninja']).stdout
    equal(text.split('\n')[0].strip(), '[1/2] making long.o', 'the step that runs')
    text = shell(['bash', '-c', f'. {TOP}/examples/heartbeat.sh; heartbeat log sleep 13']).stdout
    equal([line.strip() for line in text.splitlines()][:2], ['waiting ...', 'waiting ... (still)'], 'a command without a word')


@case
def without_a_video_it_renders_one_and_what_it_says_next_works(folder):
    text = quickstart().stdout
    equal(size_of('results/annotated.mp4'), (640, 360), 'size')
    for part in ('250 frames of 640x360', 'the filter itself: ', ' ms a frame', 'traversable: '):
        contains(text, part)
    commands = [line for line in text[text.index('What next'):].splitlines()[1:]]
    equal(len(commands), 3, text)
    for command in commands:
        shell(command.replace('-o out', f'-o {folder}/out'), cwd=TOP)


@case
def it_takes_what_people_have(folder):
    video('flat.mp4')
    mark_turned('flat.mp4', 90, 'phone clip.mp4')
    quickstart('phone clip.mp4')
    check((96, 160), 30)
    quickstart(video('odd.mkv', '-c:v', 'ffv1', '-vf', 'format=yuv444p,scale=161:97'))
    check((161, 97), 30)
    quickstart(video('four22.mp4', pixels='yuv422p'))
    check((160, 96), 30)
    quickstart(video('hevc.mp4', '-c:v', 'libx265', '-x265-params', 'log-level=error', pixels='yuv420p10le'))
    check((160, 96), 30)
    quickstart(video('loop.gif', pixels='rgb8'))
    check((160, 96), 30)


@case
def what_it_cannot_take_it_names(folder):
    ffmpeg('-f', 'lavfi', '-i', 'sine=duration=0.3', 'sound.m4a')
    contains(quickstart('sound.m4a', code=1).stderr, 'there is no video in it, only audio/')
    contains(quickstart('absent.mp4', code=1).stderr, 'absent.mp4: there is no such file')
    video('clip.mp4', '-movflags', '+faststart')
    contains(quickstart('clip.mp4', 'no-such=1', code=2).stderr, "no property 'no-such'")
    whole = pathlib.Path('clip.mp4').read_bytes()
    pathlib.Path('cut.mp4').write_bytes(whole[:len(whole) * 2 // 3])
    contains(quickstart('cut.mp4', code=1).stderr, 'the file is cut off')
    check((160, 96), len(open('results/partial.terrain.jsonl').readlines()), 'partial.')


@case
def settings_reach_the_filter_and_a_bonnet_is_named(folder):
    video('car.mp4', '-vf', 'drawbox=y=ih*0.75:h=ih*0.25:color=gray:t=fill', size='320x240', frames=72)
    rows = int(re.search(r'try window-bottom=(\d+)', quickstart('car.mp4').stdout)[1])
    assert 50 <= rows <= 60, rows
    assert 'never change' not in quickstart(f'window-bottom={rows}', 'car.mp4').stdout
    equal(sorted(path.name for path in pathlib.Path('results/earlier-1').iterdir()), list(RESULTS), 'what the first run left')
    assert pathlib.Path('results/earlier-1/terrain.jsonl').read_bytes() != pathlib.Path('results/terrain.jsonl').read_bytes()
    window = json.loads(open('results/terrain.jsonl').readline())['window']
    equal(window[1] + window[3], 240 - rows, 'the lower edge of the window')


if __name__ == '__main__':
    main(CASES, at_once=2)
