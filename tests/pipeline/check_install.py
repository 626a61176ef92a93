#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Installs a build into an empty folder and uses what is there: the plugin, the headers, the pkg-config files.

usage: check_install.py BUILD_FOLDER
"""
import os
import pathlib
import shlex
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from tap import installing  # noqa: E402

C_PROGRAM = r'''
#include <gst/terrainseg/terrainsegmeta.h>
int main (int argc, char **argv) {
  GstElement *element;
  GstBuffer *buffer;
  gst_init (&argc, &argv);
  buffer = gst_buffer_new ();
  if (gst_buffer_get_terrain_seg_structure (buffer) != NULL) return 1;   /* before the plugin is loaded */
  element = gst_element_factory_make ("terrainseg", NULL);
  if (element == NULL) return 2;
  if (gst_buffer_get_terrain_seg_structure (buffer) != NULL) return 3;
  if (gst_buffer_add_custom_meta (buffer, GST_TERRAIN_SEG_META_NAME) == NULL) return 4;
  if (gst_terrain_seg_meta_get_horizon_row (gst_buffer_get_terrain_seg_structure (buffer)) != -1) return 5;
  if (gst_terrain_seg_meta_get_flags (gst_buffer_get_terrain_seg_structure (buffer)) != GST_TERRAIN_SEG_FLAG_UNKNOWN) return 6;
  gst_buffer_unref (buffer);
  gst_object_unref (element);
  return 0;
}
'''
CPP_PROGRAM = r'''
#include <terrainseg/segmenter.hpp>
#include <vector>
int main() {
  using namespace terrainseg;
  const Settings settings = Settings::of(Preset::standard);
  if (validate(settings)) return 1;
  Segmenter segmenter(settings);
  std::vector<unsigned char> pixels(160 * 120 * 3, 90);
  Frame frame;
  frame.format = PixelFormat::RGB;
  frame.width = 160;
  frame.height = 120;
  frame.planes[0] = {pixels.data(), 160 * 3};
  if (!segmenter.process(frame).ok()) return 2;
  return segmenter.estimate().mask.width == 160 ? 0 : 3;
}
'''

PROGRAMS = (('gstreamer-terrainseg-1.0', C_PROGRAM, 'cc -std=c11 -Wall -Wextra -Werror -x c'),
            ('terrainseg', CPP_PROGRAM, 'c++ -std=c++20 -Wall -Wextra -Werror -x c++'))


def run(command, **more):
    done = subprocess.run(command, env=dict(os.environ, **more), capture_output=True, text=True, timeout=300)
    if done.returncode:
        sys.exit(f'{shlex.join(map(str, command))} ended with {done.returncode}:\n{done.stdout[-2000:]}{done.stderr[-2000:]}')
    return done.stdout


def only(root, pattern):
    found = sorted(root.rglob(pattern))
    if not found:
        sys.exit(f'not installed: {pattern}')
    return found[0]


def check_after_install(folder):
    """The loader's cache is renewed by root where it knows the folder, however much ldconfig prints behind that line."""
    script = pathlib.Path(__file__).resolve().parent.parent.parent / 'tools/after_install.sh'
    programs = folder / 'bin'
    programs.mkdir()
    (programs / 'ldconfig').write_text(
        f'#!/bin/sh\n[ "$1" = -v ] || exec touch {folder}/renewed\necho "/usr/local/lib: (from a file)"\n'
        'seq 100000 || exit 1\n')
    (programs / 'id').write_text('#!/bin/sh\necho 0\n')
    for program in programs.iterdir():
        program.chmod(0o755)
    path = {'PATH': f'{programs}:{os.environ["PATH"]}'}
    for libraries, renewed in ('/usr/local/lib', True), ('/opt/lib', False):
        (folder / 'renewed').unlink(missing_ok=True)
        said = run([str(script), '/plugins', libraries, '/plugins'], **path)
        if (folder / 'renewed').exists() != renewed or ('LD_LIBRARY_PATH' in said) == renewed:
            sys.exit(f'after_install.sh with {libraries}: renewed {not renewed}, said {said!r}')


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    build = pathlib.Path(sys.argv[1]).resolve()
    # meson devenv finds the plugin without anything being installed.
    for name in ('GST_PLUGIN_PATH', 'GST_REGISTRY'):
        os.environ.pop(name, None)
    if 'terrainseg' not in run(['meson', 'devenv', '-C', str(build), 'gst-inspect-1.0', 'terrainseg']):
        sys.exit('meson devenv: gst-inspect-1.0 terrainseg does not answer')

    with tempfile.TemporaryDirectory() as folder:
        check_after_install(pathlib.Path(folder))
    with tempfile.TemporaryDirectory() as folder, installing(build):
        root = pathlib.Path(folder)
        run(['meson', 'install', '-C', str(build), '--no-rebuild', '--quiet', '--destdir', str(root / 'image')])
        image = root / 'image'
        plugin = only(image, 'libgstterrainseg.so')
        only(image, 'libterrainseg.so.0')
        for header in ('export', 'frame', 'settings', 'estimate', 'terrain', 'segmenter'):
            only(image, f'include/terrainseg/{header}.hpp')
        only(image, 'gst/terrainseg/terrainsegmeta.h')

        gst = {'GST_PLUGIN_PATH': str(plugin.parent), 'GST_REGISTRY': str(root / 'registry.bin'),
               'G_DEBUG': 'fatal-criticals',
               'LD_LIBRARY_PATH': str(only(image, 'libterrainseg.so.0').parent)}
        answer = run(['gst-inspect-1.0', 'terrainseg'], **gst)
        if str(plugin) not in answer:
            sys.exit('gst-inspect-1.0 answers from another plugin than the installed one')

        # The rover's page, where it is built: it finds its parts.
        for rover in image.rglob('bin/terrainseg-rover'):
            run([str(rover), '--help'], **gst)
            only(image, 'page.html')
            only(image, 'terrainseg-rover.service')

        # The files say where they will be installed; this test looks at them where they are now.
        configs = root / 'pkgconfig'
        configs.mkdir()
        for name in ('terrainseg', 'gstreamer-terrainseg-1.0'):
            text = only(image, f'{name}.pc').read_text()
            prefix = next(line.split('=', 1)[1] for line in text.splitlines() if line.startswith('prefix='))
            (configs / f'{name}.pc').write_text(text.replace(f'prefix={prefix}', f'prefix={image}{prefix}', 1))
        for package, program, compiler in PROGRAMS:
            flags = shlex.split(run(['pkg-config', '--cflags', '--libs', package], PKG_CONFIG_PATH=str(configs)))
            source = root / f'{package}.source'
            source.write_text(program)
            run([*compiler.split(), str(source), '-x', 'none', '-o', str(root / package), *flags])
            run([str(root / package)], **gst)

        # What was installed goes again, folders that it made included.
        run(['ninja', '-C', str(build), 'uninstall'])
        left = [str(path.relative_to(image)) for path in image.rglob('*')]
        if left:
            sys.exit(f'ninja uninstall leaves {left}')

    # The uninstalled tree serves programs too.
    with tempfile.TemporaryDirectory() as folder:
        for package, program, compiler in PROGRAMS:
            source, out = pathlib.Path(folder) / f'{package}.source', pathlib.Path(folder) / package
            source.write_text(program)
            run(['meson', 'devenv', '-C', str(build), 'sh', '-c',
                 f'{compiler} {source} -x none -o {out} $(pkg-config --cflags --libs {package}) && {out}'])


if __name__ == '__main__':
    main()
