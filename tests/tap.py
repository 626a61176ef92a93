# SPDX-License-Identifier: LGPL-2.1-or-later
"""A test script as functions: prints the Test Anything Protocol that `meson test` counts case by case."""
import concurrent.futures
import contextlib
import fcntl
import itertools
import multiprocessing
import os
import pathlib
import subprocess
import sys
import tempfile
import traceback


class Skip(Exception):
    """Raised by a case whose tools are not there; the text says which."""


@contextlib.contextmanager
def installing(build):
    """While a build is installed: the log that `ninja uninstall` reads is one for all who install it."""
    with open(pathlib.Path(build) / 'install.lock', 'w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


chosen = []  # the cases that are run; a process that runs one inherits them


def outcome(number):
    """Runs a case in its own empty folder: whether it held, and what is printed behind its number."""
    case = chosen[number]
    name = case.__name__
    with tempfile.TemporaryDirectory(prefix='terrainseg-') as folder, contextlib.ExitStack() as stack:
        stack.callback(os.chdir, os.getcwd())
        os.chdir(folder)
        try:
            case(pathlib.Path(folder))
            return True, name
        except Skip as reason:
            return True, f'{name} # SKIP {reason}'
        except Exception:  # a failed case must not hide the ones after it
            return False, '\n# '.join([name, *traceback.format_exc().splitlines()])


def main(cases, at_once=1, alone=()):
    """Runs every function; arguments choose cases by name. Several at once for cases that wait for programs, each in a
    process of its own; those of `alone` after all others, one by one."""
    wanted = [case for case in cases if not sys.argv[1:] or case.__name__ in sys.argv[1:]]
    chosen[:] = sorted(wanted, key=lambda case: case in alone)
    together = sum(case not in alone for case in chosen) if at_once > 1 else 0
    print(f'1..{len(chosen)}', flush=True)
    held = True
    with concurrent.futures.ProcessPoolExecutor(at_once, multiprocessing.get_context('fork')) as pool:
        outcomes = itertools.chain(pool.map(outcome, range(together)), map(outcome, range(together, len(chosen))))
        for number, (good, text) in enumerate(outcomes, 1):
            print('ok' if good else 'not ok', number, text, flush=True)
            held = held and good
    sys.exit(not held)


def equal(actual, expected, what=''):
    assert actual == expected, f'{what}: {actual!r} instead of {expected!r}'


def contains(text, part):
    assert part in text, f'{part!r} is not in {text!r}'


def said_by(script, *arguments, code=0):
    """All that a Python script prints, which must end with that code."""
    result = subprocess.run([sys.executable, script, *map(str, arguments)], capture_output=True, text=True)
    equal(result.returncode, code, result.stderr)
    return result.stdout + result.stderr
