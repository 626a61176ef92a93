# SPDX-License-Identifier: LGPL-2.1-or-later
"""Files that ffmpeg makes for tests, whatever version of it is there."""
import functools
import pathlib
import subprocess


def ffmpeg(*arguments):
    subprocess.run(['ffmpeg', '-nostdin', '-v', 'error', '-y', *map(str, arguments)], check=True)


@functools.cache
def has_display_rotation():
    return '-display_rotation' in subprocess.run(['ffmpeg', '-h', 'full'], capture_output=True, text=True).stdout


def mark_turned(video, angle, to):
    """A copy whose tag says that the camera was turned, as a phone's does; from version 6 on the old metadata makes no tag."""
    if has_display_rotation():
        ffmpeg('-display_rotation', angle, '-i', video, '-c', 'copy', to)
    else:
        ffmpeg('-i', video, '-c', 'copy', '-metadata:s:v', f'rotate={angle}', to)


def drive(to, size=(640, 360), frames=75, codec='libx264'):
    """The renderer's drive as cameras and phones write it: B-frames, a key frame a second, sound that is as long."""
    raw = f'{to}.raw'
    caps = f'video/x-raw,format=I420,width={size[0]},height={size[1]},framerate=30/1'
    subprocess.run(['gst-launch-1.0', '-q', *f'terrainscenesrc num-buffers={frames} ! {caps} ! filesink location={raw}'.split()], check=True)
    quiet = ('-x265-params', 'log-level=none') if codec == 'libx265' else ()
    ffmpeg('-f', 'rawvideo', '-pix_fmt', 'yuv420p', '-s', '{}x{}'.format(*size), '-r', 30, '-i', raw, '-f', 'lavfi', '-i', 'sine=300',
           '-c:v', codec, '-preset', 'ultrafast', '-bf', 3, '-g', 30, *quiet, '-c:a', 'aac', '-t', frames / 30, to)
    pathlib.Path(raw).unlink()
    return to
