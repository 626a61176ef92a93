#!/usr/bin/python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Compares docs/elements/ELEMENT.md with what the elements say about themselves.

usage: check_docs.py [--write] [--self-check] BUILD_FOLDER

Each element of the plugins terrainseg, terrainmcap, terrainros2 and terrainreference needs a page with three generated parts, between
<!-- pads --> <!-- properties --> <!-- signals --> and <!-- end -->. --write writes these parts (and a page that has only
them where there is none). Without it, every difference is printed and the exit status is 1, and so are every link between the
pages that leads to no file or to no heading, and every line of prose that is longer than 100 characters.
"""
import os
import pathlib
import re
import sys

TOP = pathlib.Path(__file__).resolve().parents[2]
PAGES = TOP / 'docs' / 'elements'
PLUGINS = ('terrainseg', 'terrainmcap', 'terrainros2', 'terrainreference')
SECOND_PAGES = {'terrainseg-behaviour'}  # prose about an element that has its own page
NOT_IN_EVERY_BUILD = {'terrainmcapsink', 'terrainros2sink', 'terrainreference'}
ONLY_IN_SOME_BUILDS = {'analytics-meta'}  # needs GStreamer 1.26: described in the prose


def load(build):
    os.environ['GST_PLUGIN_PATH'] = f'{build}/gst:{build}/lab'
    os.environ.setdefault('GST_REGISTRY', str(build / 'registry.bin'))
    import gi
    gi.require_version('Gst', '1.0')
    from gi.repository import GObject, Gst
    Gst.init(None)
    return GObject, Gst


def enum_nicks(enum_class, GObject):
    """PyGObject 3.42 makes a Python class of an enumeration, 3.50 shows GLib's own."""
    if hasattr(enum_class, '__enum_values__'):
        return [value.value_nick for value in enum_class.__enum_values__.values()]
    values = (GObject.enum_get_value(enum_class, i) for i in range(enum_class.minimum, enum_class.maximum + 1))
    return [value.value_nick for value in values if value is not None]


def flag_nicks(flags_class, GObject):
    """In the order of their bits; of both kinds of class, as enum_nicks()."""
    if hasattr(flags_class, '__flags_values__'):
        values = flags_class.__flags_values__
        return [values[bit].value_nicks[0] for bit in sorted(values) if bit]
    values = (GObject.flags_get_first_value(flags_class, 1 << bit) for bit in range(32) if flags_class.mask >> bit & 1)
    return [value.value_nick for value in values]


