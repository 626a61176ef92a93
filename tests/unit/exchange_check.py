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

FLAGS = ['learned', 'frozen', 'starved', 'unknown', 'horizon-held', 'blocked', 'window-still']


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
    motion = line.get('motion')
    assert (motion is None) == (unit['motion'] is None), 'motion'
    if motion:
        row = -1 if motion['vanishing_row'] is None else motion['vanishing_row']
        assert math.isclose(row, unit['motion'][0] / (65536 if unit['motion'][0] >= 0 else 1), abs_tol=1e-3), motion
        assert math.isclose(motion['speed_over_height'], unit['motion'][1] / 65536, abs_tol=1e-3), motion
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


def check_platform(i, platform, time):
    """The values that sample i was given, to within a step of their numbers."""
    expected = {'time': time, 'version': 17}
    if i % 2:
        expected |= {'latitude': 4.5 * i - 90, 'longitude': 9 * i - 180, 'altitude': 100 * i}
    if i % 4 == 1:
        expected['heading'] = 9 * i
    if i % 3 == 0:
        expected |= {'pitch': i - 20, 'roll': 5 * i - 90, 'azimuth': 0, 'elevation': 0, 'relative roll': 0}
    assert platform.keys() == expected.keys(), platform
    steps = {'latitude': 1e-7, 'longitude': 1e-7, 'altitude': 0.16, 'heading': 0.003, 'pitch': 0.0004, 'roll': 0.0008}
    for name, value in expected.items():
        if name == 'roll' and abs(value) > 90:
            assert platform[name] is None
        else:
            assert abs(platform[name] - value) <= steps.get(name, 0), (i, name, platform[name], value)


def main(program, schema_path):
    with open(schema_path, encoding='utf-8') as f:
        schema = json.load(f)
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    # The schema must be able to refuse: a check that accepts everything checks nothing.
    for broken in ({}, {'frame': -1}, {'frame': 'x'}):
        assert not validator.is_valid(broken)

    seen, metres = [], 0
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
            if 'metric' in line:
                metres += 1
                assert line['utc'].startswith('2026-11-22T20:00:0') and line['utc'].endswith('Z')
                m = line['metric']
                assert len({len(m[n]) for n in ('ranges', 'bearings', 'low', 'high', 'free')} | {len(line['boundary'])}) == 1
                assert all((r is None) == (b is None) and (not f or r == m['range_max'])
                           for r, b, f in zip(m['ranges'], m['bearings'], m['free']))
                for broken in ({**m, 'height': 0}, {**m, 'ranges': [-1]}, {**m, 'free': [1]}, {**m, 'pitch': 'inf'}):
                    assert not validator.is_valid({**line, 'metric': broken})
                assert not validator.is_valid({**line, 'utc': 'yesterday'})
            with open(path[:-5] + '.klv', 'rb') as f:
                data = f.read()
            assert len(data) <= 60000
            seen.append(check_pair(line, klv_decoder.decode(data)))
            with open(path[:-5] + '-uas.klv', 'rb') as f:
                nested = f.read()
            assert len(nested) <= 60000
            platform, inner = klv_decoder.decode_uas(nested)
            check_platform(int(os.path.basename(path)[:3]), platform, (line['pts'] or 0) // 1000)
            assert check_pair(line, klv_decoder.decode(inner)) == seen[-1]
            assert inner == data or seen[-1] == 'halved'
    assert seen.count('halved') == 1 and seen.count('whole') > 30, seen
    assert metres > 10, metres
    print(f'{len(seen)} estimates: lines valid, units equal ({seen.count("halved")} halved)')


if __name__ == '__main__':
    main(*sys.argv[1:])
