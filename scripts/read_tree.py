#!/usr/bin/env python3
"""Prints the facts about a tree file, or its nodes with --nodes. The documentation of
bvh_core::file describes the format."""
import struct
import sys
import zlib

data = open(sys.argv[1], "rb").read()
if len(data) < 192 or data[:8] != b"\x89BVH\r\n\x1a\n" or struct.unpack_from("<2I", data, 8) != (4, 0x01020304):
    sys.exit("not a tree file of version 4")
objective, scene, count, objects, seed, work, cost = struct.unpack_from("<2I4Qd", data, 16)
references, flags = struct.unpack_from("<QI", data, 168)
visits = count if flags & 1 else 0
frame = 96 if flags & 2 else 0
if len(data) != 192 + 32 * count + 4 * references + 4 * visits + frame:
    sys.exit("cut or extended")
if zlib.crc32(data[:188], zlib.crc32(data[192:])) != struct.unpack_from("<I", data, 188)[0]:
    sys.exit("damaged")
nodes = list(struct.iter_unpack("<6f2I", data[192:192 + 32 * count]))
ids = struct.unpack_from("<%dI" % references, data, 192 + 32 * count)

LEAF = 1 << 31
depth, area, leaves = [0] * count, 0.0, 0
for index, (x0, y0, z0, x1, y1, z1, first, tagged) in enumerate(nodes):
    if tagged & LEAF:
        leaves += 1
        continue
    x, y, z = x1 - x0, y1 - y0, z1 - z0
    area += x * y + y * z + z * x
    depth[first:first + tagged] = [depth[index] + 1] * tagged
if "--nodes" in sys.argv:
    for *box, first, tagged in nodes:
        print("leaf" if tagged & LEAF else "inner", first, tagged & ~LEAF, *box)
else:
    method = data[104:168].rstrip(b"\0").decode()
    facts = {"method": method, "seed": seed, "work": work, "objects": objects, "nodes": count}
    facts |= {"inner nodes": count - leaves, "leaves": leaves, "depth": max(depth, default=0)}
    facts |= {"cost when saved": cost, "internal area": area, "ids": sorted(set(ids)) == list(range(objects))}
    print(*(f"{what}: {value}" for what, value in facts.items()), sep="\n")
