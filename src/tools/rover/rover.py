# SPDX-License-Identifier: LGPL-2.1-or-later
"""The camera's pipeline and its consumers. Frames pass terrainseg once. Pictures, recordings and WebRTC are separate pipelines that
get references to the frames, so errors, full disks and slow encoders do not affect the camera."""
import array
import math
import os
import pathlib
import re
import shutil
import threading
import time

import gi

gi.require_version('Gst', '1.0')
gi.require_version('GstApp', '1.0')
from gi.repository import GLib, GObject, Gst, GstApp  # noqa: E402,F401 (GstApp: methods of appsrc and appsink)

from filter_settings import (FLAGS, KEYS, NOT_KEPT, WINDOW_IN_PIXELS, fields_of, horizon_of, read_group, rect_text,  # noqa: E402
                             rectangles_of, regions_text, set_horizon, set_text, settings_of, stock_of, text_of, write_settings)

SCENE = 'terrainscenesrc is-live=true ! video/x-raw,format=I420,width=640,height=360,framerate=30/1'
CAMERA = 'v4l2src ! decodebin'
FIRST_FRAME, SILENCE, RETRY = 15, 3, 1  # seconds: limit for the first frame, limit without a frame, interval between two attempts
LEAST_DISK = 300_000_000  # minimum free space in bytes during a recording
RECORDING = re.compile(r'rover-\d{8}-\d{6}\.(mcap|jsonl)')
MOST_REGIONS = 32
PICTURES = ('videoscale ! video/x-raw,width=[16,{width}],pixel-aspect-ratio=1/1 ! terrainoverlay name=overlay ! videoconvert '
            # JPEG is full range: without a conversion the pictures would be grey.
            '! video/x-raw,format=I420,colorimetry=1:4:0:0 ! jpegenc quality=70 ! appsink name=out sync=false max-buffers=1 drop=true emit-signals=true')
ENCODE = ('videoconvert ! video/x-raw,format=I420 ! x264enc bframes=0 tune=zerolatency speed-preset=ultrafast key-int-max=30 '
          '! h264parse config-interval=-1 ! ')


def has(*elements):
    return all(Gst.ElementFactory.find(name) for name in elements)


def number(value, least=0.0, most=1.0):
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not least <= value <= most:
        raise ValueError(f'{value!r} is not a number from {least:g} to {most:g}')
    return float(value)


def numbers_of(fields, name, kind):
    buffer = fields.get_value(name)
    return array.array(kind, buffer.extract_dup(0, buffer.get_size())) if buffer else array.array(kind)


class Feed:
    """A pipeline behind an appsrc, which queues `depth` frames. If it is slower than the camera, the oldest frame is dropped."""

    def __init__(self, main, description, depth):
        self.pipeline = Gst.parse_launch('appsrc name=in is-live=true format=time leaky-type=downstream max-bytes=0 max-time=0 '
                                         f'max-buffers={depth} ! {description}')
        self.source = self.get('in')
        # Frames keep the time stamps of the camera's pipeline.
        self.pipeline.use_clock(main.get_clock())
        self.pipeline.set_start_time(Gst.CLOCK_TIME_NONE)
        self.pipeline.set_base_time(main.get_base_time())

    def get(self, name):
        return self.pipeline.get_by_name(name)

    def start(self):
        self.pipeline.set_state(Gst.State.PLAYING)
        return self

    def error(self):
        message = self.pipeline.get_bus().pop_filtered(Gst.MessageType.ERROR)
        return message and message.parse_error()[0].message

    def end(self, wait=0):
        """Stops it; with `wait` (seconds) it finishes queued frames first. Returns its error, if any."""
        error = self.error()
        if wait and not error:
            self.source.emit('end-of-stream')
            message = self.pipeline.get_bus().timed_pop_filtered(wait * Gst.SECOND, Gst.MessageType.EOS | Gst.MessageType.ERROR)
            if not message:
                error = f'it did not end within {wait} s'
            elif message.type == Gst.MessageType.ERROR:
                error = message.parse_error()[0].message
        self.pipeline.set_state(Gst.State.NULL)
        return error


def said_in(message):
    """The sentence of an error and its detail, without the place in GStreamer's source."""
    error, debug = message.parse_error()
    return ': '.join([error.message.rstrip('. ')] + [line.rstrip('. ') for line in (debug or '').splitlines()[1:2]])


