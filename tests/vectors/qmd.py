#!/usr/bin/env python3
"""A reference decoder of QMD, written from docs/FORMAT.md alone, and the golden vectors.

    qmd.py hash FILE...    prints the SHA-256 of each clip's frames: channel words, little-endian, frame by frame
    qmd.py make FOLDER     writes the vectors and SHA256SUMS

Whole numbers only; nothing but the standard library.
"""

import hashlib
import random
import struct
import sys
from pathlib import Path


def word(bits):
    """docs/FORMAT.md, "Numbers": an f32's bits as a 16.16 word."""
    sign, exponent, fraction = bits >> 31, bits >> 23 & 0xFF, bits & 0x7FFFFF
    if exponent == 255 and fraction:
        return 0
    # The value is numerator * 2**power; times 2**16; halves away from zero.
    if exponent == 0:
        numerator, power = fraction, -149
    else:
        numerator, power = fraction | 0x800000, exponent - 150
    power += 16
    if power >= 0:
        magnitude = numerator << power
    else:
        magnitude = (numerator + (1 << (-power - 1))) >> -power
    value = -magnitude if sign else magnitude
    return max(-(2**31), min(2**31 - 1, value))


def frames(clip):
    """All frames of a sound clip, each a list of words."""
    at, pose = 0, None
    while at < len(clip):
        n, m, _rate, fdf, b = struct.unpack_from("<IHHIB", clip, at)
        at += 13
        assert n >= 1 and m >= 1 and fdf <= m and 8 <= b <= 16
        if pose is None:
            assert min(clip[at : at + m]) >= 1
            pose = [word(bits) for bits in struct.unpack_from(f"<{m}I", clip, at + m)]
            at += 5 * m
        table = [word(bits) for bits in struct.unpack_from(f"<{1 << b}I", clip, at)]
        at += 4 << b
        kind = "B" if b == 8 else "H"
        row = struct.Struct(f"<{fdf}I{m - fdf}{kind}")
        for _ in range(n):
            cells = row.unpack_from(clip, at)
            at += row.size
            for c, cell in enumerate(cells):
                d = word(cell) if c < fdf else table[cell & ((1 << b) - 1)]
                pose[c] = (pose[c] + d + 2**31) % 2**32 - 2**31
            yield pose


def digest(clip):
    sha = hashlib.sha256()
    for pose in frames(clip):
        sha.update(struct.pack(f"<{len(pose)}i", *pose))
    return sha.hexdigest()


# Bits of floats where a conversion turns: zeros, subnormals, halves of the last place, ends of the range, infinities
# and not-a-numbers of both signs.
TURNS = [0x00000000, 0x00000001, 0x007FFFFF, 0x00800000, 0x36FFFFFF, 0x37000000, 0x37000001, 0x377FFFFF, 0x37800000]
TURNS += [0x37BFFFFF, 0x37C00000, 0x37C00001, 0x3F7FFFFF, 0x3F800000, 0x3FC00000, 0x43B40000, 0x46FFFE00, 0x46FFFFFF]
TURNS += [0x47000000, 0x47000001, 0x4F000000, 0x7F7FFFFF, 0x7F800000, 0x7F800001, 0x7FC00000, 0x7FFFFFFF]
TURNS += [bits | 0x80000000 for bits in TURNS]


def make(rng, m, fdf, b, segments, floats):
    """A clip with a segment for every number of rows; `floats` gives the bits of the next float."""
    clip = b""
    for number, n in enumerate(segments):
        clip += struct.pack("<IHHIB", n, m, 12000, fdf, b)
        if number == 0:
            clip += bytes(rng.randint(1, 6) for _ in range(m))
            clip += struct.pack(f"<{m}I", *(floats() for _ in range(m)))
        clip += struct.pack(f"<{1 << b}I", *(floats() for _ in range(1 << b)))
        for _ in range(n):
            clip += struct.pack(f"<{fdf}I", *(floats() for _ in range(fdf)))
            # Bits above b are set at random: a decoder does not look at them.
            clip += struct.pack(f"<{m - fdf}{'B' if b == 8 else 'H'}", *(rng.getrandbits(8 if b == 8 else 16) for _ in range(m - fdf)))
    return clip


def vectors():
    rng = random.Random(7)

    def small():
        return struct.unpack("<I", struct.pack("<f", rng.uniform(-3, 3)))[0]

    def turns(state=[]):
        state[:] = state or list(TURNS)
        return state.pop()

    return {
        "qmd-one-channel": make(rng, 1, 0, 8, [5], small),
        "qmd-all-fixed": make(rng, 3, 3, 8, [9], small),
        "qmd-float-edges": make(rng, 8, 4, 8, [13], turns),
        "qmd-any-float": make(rng, 5, 2, 8, [20], lambda: rng.getrandbits(32)),
        "qmd-two-byte-index": make(rng, 4, 1, 9, [6], small),
        "qmd-segments": make(rng, 5, 2, 8, [1, 3, 2], small),
        "qmd-many-channels": make(rng, 300, 1, 8, [2], small),
    }


def main(arguments):
    match arguments:
        case ["hash", *files] if files:
            for file in files:
                print(digest(Path(file).read_bytes()), "", Path(file).name)
        case ["make", folder]:
            lines = []
            for name, clip in vectors().items():
                (Path(folder) / f"{name}.qmd").write_bytes(clip)
                lines.append(f"{digest(clip)}  {name}.qmd\n")
            (Path(folder) / "SHA256SUMS").write_text("".join(lines))
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])
