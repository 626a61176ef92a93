#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""tools/release.sh without the packages, which tests/ci/packages.sh builds: what it leaves and what it refuses."""
import hashlib
import os
import pathlib
import re
import subprocess
import sys
import tarfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from tap import Skip, contains, equal, main  # noqa: E402

TOP = pathlib.Path(__file__).resolve().parent.parent.parent
CASES = []


def case(function):
    CASES.append(function)
    return function


def git(*arguments):
    return subprocess.run(['git', '-c', 'user.name=test', '-c', 'user.email=test@localhost', *arguments], check=True, capture_output=True, text=True).stdout


def source():
    """What is committed, as a clone of its own; the working folder."""
    if subprocess.run(['git', '-C', TOP, 'rev-parse', 'HEAD'], capture_output=True).returncode:
        raise Skip('this source is no git clone')
    git('clone', '-q', '--no-hardlinks', str(TOP), 'clone')
    os.chdir('clone')


def release(*words, code=0):
    result = subprocess.run(['tools/release.sh', *words], capture_output=True, text=True, env={**os.environ, 'SOURCE_ONLY': '1'})
    equal(result.returncode, code, result.stderr)
    return result.stdout + result.stderr


@case
def the_source_and_its_checksum(folder):
    source()
    kept = []
    for _ in range(2):  # again into the same folder
        release(folder / 'out')
        archives = sorted((folder / 'out').glob('*.tar.xz'))
        equal([path.name.rsplit('-', 1)[-1] for path in archives], ['api.tar.xz', archives[1].name.rsplit('-', 1)[-1]], 'what is left')
        kept.append([path.read_bytes() for path in archives])
        sums = dict(reversed(line.split()) for line in (folder / 'out' / 'SHA256SUMS').read_text().splitlines())
        equal(sums, {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in archives}, 'checksums')
    archive = archives[1]
    with tarfile.open(archives[0]) as packed:
        pages = [name for name in packed.getnames() if name.endswith('.html')]
    assert any('Segmenter' in name for name in pages) and any('terrainsegmeta_8h' in name for name in pages), pages[:20]
    assert kept[0] == kept[1], 'the same commit gives the same bytes'
    top = archive.name.removesuffix('.tar.xz')
    with tarfile.open(archive) as packed:
        names = {name.removeprefix(f'{top}/') for name in packed.getnames() if name != top}
        folders = {member.name.removeprefix(f'{top}/') for member in packed.getmembers() if member.isdir()}
    equal(sorted(names - folders), sorted(git('ls-files').splitlines()), 'files')


@case
def what_it_refuses(folder):
    source()
    pathlib.Path('left-over').write_text('')
    contains(release(folder / 'out', code=1), 'something is not committed')
    os.remove('left-over')
    for path, old, new, said in (('meson.build', "  version: '", "  version: '9", 'debian/changelog'),
                                 ('CHANGELOG.md', '\n## ', '\n## Not ', 'CHANGELOG.md has no section')):
        text = pathlib.Path(path).read_text()
        assert old in text, path
        pathlib.Path(path).write_text(text.replace(old, new, 1))
        git('commit', '-qam', 'another version')
        contains(release(folder / 'out', code=1), said)
        git('reset', '-q', '--hard', 'HEAD~1')
    contains(release('--tags', folder / 'out', code=1), 'unknown option --tags')
    contains(release(folder / 'out', folder / 'other', code=1), 'two folders')
    assert not (folder / 'out').exists(), 'nothing is left'


@case
def the_tag(folder):
    source()
    contains(release('--tag', folder / 'out', code=1), 'not released')
    version = re.search(r"version: '([\d.]+)'", pathlib.Path('meson.build').read_text())[1]
    changes = pathlib.Path('CHANGELOG.md')
    changes.write_text(changes.read_text().replace('not released yet', '1 December 2026'))
    git('commit', '-qam', 'a date')
    git('config', 'user.name', 'test')
    git('config', 'user.email', 'test@localhost')
    release(folder / 'out', '--tag')
    equal(git('rev-parse', f'v{version}^{{commit}}'), git('rev-parse', 'HEAD'), 'what the tag names')
    contains(release('--tag', folder / 'again', code=1), 'already exists')


if __name__ == '__main__':
    main(CASES)
