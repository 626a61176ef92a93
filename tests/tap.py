# SPDX-License-Identifier: LGPL-2.1-or-later
"""A test script as functions: prints the Test Anything Protocol that `meson test` counts case by case."""
import contextlib
import os
import pathlib
import sys
import tempfile
import traceback


class Skip(Exception):
    """Raised by a case whose tools are not there; the text says which."""


def main(cases):
    """Runs every function in its own empty folder; arguments choose cases by name."""
    chosen = [case for case in cases if not sys.argv[1:] or case.__name__ in sys.argv[1:]]
    print(f'1..{len(chosen)}', flush=True)
    failures = 0
    for number, case in enumerate(chosen, 1):
        name = case.__name__
        with tempfile.TemporaryDirectory(prefix='terrainseg-') as folder, contextlib.ExitStack() as stack:
            stack.callback(os.chdir, os.getcwd())
            os.chdir(folder)
            try:
                case(pathlib.Path(folder))
                print(f'ok {number} {name}', flush=True)
            except Skip as reason:
                print(f'ok {number} {name} # SKIP {reason}', flush=True)
            except Exception:  # a failed case must not hide the ones after it
                failures += 1
                print(f'not ok {number} {name}', flush=True)
                for line in traceback.format_exc().splitlines():
                    print(f'# {line}', flush=True)
    sys.exit(1 if failures else 0)


def equal(actual, expected, what=''):
    assert actual == expected, f'{what}: {actual!r} instead of {expected!r}'


def contains(text, part):
    assert part in text, f'{part!r} is not in {text!r}'
