#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Configures the project with each dependency absent, alone and all together.

On auto the parts that need it are left out and the summary names the package; enabled, the set-up stops and names it, and so it
does without what nothing can be built without. Every dependency(), find_library() and find_program() of every build file is one of
these, or a row of ALWAYS_THERE below: anything else fails here, so that nothing is left out in silence. And what
examples/quickstart.sh builds is the product, and nothing of tests, examples or the lab.

usage: check_configure.py SOURCE_FOLDER | --self-check
"""
import json
import os
import pathlib
import re
import stat
import subprocess
import sys
import tempfile

# What is looked for and belongs to what compiles, runs meson or is in this repository.
ALWAYS_THERE = {
    'threads': 'the C library', 'dl': 'the C library', 'm': 'the C library', '': 'nothing, which stands for what is absent',
    '/usr/bin/python3': 'what meson runs on', 'python3': 'what meson runs on', 'checks/check_commands.py': 'a script beside its build file', 'check_abi.py': 'a script beside its build file',
}
# In the one loop over the table of optional dependencies.
OF_THE_TABLE = {('meson.build', 'dependency', 'name'), ('meson.build', 'find_program', 'name')}
ANALYTICS = 'gstreamer-analytics-1.0'
ANALYTICS_PACKAGE = 'libgstreamer-plugins-bad1.0-dev'

# Hides packages from meson: pkg-config does not know them, and there is no CMake to ask instead.
PKG_CONFIG = '''#!/bin/sh
for word in "$@"; do
  for hidden in $HIDDEN_PACKAGES; do
    [ "$word" != "$hidden" ] || { echo "Package $word was not found" >&2; exit 1; }
  done
done
exec pkg-config "$@"
'''


def optional_packages(source):
    """Name, Debian package and parts of every optional dependency, as the build file lists them."""
    text = (source / 'meson.build').read_text()
    table = text[text.index('optional = {'):text.index('option_of = ')]
    rows = re.findall(r"'([\w.+-]+)': \[([^,]*), '([\w.+-]+)', \[([^\]]*)\]\]", table)
    if len(rows) < 5 or len(rows) != len(re.findall(r"^  '[^']+': \[", table, re.M)):
        sys.exit(f'the list of optional dependencies was not understood: {rows}')
    return {name: (package, re.findall(r"'(\w+)'", parts), version == "''") for name, version, package, parts in rows}


def looked_for(file, text):
    """(file, function, name, package) of everything that a build file looks for; a name that is no text is a variable's."""
    text = re.sub(r"^((?:[^'#\n]|'[^'\n]*')*)#.*$", r'\1', text, flags=re.M)
    found = []
    for call in re.finditer(r"(?<![\w])(dependency|find_library|find_program)\(", text):
        depth, end = 1, call.end()
        while depth and end < len(text):
            quoted = re.match(r"'[^']*'", text[end:])
            depth += 0 if quoted else {'(': 1, ')': -1}.get(text[end], 0)
            end += quoted.end() if quoted else 1
        arguments = text[call.end():end - 1]
        package = re.search(r"not_found_message:\s*'install ([\w.+-]+)", arguments)
        positional = re.match(r"\s*(?:'[^']*'|\w+(?!\s*:))(?:\s*,\s*(?:'[^']*'|\w+(?!\w*\s*:)))*", arguments)
        names = re.findall(r"'([^']*)'|(\w+)", positional[0] if positional else '')
        found += [(file, call[1], literal or variable, package and package[1]) for literal, variable in names] or [(file, call[1], '?', None)]
    return found


def not_covered(calls, optional):
    """What no set-up below takes away and nothing says why it need not."""
    return [f'{file}: {function}({name}) is in no table: its absence may go unsaid' for file, function, name, package in calls
            if name not in ALWAYS_THERE and name not in optional and name != ANALYTICS and not package and (file, function, name) not in OF_THE_TABLE]


