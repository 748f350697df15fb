"""Reads an AMC file with pyacclaim and writes what it makes of it, for tests/import_peers.rs.

Usage: import_pyacclaim.py SKELETON MOTION STRIDE > OUT
OUT: one line of JSON (names of the bones; name and number of values of each line of an AMC frame; numbers of
frames and of channels), then little-endian doubles: the values of all frames in degrees and centimetres, then
the bones' positions in cm in every STRIDE-th frame. pyacclaim 0.0.1 leaves a file's last frame out.
"""

import contextlib
import json
import math
import sys
from array import array

import pyacclaim

CM_PER_INCH = 2.54  # it divides lengths by the file's unit, which leaves inches

skeleton, motion, stride = sys.argv[1], sys.argv[2], int(sys.argv[3])
with contextlib.redirect_stdout(sys.stderr):
    asf = pyacclaim.loadASF(skeleton, verbose=False)
    frames = pyacclaim.loadAMC(asf, motion)

values = array("d")
for pose in frames:
    for name, numbers in pose.items():
        lengths = 3 if name == "root" else 0
        values.extend(number * CM_PER_INCH for number in numbers[:lengths])
        values.extend(math.degrees(number) for number in numbers[lengths:])

bones = asf["bones"]
positions = array("d")
for pose in frames[::stride]:
    bones["root"].set_pose(pose)
    for bone in bones.values():
        positions.extend(bone.global_coordinate * CM_PER_INCH)

header = {
    "names": list(bones),
    "lines": [[name, len(numbers)] for name, numbers in frames[0].items()],
    "frames": len(frames),
    "channels": len(values) // len(frames),
}
sys.stdout.buffer.write(json.dumps(header).encode() + b"\n")
values.tofile(sys.stdout.buffer)
positions.tofile(sys.stdout.buffer)