class Describer:
    """Markdown from introspection."""

    def __init__(self, GObject, Gst):
        self.GObject, self.Gst = GObject, Gst

    def element_names(self):
        registry = self.Gst.Registry.get()
        return sorted(feature.get_name() for plugin in PLUGINS
                      for feature in registry.get_feature_list_by_plugin(plugin)
                      if isinstance(feature, self.Gst.ElementFactory))

    def number(self, value, limits):
        """A limit by its name where it is that of the type, else in digits."""
        if value in limits:
            return limits[value]
        return f'{value:g}' if isinstance(value, float) else str(value)

    def kind_and_range(self, spec):
        name = spec.value_type.name
        if self.GObject.type_is_a(spec.value_type, self.GObject.TYPE_ENUM):
            return 'enumeration', ', '.join(f'`{nick}`' for nick in enum_nicks(spec.enum_class, self.GObject))
        if self.GObject.type_is_a(spec.value_type, self.GObject.TYPE_FLAGS):
            return 'flags', ', '.join(f'`{nick}`' for nick in flag_nicks(spec.flags_class, self.GObject))
        plain = {'gint': 'integer', 'guint': 'unsigned integer', 'gint64': 'integer', 'guint64': 'unsigned integer',
                 'gdouble': 'number', 'gfloat': 'number', 'gboolean': 'boolean', 'gchararray': 'text',
                 'GstValueArray': 'array', 'GstStructure': 'structure', 'GstFraction': 'fraction',
                 'GstCaps': 'caps'}.get(name, name)
        if hasattr(spec, 'minimum') and plain in ('integer', 'unsigned integer', 'number'):
            limits = {2**31 - 1: '2^31 - 1', 2**32 - 1: '2^32 - 1', 2**63 - 1: '2^63 - 1', 2**64 - 1: '2^64 - 1',
                      -2**31: '-2^31', -2**63: '-2^63'}
            return plain, f'{self.number(spec.minimum, limits)}..{self.number(spec.maximum, limits)}'
        return plain, 'true, false' if plain == 'boolean' else ''

    def text(self, spec, value):
        if value is None:
            return 'none'
        if isinstance(value, bool):
            return 'true' if value else 'false'
        if hasattr(value, 'value_nicks'):
            every = len(value.value_nicks) == len(flag_nicks(spec.flags_class, self.GObject))
            return 'all' if every else ' + '.join(value.value_nicks) or 'none'
        if hasattr(value, 'value_nick'):
            return value.value_nick
        if 'color' in spec.name and isinstance(value, int):
            return f'0x{value:08x}'
        return f'{value:g}' if isinstance(value, float) else str(value)

    def value(self, element, spec):
        if not spec.flags & self.GObject.ParamFlags.READABLE:
            return ''
        if spec.value_type.name == 'GstValueArray':  # bindings without overrides cannot read it
            return 'none'
        if spec.value_type.name == 'GstStructure':
            return ''
        return self.text(spec, element.get_property(spec.name))

    def when(self, spec):
        # Bits of GstParamFlags.
        controllable, playing, paused, ready = 1 << 9, 1 << 12, 1 << 11, 1 << 10
        if not spec.flags & self.GObject.ParamFlags.WRITABLE:
            return 'read only'
        words = 'playing' if spec.flags & playing else 'paused' if spec.flags & paused else 'ready'
        return words + (', controllable' if spec.flags & controllable else '')

    def properties(self, name):
        element = self.Gst.ElementFactory.make(name, None)
        own = [s for s in element.list_properties() if s.owner_type == type(element).__gtype__
               and s.name not in ONLY_IN_SOME_BUILDS]
        paper = None
        if any(s.name == 'preset' for s in own):
            paper = self.Gst.ElementFactory.make(name, None)
            self.Gst.util_set_object_arg(paper, 'preset', 'paper')
        lines = ['| property | type | range | default |' + (' paper |' if paper else '') + ' changeable | meaning |',
                 '|---|---|---|---|' + ('---|' if paper else '') + '---|---|']
        for spec in own:
            kind, limits = self.kind_and_range(spec)
            default = self.value(element, spec)
            cells = [f'`{spec.name}`', kind, limits, default]
            if paper:
                other = self.value(paper, spec)
                cells.append('' if other == default or spec.name == 'preset' else other)
            cells += [self.when(spec), spec.blurb]
            lines.append('| ' + ' | '.join(c.replace('|', '\\|') for c in cells) + ' |')
        return lines if own else ['It has none of its own.']

    def signals(self, name):
        element = self.Gst.ElementFactory.make(name, None)
        lines = []
        for signal in self.GObject.signal_list_names(type(element)) or ():
            query = self.GObject.signal_query(signal, type(element))
            arguments = ', '.join(t.name for t in query.param_types)
            action = ' (action)' if query.signal_flags & self.GObject.SignalFlags.ACTION else ''
            lines.append(f'- `{signal}`{action}: ({arguments}) -> {query.return_type.name}')
        return lines or ['None.']

    def pads(self, name):
        lines = []
        templates = self.Gst.ElementFactory.find(name).get_static_pad_templates()
        for template in sorted(templates, key=lambda t: (t.direction.value_nick, t.name_template)):
            presence = {'ALWAYS': 'always', 'SOMETIMES': 'sometimes', 'REQUEST': 'on request'}
            word = presence[template.presence.value_name.rsplit('_', 1)[1]]
            lines += [f'- `{template.name_template}` ({template.direction.value_nick}, {word})', '', '  ```']
            caps = template.get_caps()
            if caps.is_any():
                lines.append('  ANY')
            for i in range(caps.get_size()):
                text = re.sub(r'\((string|int|fraction|boolean)\)', '', caps.get_structure(i).to_string())
                features = caps.get_features(i)
                if features and features.to_string() != 'memory:SystemMemory':
                    text = text.replace(',', f'({features.to_string()}),', 1)
                lines.append('  ' + text.rstrip(';'))
            lines.append('  ```')
        return lines


def parts(describer, name):
    return {'pads': describer.pads(name), 'properties': describer.properties(name),
            'signals': describer.signals(name)}


def replace(text, part, lines):
    """`text` with the lines of a part in it, and the lines that stood there; None where it has no such part."""
    match = re.search(rf'(<!-- {part} -->\n)(.*?)(<!-- end -->)', text, re.S)
    if not match:
        return text, None
    body = '\n'.join(lines) + '\n'
    return text[:match.start(2)] + body + text[match.start(3):], match.group(2)


def empty_page(name, factory):
    sections = ''.join(f'\n## {part.capitalize()}\n\n<!-- {part} -->\n<!-- end -->\n'
                       for part in ('pads', 'properties', 'signals'))
    return f'# {name}\n\n{factory.get_metadata("description")}.\n{sections}'


