#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""usage: exchange_check.py SAMPLES_PROGRAM SCHEMA

Every line is JSON that the published schema accepts; every KLV unit, read by a decoder of its own, says the same
as the line of the same estimate."""
import glob
import json
import math
import os
import subprocess
import sys
import tempfile

import jsonschema

import klv_decoder

FLAGS = ['learned', 'frozen', 'starved', 'unknown', 'horizon-held', 'blocked']


def refuse_constant(name):
    raise ValueError(f'{name} is not JSON')


def unroll(mask):
    out = bytearray()
    for value, length in zip(mask['runs'][0::2], mask['runs'][1::2]):
        out += bytes([value]) * length
    assert len(out) == mask['width'] * mask['height']
    return bytes(out)


def check_pair(line, unit):
    for name in ('frame', 'width', 'height', 'confidence', 'generation'):
        assert line[name] == unit[name], name
    assert line['frame'] & 0xffffff == unit['frame24']
    assert (line['pts'] or 0) // 1000 == unit['time']
    assert (-1 if line['horizon']['row'] is None else line['horizon']['row'],
            line['horizon']['confidence']) == unit['horizon']
    assert round(line['traversable'] * 1000) == unit['permille']
    assert tuple(line['window']) == unit['window']
    assert line['flags'] == [n for i, n in enumerate(FLAGS) if unit['flags'] >> i & 1]
    assert len(line['models']) == len(unit['models'])
    for a, b in zip(line['models'], unit['models']):
        assert a['mass'] == b['mass']
        assert all(math.isclose(x, y / 256, abs_tol=5.01e-4) for x, y in zip(a['mean'], b['mean']))
        assert all(math.isclose(x, y / 256, abs_tol=5.01e-4) for x, y in zip(a['variance'], b['variance']))
    mask = line['mask']
    assert (mask['width'], mask['height']) == unit['sent']
    row = line['horizon']['row']
    assert (3 in unit['targets']) == (row is not None)
    names = {1: b'traversable', 2: b'doubtful', 3: b'horizon'}
    assert all(t['object'][2] == names[i] for i, t in unit['targets'].items())
    if unit['mask_size'] != unit['sent']:
        return 'halved'
    assert unroll(mask) == unit['mask']
    assert [round(f * line['height']) for f in line['boundary']] == unit['boundary']
    if row is not None and unit['mask_size'] == (line['width'], line['height']):
        t = unit['targets'][3]
        assert klv_decoder.big(t[2]) == row * line['width'] + 1
        assert klv_decoder.big(t[3]) == (row + 1) * line['width']
        assert klv_decoder.big(t[19]) == row + 1
    return 'whole'


def main(program, schema_path):
    with open(schema_path, encoding='utf-8') as f:
        schema = json.load(f)
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    # The schema must be able to refuse: a check that accepts everything checks nothing.
    for broken in ({}, {'frame': -1}, {'frame': 'x'}):
        assert not validator.is_valid(broken)

    seen = []
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([program, folder], check=True)
        for path in sorted(glob.glob(os.path.join(folder, '*.json'))):
            with open(path, encoding='utf-8') as f:
                text = f.read()
            assert text.endswith('}\n') and text.count('\n') == 1
            line = json.loads(text, parse_constant=refuse_constant)
            validator.validate(line)
            for extra in ('boundary', 'flags'):
                assert not validator.is_valid({**line, extra: ['nonsense']})
            with open(path[:-5] + '.klv', 'rb') as f:
                data = f.read()
            assert len(data) <= 60000
            seen.append(check_pair(line, klv_decoder.decode(data)))
    assert seen.count('halved') == 1 and seen.count('whole') > 30, seen
    print(f'{len(seen)} estimates: lines valid, units equal ({seen.count("halved")} halved)')


if __name__ == '__main__':
    main(*sys.argv[1:])