def self_check():
    text = """a = dependency('one', version: v, required: get_option('x'))  # dependency('none')
b = cc.find_library('two', required: false)
c = find_program('three', 'threes')
d = [dependency('four', not_found_message: 'install libfour-dev'), dependency(five)]
# dependency('no')
e = dependency('optional'); f = my_dependency('no'); g = declare_dependency(link_with: h); i = dependency('threads')
j = dependency('', required: false)
"""
    calls = looked_for('src/meson.build', text)
    names = [name for _, _, name, _ in calls]
    wanted = ['one', 'two', 'three', 'threes', 'four', 'five', 'optional', 'threads', '']
    if names != wanted:
        return f'{names} in place of {wanted}'
    missed = [line.split('(')[1].split(')')[0] for line in not_covered(calls, {'optional'})]
    return '' if missed == ['one', 'two', 'three', 'threes', 'five'] else f'not covered: {missed}'


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    if sys.argv[1] == '--self-check':
        wrong = self_check()
        sys.exit(f'the check of build files does not hold: {wrong}' if wrong else 0)
    source = pathlib.Path(sys.argv[1]).resolve()
    packages = optional_packages(source)
    calls = []
    for file in sorted(source.rglob('meson.build')):
        # A clone or a build folder inside this one is none of it.
        if not any(part.startswith(('build', '.')) for part in file.relative_to(source).parts[:-1]):
            calls += looked_for(str(file.relative_to(source)), file.read_text())
    wrong = not_covered(calls, packages)
    # Meson's own list, which leaves out what stands in loops and lists, must hold nothing else.
    scanned = subprocess.run(['meson', 'introspect', '--scan-dependencies', str(source / 'meson.build')], capture_output=True, text=True, check=True).stdout
    wrong += [f'meson scans {row["name"]}, which was not read' for row in json.loads(scanned) if row['name'] not in {name for _, _, name, _ in calls}]
    if wrong:
        sys.exit('\n'.join(wrong))
    required = {name: package for _, _, name, package in calls if package and name != ANALYTICS}
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        shim = folder / 'pkg-config-shim'
        shim.write_text(PKG_CONFIG)
        shim.chmod(shim.stat().st_mode | stat.S_IXUSR)
        native = folder / 'native.ini'
        runs = 0

        def setup(hidden, *options):
            nonlocal runs
            runs += 1
            programs = ''.join(f"{name} = 'no-{name}-here'\n" for name in hidden if name in packages and packages[name][2])
            native.write_text(f"[binaries]\npkgconfig = '{shim}'\ncmake = 'no-cmake-here'\n{programs}")
            done = subprocess.run(['meson', 'setup', str(folder / f'build{runs}'), str(source), '--native-file', str(native), *options],
                                  env=dict(os.environ, HIDDEN_PACKAGES=' '.join(hidden)), capture_output=True, text=True, timeout=300)
            return done.returncode, done.stdout + done.stderr

        def expect(truth, what, log):
            if not truth:
                sys.exit(f'{what}:\n{log[-3000:]}')

        status, log = setup([])
        expect(status == 0 and 'no: install' not in log, 'with everything at hand something is left out', log)
        # The fuzzers are asked for or not, so nothing is said of them without; an example goes with the tests.
        for name, (package, parts, _) in packages.items():
            status, log = setup([name])
            expect(status == 0, f'without {name} the set-up fails', log)
            said = [line for line in log.splitlines() if 'no: install' in line and package in line]
            wanted = [part for part in parts if part != 'fuzz']
            expect(len(said) == len(wanted), f'without {name} the summary names {package} {len(said)} times, not for {wanted}', log)
            for option in sorted({{'process': 'tools', 'calibrate': 'tools', 'pictures': 'calibrate-pictures', 'rtsp': 'tests'}.get(part, part) for part in parts}):
                value = 'true' if option == 'fuzz' else 'enabled'
                status, log = setup([name], f'-D{option}={value}', *(['-Dtools=disabled', '-Dlab=disabled', '-Dtests=disabled'] if option == 'fuzz' else []))
                expect(status != 0 and f'install the package {package}' in log, f'-D{option}={value} without {name} does not name {package}', log)
        parts = {part for _, some, _ in packages.values() for part in some}
        status, log = setup(list(packages))
        expect(status == 0 and log.count('no: install') == len(parts - {'fuzz', 'rtsp', 'pictures'}), 'with the plugin\'s packages only the plugin is not configured', log)
        for name, package in required.items():
            status, log = setup([name])
            expect(status != 0 and f'install {package}' in log, f'without {name} the set-up does not stop and name {package}', log)
        status, log = setup([ANALYTICS])
        old = re.search(r'gstreamer-1.0 found: YES 1\.(\d+)', log)
        reason = 'GStreamer is older than 1.26' if old and int(old[1]) < 26 else f'install {ANALYTICS_PACKAGE}'
        expect(status == 0 and re.search(rf'GstAnalytics metadata +: no: {re.escape(reason)}', log), f'without {ANALYTICS} the summary does not say: {reason}', log)
        status, log = setup([ANALYTICS], '-Danalytics=enabled')
        expect(status != 0 and f'install {ANALYTICS_PACKAGE}' in log, f'-Danalytics=enabled without it does not name {ANALYTICS_PACKAGE}', log)

        # What the quickstart builds, in its own words.
        words = (source / 'examples/quickstart.sh').read_text()
        options = re.search(r'meson setup "\$build" (.*) \|\|', words)[1].split()
        targets = re.search(r'ninja -C "\$build" (.*) \|\|', words)[1].split()
        status, log = setup([], *options)
        expect(status == 0, 'the quickstart cannot be configured', log)
        steps = subprocess.run(['ninja', '-n', '-v', '-C', str(folder / f'build{runs}'), *targets], capture_output=True, text=True, check=True).stdout
        compiled = re.findall(r' -c (\S+)', steps)
        others = [file for file in compiled if re.search('/(tests|examples|lab)/', file)]
        expect(len(compiled) > 50 and not others, f'the quickstart compiles {len(compiled)} files, among them {others}', steps)
        print(f'{runs} set-ups; the quickstart compiles {len(compiled)} files')


if __name__ == '__main__':
    main()
