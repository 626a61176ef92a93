# SPDX-License-Identifier: LGPL-2.1-or-later
"""A decoder of the KLV units, written from docs/klv.md and the structure of ST 0903 and ST 0601, apart from
src/exchange."""
import struct
import zlib

VMTI = bytes.fromhex('060e2b34020b01010e01030306000000')
UAS = bytes.fromhex('060e2b34020b01010e01030101000000')
TERRAIN = bytes.fromhex('060e2b34020b01010f') + b'TRNSEG' + b'\x01'


class Bad(Exception):
    pass


def ber(data, at):
    """Length at `at` and the position behind it."""
    first = data[at]
    if first < 128:
        return first, at + 1
    n = first - 128
    return int.from_bytes(data[at + 1:at + 1 + n], 'big'), at + 1 + n


def items(data):
    """Tag, value of a Local Set with one-byte tags."""
    at = 0
    while at < len(data):
        tag = data[at]
        n, at = ber(data, at + 1)
        if at + n > len(data):
            raise Bad(f'tag {tag} is cut short')
        yield tag, data[at:at + n]
        at += n


def packs(data):
    at = 0
    while at < len(data):
        n, at = ber(data, at)
        yield data[at:at + n]
        at += n


def big(data):
    return int.from_bytes(data, 'big')


def sum16(data):
    return sum(b << 8 if i % 2 == 0 else b for i, b in enumerate(data)) & 0xffff


def runs(series):
    for pair in packs(series):
        n, at = ber(pair, 0)
        number = big(pair[at:at + n])
        length, end = ber(pair, at + n)
        if end != len(pair):
            raise Bad('bytes behind a run')
        yield number - 1, length


def rows(data):
    """Zigzag differences, seven bits a byte, least significant first."""
    row, value, shift, out = 0, 0, 0, []
    for b in data:
        value |= (b & 127) << shift
        shift += 7
        if b < 128:
            row += -((value + 1) // 2) if value % 2 else value // 2
            out.append(row)
            value = shift = 0
    return out


def decode(unit):
    if unit[:16] != VMTI:
        raise Bad('no VMTI Local Set')
    n, start = ber(unit, 16)
    if start + n != len(unit):
        raise Bad('the set does not fill the unit')
    fields = dict(items(unit[start:]))
    tags = [t for t, _ in items(unit[start:])]
    if tags[0] != 2 or tags[-1] != 1 or len(set(tags)) != len(tags):
        raise Bad('the time stamp must come first, the checksum last, every tag once')
    if big(fields[1]) != sum16(unit[:-2]):
        raise Bad('checksum')
    width, height = big(fields[8]), big(fields[9])
    mask = bytearray(width * height)
    targets = {}
    for pack in packs(fields.get(101, b'')):
        ident, target = pack[0], dict(items(pack[1:]))
        targets[ident] = target
        target['object'] = dict(items(target[102]))
        if 101 in target:
            value = {1: 255, 2: 128}[ident]
            count = 0
            for first, length in runs(dict(items(target[101]))[2]):
                mask[first:first + length] = bytes([value]) * length
                count += length
            share = count * 100 / (width * height)
            if not (target[7][0] == 1 and share <= 1.5 or abs(target[7][0] - share) <= 0.5):
                raise Bad(f'percentage {target[7][0]}, counted {share}')
    if len(mask) != width * height:
        raise Bad('a run leaves the mask')
    if big(fields[5]) != len(targets) or big(fields[6]) != len(targets):
        raise Bad('number of targets')

    private = fields[127]
    if private[:16] != TERRAIN:
        raise Bad("no terrainseg Local Set")
    t = dict(items(private[16:]))
    if big(t[127]) != zlib.crc32(unit[:-8]):
        raise Bad('CRC-32')
    if t[1] != b'\x01':
        raise Bad('version')
    horizon_row, horizon_confidence = struct.unpack('>iB', t[6])
    models = []
    for at in range(0, len(t[13]), 29):
        m = struct.unpack('>3H3IQ3B', t[13][at:at + 29])
        models.append({'mean': m[0:3], 'variance': m[3:6], 'mass': m[6], 'rgb': m[7:10]})
    frame_width, frame_height = struct.unpack('>HH', t[3])
    return {
        'time': big(fields[2]), 'frame': big(t[2]), 'frame24': big(fields[7]), 'width': frame_width,
        'height': frame_height, 'region': struct.unpack('>4i', t[4]), 'sent': struct.unpack('>HH', t[5]),
        'horizon': (horizon_row, horizon_confidence), 'confidence': t[7][0], 'permille': big(t[8]),
        'window': struct.unpack('>4i', t[9]), 'generation': big(t[10]), 'flags': big(t[11]),
        'boundary': rows(t[12]), 'models': models, 'mask_size': (width, height), 'mask': bytes(mask),
        'targets': targets, 'motion': struct.unpack('>2i', t[14]) if 14 in t else None,
    }


def linear(data, low, high):
    """A number of ST 0601: unsigned over low..high, or signed over -high..high where low is None."""
    n = big(data)
    if low is not None:
        return low + n * (high - low) / (2 ** (8 * len(data)) - 1)
    half = 2 ** (8 * len(data) - 1)
    if n == half:
        return None  # out of range
    return (n - 2 * half if n > half else n) * high / (half - 1)


# tag: name, lowest (None: signed), highest, bytes
PLATFORM = {5: ('heading', 0, 360, 2), 6: ('pitch', None, 20, 2), 7: ('roll', None, 50, 2), 13: ('latitude', None, 90, 4),
            14: ('longitude', None, 180, 4), 15: ('altitude', -900, 19000, 2), 18: ('azimuth', 0, 360, 4),
            19: ('elevation', None, 180, 4), 20: ('relative roll', 0, 360, 4), 90: ('pitch', None, 90, 4),
            91: ('roll', None, 90, 4)}


def decode_uas(unit):
    """What a UAS Datalink Local Set says of the platform, and the VMTI set in it as it would stand alone."""
    if unit[:16] != UAS:
        raise Bad('no UAS Datalink Local Set')
    n, start = ber(unit, 16)
    if start + n != len(unit):
        raise Bad('the set does not fill the unit')
    tags = [t for t, _ in items(unit[start:])]
    fields = dict(items(unit[start:]))
    if tags[0] != 2 or tags[-1] != 1 or len(set(tags)) != len(tags):
        raise Bad('the time stamp must come first, the checksum last, every tag once')
    if big(fields.pop(1)) != sum16(unit[:-2]):
        raise Bad('checksum')
    platform = {'time': big(fields.pop(2)), 'version': big(fields.pop(65))}
    inner = fields.pop(74)
    for tag, value in fields.items():
        name, low, high, size = PLATFORM[tag]
        if len(value) != size or name in platform:
            raise Bad(f'item {tag}')
        platform[name] = linear(value, low, high)
    n = len(inner) + 4
    alone = VMTI + (bytes([n]) if n < 128 else bytes([0x81, n]) if n < 256 else b'\x82' + n.to_bytes(2, 'big')) + inner + b'\1\2'
    return platform, alone + sum16(alone).to_bytes(2, 'big')
