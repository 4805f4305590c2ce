#!/usr/bin/env python3
"""An external method for specs, which divides objects at the median of the longest axis.

Called as `external_method.py BOXES TREE`."""
import os
import struct
import sys
import zlib

data = open(sys.argv[1], "rb").read()
boxes = list(struct.iter_unpack("<6f", data))  # min x, y, z, max x, y, z of every object
seed = int(os.environ["BVH_SEED"])  # for methods that draw random numbers

LEAF = 1 << 31
nodes, ids, area = [None], [], 0.0
todo = [(0, list(range(len(boxes))))]
while todo:
    at, objects = todo.pop()
    columns = list(zip(*(boxes[i] for i in objects)))
    box = [min(column) for column in columns[:3]] + [max(column) for column in columns[3:]]
    if len(objects) == 1:
        nodes[at] = (*box, len(ids), LEAF | 1)
        ids += objects
        continue
    x, y, z = (box[axis + 3] - box[axis] for axis in range(3))
    area += x * y + y * z + z * x
    axis = (x, y, z).index(max(x, y, z))
    objects.sort(key=lambda i: boxes[i][axis] + boxes[i][axis + 3])
    middle, first = len(objects) // 2, len(nodes)
    nodes[at] = (*box, first, 2)
    nodes += [None, None]
    todo += [(first, objects[:middle]), (first + 1, objects[middle:])]

body = b"".join(struct.pack("<6f2I", *node) for node in nodes) + struct.pack("<%dI" % len(ids), *ids)
head = struct.pack("<8s4I", b"\x89BVH\r\n\x1a\n", 4, 0x01020304, 0, zlib.crc32(data))
head += struct.pack("<4Q3d6f64sQI8x", len(nodes), len(boxes), seed, 0, area, 0.0, 0.0, *nodes[0][:6], b"median", len(ids), 0)
open(sys.argv[2], "wb").write(head + struct.pack("<I", zlib.crc32(head, zlib.crc32(body))) + body)