def differences(name, text, wanted):
    found = []
    for part, lines in wanted.items():
        _, stands = replace(text, part, lines)
        if stands is None:
            found.append(f'docs/elements/{name}.md has no part <!-- {part} --> ... <!-- end -->')
            continue
        is_there, should = stands.splitlines(), lines
        found += [f'docs/elements/{name}.md: no element says "{line}"' for line in is_there if line not in should]
        found += [f'docs/elements/{name}.md: missing "{line}"' for line in should if line not in is_there]
    return found


def headings(page):
    """The anchors of a page, as its forge makes them."""
    text = re.sub(r'^```.*?^```', '', page.read_text(), flags=re.M | re.S)
    titles = (re.sub(r'\[([^]]*)\]\([^)]*\)', r'\1', title) for title in re.findall(r'^#+ (.*)$', text, re.M))
    return {re.sub(r'[^\w\- ]', '', title.lower()).strip().replace(' ', '-') for title in titles}


def broken_links(page, text):
    for target in re.findall(r'\]\(([^)\s]+)\)', text):
        path, _, anchor = target.partition('#')
        there = page.parent / path if path else page
        if '://' in target:
            continue
        if not there.exists() or (anchor and there.suffix == '.md' and anchor not in headings(there)):
            yield f'{page.relative_to(TOP)}: the link {target} leads nowhere'


def wide_lines(page, text):
    """Lines of prose of more than 100 characters; tables, code, pictures and generated parts may be wider."""
    text = re.sub(r'<!-- (pads|properties|signals) -->.*?<!-- end -->|^ *```.*?^ *```', lambda part: '\n' * part[0].count('\n'), text,
                  flags=re.M | re.S)
    for number, line in enumerate(text.splitlines(), 1):
        if len(line) > 100 and not line.startswith(('|', '![', '    ')):
            yield f'{page.relative_to(TOP)}: line {number} has {len(line)} characters, at most 100 are allowed'


def self_check(describer):
    """The check must see a changed default, a lost row, a lost part, links that lead nowhere and a long line."""
    readme = TOP / 'README.md'
    links = {'docs/architecture.md': 0, '#elements': 0, 'docs/absent.md': 1, '#no-such-heading': 1, 'docs/architecture.md#no-such': 1}
    if any(len(list(broken_links(readme, f'[a]({link})'))) != count for link, count in links.items()):
        return False
    wide = 'word ' * 21
    for text, count in (wide, 1), (f'- {wide}', 1), (f'| {wide}', 0), (f'```\n{wide}\n```\n', 0), (f'```\na\n```\n{wide}', 1):
        if len(list(wide_lines(readme, text))) != count:
            return False
    wanted = parts(describer, 'terrainseg')
    page = empty_page('terrainseg', describer.Gst.ElementFactory.find('terrainseg'))
    for part, lines in wanted.items():
        page, _ = replace(page, part, lines)
    rows = wanted['properties']
    spoiled = [page.replace('| 1.25 |', '| 1.5 |', 1), page.replace(rows[5] + '\n', ''),
               page.replace('<!-- signals -->', '')]
    good = differences('terrainseg', page, wanted)
    return not good and all(s != page and differences('terrainseg', s, wanted) for s in spoiled)


def main():
    words = [w for w in sys.argv[1:] if not w.startswith('--')]
    if len(words) != 1:
        sys.exit(__doc__)
    describer = Describer(*load(pathlib.Path(words[0]).resolve()))
    names = describer.element_names()
    if 'terrainseg' not in names:
        sys.exit('docs: the plugin terrainseg is not there')
    if '--self-check' in sys.argv:
        sys.exit(0 if self_check(describer) else 'docs: the check cannot fail')
    wrong = []
    for name in names:
        page, wanted = PAGES / f'{name}.md', parts(describer, name)
        if '--write' in sys.argv:
            text = page.read_text() if page.is_file() else empty_page(name, describer.Gst.ElementFactory.find(name))
            for part, lines in wanted.items():
                text, _ = replace(text, part, lines)
            PAGES.mkdir(parents=True, exist_ok=True)
            page.write_text(text)
        elif not page.is_file():
            wrong.append(f'docs/elements/{name}.md is missing')
            continue
        wrong += differences(name, page.read_text(), wanted)
    present = {p.stem for p in PAGES.glob('*.md')} - SECOND_PAGES - NOT_IN_EVERY_BUILD
    wrong += [f'docs/elements/{n}.md describes no element of the plugins' for n in sorted(present - set(names))]
    for page in sorted([*TOP.glob('*.md'), *(TOP / 'docs').rglob('*.md')]):
        if not page.name.endswith('.in.md'):  # a text before its figures and files are made
            wrong += broken_links(page, page.read_text())
            wrong += wide_lines(page, page.read_text())
    for line in wrong:
        print('docs:', line)
    sys.exit(1 if wrong else 0)


if __name__ == '__main__':
    main()
