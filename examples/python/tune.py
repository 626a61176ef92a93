#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""The window of examples/tune.sh, which starts this program and describes its use."""
import argparse
import os
import pathlib
import shlex
import sys

import gi

gi.require_version('Gst', '1.0')
gi.require_version('GstVideo', '1.0')
from gi.repository import GLib, GObject, Gst, GstVideo  # noqa: E402

import find_plugin  # noqa: E402
sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / 'src/tools/rover'))
from filter_settings import (FLAGS, KEYS, fields_of, horizon_of, read_group, rectangles_of, set_horizon, set_text,  # noqa: E402
                             settings_of, stock_of, text_of, write_settings)

PANEL, PANEL_HEIGHT = 380, 590  # pixels beside the picture
HELP = '''1..9 0  choose    + -  change
Backspace  as the preset has it
left drag   training window
right drag  region to ignore
right click removes it
middle drag, or h at the pointer
            where level ground ends
n the filter finds that itself
Space pause   . step   r forget
l learning on/off   q leave'''


def fail(message):
    sys.exit(f'tune.sh: {message}')


def source_of(what):
    if what == 'scene':
        return 'terrainscenesrc is-live=true ! video/x-raw,format=I420,width=640,height=360,framerate=30/1'
    if what == 'camera':
        return os.environ.get('SOURCE', 'v4l2src ! decodebin') + ' ! videoconvert ! video/x-raw,format=NV12 ! queue leaky=downstream max-size-buffers=1'
    if not os.access(what, os.R_OK):
        fail(f'{what} cannot be read; use a video file, camera or scene')
    return find_plugin.upright(what)


