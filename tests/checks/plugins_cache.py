#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Writes what GStreamer's documentation tools know of the plugins: the cache that hotdoc's extension for GStreamer reads without
loading them. Its fields are those of the caches in GStreamer's own modules (docs/plugins/gst_plugins_cache.json there).

usage: plugins_cache.py BUILD_FOLDER [FILE]      FILE: BUILD_FOLDER/gst_plugins_cache.json

Fails when the plugin cannot be loaded or when an element, a property or a choice lacks its description.
"""
import json
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from check_docs import ONLY_IN_SOME_BUILDS, PLUGINS, load  # noqa: E402

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


def undescribed(plugin):
    for name, element in plugin['elements'].items():
        yield from (f'{name}: {key}' for key in ('author', 'description', 'klass', 'long-name') if not element[key])
        yield from (f'{name}.{key}' for key, spec in element['properties'].items() if not spec['blurb'])
    for name, kind in plugin['other-types'].items():
        yield from (f'{name}: {value["name"]}' for value in kind['values'] if not value['desc'])


def main():
    if len(sys.argv) not in (2, 3) or sys.argv[1].startswith('-'):
        sys.exit(__doc__)
    build = pathlib.Path(sys.argv[1]).resolve()
    cache = Cache(*load(build))
    found = {name: plugin for name in PLUGINS if (plugin := cache.plugin(name))}
    if 'terrainseg' not in found:
        sys.exit(f'plugins_cache.py: {build} has no plugin terrainseg')
    file = pathlib.Path(sys.argv[2]) if len(sys.argv) == 3 else build / 'gst_plugins_cache.json'
    file.write_text(json.dumps(found, indent=4, sort_keys=True, ensure_ascii=False) + '\n')
    missing = [text for plugin in found.values() for text in undescribed(plugin)]
    sys.exit('no description: ' + ', '.join(missing) if missing else 0)


main()
