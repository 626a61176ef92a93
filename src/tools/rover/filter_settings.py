# SPDX-License-Identifier: LGPL-2.1-or-later
"""Settings of a terrainseg element as text and as a file: shared by terrainseg-rover and examples/tune.sh."""
import os
import pathlib
import re

import gi

gi.require_version('Gst', '1.0')
from gi.repository import GLib, GObject, Gst  # noqa: E402

# The ten properties that both programs offer, and the step of one press of + or -.
KEYS = (('preset', 1), ('caution', 2), ('doubtful', 4), ('window-sigma', 0.25), ('forget-shift', 1), ('connected-ground', 1),
        ('odd-spots', 1), ('motion', 1), ('temporal', 1), ('overlay-style', 1))
# Properties that are not saved: display, position in the pipeline, temporary states, and mirrors of other properties.
NOT_KEPT = {'name', 'parent', 'overlay', 'navigation', 'post-messages', 'settings-location', 'model-location', 'instance',
            'stages', 'qos', 'learning', 'near-clear', 'n-threads', 'ignore-regions', 'start-time'}
WINDOW_IN_PIXELS = ('window-x', 'window-bottom', 'window-width', 'window-height')
FLAGS = ((1, 'learned'), (2, 'frozen'), (4, 'starved'), (8, 'unknown'), (16, 'horizon held'), (32, 'blocked'),
         (64, 'window still'))


def fields_of(buffer):
    meta = buffer.get_custom_meta('GstTerrainSegMeta')
    return meta.get_structure() if meta else None


def text_of(element, name):
    """The value of a property as text for gst-launch-1.0 and a settings file."""
    spec = element.find_property(name)
    value = element.get_property(name)
    if spec.value_type.is_a(GObject.TYPE_ENUM):
        return value.value_nick
    if isinstance(value, float):
        return f'{value:g}'
    if isinstance(value, bool):
        return 'true' if value else 'false'
    return '' if value is None else str(value)


def rectangles_of(text):
    """<<x, y, width, height>, ...> as a list of tuples."""
    numbers = [int(number) for number in re.findall(r'-?\d+', re.sub(r'\([a-z]+\)', '', text))]
    return list(zip(*[iter(numbers)] * 4))


def regions_text(regions):
    return '<' + ','.join('<(int){},(int){},(int){},(int){}>'.format(*each) for each in regions) + '>'


def rect_text(x, y, width, height):
    """Fractions of the frame as the text of window-rect."""
    return ','.join(f'{side:.5f}'.rstrip('0').rstrip('.') for side in (x, y, width, height))


def set_horizon(element, row):
    """Where level ground ends as a fraction of the height, as the pointer says; None where the filter is to find it."""
    if row is None:
        element.emit('unset-property', 'horizon-hint')
    else:
        element.set_property('horizon-hint', round(min(max(row, 0.0), 1.0), 4))


def horizon_of(element):
    """The fraction that was set, or None."""
    row = element.get_property('horizon-hint')
    return None if row < 0 else row


def window_of(element, fields):
    """The training window in fractions: as drawn if that fits the frame, otherwise that of the last frame."""
    width, height = fields.get_value('frame-width'), fields.get_value('frame-height')
    x, bottom, w, h = (element.get_property(name) for name in WINDOW_IN_PIXELS)
    y = height - bottom - h
    if not (w and h and x >= 0 and x + w <= width and y >= 0):
        x, y, w, h = (fields.get_value(f'window-{side}') for side in 'xywh')
    return x / width, y / height, w / width, h / height


def stock_of(element):
    """A fresh element with the same preset."""
    stock = Gst.ElementFactory.make('terrainseg')
    Gst.util_set_object_arg(stock, 'preset', text_of(element, 'preset'))
    return stock


def settings_of(element, regions, fields=None):
    """The settings that differ from the preset, as pairs of name and text, the preset first. A window in pixels is saved as window-rect,
    which is valid for every frame size, if the metadata (`fields`) of a frame is known."""
    stock = stock_of(element)
    preset = text_of(element, 'preset')
    kept = [('preset', preset)] if preset != 'default' else []
    for spec in element.list_properties():
        writable = spec.flags & GObject.ParamFlags.WRITABLE
        if spec.name in NOT_KEPT or spec.name == 'preset' or not writable:
            continue
        value = text_of(element, spec.name)
        if value != text_of(stock, spec.name):
            kept.append((spec.name, value))
    names = {name for name, _ in kept}
    if fields and names.intersection(WINDOW_IN_PIXELS):
        kept = [pair for pair in kept if pair[0] not in WINDOW_IN_PIXELS]
        if 'window-rect' not in names:
            kept.append(('window-rect', rect_text(*window_of(element, fields))))
    if regions:
        kept.append(('ignore-regions', regions_text(regions)))
    return kept


def read_group(path):
    """The group [terrainseg] of a settings file as a dictionary; empty without a file. Raises ValueError if it cannot be read."""
    keys = GLib.KeyFile()
    if not os.path.exists(path):
        return {}
    try:
        keys.load_from_file(str(path), GLib.KeyFileFlags.NONE)
        return {key: keys.get_value('terrainseg', key) for key in keys.get_keys('terrainseg')[0]}
    except GLib.Error as error:
        raise ValueError(f'{path}: {error.message}') from None


def write_settings(path, settings):
    """Writes the file atomically; keeps other groups and comments of an existing file."""
    keys = GLib.KeyFile()
    if os.path.exists(path):
        keys.load_from_file(str(path), GLib.KeyFileFlags.KEEP_COMMENTS)
        if keys.has_group('terrainseg'):
            for key in keys.get_keys('terrainseg')[0]:
                keys.remove_key('terrainseg', key)
    for name, value in settings:
        keys.set_value('terrainseg', name, value)
    if not settings:
        keys.set_value('terrainseg', 'preset', 'default')
    part = pathlib.Path(f'{path}.part')
    part.write_text(keys.to_data()[0])
    os.replace(part, path)


def set_text(element, name, value):
    """Sets a property from text; raises ValueError with the reason."""
    spec = element.find_property(name)
    if not spec:
        raise ValueError(f'terrainseg has no property {name}; gst-inspect-1.0 terrainseg lists them')
    # util_set_object_arg() ignores invalid text, and only warns about values out of range.
    least, most = getattr(spec, 'minimum', None), getattr(spec, 'maximum', None)
    try:
        number = least is not None and (int(value, 0) if isinstance(least, int) else float(value))
        in_range = least is None or least <= number <= most
        quoted = value.replace('\\', r'\\').replace('"', r'\"')
        if in_range:
            Gst.parse_launch(f'terrainseg {name}="{quoted}"')
    except (ValueError, GLib.Error):
        raise ValueError(f'{name} = {value!r} is not a {spec.value_type.name}; gst-inspect-1.0 terrainseg lists the values') from None
    if not in_range:
        raise ValueError(f'{name} = {value}: must be {least}..{most}')
    Gst.util_set_object_arg(element, name, value)
