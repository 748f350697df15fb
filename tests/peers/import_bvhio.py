"""Reads a BVH file with bvhio and writes what it makes of it, for tests/import_peers.rs.

Usage: import_bvhio.py FILE STRIDE > OUT
OUT: one line of JSON (names of the joints, numbers of frames and of channels), then little-endian doubles:
the channel values of all frames, then the joints' world positions in every STRIDE-th frame.
"""

import json
import sys
from array import array

import bvhio
from bvhio.lib import Parser

path, stride = sys.argv[1], int(sys.argv[2])

# bvhio turns channels into quaternions at once: keep the numbers that it reads as well.
rows = []
read_row = Parser._deserializeKeyframe


def keep_row(data, debug_info):
    rows.append(read_row(data, debug_info))
    return rows[-1]


Parser._deserializeKeyframe = keep_row
root = bvhio.readAsHierarchy(path)

joints = [joint for joint, _, _ in root.layout()]
positions = array("d")
for frame in range(0, len(rows), stride):
    root.loadPose(frame)
    for joint in joints:
        positions.extend(joint.PositionWorld)

header = {"names": [joint.Name for joint in joints], "frames": len(rows), "channels": len(rows[0])}
sys.stdout.buffer.write(json.dumps(header).encode() + b"\n")
for row in rows:
    array("d", row).tofile(sys.stdout.buffer)
positions.tofile(sys.stdout.buffer)
