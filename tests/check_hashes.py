#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Finds commits that pages name and this history does not have.

usage: check_hashes.py [--self-check]

A commit is named by 7 to 12 hexadecimal digits, or all 40, that stand alone. In pages (*.md, *.txt) every such word with a letter
in it counts; elsewhere, and where all are decimal digits, only behind "commit" or "at" (7 of them, not a round number). What follows
`0x`, `#` or a quotation mark is something else. A history rewritten after a page was written leaves hashes behind that nobody can
look up; so does a figure measured in somebody's own clone. Where there is no whole history (a release, a shallow clone) nothing is
checked, and that is said.

--self-check: hashes that are wrong make the check fail, words that are none do not, and what is no whole clone passes.
"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile

TOP = pathlib.Path(__file__).resolve().parent.parent
ALONE = r'(?<![0-9A-Za-z_#\\/+="\'-])(?<![0-9A-Za-z]\.)%s(?![0-9A-Za-z_"\'-]|\.[0-9])'
LENGTH = r'(?:[0-9a-f]{40}|[0-9a-f]{7,12})'
IN_PAGES = re.compile(ALONE % (r'(?=[0-9]*[a-f])' + LENGTH))
NAMED = re.compile(r'\b(?:[Cc]ommit|[Aa]t)\s+`?' + ALONE % (r'(?:(?=[0-9]*[a-f])' + LENGTH + r'|(?!\d{4}000)\d{7})'))
WORDS = {'acceded', 'defaced', 'effaced'}


def git(folder, *arguments):
    """What it prints, or nothing where it fails or is not there."""
    try:
        done = subprocess.run(['git', '-C', folder, *arguments], capture_output=True, text=True, errors='replace', check=False)
    except OSError:
        return ''
    return done.stdout if done.returncode == 0 else ''


def why_not(folder):
    """Why there is no whole history here, or nothing where there is."""
    top = git(folder, 'rev-parse', '--show-toplevel').strip()
    if not top or not os.path.samefile(top, folder):
        return 'this is no clone (or git does not read it)'
    if git(folder, 'rev-parse', '--is-shallow-repository').strip() != 'false':
        return 'this clone is shallow'
    return '' if git(folder, 'rev-parse', '--verify', 'HEAD') else 'nothing was committed yet'


def hashes(name, text):
    """(line, word) of what looks like a commit."""
    page = name.endswith(('.md', '.txt')) and not name.startswith('tests/golden/')
    found = set()
    for number, line in enumerate(text.splitlines(), 1):
        words = [m.group() for m in IN_PAGES.finditer(line)] if page else []
        words += [m.group().split()[-1].strip('`') for m in NAMED.finditer(line)]
        found |= {(number, word) for word in words if word not in WORDS}
    return sorted(found)


def unknown(folder):
    """FILE:LINE: what is wrong, over all files of the clone."""
    history = sorted(git(folder, 'rev-list', 'HEAD').split())
    wrong = []
    for name in git(folder, 'ls-files', '-z').split('\0'):
        path = pathlib.Path(folder) / name
        if not name or not path.is_file() or path.is_symlink() or path.resolve() == pathlib.Path(__file__).resolve():
            continue  # hashes that are wrong stand here
        data = path.read_bytes()
        if b'\0' in data:
            continue
        for number, word in hashes(name, data.decode(errors='replace')):
            if not any(commit.startswith(word) for commit in history):
                wrong.append(f'{name}:{number}: {word} is no commit of this history; name one that is, or a date')
    return wrong


def self_check():
    wrong = []
    for name, text, wanted in (
            ('README.md', 'measured at 1234abc.', ['1234abc']), ('README.md', '(edeabed, with two threads)', ['edeabed']),
            ('README.md', 'commits 1234abc..4321cba', ['1234abc', '4321cba']), ('docs/a.md', 'frames at 4971466, the same', ['4971466']),
            ('docs/a.txt', 'commit ' + '12ab' * 10, ['12ab' * 10]), ('docs/a.md', 'they `1234abc`: yes', ['1234abc']),
            ('src/a.cpp', '// as at 1234abc', ['1234abc']), ('src/a.cpp', '// as at commit `1234abc`', ['1234abc']),
            ('README.md', 'tint #1234abc, 0x1234abc, "1234abc", x=1234abc, 1234abc.50 and 1234abcg', []),
            ('README.md', 'at 2000000 bits, 1000000000 frames at 30, defaced', []), ('docs/a.md', '06-0e-1234abc, 0142c00dffe1aab', []),
            ('README.md', 'id 12345678-1234-1234-1234-123456789abc', []), ('tests/golden/mask_hashes.txt', '1234abcd', []),
            ('src/a.cpp', 'const char* digits = "1234abc"; f(0x1234abc);', []), ('src/a.cpp', 'read 1234abc', [])):
        found = [word for _, word in hashes(name, text)]
        if found != wanted:
            wrong.append(f'{name}: {text!r}: {found}')
    with tempfile.TemporaryDirectory() as folder:
        clone = pathlib.Path(folder) / 'clone'
        clone.mkdir()
        if not why_not(clone):
            wrong.append('a folder without a history is checked')
        if not git(folder, '--version'):
            print('hashes: no git here; only the words were checked')
            return wrong
        git(clone, 'init', '-q')
        if not why_not(clone):
            wrong.append('a clone without a commit is checked')

        def commit(text):
            (clone / 'README.md').write_text(text)
            git(clone, 'add', '.')
            git(clone, '-c', 'user.name=a', '-c', 'user.email=a@b', '-c', 'commit.gpgsign=false', 'commit', '-q', '-m', 'a commit')
            return git(clone, 'rev-parse', 'HEAD').strip()
        first = commit('nothing yet\n')
        # As many digits as leave a letter in it: a hash of decimal digits alone is looked for behind "at".
        length = max(7, next(n for n, digit in enumerate(first, 1) if digit in 'abcdef'))
        last = commit(f'at {first[:min(length, 12)]} and {first}\n')
        if why_not(clone) or unknown(clone):
            wrong.append(f'commits that are there: {why_not(clone)}{unknown(clone)}')
        (clone / 'README.md').write_text(f'at {first}\nand at {last}\n')
        git(clone, 'reset', '-q', '--soft', first)
        if [line.split(':')[1] for line in unknown(clone)] != ['2']:
            wrong.append('a commit that is in no history passes')
        below = clone / 'release'
        below.mkdir()
        if not why_not(below):
            wrong.append('a release inside a clone is checked against that clone')
        git(clone, 'checkout', '-q', '-f', last)
        git(folder, 'clone', '-q', '--depth', '1', f'file://{clone}', 'shallow')
        if 'shallow' not in why_not(pathlib.Path(folder) / 'shallow'):
            wrong.append('a shallow clone is checked')
    return wrong


def main():
    if '--self-check' in sys.argv:
        wrong = self_check()
        sys.exit('\n'.join(f'hashes: the check does not hold: {line}' for line in wrong) if wrong else 0)
    reason = why_not(TOP)
    if reason:
        print(f'hashes: {reason}; what commits pages name was not checked')
        return
    wrong = unknown(TOP)
    sys.exit('\n'.join(f'hashes: {line}' for line in wrong) if wrong else 0)


if __name__ == '__main__':
    main()
