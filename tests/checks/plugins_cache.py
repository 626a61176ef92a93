#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Compares docs/plugins/gst_plugins_cache.json, what GStreamer's documentation tools know of the plugins, with the plugins.

usage: plugins_cache.py [--write] BUILD_FOLDER

--write writes the file. Its fields are those of the caches in GStreamer's own modules (docs/plugins/ there), so that hotdoc's
extension for GStreamer reads it without building and loading the plugins.
"""
import difflib
import json
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from check_docs import ONLY_IN_SOME_BUILDS, PLUGINS, load  # noqa: E402

CACHE = pathlib.Path(__file__).resolve().parents[2] / 'docs' / 'plugins' / 'gst_plugins_cache.json'
MUTABLE = ((1 << 12, 'playing'), (1 << 11, 'paused'), (1 << 10, 'ready'))
CONTROLLABLE = 1 << 9


class Cache:
    def __init__(self, GObject, Gst):
        self.GObject, self.Gst = GObject, Gst
        self.types = {}  # of properties of the plugin at work

    def note_type(self, spec):
        gtype = spec.value_type
        is_enum = self.GObject.type_is_a(gtype, self.GObject.TYPE_ENUM)
        if not gtype.name.startswith('GstTerrain') or not (is_enum or self.GObject.type_is_a(gtype, self.GObject.TYPE_FLAGS)):
            return
        gclass = spec.enum_class if is_enum else spec.flags_class
        self.types[gtype.name] = {'kind': 'enum' if is_enum else 'flags', 'values': self.values(gclass, is_enum)}

    def values(self, gclass, is_enum):
        """PyGObject 3.42 makes a Python class of an enumeration, 3.50 shows GLib's own."""
        if is_enum and hasattr(gclass, '__enum_values__'):
            members = [(v.value_name, v.value_nick, int(v)) for v in gclass.__enum_values__.values()]
        elif not is_enum and hasattr(gclass, '__flags_values__'):
            members = [(v.value_names[0], v.value_nicks[0], int(v)) for v in gclass.__flags_values__.values() if int(v)]
        elif is_enum:
            found = (self.GObject.enum_get_value(gclass, i) for i in range(gclass.minimum, gclass.maximum + 1))
            members = [(v.value_name, v.value_nick, v.value) for v in found if v is not None]
        else:
            found = (self.GObject.flags_get_first_value(gclass, 1 << bit) for bit in range(32) if gclass.mask >> bit & 1)
            members = [(v.value_name, v.value_nick, v.value) for v in found]
        form = '{}' if is_enum else '0x{:08x}'
        return [{'desc': desc, 'name': nick, 'value': form.format(value)} for desc, nick, value in sorted(members, key=lambda m: m[2])]

    def property(self, element, spec):
        self.note_type(spec)
        flags = int(spec.flags)
        entry = {'blurb': spec.blurb, 'conditionally-available': False, 'construct': bool(flags & 4),
                 'construct-only': bool(flags & 8), 'controllable': bool(flags & CONTROLLABLE), 'default': self.default(element, spec)}
        if hasattr(spec, 'minimum') and spec.value_type.name in ('gint', 'guint', 'gint64', 'guint64', 'gdouble', 'gfloat'):
            entry['max'], entry['min'] = (f'{v:g}' if isinstance(v, float) else str(v) for v in (spec.maximum, spec.minimum))
        entry['mutable'] = next((name for bit, name in MUTABLE if flags & bit), 'null')
        entry.update(readable=bool(flags & 1), type=spec.value_type.name, writable=bool(flags & 2))
        return entry

    def default(self, element, spec):
        if not int(spec.flags) & 1 or spec.value_type.name in ('GstStructure', 'GstValueArray'):
            return 'NULL'
        value = element.get_property(spec.name)
        if value is None:
            return 'NULL'
        if isinstance(value, bool):
            return str(value).lower()
        if hasattr(value, 'value_nicks'):
            return '+'.join(value.value_nicks)
        if hasattr(value, 'value_nick'):
            return f'{value.value_nick} ({int(value)})'
        return f'{value:g}' if isinstance(value, float) else str(value)

    def element(self, factory):
        element = factory.create(None)
        gtype = type(element).__gtype__
        above, hierarchy = gtype, []
        while above.name != 'void' and above != self.GObject.TYPE_INVALID:
            hierarchy.append(above.name)
            above = self.GObject.type_parent(above) if above != self.GObject.TYPE_OBJECT else self.GObject.TYPE_INVALID
        get = factory.get_metadata
        entry = {'author': get('author'), 'description': get('description'), 'hierarchy': hierarchy, 'klass': get('klass'),
                 'long-name': get('long-name'),
                 'pad-templates': {pad.name_template: {'caps': pad.get_caps().to_string().replace('; ', '\n').replace(';', ''),
                                                       'direction': pad.direction.value_nick, 'presence': pad.presence.value_nick}
                                   for pad in sorted(factory.get_static_pad_templates(), key=lambda pad: pad.name_template)},
                 'properties': {s.name: self.property(element, s) for s in sorted(element.list_properties(), key=lambda s: s.name)
                                if s.owner_type == gtype and s.name not in ONLY_IN_SOME_BUILDS},
                 'rank': {0: 'none'}.get(factory.get_rank(), str(factory.get_rank()))}
        signals = {}
        for name in sorted(self.GObject.signal_list_names(gtype) or ()):
            query = self.GObject.signal_query(name, gtype)
            signals[name] = {'action': bool(int(query.signal_flags) & 32), 'return-type': query.return_type.name, 'when': 'last',
                             'args': [{'name': f'arg{i}', 'type': t.name} for i, t in enumerate(query.param_types)]}
        if signals:
            entry['signals'] = signals
        return entry

    def plugin(self, name):
        registry = self.Gst.Registry.get()
        plugin = registry.find_plugin(name)
        if plugin is None:
            return None
        self.types = {}
        factories = [f for f in registry.get_feature_list_by_plugin(name) if isinstance(f, self.Gst.ElementFactory)]
        elements = {f.get_name(): self.element(f.load()) for f in sorted(factories, key=lambda f: f.get_name())}
        return {'description': plugin.get_description(), 'elements': elements, 'filename': pathlib.Path(plugin.get_filename()).stem.removeprefix('lib'),
                'license': plugin.get_license(), 'other-types': dict(sorted(self.types.items())), 'package': plugin.get_package(),
                'source': plugin.get_source(), 'tracers': {}}


def main():
    arguments = [a for a in sys.argv[1:] if not a.startswith('--')]
    if len(arguments) != 1:
        sys.exit(__doc__)
    cache = Cache(*load(pathlib.Path(arguments[0]).resolve()))
    found = {name: cache.plugin(name) for name in PLUGINS}
    if found['terrainseg'] is None:
        sys.exit(f'plugins_cache.py: {arguments[0]} has no plugin terrainseg')
    there = CACHE.read_text() if CACHE.exists() else ''
    if found['terrainreference'] is None:  # a build without tools
        found['terrainreference'] = json.loads(there or '{}').get('terrainreference')
    text = json.dumps(found, indent=4, sort_keys=True, ensure_ascii=False) + '\n'
    if '--write' in sys.argv:
        CACHE.parent.mkdir(exist_ok=True)
        CACHE.write_text(text)
        return
    lines = list(difflib.unified_diff(there.splitlines(), text.splitlines(), str(CACHE.name), 'the plugins say', lineterm='', n=1))
    print('\n'.join(lines[:60]))
    sys.exit(bool(lines) and f'{CACHE.name} is not what the plugins say: tests/checks/plugins_cache.py --write BUILD_FOLDER')


main()
