#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Runs the commands of README.md and docs/ as they are printed there.

usage: check_commands.py BUILD_FOLDER [PAGE...]

A fenced block that starts with ```sh is run by bash in an empty folder in which drive.mp4 and a folder of frames
exist. Words behind `sh` say what cannot be run alone:
  camera      needs hardware: not run
  install     changes the machine or builds it: not run here (other tests run these commands)
  live        has no end of its own: must run for some seconds without failing
  background  starts before the next block and is stopped after it; it must not have failed until then
What is changed before a block runs: a window becomes a sink without a screen, a scene without an end gets one, and
each port becomes one that is free. Blocks run side by side, but for those that one in the background serves:
one after the other what waits for real time to pass, beside it what keeps the processors busy.
"""
import concurrent.futures
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from ports import free_port  # noqa: E402

TOP = pathlib.Path(__file__).resolve().parents[2]
BLOCK = re.compile(r'^( *)```sh([^\n]*)\n(.*?)^ *```', re.M | re.S)
PORT = re.compile(r'((?:\bport=|--port |\bmosquitto -p |srt://[\w.]*:))(\d+)\b')
WAITS = re.compile(r'--self-test|\bis-live=true|\bmosquitto\b')
LIMIT = 60


def runnable(text):
    """The command with an end."""
    return re.sub(r'\bterrainscenesrc\b(?![^!]*num-buffers)', 'terrainscenesrc num-buffers=60', text)


def with_free_ports(text, ports):
    def replaced(match):
        if match[2] not in ports:
            ports[match[2]] = free_port()
        return f'{match[1]}{ports[match[2]]}'
    return PORT.sub(replaced, text)


def start(text, folder, environment):
    text = re.sub(r'\bautovideosink\b', 'fakesink', text)
    return subprocess.Popen(['bash', '-euo', 'pipefail', '-c', text], cwd=folder, env=environment, text=True,
                            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                            start_new_session=True)


def stop(process):
    try:
        os.killpg(process.pid, signal.SIGINT)
        process.wait(5)
    except (ProcessLookupError, subprocess.TimeoutExpired):
        pass
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass


class Group:
    """A block and what runs in the background before it; `lines` tell how they ended."""

    def __init__(self, page, blocks):
        self.page, self.blocks = page, blocks
        self.failed = 0
        self.lines = []
        self.waits = any({'live', 'background'} & set(words) or WAITS.search(text) for words, _, text in blocks)

    def fail(self, where, output):
        self.failed += 1
        self.lines += [f'FAILED {where}', *('  ' + line for line in output.splitlines()[-15:])]

    def run(self, scratch, environment):
        background = []
        for number, (words, where, text) in enumerate(self.blocks):
            folder = pathlib.Path(tempfile.mkdtemp(prefix=f'{self.page.stem}-', dir=scratch))
            shutil.copytree(scratch / 'stock', folder, dirs_exist_ok=True)
            for there in ('examples', 'docs', 'tests'):
                (folder / there).symlink_to(TOP / there)
            process = start(text if 'background' in words else runnable(text), folder, environment)
            if 'background' in words:
                background.append((where, process))
                time.sleep(1.5)
                continue
            try:
                output, _ = process.communicate(timeout=8 if 'live' in words else LIMIT)
                bad = process.returncode != 0
            except subprocess.TimeoutExpired:
                stop(process)
                output = process.stdout.read()
                bad = 'live' not in words or 'ERROR' in output
                output += f'\ndid not end within {LIMIT} s'
            if bad:
                self.fail(where, output)
            else:
                self.lines.append(f'ok {where}')
        for where, server in background:
            if server.poll() not in (None, 0):
                self.fail(where, server.stdout.read())
            stop(server)
        return self


def groups(path):
    """The blocks of a page that run, each with what serves it; what has an unknown word fails without being run."""
    name = path.relative_to(TOP) if path.is_relative_to(TOP) else path
    blocks, ports = [], {}
    for _, words, text in BLOCK.findall(path.read_text()):
        words = words.split()
        where = f'{name}: {text.strip().splitlines()[0].strip()[:90]}'
        if unknown := set(words) - {'camera', 'install', 'background', 'live'}:
            group = Group(path, [])
            group.fail(where, f'unknown words behind sh: {unknown}')
            yield group
        elif not {'camera', 'install'} & set(words):
            blocks.append((words, where, with_free_ports(text, ports)))
            if 'background' not in words:
                yield Group(path, blocks)
                blocks, ports = [], {}
    if blocks:
        yield Group(path, blocks)


def main():
    if len(sys.argv) < 2 or sys.argv[1].startswith('-'):
        sys.exit(__doc__)
    build = pathlib.Path(sys.argv[1]).resolve()
    paths = [pathlib.Path(p) for p in sys.argv[2:]] or [TOP / 'README.md', *sorted((TOP / 'docs').rglob('*.md'))]
    environment = dict(os.environ, GST_PLUGIN_PATH=f'{build}/gst:{build}/lab', GST_REGISTRY=str(build / 'registry-docs.bin'),
                       PATH=f"{build / 'src' / 'tools'}:{TOP / 'src' / 'tools' / 'rover'}:{os.environ['PATH']}", TERRAINSEG_SOURCE=str(TOP))
    environment.pop('DISPLAY', None)
    ran = failed = 0
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        stock = scratch / 'stock'
        (stock / 'frames').mkdir(parents=True)
        subprocess.run(['gst-launch-1.0', '-q', '-e', *'terrainscenesrc num-buffers=40 ! video/x-raw,width=320,height=180,'
                        'format=I420 ! x264enc ! h264parse ! mp4mux ! filesink location=drive.mp4'.split()],
                       cwd=stock, env=environment, check=True, timeout=LIMIT)
        subprocess.run(['gst-launch-1.0', '-q', *'terrainscenesrc num-buffers=5 ! video/x-raw,width=320,height=180 ! '
                        'videoconvert ! pngenc ! multifilesink location=frames/%04d.png'.split()],
                       cwd=stock, env=environment, check=True, timeout=LIMIT)
        found = [group for path in paths for group in groups(path.resolve())]
        with concurrent.futures.ThreadPoolExecutor(1) as waiting, concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as working:
            for done in [(waiting if group.waits else working).submit(group.run, scratch, environment) for group in found]:
                group = done.result()
                print('\n'.join(group.lines), flush=True)
                ran += len(group.blocks)
                failed += group.failed
    print(f'{ran - failed} of {ran} commands of {len(paths)} pages work')
    sys.exit(1 if failed or not ran else 0)


if __name__ == '__main__':
    main()