class Rover:
    def __init__(self, options, log):
        self.options, self.log = options, log
        self.folder = pathlib.Path(options.folder)
        self.recordings = self.folder / 'recordings'
        self.recordings.mkdir(parents=True, exist_ok=True)
        self.lock = threading.RLock()
        self.picture_came = threading.Condition(self.lock)
        self.feeds = {}           # by name: pictures, recording, webrtc
        self.watchers = {'pictures': 0, 'webrtc': 0}
        self.makers = {'pictures': self.make_pictures}
        self.picture, self.pictures = None, 0
        self.sample, self.frames, self.came = None, 0, 0.0
        self.camera, self.begun, self.begun_at, self.retry_at = None, 0, 0.0, 0.0
        self.problem, self.note = 'the camera has not started yet', ''
        self.recording, self.wants_recording = None, False
        self.regions, self.size = [], None
        self.made, self.made_at, self.rate, self.rate_at = None, 0.0, 0.0, (0, time.monotonic())
        self.warned, self.stock = set(), {}
        self.pipeline = Gst.parse_launch('queue name=start leaky=downstream max-size-buffers=1 max-size-bytes=0 max-size-time=0 '
                                         '! terrainseg name=terrain ! appsink name=out sync=false max-buffers=1 emit-signals=true')
        self.terrain = self.pipeline.get_by_name('terrain')
        self.pipeline.get_by_name('out').connect('new-sample', self.on_frame)
        self.load_settings()
        Gst.parse_bin_from_description(self.source(), True)  # an invalid source ends the program at the start
        bus = self.pipeline.get_bus()
        bus.add_signal_watch()
        bus.connect('message', self.on_message)

    # The camera

    def source(self):
        named = {'scene': SCENE, 'camera': CAMERA}
        return f"{named.get(self.options.source, self.options.source)} ! videoconvert ! capsfilter caps=\"video/x-raw,format={{I420,NV12}}\""

    def start(self):
        self.begun, self.begun_at = self.frames, time.monotonic()
        self.camera = Gst.parse_bin_from_description(self.source(), True)
        self.pipeline.add(self.camera)
        self.camera.link(self.pipeline.get_by_name('start'))
        if 'start-time' not in dict(self.options.properties):
            self.terrain.set_property('start-time', str(time.time_ns()))
        if self.pipeline.set_state(Gst.State.PLAYING) == Gst.StateChangeReturn.FAILURE:
            message = self.pipeline.get_bus().pop_filtered(Gst.MessageType.ERROR)
            self.fail(said_in(message) if message else 'the camera cannot be started')

    def stop(self):
        """Stops the feeds and the camera."""
        if self.recording:
            self.stop_recording(again=True)
        self.pipeline.set_state(Gst.State.NULL)
        for name in list(self.feeds):
            self.drop_feed(name)
        if self.camera:
            self.pipeline.remove(self.camera)
            self.camera = None

    def fail(self, reason):
        if reason != self.problem:
            self.log(3, f'camera: {reason}; trying again every {RETRY} s')
        self.problem, self.retry_at = reason, time.monotonic() + RETRY
        self.stop()

    def on_message(self, _bus, message):
        if message.type == Gst.MessageType.ERROR:
            self.fail(said_in(message))
        elif message.type == Gst.MessageType.EOS:
            self.fail('the source has ended')
        elif message.type == Gst.MessageType.WARNING:
            text = message.parse_warning()[0].message
            if text not in self.warned and len(self.warned) < 100:
                self.warned.add(text)
                self.log(4, text)
            self.note = text

    def report(self, level, text):
        """Reports to the log and the page; repetitions are logged once."""
        if text != self.note:
            self.log(level, text)
        self.note = text

    def watch(self):
        """Called four times a second: restarts a failed camera, and checks the feeds."""
        now = time.monotonic()
        if not self.camera:
            if now >= self.retry_at:
                self.start()
        elif self.frames == self.begun:
            if now - self.begun_at > FIRST_FRAME:
                self.fail(f'no frame within {FIRST_FRAME} s')
        elif now - self.came > SILENCE:
            self.fail(f'no frame for {SILENCE} s')
        elif self.problem:
            self.problem = None
            self.log(6, f'camera: frames of {self.size[0]}x{self.size[1]}')
            if self.wants_recording and not self.recording:
                self.start_recording()
        with self.lock:
            failed = [(name, error) for name, feed in self.feeds.items() if (error := feed.error())]
        for name, error in failed:
            if name == 'recording':
                self.stop_recording(error)
            else:
                self.drop_feed(name)
                self.report(4, f'{name}: {error}')
        if self.recording and shutil.disk_usage(self.recordings).free < LEAST_DISK:
            self.stop_recording()
            self.report(4, 'recording: ended, the disk is nearly full')
        if now - self.rate_at[1] >= 2:
            self.rate = (self.frames - self.rate_at[0]) / (now - self.rate_at[1])
            self.rate_at = self.frames, now
        return True

    # Frames

    def on_frame(self, sink):
        sample = sink.emit('pull-sample')
        if not sample:
            return Gst.FlowReturn.EOS
        with self.lock:
            self.sample, self.frames, self.came = sample, self.frames + 1, time.monotonic()
            caps = sample.get_caps().get_structure(0)
            self.fit_regions((caps.get_value('width'), caps.get_value('height')))
            missing = [name for name, count in self.watchers.items() if count and name in self.makers and name not in self.feeds]
            for name in missing:
                self.feeds[name] = self.makers[name]().start()
            feeds = list(self.feeds.values())
        for feed in feeds:
            feed.source.emit('push-sample', sample)
        return Gst.FlowReturn.OK

    def make_view(self, description):
        """A feed of frames with the free space drawn on them."""
        feed = Feed(self.pipeline, description.format(width=self.options.width), 1)
        self.terrain.bind_property('overlay-style', feed.get('overlay'), 'overlay-style', GObject.BindingFlags.SYNC_CREATE)
        return feed

    def make_pictures(self):
        feed = self.make_view(PICTURES)
        feed.get('out').connect('new-sample', self.on_picture)
        return feed

    def on_picture(self, sink):
        sample = sink.emit('pull-sample')
        if sample:
            buffer = sample.get_buffer()
            with self.picture_came:
                self.picture, self.pictures = buffer.extract_dup(0, buffer.get_size()), self.pictures + 1
                self.picture_came.notify_all()
        return Gst.FlowReturn.OK

    def next_picture(self, seen, wait):
        """Waits for a picture with another number than `seen`. Returns number and picture; None after `wait` seconds."""
        with self.picture_came:
            self.picture_came.wait_for(lambda: self.pictures != seen, wait)
            return self.pictures, self.picture if self.pictures != seen else None

    def begin_watching(self, name):
        with self.lock:
            self.watchers[name] += 1
            return self.pictures

    def end_watching(self, name):
        with self.lock:
            self.watchers[name] -= 1
            unwatched = not self.watchers[name]
        if unwatched:
            self.drop_feed(name)

    def drop_feed(self, name, wait=0):
        with self.lock:
            feed = self.feeds.pop(name, None)
        return feed.end(wait) if feed else None

    # Status

    def status(self):
        """The status as a JSON-compatible dictionary; updated at most five times a second for all viewers."""
        with self.lock:
            now = time.monotonic()
            if not self.made or now - self.made_at > 0.2:
                self.made, self.made_at = self.read_status(now), now
            return self.made

    def read_status(self, now):
        values = {name: text_of(self.terrain, name) for name, _ in KEYS}
        if self.stock.get('preset') != values['preset']:
            stock = stock_of(self.terrain)
            self.stock = {name: text_of(stock, name) for name, _ in KEYS}
        status = {'frames': self.frames, 'age': round(now - self.came, 2) if self.frames else None, 'problem': self.problem, 'note': self.note,
                'rate': round(self.rate, 1), 'viewers': sum(self.watchers.values()), 'feeds': sorted(self.feeds), 'settings': values,
                'changed': [name for name, value in values.items() if value != self.stock[name]],
                'learning': self.terrain.get_property('learning'), 'recording': None, 'recordings': self.recorded(),
                'saved': [name for name, path in (('terrain', self.terrain_file()), ('settings', pathlib.Path(self.options.settings))) if path.exists()]}
        if self.recording:
            path, since = self.recording
            status['recording'] = {'name': path.name, 'seconds': round(now - since)}
        fields = self.sample and fields_of(self.sample.get_buffer())
        if fields:
            status.update(self.read_frame(fields, self.sample.get_buffer()))
        return status

    def read_frame(self, fields, buffer):
        get, of_stats = fields.get_value, self.terrain.get_property('stats').get_value
        width, height = get('frame-width'), get('frame-height')
        flags = get('flags')
        boundary = numbers_of(fields, 'boundary', 'H')
        # The columns of the mask above the window.
        scale = len(boundary) / max(1, get('mask-w'))
        first = max(0, int((get('window-x') - get('mask-x')) * scale))
        last = max(first + 1, math.ceil((get('window-x') + get('window-w') - get('mask-x')) * scale))
        ahead = boundary[first:last]
        unknown = bool(flags & 8)
        return {'size': [width, height], 'flags': [word for bit, word in FLAGS if flags & bit],
                'free': None if unknown or not ahead else round(1 - max(ahead) / height, 4),
                'metres': None if unknown else self.metres(buffer, first, last),
                'traversable': get('traversable-permille') / 1000, 'confidence': round(get('confidence') / 255, 3),
                'horizon': None if get('horizon-row') < 0 else round(get('horizon-row') / height, 4),
                'window': [round(get(f'window-{side}') / whole, 5) for side, whole in zip('xywh', (width, height) * 2)],
                'regions': [[x / width, y / height, w / width, h / height] for x, y, w, h in self.regions],
                'hint': horizon_of(self.terrain), 'lesson': self.lesson(flags), 'generation': get('model-generation'),
                'ms': round(of_stats('total-median-us') / 1000, 2), 'learned': of_stats('learned'), 'seen': of_stats('frames')}

    def lesson(self, flags):
        """Why the window is not learned; empty if it is."""
        if not self.terrain.get_property('learning'):
            return 'learning is switched off'
        if not self.terrain.get_property('near-clear'):
            return 'the near-range sensor reports an obstacle (near-clear=false)'
        if flags & 64:
            return 'the window shows the vehicle or a still picture: move it onto the ground'
        if flags & 4:
            return 'too few usable pixels in the window'
        return 'this frame was not to be learned' if flags & 2 else ''

    @staticmethod
    def metres(buffer, first, last):
        """The shortest range ahead of the window in metres, and whether it is free up to range-max."""
        meta = buffer.get_custom_meta('GstTerrainMetricMeta')
        if not meta:
            return None
        fields = meta.get_structure()
        ranges = [each for each in numbers_of(fields, 'ranges', 'f')[first:last] if not math.isnan(each)]
        if not ranges:
            return None
        nearest = min(ranges)
        return {'free': math.isinf(nearest), 'value': round(fields.get_value('range-max') if math.isinf(nearest) else nearest, 2)}

    def keys(self):
        """Description of the settings for the page."""
        for name, step in KEYS:
            spec = self.terrain.find_property(name)
            entry = {'name': name, 'blurb': spec.blurb}
            if spec.value_type.is_a(GObject.TYPE_ENUM):
                entry['choices'] = [value.value_nick for _, value in sorted(type(self.terrain.get_property(name)).__enum_values__.items())]
            elif spec.value_type == GObject.TYPE_BOOLEAN:
                entry['choices'] = ['false', 'true']
            else:
                entry.update(least=spec.minimum, most=spec.maximum, step=step)
            yield entry

    # What is set

    def set_key(self, name, text):
        if name not in dict(KEYS):
            raise ValueError('this setting is not offered')
        if text is None:
            self.terrain.emit('unset-property', name)
        elif isinstance(text, str) and re.fullmatch(r'[a-z0-9.-]{1,40}', text):
            set_text(self.terrain, name, text)
        else:
            raise ValueError('this is not a value')

    def set_window(self, sides):
        """Sets the window in fractions of the frame; None = the default of the preset."""
        if sides is None:
            for name in ('window-rect', *WINDOW_IN_PIXELS):
                self.terrain.emit('unset-property', name)
            return
        x, y, width, height = self.rectangle(sides)
        self.terrain.set_property('window-rect', rect_text(x, y, width, height))

    @staticmethod
    def rectangle(sides):
        """Limits it to the frame and rounds to 1/100000, the resolution of window-rect."""
        if not isinstance(sides, list) or len(sides) != 4:
            raise ValueError('a rectangle is [x, y, width, height]')
        x, y, width, height = (round(1e5 * number(side)) for side in sides)
        width, height = min(width, 100000 - x), min(height, 100000 - y)
        if width < 1000 or height < 1000:
            raise ValueError('this rectangle is too small')
        return x / 1e5, y / 1e5, width / 1e5, height / 1e5

    def frame_size(self):
        if not self.size:
            raise ValueError('the camera has given no frame yet')
        return self.size

    def add_region(self, sides):
        with self.lock:
            if len(self.regions) >= MOST_REGIONS:
                raise ValueError(f'at most {MOST_REGIONS} regions are possible')
            width, height = self.frame_size()
            x, y, w, h = self.rectangle(sides)
            left, top = round(x * width), round(y * height)
            self.put_regions([*self.regions, (left, top, max(1, round((x + w) * width) - left), max(1, round((y + h) * height) - top))])

    def remove_regions(self, point):
        """Removes the regions that contain a point."""
        if not isinstance(point, list) or len(point) != 2:
            raise ValueError('a point is [x, y]')
        with self.lock:
            x, y = (number(at) * side for at, side in zip(point, self.frame_size()))
            self.put_regions([(left, top, w, h) for left, top, w, h in self.regions if not (left <= x < left + w and top <= y < top + h)])

    def put_regions(self, regions):
        self.regions = regions
        Gst.util_set_object_arg(self.terrain, 'ignore-regions', regions_text(regions))

    def fit_regions(self, size):
        """Converts the regions to pixels after a change of the frame size; they keep their position in the picture."""
        before, self.size = self.size, size
        if before and before != size and self.regions:
            across, down = size[0] / before[0], size[1] / before[1]
            self.put_regions([(round(x * across), round(y * down), max(1, round(w * across)), max(1, round(h * down))) for x, y, w, h in self.regions])

    def set_horizon(self, row):
        """Sets where level ground ends as a fraction of the height; None = the filter finds it."""
        set_horizon(self.terrain, None if row is None else number(row))

    def set_learning(self, on):
        if not isinstance(on, bool):
            raise ValueError('learning is true or false')
        self.terrain.set_property('learning', on)

    # What is kept

    def load_settings(self):
        """Applies the settings file, then the command line; all or, if a value is invalid, none of it."""
        kept = read_group(self.options.settings)
        trial = Gst.ElementFactory.make('terrainseg')
        for name, text in [*kept.items(), *self.options.properties]:
            set_text(trial, name, text)
        self.regions = []
        for spec in self.terrain.list_properties():
            if spec.name not in NOT_KEPT:
                self.terrain.emit('unset-property', spec.name)
        for name, text in [*kept.items(), *self.options.properties]:
            regions = name == 'ignore-regions'  # the Python bindings cannot read its value
            if regions or not self.terrain.find_property(name) or text_of(self.terrain, name) != text:  # some can be set only before the start
                set_text(self.terrain, name, text)
            if regions:
                self.regions = rectangles_of(text)
        if not self.regions:
            self.put_regions([])

    def save_settings(self):
        with self.lock:
            fields = self.sample and fields_of(self.sample.get_buffer())
        write_settings(self.options.settings, settings_of(self.terrain, self.regions, fields))

    def terrain_file(self):
        return self.folder / 'saved.terrain'

    def save_terrain(self):
        if not self.terrain.emit('save-model', str(self.terrain_file())):
            raise ValueError('nothing has been learned yet, or the disk is full')

    def load_terrain(self):
        if not self.terrain.emit('load-model', str(self.terrain_file())):
            raise ValueError('there is no saved terrain that fits')

    # Recordings

    def recorded(self):
        """Names and sizes of finished recordings, the newest first."""
        names = sorted(filter(RECORDING.fullmatch, os.listdir(self.recordings)), reverse=True)
        return [[name, (self.recordings / name).stat().st_size] for name in names[:20]]

    def recording_file(self, name):
        """The path of a finished recording; None if that name does not exist."""
        return self.recordings / name if RECORDING.fullmatch(name) and (self.recordings / name).is_file() else None

    def start_recording(self):
        with self.lock:
            self.wants_recording = True
            if self.problem:
                self.note = 'recording: starts with the first frame of the camera'
            if self.recording or self.problem:
                return
            mcap = has('terrainmcapsink')
            path = self.recordings / time.strftime(f'rover-%Y%m%d-%H%M%S.{"mcap" if mcap else "jsonl"}')
            if path.exists():
                raise ValueError('a recording of this second already exists')
            if mcap:
                feed = Feed(self.pipeline, f"{ENCODE if has('x264enc', 'h264parse') else ''}terrainmcapsink name=file sync=false", 8)
                for name in 'camera-info', 'mount':
                    feed.get('file').set_property(name, self.terrain.get_property(name))
                feed.get('file').set_property('location', str(path))
            else:
                feed = Feed(self.pipeline, 'terrainextract json-mask=true ! application/x-ndjson ! filesink name=file sync=false', 8)
                feed.get('file').set_property('location', f'{path}.part')
            self.feeds['recording'] = feed.start()
            self.recording = path, time.monotonic()
        self.report(6, f'recording: {path.name}')

    def stop_recording(self, error=None, again=False):
        """Finishes the recording, unless it has failed. `again`: another one starts with the camera."""
        with self.lock:
            ended, self.recording = self.recording, None
            self.wants_recording = again
        if not ended:
            return
        later = self.drop_feed('recording', 0 if error else 5)
        error = error or later  # the first error has the cause
        part = pathlib.Path(f'{ended[0]}.part')
        if ended[0].suffix == '.jsonl' and part.exists():
            part.rename(ended[0])
        self.report(4 if error else 6, f'recording: {error or "ended"}')
