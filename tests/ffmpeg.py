# SPDX-License-Identifier: LGPL-2.1-or-later
"""Files that ffmpeg makes for tests, whatever version of it is there."""
import functools
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
