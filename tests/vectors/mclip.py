#!/usr/bin/env python3
"""A reference decoder of mclip, written from docs/FORMAT.md alone, and the golden vectors.

    mclip.py hash FILE...    prints the SHA-256 of each clip's frames: channel words, little-endian, frame by frame
    mclip.py make FOLDER     writes the vectors and SHA256SUMS.mclip

Whole numbers only; nothing but the standard library.
"""

import hashlib
import random
import struct
import sys
import zlib
from pathlib import Path

PCM, MULAW, DPCM, ADPCM, QMD = range(5)
FIXED, HUFFMAN, ADAPTIVE = range(3)


def wrap(x):
    return (x + 2**31) % 2**32 - 2**31


def scale(x, f):
    return x * f >> 16


def signed(s):
    return s // 2 if s % 2 == 0 else -(s + 1) // 2


def clamp(x, low, high):
    return max(low, min(high, x))


MANTISSAS = [0x80000000, 0x8B95C1E4, 0x9837F052, 0xA5FED6AA, 0xB504F334, 0xC5672A11, 0xD744FCCB, 0xEAC0C6E8]


def step(i):
    return MANTISSAS[i % 8] >> (28 - i // 8)


class Bits:
    """A bit string; past its end come zeros."""

    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, count):
        value = 0
        for _ in range(count):
            byte = self.data[self.at // 8] if self.at < 8 * len(self.data) else 0
            value = value << 1 | byte >> (7 - self.at % 8) & 1
            self.at += 1
        return value


    def signed(self, count):
        value = self.take(count)
        return value - (value >> (count - 1) << count)

    def align(self):
        self.at = (self.at + 7) // 8 * 8


class Fields:
    """postcard's numbers and slices."""

    def __init__(self, data):
        self.data, self.at = data, 0

    def u8(self):
        self.at += 1
        return self.data[self.at - 1]

    def varint(self, bits=32):
        value = shift = 0
        while True:
            byte = self.u8()
            value |= (byte & 127) << shift
            shift += 7
            assert value < 2**bits and shift < bits + 7
            if byte < 128:
                return value

    def zigzag(self):
        return signed(self.varint())

    def bytes(self):
        length = self.varint()
        self.at += length
        return self.data[self.at - length : self.at]


class Channel:
    def __init__(self, bits, packings, precision, is_pcm, predictors, names):
        bit_packing, step_packing, entry_packing, group_packing, predictor_packing = packings
        self.is_first, kind = bits.take(1), bits.take(3)
        self.name = names.bytes().decode() if self.is_first and names.data else None
        self.bits, self.step = (l + bits.take(w) for l, w in (bit_packing, step_packing))
        self.group = self.alpha = self.entry_bits = self.low = 0
        if self.bits:
            self.group = group_packing[0] + bits.take(group_packing[1])
            if is_pcm:
                self.alpha = bits.take(15)
            else:
                self.entry_bits = entry_packing[0] + bits.take(entry_packing[1])
                self.alpha = predictors[predictor_packing[0] + bits.take(predictor_packing[1])]
                assert 1 <= self.entry_bits <= 32
        self.shift = self.step if is_pcm else max(3 + self.step // 8 - precision, 0)
        if is_pcm or not self.bits:
            low = shift = 0
            while True:
                part = bits.take(4)
                low |= (part & 7) << shift
                shift += 3
                if part < 8:
                    break
            self.low = wrap(signed(low % 2**32) << self.shift)
        assert kind <= 6 and self.bits <= 16


class State:
    """A channel at an entry point."""

    def __init__(self, channel, value):
        self.x1 = self.x2 = value
        self.bits, self.step, self.group, self.coefficient = channel.bits, channel.step, channel.group, channel.alpha
        self.low, self.level = channel.low, 0
        self.d1 = self.d2 = 0
        self.alpha = [0, 0]
        self.r = [0, 0, 0]
        self.moved = []


class FixedWidth:
    def reset(self):
        pass

    def code(self, bits, state):
        return bits.signed(state.bits)


class Huffman:
    BOUNDS = [0, 1, 2, 3, 5, 8, 13]

    def __init__(self, tables):
        self.classes, groups = tables[:2]
        assert self.classes * groups <= 8
        at, self.prefixes = 2, []
        for _ in range(groups * self.classes):
            n = tables[at]
            at += 1
            if n == 0:
                # A prefix of no bits.
                self.prefixes.append({(0, 0): tables[at]})
                at += 1
                continue
            lengths = [tables[at + i // 2] >> (4 * (i % 2)) & 15 for i in range(n)]
            at += (n + 1) // 2
            assert sum(2.0**-length for length in lengths if length) == 1 and max(lengths) <= 8
            prefix, before, table = 0, 0, {}
            for length, i in sorted((length, i) for i, length in enumerate(lengths) if length):
                prefix <<= length - before
                before = length
                table[length, prefix] = "escape" if i == n - 1 else i
                prefix += 1
            self.prefixes.append(table)
        assert at == len(tables)

    def reset(self):
        pass

    def code(self, bits, state):
        table = self.prefixes[state.group * self.classes + state.level]
        length = prefix = 0
        while (length, prefix) not in table:
            prefix = prefix << 1 | bits.take(1)
            length += 1
        s = table[length, prefix]
        c = bits.signed(state.bits) if s == "escape" else signed(s)
        level = min(sum(abs(c) > bound for bound in self.BOUNDS), self.classes - 1)
        state.level = max(level, state.level - 1)
        return c


class AdaptiveHuffman:
    def __init__(self, tables):
        (self.k,) = tables
        self.reset()

    def reset(self):
        K = 1 << self.k
        # What is below a node: its first child, or a symbol as ("leaf", s).
        self.below = [2 * i + 1 for i in range(K - 1)] + [("leaf", s) for s in range(K)]
        self.weight = [0] * (K - 1) + [1] * K
        for i in reversed(range(K - 1)):
            self.weight[i] = self.weight[2 * i + 1] + self.weight[2 * i + 2]

    def code(self, bits, state):
        K = 1 << self.k
        node, path = 0, []
        while not isinstance(self.below[node], tuple):
            node = self.below[node] + bits.take(1)
        s = self.below[node][1]
        if self.weight[0] < 32768:
            while node > 0:
                leader = node
                while leader > 1 and self.weight[leader - 1] == self.weight[node]:
                    leader -= 1
                self.below[node], self.below[leader] = self.below[leader], self.below[node]
                self.weight[leader] += 1
                child = leader if leader % 2 else leader - 1
                node = self.below.index(child)
            self.weight[0] += 1
        return bits.signed(state.bits) if s == K - 1 else signed(s)


def solve(r):
    if r[0] < 256:
        return [0, 0]
    h = max(r[0].bit_length() - 15, 0)
    r0, r1, r2 = (x >> h for x in r)
    r1, r2 = clamp(r1, -r0, r0), clamp(r2, -r0, r0)

    def ratio(a, b):
        a = clamp(a, -b, b) * 16384
        return clamp(abs(a) // b * (1 if a >= 0 else -1), -15360, 15360)

    k1 = ratio(r1, r0)
    g = max(r0 - (k1 * r1 >> 14), 1)
    k2 = ratio(r2 - (k1 * r1 >> 14), g)
    return [k1 - (k1 * k2 >> 14), k2]


class Clip:
    def __init__(self, data):
        assert data[:4] == b"MCLP"
        version, zero, length = struct.unpack_from("<HHI", data, 4)
        assert version == 1 and zero == 0
        (crc,) = struct.unpack_from("<I", data, 12 + length)
        assert crc == zlib.crc32(data[: 12 + length])
        self.read_header(data[12 : 12 + length])
        self.blocks = data[16 + length :]

    def read_header(self, header):
        fields = Fields(header)
        self.rate = fields.varint(), fields.varint()
        self.frames, m, self.block_bytes = fields.varint(), fields.varint(16), fields.varint(16)
        self.ram, self.delay, self.codec, entropy = fields.varint(), fields.varint(16), fields.u8(), fields.u8()
        self.parameters, self.tables, self.cycles = fields.bytes(), fields.bytes(), fields.bytes()
        coefficients, records, names = fields.bytes(), Bits(fields.bytes()), Fields(fields.bytes())
        predictors = [a for (a,) in struct.iter_unpack("<h", coefficients)] or [0]
        precision = records.take(4)
        packings = [(records.take(8), records.take(4)) for _ in range(5)]
        assert all(least + 2**width <= 256 for least, width in packings)
        self.channels = [Channel(records, packings, precision, self.codec == PCM, predictors, names) for _ in range(m)]
        assert fields.at == len(header) and min(self.rate) >= 1 and self.frames >= 1 and m >= 1
        assert (records.at + 7) // 8 == len(records.data) and names.at == len(names.data)
        self.source = FixedWidth() if entropy == FIXED else [Huffman, AdaptiveHuffman][entropy - 1](self.tables)

    def decode(self):
        at = frame = 0
        while frame < self.frames:
            N, n, first, crc = struct.unpack_from("<HHII", self.blocks, at)
            codes = self.blocks[at + 12 : at + 12 + N]
            assert N <= self.block_bytes and crc == zlib.crc32(self.blocks[at : at + 8] + codes)
            assert first & 2**31 - 1 == frame and n >= 1
            bits = Bits(codes)
            yield from self.block(bits, n, first >> 31)
            assert (bits.at + 7) // 8 == N
            at += 12 + N
            frame += n
        assert frame == self.frames and at == len(self.blocks)

    def block(self, bits, n, entry):
        for i in range(n):
            if entry and i == 0:
                self.enter(bits)
                if self.codec != PCM:
                    yield [state.x1 for state in self.states]
                    continue
            self.number += 1
            for number, state in enumerate(self.states):
                if number % 8 == 0:
                    self.align(bits)
                if state.bits:
                    self.next(number, state, self.source.code(bits, state))
            self.align(bits)
            yield [state.x1 for state in self.states]

    def align(self, bits):
        if isinstance(self.source, FixedWidth):
            bits.align()

    def enter(self, bits):
        self.number = 0
        self.source.reset()
        self.states = []
        for channel in self.channels:
            value = bits.signed(channel.entry_bits) << channel.shift if channel.entry_bits else channel.low
            self.states.append(State(channel, wrap(value)))
            if self.codec == ADPCM:
                lowest, highest = self.parameters[16:18]
                self.states[-1].step = clamp(channel.step, lowest, highest)
        self.align(bits)

    def next(self, number, state, c):
        x1, x2, a, (a1, a2), b = state.x1, state.x2, state.coefficient, state.alpha, state.bits
        window = self.parameters[18] if self.codec == ADPCM else 0
        first, second = x1 - max(a, -32767) * (x1 >> 16), x1 + (wrap(clamp(a, -128, 127) * wrap(x1 - x2)) >> 6)
        if self.codec == PCM:
            delta = a << state.step
            x = state.low + (delta << b - 1) + (delta >> 1) + c * delta
        elif self.codec == MULAW:
            levels = list(struct.unpack(f"<{len(self.parameters) // 2}H", self.parameters))
            m, spread = c if c >= 0 else -1 - c, 1 << (len(levels).bit_length() - b)
            level = [levels[i * spread] if i * spread < len(levels) else 65536 for i in (m, m + 1)]
            d = 2 * scale(step(state.step), min(sum(level) // 4, 32767))
            x = first + (d if c >= 0 else -d)
        elif self.codec == QMD:
            levels = struct.unpack(f"<{len(self.parameters) // 2}h", self.parameters)
            s = 2 * c if c >= 0 else -2 * c - 1
            x = x1 + (16 * scale(step(state.step), levels[s]) if s < len(levels) else 0)
        else:
            if window:
                p = x1 + (wrap(a1 * state.d1 + a2 * state.d2) >> 7)
            else:
                p = [x1, first, second][self.parameters[0] if self.codec == DPCM else 2]
            x = p + c * step(state.step)
            if self.codec == ADPCM:
                multipliers = struct.unpack_from("<16b", self.parameters)
                lowest, highest = self.parameters[16:18]
                state.step = max(min(state.step + multipliers[c * 16 // 2**b % 16], highest), lowest)
        state.x1, state.x2 = wrap(x), x1
        if window:
            e = clamp(wrap(state.x1 - x1) >> 7, -4096, 4095)
            if window < 15:
                for i, before in enumerate([e, state.d1, state.d2]):
                    state.r[i] += e * before - (state.r[i] >> window)
            else:
                state.moved = (state.moved + [e])[-window:]
                state.r = [sum(a * b for a, b in zip(state.moved[k:], state.moved)) for k in range(3)]
            state.d1, state.d2 = e, state.d1
            if (self.number + number) % (1 << self.parameters[19]) == 0:
                state.alpha = solve(state.r)


def digest(data):
    sha = hashlib.sha256()
    for frame in Clip(data).decode():
        sha.update(struct.pack(f"<{len(frame)}i", *frame))
    return sha.hexdigest()


def varint(x):
    out = b""
    while x > 127:
        out += bytes([x & 127 | 128])
        x >>= 7
    return out + bytes([x])


def zigzag(x):
    return varint(2 * x if x >= 0 else -2 * x - 1)


def slice_of(data):
    return varint(len(data)) + data


class BitString:
    def __init__(self):
        self.digits = ""

    def put(self, value, count):
        assert 0 <= value < 1 << count
        self.digits += f"{value:0{count}b}" if count else ""

    def bytes(self):
        padded = self.digits + "0" * (-len(self.digits) % 8)
        return bytes(int(padded[i : i + 8], 2) for i in range(0, len(padded), 8))


def record(name, kind, low, entry_bits, bits, step, group=0, alpha=0):
    """A channel of joint `name`, or of the same one as before where that is None; `low` as it is stored."""
    return dict(name=name, kind=kind, low=low, entry_bits=entry_bits, bits=bits, step=step, group=group, alpha=alpha)


def channels_part(records, is_pcm, precision):
    """Predictors, records and names."""
    alphas = [] if is_pcm else sorted({r["alpha"] for r in records if r["bits"]})
    fields = ["bits", "step", "entry_bits", "group", "predictor"]
    for r in records:
        r["predictor"] = alphas.index(r["alpha"]) if r["bits"] and alphas else 0
    out, packings = BitString(), {}
    out.put(precision, 4)
    for field in fields:
        values = [r[field] for r in records]
        width = (max(values) - min(values)).bit_length()
        packings[field] = min(min(values), 256 - (1 << width)), width
        out.put(packings[field][0], 8)
        out.put(width, 4)

    def put(r, field):
        out.put(r[field] - packings[field][0], packings[field][1])

    names = b""
    for r in records:
        out.put(r["name"] is not None, 1)
        names += b"" if r["name"] is None else slice_of(r["name"].encode())
        out.put(r["kind"], 3)
        for field in fields[:2]:
            put(r, field)
        if r["bits"]:
            put(r, "group")
            if is_pcm:
                out.put(r["alpha"], 15)
            else:
                put(r, "entry_bits")
                put(r, "predictor")
        if r["bits"] and not is_pcm:
            continue
        low = 2 * r["low"] if r["low"] >= 0 else -2 * r["low"] - 1
        while low > 7:
            out.put(8 | low & 7, 4)
            low >>= 3
        out.put(low, 4)
    # A clip without names has none at all.
    names = names if any(r["name"] for r in records) else b""
    return b"".join(struct.pack("<h", alpha) for alpha in alphas), out.bytes(), names


def make(rng, codec, entropy, parameters, tables, records, blocks, ones=0.5, precision=2):
    """A clip of random codes, of which `ones` are 1; `blocks` has the frames of each, negative for no entry point."""
    predictors, packed, names = channels_part(records, codec == PCM, precision)
    m = len(records)
    ram = 16 * m * (2 if codec == ADPCM and parameters[18] else 1)
    if codec == ADPCM and parameters[18] >= 15:
        ram += 2 * m * parameters[18]
    if entropy == HUFFMAN:
        ram += 512 * tables[0] * tables[1]
    if entropy == ADAPTIVE:
        ram += (12 << tables[0]) - 6

    def header(block_bytes):
        fields = varint(30000) + varint(1001) + varint(sum(map(abs, blocks))) + varint(m) + varint(block_bytes)
        fields += varint(ram) + varint(0) + bytes([codec, entropy])
        fields += slice_of(parameters) + slice_of(tables) + slice_of(bytes([3, 1, 2, 3, 4]))
        fields += slice_of(predictors) + slice_of(packed) + slice_of(names)
        return fields

    # Any bits are codes: decode, and see how many were used.
    clip = Clip.__new__(Clip)
    clip.read_header(header(0))
    data, longest, frame = b"", 0, 0
    for n in blocks:
        entry, n = n > 0, abs(n)
        length = 8 + n * m * 5
        codes = bytes(sum((rng.random() < ones) << i for i in range(8)) for _ in range(length))
        bits = Bits(codes)
        for _ in clip.block(bits, n, entry):
            pass
        used = (bits.at + 7) // 8
        assert used <= length
        codes = bytearray(codes[:used])
        if bits.at % 8:
            codes[-1] &= 0xFF << (8 - bits.at % 8) & 0xFF
        head = struct.pack("<HHI", used, n, frame | entry << 31)
        data += head + struct.pack("<I", zlib.crc32(head + codes)) + codes
        longest, frame = max(longest, used), frame + n
    fields = header(longest)
    head = b"MCLP" + struct.pack("<HHI", 1, 0, len(fields)) + fields
    return head + struct.pack("<I", zlib.crc32(head)) + data


def described(*codes):
    """Code lengths, the escape's last, as tables have them."""
    out = b""
    for lengths in codes:
        padded = lengths + [0] * (len(lengths) % 2)
        out += bytes([len(lengths)]) + bytes(a | b << 4 for a, b in zip(padded[::2], padded[1::2]))
    return out


def vectors():
    rng = random.Random(7)
    low, high = -(2**31), 2**31 - 1
    mulaw = struct.pack("<16H", *(round(65536 * ((1 + 255) ** (i / 16) - 1) / 255) for i in range(16)))
    mulaw9 = struct.pack("<256H", *(round(65536 * ((1 + 30) ** (i / 256) - 1) / 30) for i in range(256)))
    levels = struct.pack("<8h", 0, -900, 1000, 4096, -4000, 32767, -32768, 12345)
    adapts = struct.pack("<16b", -2, -1, 0, 1, 2, 4, 6, 8, 9, 7, 5, 3, 1, 0, -1, -2) + bytes([0, 199])
    bounded = struct.pack("<16b", -128, 127, -56, 3, 99, 127, -128, 127, 5, 6, 7, -8, 9, -10, 11, -128) + bytes([60, 140])
    still = bytes(16) + bytes([0, 199])
    books = bytes([2, 2]) + described([1, 3, 3, 3, 4, 5, 6, 6], [2, 2, 3, 3, 3, 4, 0, 5, 6, 6])
    books += bytes([0, 2]) + described([1, 1])
    deep = bytes([1, 1]) + described([1, 2, 3, 4, 5, 6, 7, 8, 8])
    wide = bytes([8, 1]) + described(*([[2, 2, 2, 3, 4, 5, 6, 7, 8, 8] for _ in range(8)]))
    groups = bytes([1, 8]) + described(*([[2, 2, 2, 3, 4, 5, 6, 7, 8, 8], [1, 1]] * 4))

    def some(*bits, groups=1, steps=(90, 110)):
        alphas = [0, 40, 90, -9000]
        return [
            record(
                None if i % 3 == 2 else f"joint {i}",
                rng.randrange(7),
                rng.randrange(-90, 90),
                rng.randrange(1, 18),
                b,
                rng.randrange(*steps),
                i % groups,
                alphas[i % 4],
            )
            for i, b in enumerate(bits)
        ]

    def grids(*bits):
        return [record(f"grid {i}", i % 7, rng.randrange(-(2**20), 0), 0, b, 3, 0, 1000 + i) for i, b in enumerate(bits)]

    edges = [
        record("all", 0, 0, 32, 16, 199, 0, 32767),
        record("least", 3, 0, 1, 16, 0, 0, -32768),
        record("most", 4, 0, 31, 1, 199, 0, 127),
        record("shifted", 5, 0, 17, 7, 199, 0, 64),
        record("still", 6, 5, 0, 0, 0),
        record(None, 2, 5, 0, 0, 64),
        record("lowest", 1, -(2**31), 0, 0, 0),
    ]
    edge_grids = [
        record("all", 0, -(2**16), 0, 16, 15, 0, 32767),
        record("none", 1, 2**31 - 1, 0, 8, 15, 0, 0),
        record("still", 2, -(2**31), 0, 0, 0),
    ]
    made = {
        "pcm": make(rng, PCM, FIXED, b"", b"", grids(6, 0, 8, 13), [9, 5, -6]),
        "pcm-huffman": make(rng, PCM, HUFFMAN, b"", wide, grids(6, 4, 8), [12, -9]),
        "pcm-adaptive-huffman": make(rng, PCM, ADAPTIVE, b"", bytes([4]), grids(6, 4, 8), [40]),
        "pcm-octets": make(rng, PCM, FIXED, b"", b"", grids(*[6] * 8, *[3] * 16, 3, 5, *[7] * 6, *[4] * 7), [9, -6]),
        "pcm-edges": make(rng, PCM, FIXED, b"", b"", edge_grids, [7, 1]),
        "mulaw": make(rng, MULAW, FIXED, mulaw, b"", some(5, 3, 1), [12, 8]),
        "mulaw-nine-bits": make(rng, MULAW, HUFFMAN, mulaw9, deep, some(9, 8, 2), [15]),
        "mulaw-one-level": make(rng, MULAW, FIXED, b"\0\0", b"", some(1, 1), [15]),
        "dpcm-last": make(rng, DPCM, FIXED, bytes([0]), b"", some(4, 8, 1, 0, 16), [11, -3, 6]),
        "dpcm-octets": make(
            rng,
            DPCM,
            FIXED,
            bytes([1]),
            b"",
            some(*(b for width in range(1, 10) for b in [width] * 8), 3, *[0] * 8, *[5] * 15, *[4] * 11),
            [5, -3],
        ),
        "dpcm-first": make(rng, DPCM, HUFFMAN, bytes([1]), books, some(4, 8, 3, groups=2), [11, -7, 6]),
        "dpcm-second": make(rng, DPCM, HUFFMAN, bytes([2]), wide, some(6, 6, 6, 6), [30, -20], ones=0.3),
        "dpcm-adaptive-huffman": make(rng, DPCM, ADAPTIVE, bytes([2]), bytes([5]), some(6, 7, 4), [30, -60, 20], ones=0.4),
        "dpcm-counting-ends": make(rng, DPCM, ADAPTIVE, bytes([0]), bytes([1]), some(1, 2), [16500], ones=0.1),
        "dpcm-edges": make(rng, DPCM, FIXED, bytes([2]), b"", edges, [40, 1], precision=15),
        "dpcm-groups": make(rng, DPCM, HUFFMAN, bytes([2]), groups, some(*[6] * 12, groups=8), [20], ones=0.3),
        "dpcm-escapes": make(rng, DPCM, HUFFMAN, bytes([0]), deep, some(16, 8), [20], ones=0.9),
        "dpcm-one-channel": make(rng, DPCM, FIXED, bytes([0]), b"", some(3), [1]),
        "dpcm-no-codes": make(rng, DPCM, FIXED, bytes([0]), b"", [record("", 3, 7, 0, 0, 0)], [3, -2, 4]),
        "dpcm-many-channels": make(rng, DPCM, HUFFMAN, bytes([1]), wide, some(*[4] * 300), [2]),
        "adpcm-step": make(rng, ADPCM, FIXED, adapts + bytes([0, 0]), b"", some(3, 4, 8, 1, 0), [40, 20]),
        "adpcm-octets": make(
            rng, ADPCM, FIXED, adapts + bytes([0, 0]), b"", some(*(b for width in range(1, 9) for b in [width] * 8), *[4] * 5), [9]
        ),
        "adpcm-bounded-step": make(rng, ADPCM, ADAPTIVE, bounded + bytes([0, 0]), bytes([8]), some(3, 4, 16), [40]),
        "adpcm-predictor": make(rng, ADPCM, HUFFMAN, still + bytes([4, 2]), wide, some(6, 6, 6), [60, -30, 30], ones=0.3),
        "adpcm-both": make(rng, ADPCM, FIXED, adapts + bytes([5, 0]), b"", some(3, 4, 2), [90]),
        "adpcm-edges": make(rng, ADPCM, FIXED, adapts + bytes([1, 1]), b"", edges, [60], precision=0),
        "adpcm-long-window": make(rng, ADPCM, FIXED, still + bytes([6, 3]), b"", edges, [60]),
        "qmd": make(rng, QMD, FIXED, levels, b"", some(3, 3, 2, 4), [25, -8]),
        "qmd-huffman": make(rng, QMD, HUFFMAN, levels, wide, some(3, 3, 3), [25, 30]),
        "adpcm-sliding-15": make(rng, ADPCM, HUFFMAN, still + bytes([15, 1]), wide, some(6, 6, 0, 6), [60, -30, 30], ones=0.3),
        "adpcm-sliding-120": make(rng, ADPCM, FIXED, adapts + bytes([120, 4]), b"", some(3, 4, 2), [200, -150]),
        "adpcm-sliding-edges": make(rng, ADPCM, ADAPTIVE, adapts + bytes([64, 3]), bytes([6]), edges, [260]),
        "dpcm-edge-leaks": make(rng, DPCM, FIXED, bytes([1]), b"", edges, [30, -4]),
        # First steps below, between and above the bounds.
        "adpcm-outside-bounds": make(rng, ADPCM, FIXED, adapts[:16] + bytes([98, 102, 0, 0]), b"", some(*[4] * 9), [30, -4]),
    }
    return {f"{name}.mclip": clip for name, clip in made.items()}


def main(arguments):
    match arguments:
        case ["hash", *files] if files:
            for file in files:
                print(digest(Path(file).read_bytes()), "", Path(file).name)
        case ["make", folder]:
            lines = []
            for name, clip in vectors().items():
                (Path(folder) / name).write_bytes(clip)
                lines.append(f"{digest(clip)}  {name}\n")
            (Path(folder) / "SHA256SUMS.mclip").write_text("".join(lines))
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])
