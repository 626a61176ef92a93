#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Configures the project with each optional dependency absent, alone and all together.

On auto the parts that need it are left out and the summary names the package; enabled, the set-up stops and names it. And
what examples/quickstart.sh builds is the plugin and terrainseg-process, nothing else.

usage: check_configure.py SOURCE_FOLDER
"""
import os
import pathlib
import re
import stat
import subprocess
import sys
import tempfile

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
    rows = re.findall(r"'([\w.+-]+)': \[[^,]*, '([\w.+-]+)', \[([^\]]*)\]\]", table)
    return {name: (package, re.findall(r"'(\w+)'", parts)) for name, package, parts in rows}


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    source = pathlib.Path(sys.argv[1]).resolve()
    packages = optional_packages(source)
    if len(packages) < 5:
        sys.exit(f'the list of optional dependencies was not understood: {packages}')
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        shim = folder / 'pkg-config-shim'
        shim.write_text(PKG_CONFIG)
        shim.chmod(shim.stat().st_mode | stat.S_IXUSR)
        native = folder / 'native.ini'
        native.write_text(f"[binaries]\npkgconfig = '{shim}'\ncmake = 'no-cmake-here'\n")
        runs = 0

        def setup(hidden, *options):
            nonlocal runs
            runs += 1
            done = subprocess.run(['meson', 'setup', str(folder / f'build{runs}'), str(source), '--native-file', str(native), *options],
                                  env=dict(os.environ, HIDDEN_PACKAGES=' '.join(hidden)), capture_output=True, text=True, timeout=300)
            return done.returncode, done.stdout + done.stderr

        def expect(truth, what, log):
            if not truth:
                sys.exit(f'{what}:\n{log[-3000:]}')

        status, log = setup([])
        expect(status == 0 and 'no: install' not in log, 'with everything at hand something is left out', log)
        for name, (package, parts) in packages.items():
            status, log = setup([name])
            expect(status == 0, f'without {name} the set-up fails', log)
            said = [line for line in log.splitlines() if 'no: install' in line and package in line]
            expect(len(said) == len(parts), f'without {name} the summary names {package} {len(said)} times, not for {parts}', log)
            option = {'process': 'tools', 'eval': 'tools'}.get(parts[0], parts[0])
            status, log = setup([name], f'-D{option}=enabled')
            expect(status != 0 and f'install the package {package}' in log, f'-D{option}=enabled without {name} does not name {package}', log)
        status, log = setup(list(packages))
        expect(status == 0 and log.count('no: install') == 5, 'with the plugin\'s packages only the plugin is not configured', log)

        # What the quickstart builds, in its own words.
        words = (source / 'examples/quickstart.sh').read_text()
        options = re.search(r'meson setup "\$build" (.*) \|\|', words)[1].split()
        targets = re.search(r'ninja -C "\$build" (.*) \|\|', words)[1].split()
        status, log = setup([], *options)
        expect(status == 0, 'the quickstart cannot be configured', log)
        steps = subprocess.run(['ninja', '-n', '-v', '-C', str(folder / f'build{runs}'), *targets], capture_output=True, text=True, check=True).stdout
        compiled = re.findall(r' -c (\S+)', steps)
        others = [file for file in compiled if re.search('/(tests|examples|src/reference|src/tools/(eval|calibrate))/', file)]
        expect(len(compiled) > 50 and not others, f'the quickstart compiles {len(compiled)} files, among them {others}', steps)
        print(f'{runs} set-ups; the quickstart compiles {len(compiled)} files')


if __name__ == '__main__':
    main()
