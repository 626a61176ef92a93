#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Holds the arrows of the house: who may include whom.

kernels know nobody; stages know the public face, kernels and the stages before them (no cycles); exchange and painter
know the estimate; gst knows the core's public face, painter, exchange and scene; nothing in the core knows GStreamer,
OpenCV, Eigen, and nothing in the core speaks floating point.

usage: check_house.py [--self-check]
"""
import pathlib
import re
import sys

TOP = pathlib.Path(__file__).resolve().parent.parent
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', re.M)
FOREIGN = re.compile(r'^(gst/|glib|gio/|opencv2|Eigen|nlohmann|json-glib)')
FLOATING = re.compile(r'\b(float|double)\b')
COMMENT = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', re.S)


def room(path):
    """The room of a file below the top: 'core', 'kernels', 'exchange', ..."""
    parts = path.parts
    if parts[0] == 'include':
        return 'public' if parts[1] == 'terrainseg' else 'meta'
    if parts[0] == 'gst':
        return 'gst'
    if parts[0] == 'src':
        if len(parts) == 2:
            return 'painter' if parts[1].startswith('painter') else 'core'
        return parts[1]
    return parts[0]


# What each room may include of the project's own headers.
MAY = {
    'public': {'public'},
    'kernels': {'kernels'},
    'core': {'public', 'kernels', 'core'},
    'painter': {'public', 'painter', 'kernels'},
    'exchange': {'public', 'exchange'},
    'scene': {'public', 'scene'},
    'reference': {'public', 'reference'},
    'tools': {'public', 'core', 'painter', 'exchange', 'scene', 'reference', 'tools', 'meta'},
    'meta': {'meta'},
    'gst': {'public', 'painter', 'exchange', 'scene', 'reference', 'meta', 'gst'},
}
INTEGER_ROOMS = {'public', 'core', 'kernels', 'painter'}
NO_FOREIGN = INTEGER_ROOMS | {'exchange', 'scene'}


def sources():
    for folder in ('include', 'src', 'gst'):
        for path in sorted((TOP / folder).rglob('*')):
            if path.suffix in ('.hpp', '.cpp', '.h', '.c') or path.name.endswith('-inl.h'):
                yield path.relative_to(TOP)


def resolve(name, path):
    for base in (TOP / path.parent, TOP / 'src', TOP / 'include', TOP / 'gst', TOP):
        if (base / name).is_file():
            return (base / name).resolve().relative_to(TOP)
    return None


def check_text(path, text):
    here, wrong = room(path), []
    for name in INCLUDE.findall(text):
        target = resolve(name, path)
        if target is None:
            if here in NO_FOREIGN and FOREIGN.match(name):
                wrong.append(f'{path}: room {here} reaches for <{name}>')
            continue
        if room(target) not in MAY.get(here, {room(target)}):
            wrong.append(f'{path}: room {here} may not include {target} (room {room(target)})')
    if here in INTEGER_ROOMS:
        hit = FLOATING.search(COMMENT.sub(' ', text))
        if hit:
            wrong.append(f'{path}: floating point ({hit.group()}) in room {here}')
    return wrong


def cycles(graph):
    """Include cycles among the core's headers and sources, stage by stage."""
    state, found = {}, []

    def visit(node, trail):
        state[node] = 1
        for after in graph.get(node, ()):
            if state.get(after) == 1:
                found.append(' -> '.join(trail + [node, after]))
            elif after not in state:
                visit(after, trail + [node])
        state[node] = 2

    for node in graph:
        if node not in state:
            visit(node, [])
    return found


def main():
    if '--self-check' in sys.argv:
        bad = check_text(pathlib.Path('src/window.cpp'), '#include <gst/gst.h>\n#include "painter.hpp"\ndouble x;\n')
        loop = cycles({'a': {'b'}, 'b': {'a'}})
        sys.exit(0 if len(bad) == 3 and loop else f'the check cannot fail: {bad} {loop}')
    wrong, graph = [], {}
    for path in sources():
        text = (TOP / path).read_text()
        wrong += check_text(path, text)
        if room(path) in ('core', 'kernels', 'public'):
            stage = str(path.with_suffix(''))
            targets = {str(t.with_suffix('')) for t in (resolve(n, path) for n in INCLUDE.findall(text)) if t}
            graph.setdefault(stage, set()).update(targets - {stage})
    wrong += [f'the arrows run in a circle: {c}' for c in cycles(graph)]
    for line in wrong:
        print('house:', line)
    sys.exit(1 if wrong else 0)


if __name__ == '__main__':
    main()