class Tuner:
    """A pipeline with a window, what keys and pointer do to it, and what is written beside the picture."""

    def __init__(self, options):
        self.options = options
        self.loop = GLib.MainLoop()
        self.chosen = 0
        self.paused = self.stepping = self.ended = False
        self.status = 0
        self.warned = set()
        self.fields = None
        self.live = options.what in ('camera', 'scene')
        self.pipeline = Gst.parse_launch(
            f'{source_of(options.what)} ! terrainseg name=terrain overlay=true navigation=true '
            f'! videoconvert ! videoscale ! video/x-raw,format=BGRx,width={options.width},pixel-aspect-ratio=1/1 '
            '! textoverlay name=line font-desc="Monospace 8" halignment=left valignment=position xpad=0 wrap-mode=none '
            'shaded-background=false '
            f'! videobox name=box right=-{PANEL} ! textoverlay name=text font-desc="Monospace 10" halignment=left valignment=top '
            f'line-alignment=left xpad={options.width + 10} ypad=6 wrap-mode=none auto-resize=false '
            f'! videoconvert ! {options.sink} name=sink')
        self.terrain, self.text = (self.pipeline.get_by_name(name) for name in ('terrain', 'text'))
        self.regions = []
        self.pointer_row = None  # of the pointer, as a fraction of the height
        self.dragging = False
        self.apply_settings()
        pad = self.terrain.get_static_pad('src')
        pad.add_probe(Gst.PadProbeType.BUFFER, self.on_frame)
        pad.add_probe(Gst.PadProbeType.EVENT_UPSTREAM, self.on_event)
        pad.add_probe(Gst.PadProbeType.EVENT_DOWNSTREAM, self.on_caps)
        bus = self.pipeline.get_bus()
        bus.add_signal_watch()
        bus.connect('message', self.on_message)

    def apply_settings(self):
        group = read_group(self.options.settings)
        if group:
            self.terrain.set_property('settings-location', self.options.settings)
            print(f'tune.sh: starts with the settings of {self.options.settings}', file=sys.stderr)
        self.regions = rectangles_of(group.get('ignore-regions', ''))
        for name, value in self.options.properties:
            set_text(self.terrain, name, value)
            if name == 'ignore-regions':
                self.regions = rectangles_of(value)

    # What is seen

    def on_frame(self, _pad, info):
        self.fields = fields_of(info.get_buffer())
        self.write_panel()
        if self.stepping:
            self.stepping = False
            GLib.idle_add(self.hold)
        return Gst.PadProbeReturn.OK

    def make_room(self, caps):
        """Below a picture that is lower than the panel; before the sink makes its window."""
        read = GstVideo.VideoInfo.new_from_caps(caps)
        if read:
            height = self.options.width * read.height * read.par_d // (read.width * read.par_n)
            self.pipeline.get_by_name('box').set_property('bottom', -max(0, PANEL_HEIGHT - height))

    def draw_line(self):
        row, line = horizon_of(self.terrain), self.pipeline.get_by_name('line')
        line.set_property('text', '' if row is None else '\u2500' * (self.options.width // 12) + ' ground ends')
        line.set_property('ypos', row or 0)

    def write_panel(self):
        self.draw_line()
        self.text.set_property('text', '\n'.join([*self.value_lines(), '', *self.number_lines(), '', HELP]))

    def value_lines(self):
        stock = stock_of(self.terrain)
        for index, (name, _) in enumerate(KEYS):
            value = text_of(self.terrain, name)
            changed = '*' if value != text_of(stock, name) else ' '
            yield f"{'>' if index == self.chosen else ' '}{(index + 1) % 10} {name:<17}{value}{changed}"

    def number_lines(self):
        state = 'paused' if self.paused else 'end of the video' if self.ended else 'playing'
        if self.fields is None:
            return [state]
        get = self.fields.get_value
        of_stats = self.terrain.get_property('stats').get_value
        horizon = 'none' if get('horizon-row') < 0 else f"row {get('horizon-row')}"
        flags = ', '.join(word for bit, word in FLAGS if get('flags') & bit)
        frames = of_stats('frames')
        learned = f"learned {of_stats('learned')} of {frames} {'frame' if frames == 1 else 'frames'}"
        window = ' '.join(str(get(f'window-{side}')) for side in 'xywh')
        return [f"{state}, frame {get('frame')}, {get('frame-width')}x{get('frame-height')}",
                f"horizon     {horizon}, sure {100 * get('horizon-confidence') // 255} %",
                f"ground ends {'as the filter finds' if horizon_of(self.terrain) is None else f'{horizon_of(self.terrain):.1%} from the top'}",
                f"confidence  {100 * get('confidence') // 255} %",
                f"traversable {get('traversable-permille') / 10:.1f} %",
                f'window      {window}', f'ignored     {len(self.regions)}',
                learned, f"model generation {get('model-generation')}",
                f"skipped: starved {of_stats('skipped-starved')}, frozen {of_stats('skipped-frozen')}",
                f'flags: {flags}', f"filter {of_stats('total-median-us') / 1000:.2f} ms a frame"]

    # What is done

    def on_caps(self, _pad, info):
        event = info.get_event()
        if event.type == Gst.EventType.CAPS:
            self.make_room(event.parse_caps())
        return Gst.PadProbeReturn.OK

    def on_event(self, _pad, info):
        fields = info.get_event().get_structure()
        if fields and fields.get_name() == 'application/x-gst-navigation':
            if fields.get_string('event') == 'key-press':
                GLib.idle_add(self.on_key, fields.get_string('key'))
            elif self.fields and fields.has_field('pointer_y'):
                button = fields.get_value('button') if fields.has_field('button') else 0
                row = fields.get_value('pointer_y') / self.fields.get_value('frame-height')
                GLib.idle_add(self.on_pointer, fields.get_string('event'), button, row)
        return Gst.PadProbeReturn.OK

    def on_pointer(self, event, button, row):
        """The middle button drags the line at which level ground ends."""
        self.pointer_row = row
        if button == 2:
            self.dragging = event == 'mouse-button-press'
        if self.dragging or (button == 2 and event == 'mouse-button-release'):
            self.set_line(row)
        return False

    def set_line(self, row):
        set_horizon(self.terrain, row)
        self.refresh()

    def set_line_at_pointer(self):
        if self.pointer_row is not None:
            self.set_line(self.pointer_row)

    def on_key(self, key):
        actions = {'plus': lambda: self.change(1), 'KP_Add': lambda: self.change(1), 'equal': lambda: self.change(1),
                   'Up': lambda: self.change(1), 'minus': lambda: self.change(-1), 'KP_Subtract': lambda: self.change(-1),
                   'Down': lambda: self.change(-1), 'BackSpace': self.unset, 'space': self.pause, 'period': self.step,
                   'Right': self.step, 'r': self.forget, 'l': self.toggle_learning, 'h': self.set_line_at_pointer, 'n': lambda: self.set_line(None), 'q': self.loop.quit,
                   'Escape': self.loop.quit}
        if key in '0 1 2 3 4 5 6 7 8 9'.split():
            self.chosen = (int(key) - 1) % 10
            self.refresh()
        elif key in actions:
            actions[key]()
        return False

    def change(self, direction):
        name, step = KEYS[self.chosen]
        spec, value = self.terrain.find_property(name), self.terrain.get_property(name)
        if isinstance(value, bool):
            value = not value
        elif spec.value_type.is_a(GObject.TYPE_ENUM):
            values = sorted(type(value).__enum_values__)
            value = values[(values.index(int(value)) + direction) % len(values)]
        else:
            value = min(spec.maximum, max(spec.minimum, value + direction * step))
        self.terrain.set_property(name, value)
        self.refresh()

    def unset(self):
        self.terrain.emit('unset-property', KEYS[self.chosen][0])
        self.refresh()

    def forget(self):
        self.terrain.emit('reset')
        self.refresh()

    def toggle_learning(self):
        self.terrain.set_property('learning', not self.terrain.get_property('learning'))
        self.refresh()

    def seek(self, position):
        return self.pipeline.seek_simple(Gst.Format.TIME, Gst.SeekFlags.FLUSH | Gst.SeekFlags.ACCURATE, position)

    def refresh(self):
        """While nothing moves, the frame that is shown goes through the filter again; a camera has only the panel's words."""
        if self.paused and not self.live:
            known, position = self.pipeline.query_position(Gst.Format.TIME)
            if known and self.seek(position):
                return
        self.write_panel()

    def hold(self):
        self.paused = True
        self.write_panel()
        self.pipeline.set_state(Gst.State.PAUSED)
        return False

    def pause(self):
        if not self.paused:
            self.hold()
            self.refresh()
        else:
            self.paused = False
            self.pipeline.set_state(Gst.State.PLAYING)

    def step(self):
        if self.live:
            self.stepping = True
            self.pipeline.set_state(Gst.State.PLAYING)
            return
        if not self.paused:
            self.hold()
        self.pipeline.get_by_name('sink').send_event(Gst.Event.new_step(Gst.Format.BUFFERS, 1, 1.0, True, False))

    def on_message(self, _bus, message):
        if message.type == Gst.MessageType.ERROR:
            error, _ = message.parse_error()
            closed = 'window was closed' in error.message
            if not closed:
                print(f'tune.sh: {message.src.get_name()}: {error.message}', file=sys.stderr)
                self.status = 1
            self.loop.quit()
        elif message.type == Gst.MessageType.WARNING:
            text = message.parse_warning()[0].message
            if text not in self.warned:
                print(f'tune.sh: {text}', file=sys.stderr)
            self.warned.add(text)
        elif message.type == Gst.MessageType.EOS:
            self.ended = not self.seek(0)
        elif message.type == Gst.MessageType.ELEMENT and message.has_name('terrainseg-region'):
            self.on_region(message.get_structure())

    def on_region(self, region):
        if region.get_string('kind') == 'ignore':
            place = tuple(region.get_value(name) for name in ('x', 'y', 'width', 'height'))
            if region.get_value('removed'):
                self.regions = [each for each in self.regions if each != place]
            else:
                self.regions.append(place)
        self.refresh()

    # From the first frame to the last

    def run(self):
        self.pipeline.set_state(Gst.State.PLAYING)
        try:
            self.loop.run()
        except KeyboardInterrupt:
            pass
        settings = settings_of(self.terrain, self.regions, self.fields)
        self.pipeline.set_state(Gst.State.NULL)
        if self.status == 0:
            self.say_goodbye(settings)
        return self.status

    def say_goodbye(self, settings):
        properties = ' '.join(f'{name}={shlex.quote(value)}' for name, value in settings)
        print(f'gst-launch-1.0 {source_of(self.options.what)} ! terrainseg {properties}{" " if properties else ""}overlay=true '
              '! videoconvert ! autovideosink', flush=True)
        try:
            write_settings(self.options.settings, settings)
        except OSError as error:
            fail(f'{self.options.settings} cannot be written: {error.strerror}; the line above has the same settings')
        print(f'tune.sh: {self.options.settings} has the same: terrainseg settings-location={shlex.quote(self.options.settings)}, '
              f'terrainseg-process --set settings-location={shlex.quote(self.options.settings)}', file=sys.stderr)


def picture_of(options):
    """The last of some frames with the window drawn, once for each value that is tried, side by side, as PNG."""
    name, values = options.attempt or ('', [''])
    settings = [('settings-location', options.settings)] if read_group(options.settings) else []
    heads, labels = [], []
    for index, value in enumerate(values):
        labels.append(f'{name}={value}' if name else os.path.basename(options.what))
        heads.append(f't. ! queue ! terrainseg name=terrain{index} overlay=true ! videoconvert ! videoscale '
                     f'! video/x-raw,format=BGRx,width={options.width},pixel-aspect-ratio=1/1 '
                     f'! textoverlay name=label{index} font-desc="Monospace 12" auto-resize=false halignment=left valignment=top '
                     f'! appsink name=out{index} sync=false max-buffers=1')
    source = source_of(options.what).replace(' is-live=true', '')
    pipeline = Gst.parse_launch(f'{source} ! tee name=t {" ".join(heads)}')
    for index, value in enumerate(values):
        pipeline.get_by_name(f'label{index}').set_property('text', labels[index])
        element = pipeline.get_by_name(f'terrain{index}')
        for key, text in [*settings, *options.properties, *([(name, value)] if name else [])]:
            set_text(element, key, text)
    png = png_of(last_samples(pipeline, len(values), options.frames))
    try:
        pathlib.Path(options.picture).write_bytes(png)
    except OSError as error:
        fail(f'{options.picture} cannot be written: {error.strerror}')
    print(options.picture)
    return 0


def last_samples(pipeline, count, frames):
    """Of each of the sinks out0, out1, ... the sample of the last of some frames."""
    sinks, bus = [pipeline.get_by_name(f'out{index}') for index in range(count)], pipeline.get_bus()
    last = []
    pipeline.set_state(Gst.State.PLAYING)
    try:
        for _ in range(frames):
            samples = [next_sample(sink, bus) for sink in sinks]
            if not all(samples):
                break
            last = samples
    finally:
        pipeline.set_state(Gst.State.NULL)
    if not last:
        fail('no frame was received')
    return last


def next_sample(sink, bus):
    """None at the end."""
    while True:
        sample = sink.emit('try-pull-sample', Gst.SECOND // 5)
        if sample or sink.get_property('eos'):
            return sample
        message = bus.pop_filtered(Gst.MessageType.ERROR)
        if message:
            fail(f'{message.src.get_name()}: {message.parse_error()[0].message}')


def png_of(samples):
    """Pictures of one size without padding, side by side."""
    get = samples[0].get_caps().get_structure(0).get_value
    width, height = get('width'), get('height')
    pictures = [sample.get_buffer().extract_dup(0, 4 * width * height) for sample in samples]
    rows = (picture[4 * width * row:4 * width * (row + 1)] for row in range(height) for picture in pictures)
    caps = f'video/x-raw,format=BGRx,width={width * len(samples)},height={height},framerate=0/1'
    joined = Gst.Sample.new(Gst.Buffer.new_wrapped(b''.join(rows)), Gst.Caps.from_string(caps), None, None)
    png = GstVideo.video_convert_sample(joined, Gst.Caps.from_string('image/png'), 10 * Gst.SECOND).get_buffer()
    return png.extract_dup(0, png.get_size())


def pair(text):
    name, equal, value = text.partition('=')
    if not (name and equal and value):
        raise argparse.ArgumentTypeError(f'{text} is not PROPERTY=VALUE')
    return name, value


def attempt(text):
    name, value = pair(text)
    return name, value.split(':')


def png_file(text):
    if not text.lower().endswith('.png'):
        raise argparse.ArgumentTypeError(f'{text}: a picture is a PNG, call it NAME.png')
    return text


def main():
    parser = argparse.ArgumentParser(prog='tune.sh', description='A window to tune the filter.')
    parser.add_argument('what', metavar='VIDEO|camera|scene')
    parser.add_argument('properties', metavar='PROPERTY=VALUE', nargs='*', type=pair, help='initial settings')
    parser.add_argument('--settings', default='terrainseg.settings', help='file that is read at the start and written on exit (%(default)s)')
    parser.add_argument('--width', type=int, default=800, help='width of the picture in the window, pixels (%(default)s)')
    parser.add_argument('--sink', default='ximagesink', help='the video sink (%(default)s)')
    parser.add_argument('--picture', metavar='FILE.png', type=png_file, help='no window: write the last frame as a picture')
    parser.add_argument('--try', dest='attempt', metavar='PROPERTY=A:B:C', type=attempt, help='with --picture: one picture per value, side by side')
    parser.add_argument('--frames', type=int, default=60, help='with --picture: number of frames to process (%(default)s)')
    options = parser.parse_args()
    options.width -= options.width % 2
    if not 64 <= options.width <= 4096:
        parser.error('--width must be 64 to 4096')
    find_plugin.init()
    for name in 'textoverlay', 'videobox':
        if not Gst.ElementFactory.find(name):
            fail(f'GStreamer has no {name}: ./install-dependencies.sh tune installs what this needs')
    if not options.picture and not os.environ.get('DISPLAY') and options.sink == 'ximagesink':
        fail('no display (DISPLAY is not set): use --picture FILE.png to draw into a file')
    try:
        return picture_of(options) if options.picture else Tuner(options).run()
    except GLib.Error as error:
        return fail(error.message)
    except ValueError as error:
        return fail(error)


if __name__ == '__main__':
    sys.exit(main())
