# SPDX-License-Identifier: LGPL-2.1-or-later
"""What the tests of the examples share: TERRAINSEG_EXAMPLES is the examples' folder."""
import importlib.util
import json
import os
import pathlib
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

EXAMPLES = pathlib.Path(os.environ['TERRAINSEG_EXAMPLES'])
PYTHON = '/usr/bin/python3'


def run(*arguments, code=0, **options):
    result = subprocess.run([str(each) for each in arguments], capture_output=True, timeout=100,
                            text=options.pop('text', True), **{'stdin': subprocess.DEVNULL, **options})
    assert result.returncode == code, f'{arguments}: exit {result.returncode}: {result.stderr}{result.stdout}'
    return result


def launch(text):
    run('gst-launch-1.0', '-q', '-e', *text.split())


def scene(name, frames=20, size=(96, 64)):
    launch(f'terrainscenesrc num-buffers={frames} ! video/x-raw,format=I420,width={size[0]},height={size[1]} ! '
           f'x264enc ! mp4mux ! filesink location={name}')
    return name


def reference_lines(source, settings=''):
    launch(f'{source} ! terrainseg {settings} ! terrainextract ! application/x-ndjson ! filesink location=reference.jsonl')
    return [json.loads(line) for line in open('reference.jsonl')]


def module(name):
    sys.path.insert(0, str(EXAMPLES / 'python'))
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / 'python' / f'{name}.py')
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded
