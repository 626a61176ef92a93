#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""The binary interface of the library and of the C header is the one on record.

usage: check_abi.py PROBE LIBRARY HEADER [--write]

PROBE is an object with debug information in which every public type stands: abidw tells the size of each and the place of its fields.
The functions that LIBRARY exports, and the macros and inline functions of the C header HEADER, stand beside them. All of it is
compared, line by line, with interface.txt (the XML that abidiff compares has half a megabyte, most of it the compiler's own types).
A change breaks programs that are not recompiled: write the record with --write in the commit that means to, and raise the soname
(docs/metadata.md). Ends with 77, skipped, where abidw is not installed (abigail-tools).
"""
import pathlib
import re
import shutil
import subprocess
import sys
from xml.etree import ElementTree

RECORD = pathlib.Path(__file__).resolve().parent / 'interface.txt'
INCLUDE = RECORD.parents[2] / 'include'
PROTOTYPE = re.compile(r'^static inline ([^;{}]*?)\s*\{', re.M)
MACRO = re.compile(r'^#define (GST_TERRAIN\w*) (.+)$', re.M)
OURS = re.compile(r'^(terrainseg::|GstTerrain)')


def types_of(probe):
    """A line for each public type and for each of its fields or values."""
    done = subprocess.run(['abidw', '--drop-private-types', '--headers-dir', INCLUDE, '--type-id-style', 'hash', probe],
                          check=True, capture_output=True, text=True)
    root = ElementTree.fromstring(done.stdout)
    by_id = {e.get('id'): e for e in root.iter() if e.get('id')}

    def name_of(identity):
        e = by_id.get(identity)
        if e is None:
            return '?'
        inner = name_of(e.get('type-id')) if e.tag in ('qualified-type-def', 'pointer-type-def', 'reference-type-def', 'array-type-def') else ''
        if inner:
            return {'q': 'const ' + inner, 'p': inner + '*', 'r': inner + '&', 'a': inner + '[]'}[e.tag[0]]
        return re.sub(r'(std::)(?:__\w+::)?(\w+).*', r'\1\2', e.get('name') or '?')

    lines = set()

    def visit(e, scope):
        name = scope + (e.get('name') or '')
        if e.tag in ('namespace-decl', 'class-decl', 'union-decl', 'enum-decl') and OURS.match(name + '::'):
            if e.tag == 'enum-decl':
                lines.update(f'{name} {v.get("name")} = {v.get("value")}' for v in e.iter('enumerator'))
            elif e.tag != 'namespace-decl' and e.get('size-in-bits'):
                lines.add(f'{name}: {int(e.get("size-in-bits")) // 8} bytes')
                lines.update(f'{name} +{int(m.get("layout-offset-in-bits")) // 8:04d} {v.get("name")}: {name_of(v.get("type-id"))}'
                             for m in e.findall('data-member') if m.get('layout-offset-in-bits') for v in m.findall('var-decl'))
        inside = e.tag in ('namespace-decl', 'class-decl', 'union-decl')
        for child in e:
            visit(child, name + '::' if inside else scope)

    visit(root, '')
    return lines


def names_of(library, header):
    listed = subprocess.run(['nm', '--dynamic', '--defined-only', '--demangle', library], check=True, capture_output=True, text=True).stdout
    lines = [line.split(' ', 2) for line in listed.splitlines()]
    text = header.read_text()
    return ({f'exports {name}' for _, kind, name in lines if kind in 'TDBR' and name.startswith('terrainseg::')} |
            {f'C {name} {value}' for name, value in MACRO.findall(text)} |
            {'C ' + ' '.join(prototype.split()) for prototype in PROTOTYPE.findall(text)})


def main():
    words = [word for word in sys.argv[1:] if word != '--write']
    if len(words) != 3:
        sys.exit(__doc__)
    if not shutil.which('abidw'):
        print('abidw is not installed (abigail-tools): skipped')
        sys.exit(77)
    probe, library, header = (pathlib.Path(word) for word in words)
    now = types_of(probe) | names_of(library, header)
    if '--write' in sys.argv:
        RECORD.write_text('\n'.join(sorted(now)) + '\n')
        return
    recorded = set(RECORD.read_text().splitlines())
    wrong = sorted([f'- {line}' for line in recorded - now] + [f'+ {line}' for line in now - recorded])
    if wrong:
        sys.exit('\n'.join(wrong) + '\nThe binary interface changed. If that is meant: tests/abi/check_abi.py ... --write')


if __name__ == '__main__':
    main()
