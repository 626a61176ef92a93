#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Holds the floors of the house: who may include whom.

Each room sees the rooms that MAY gives it: the floors of the core in one direction (base, coarse, learning, then paper or
freespace, then the segmenter), the folders of freespace along the values (look, score, learn or curve, holes, answer), the two pipelines never each other; kernels nobody; what leaves the core
(exchange, painter, gst, tools) its public face. Nothing in the core knows GStreamer, OpenCV or Eigen, speaks floating point
or includes in a circle, no chain of includes is longer than LONGEST_CHAIN files, and a frame may pass MOST_PASSED source files.

usage: check_house.py [--self-check | --chain | --passed]

--chain: prints the longest chain of includes.

--passed: prints the source files that a frame may pass: the segmenter's, and each one beside a header that one of them needs.

--self-check: every include that is not allowed, and each of the other rules, makes the check fail.
"""
import pathlib
import re
import sys

TOP = pathlib.Path(__file__).resolve().parents[2]
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', re.M)
FOREIGN = re.compile(r'^(gst/|glib|gio/|opencv2|Eigen|nlohmann|json-glib)')
FLOATING = re.compile(r'\b(float|double)\b')
COMMENT = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', re.S)

# The folder of each room; files of `src` itself are told by their name.
ROOMS = {
    'include/terrainseg/segmenter': 'facade', 'include/terrainseg': 'public', 'include/gst': 'meta',
    'src/kernels': 'kernels', 'src/base/tuning': 'tuning', 'src/base': 'base', 'src/coarse': 'coarse', 'src/learning': 'learning',
    'src/motion': 'motion', 'src/paper': 'paper',
    'src/freespace/look': 'look', 'src/freespace/score': 'score', 'src/freespace/learn': 'learn', 'src/freespace/curve': 'curve',
    'src/freespace/holes': 'holes', 'src/freespace/answer': 'answer', 'src/freespace': 'freespace',
    'src/segmenter': 'segmenter', 'src/metric': 'metric', 'src/painter': 'painter', 'src/exchange': 'exchange',
    'src/pch': 'precompiled',
    'src/recording': 'recording', 'src/ros2': 'ros2', 'src/scene': 'scene', 'src/tools': 'tools', 'lab/reference': 'reference', 'lab/eval': 'eval', 'lab/gst': 'lab',
    'gst/recording': 'recorder', 'gst/ros2': 'bridge', 'gst/support': 'support', 'gst/elements': 'elements', 'gst': 'plugin',
}

# What each room may include of the project's own headers, besides itself.
MAY = {
    'public': set(),
    'facade': {'public'},
    'precompiled': set(),
    'meta': set(),
    'kernels': set(),
    'tuning': set(),
    'base': {'public', 'kernels'},
    'coarse': {'public', 'kernels', 'base'},
    'learning': {'public', 'kernels', 'base', 'coarse'},
    'motion': {'tuning', 'public', 'kernels', 'base', 'coarse'},
    'paper': {'public', 'kernels', 'base', 'coarse', 'learning'},
    'look': {'tuning', 'public', 'kernels', 'base', 'coarse', 'learning'},
    'score': {'tuning', 'public', 'kernels', 'base', 'coarse', 'learning', 'look'},
    'learn': {'tuning', 'public', 'kernels', 'base', 'coarse', 'learning', 'look', 'score'},
    'curve': {'tuning', 'public', 'kernels', 'base', 'coarse', 'learning', 'look', 'score'},
    'holes': {'tuning', 'public', 'kernels', 'base', 'coarse', 'motion', 'look', 'curve'},
    'answer': {'tuning', 'public', 'kernels', 'base', 'coarse', 'look', 'score', 'learn', 'curve', 'holes'},
    'freespace': {'tuning', 'public', 'kernels', 'base', 'coarse', 'learning', 'motion', 'look', 'score', 'learn', 'curve', 'holes', 'answer'},
    'segmenter': {'facade', 'public', 'base', 'coarse', 'learning', 'paper', 'freespace'},
    'metric': {'public', 'kernels'},
    'painter': {'public', 'kernels'},
    'exchange': {'public'},
    'recording': {'public', 'exchange', 'metric'},
    'ros2': {'public', 'recording'},
    'scene': {'public'},
    'reference': {'public'},
    'tools': {'facade', 'public', 'exchange', 'metric', 'meta'},
    'eval': {'tuning', 'facade', 'public', 'painter', 'exchange', 'metric', 'scene', 'reference', 'tools'},
    'lab': {'facade', 'public', 'painter', 'exchange', 'reference', 'meta', 'support'},
    'support': {'facade', 'public', 'painter', 'exchange', 'metric', 'scene', 'meta'},
    'elements': {'facade', 'public', 'painter', 'exchange', 'metric', 'scene', 'meta', 'support'},
    'recorder': {'public', 'exchange', 'metric', 'recording', 'meta', 'support'},
    'bridge': {'public', 'exchange', 'metric', 'recording', 'ros2', 'recorder', 'meta', 'support'},
    'plugin': {'support', 'elements', 'meta'},
}
CORE = {'facade', 'public', 'kernels', 'tuning', 'base', 'coarse', 'learning', 'motion', 'paper', 'look', 'score', 'learn', 'curve', 'holes', 'answer',
        'freespace', 'segmenter'}
INTEGER_ROOMS = CORE | {'painter'}
LONGEST_CHAIN = 11  # files, from a source down to a header that includes none of ours
MOST_PASSED = 40
NO_FOREIGN = INTEGER_ROOMS | {'metric', 'exchange', 'recording', 'scene', 'precompiled'}


def room(path):
    """The room of a file below the top, or None."""
    folder = path.with_suffix('')
    while folder != pathlib.Path('.'):
        if str(folder) in ROOMS:
            return ROOMS[str(folder)]
        folder = folder.parent
    return None


def sources():
    for folder in ('include', 'src', 'gst', 'lab/eval', 'lab/reference', 'lab/gst'):
        for path in sorted((TOP / folder).rglob('*')):
            if path.suffix in ('.hpp', '.cpp', '.h', '.c') or path.name.endswith('-inl.h'):
                yield path.relative_to(TOP)


def resolve(name, path):
    for base in (TOP / path.parent, TOP / 'src', TOP / 'include', TOP / 'gst', TOP):
        if (base / name).is_file():
            return (base / name).resolve().relative_to(TOP)
    return None


def check_text(path, text, resolve=resolve):
    here, wrong = room(path), []
    if here is None:
        return [f'{path}: in no room (ROOMS and MAY in tests/checks/check_house.py)']
    for name in INCLUDE.findall(text):
        target = resolve(name, path)
        if target is None:
            if here in NO_FOREIGN and FOREIGN.match(name):
                wrong.append(f'{path}: room {here} reaches for <{name}>')
            continue
        there = room(target)
        if there != here and there not in MAY[here]:
            wrong.append(f'{path}: room {here} may not include {target} (room {there})')
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


def longest_chain(graph):
    """The longest way down a graph without circles, as a list of its nodes."""
    below = {}

    def chain(node):
        if node not in below:
            below[node] = [node] + max((chain(after) for after in graph.get(node, ())), key=len, default=[])
        return below[node]

    return max((chain(node) for node in sorted(graph)), key=len, default=[])


def too_long(chain):
    return [f'{len(chain)} files include one another: {" -> ".join(chain)}'] if len(chain) > LONGEST_CHAIN else []


def passed(graph, first='src/segmenter'):
    """The nodes that can be reached from the first one."""
    reached, waiting = set(), [first]
    while waiting:
        node = waiting.pop()
        if node not in reached:
            reached.add(node)
            waiting += graph.get(node, ())
    return sorted(reached)


def too_many(files):
    return [f'a frame passes {len(files)} source files, at most {MOST_PASSED} are allowed (--passed lists them)'] \
        if len(files) > MOST_PASSED else []


def self_check():
    """What the rules let through although they should not, and the other way round."""
    home = {name: pathlib.Path(folder) / 'a_file.hpp' for folder, name in ROOMS.items()}
    home['segmenter'], home['painter'] = pathlib.Path('src/segmenter.hpp'), pathlib.Path('src/painter.hpp')
    home['facade'] = pathlib.Path('include/terrainseg/segmenter.hpp')
    wrong = [f'{name}: {path} is in room {room(path)}' for name, path in home.items() if room(path) != name]
    for here, path in home.items():
        for there, target in home.items():
            found = check_text(path, '#include "it.hpp"\n', lambda *_, target=target: target)
            if bool(found) != (there != here and there not in MAY[here]):
                wrong.append(f'{here} includes {there}: {found}')
        for text, rooms in (('#include <gst/gst.h>\n', NO_FOREIGN), ('double x;\n', INTEGER_ROOMS)):
            if bool(check_text(path, text, lambda *_: None)) != (here in rooms):
                wrong.append(f'{here}: {text.strip()}')
    # The floors, written apart from the table.
    for here, there in (('base', 'coarse'), ('coarse', 'learning'), ('learning', 'paper'), ('learning', 'freespace'),
                        ('look', 'score'), ('score', 'curve'), ('learn', 'curve'), ('curve', 'learn'), ('curve', 'holes'), ('holes', 'score'),
                        ('holes', 'answer'), ('paper', 'freespace'), ('freespace', 'paper'), ('kernels', 'public'),
                        ('exchange', 'base'), ('painter', 'base'), ('elements', 'freespace'), ('support', 'elements'),
                        ('elements', 'reference'), ('tools', 'eval'), ('scene', 'eval'), ('motion', 'learning'), ('metric', 'base'), ('segmenter', 'metric'), ('freespace', 'metric'),
                        ('base', 'facade'), ('freespace', 'facade'), ('public', 'facade')):
        if there in MAY[here]:
            wrong.append(f'the table lets {here} include {there}')
    if not check_text(pathlib.Path('src/cellar/a_file.hpp'), ''):
        wrong.append('a folder without a room')
    if not cycles({'a': {'b'}, 'b': {'a'}}) or cycles({'a': {'b'}, 'b': set()}):
        wrong.append('circles are not told from lines')
    if longest_chain({'a': {'b', 'c'}, 'b': {'d'}, 'c': {'d'}, 'd': {'e'}}) not in (list('abde'), list('acde')):
        wrong.append('the longest chain of includes is not found')
    if not too_long([str(n) for n in range(LONGEST_CHAIN + 1)]) or too_long([str(n) for n in range(LONGEST_CHAIN)]):
        wrong.append('chains of any length pass')
    if passed({'a': {'b', 'c'}, 'b': {'a'}, 'd': {'e'}}, 'a') != list('abc'):
        wrong.append('what a frame passes is not found')
    if not too_many(range(MOST_PASSED + 1)) or too_many(range(MOST_PASSED)):
        wrong.append('a frame may pass any number of files')
    return wrong


def main():
    if '--self-check' in sys.argv:
        wrong = self_check()
        sys.exit('\n'.join(f'house: the check fails to fail: {line}' for line in wrong) if wrong else 0)
    wrong, graph, files = [], {}, {}
    for path in sources():
        text = (TOP / path).read_text()
        wrong += check_text(path, text)
        if room(path) in CORE:
            stage = str(path.with_suffix(''))
            files[path] = {t for t in (resolve(n, path) for n in INCLUDE.findall(text)) if t}
            graph.setdefault(stage, set()).update({str(t.with_suffix('')) for t in files[path]} - {stage})
    circles = cycles(graph)
    wrong += [f'the arrows run in a circle: {c}' for c in circles]
    chain = [str(path) for path in longest_chain(files)] if not circles else []
    if '--chain' in sys.argv:
        print(len(chain), 'files:', ' -> '.join(chain))
        return
    sources_passed = [f'{node}.cpp' for node in passed(graph) if (TOP / f'{node}.cpp').is_file()]
    if '--passed' in sys.argv:
        print('\n'.join(sources_passed))
        return
    wrong += too_long(chain) + too_many(sources_passed)
    for line in wrong:
        print('house:', line)
    sys.exit(1 if wrong else 0)


if __name__ == '__main__':
    main()
