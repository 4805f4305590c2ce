#!/usr/bin/env python3
"""Reads a tree file (format: the documentation of bvh_core::file): prints what it is, and its nodes with --nodes."""
import struct
import sys

MASK = (1 << 64) - 1


def rotate(x, by):
    return x << by & MASK | x >> 64 - by


def mix(h, x):
    return rotate((h ^ x) * 0x9E3779B97F4A7C15 & MASK, 29)


def quarter_sum(data):
    words = struct.unpack("<%dQ" % (-(-len(data) // 256) * 32), data + bytes(-len(data) % 256))
    result = len(data)
    for lane in range(32):
        state = lane + 1
        for word in words[lane::32]:
            state = rotate(state ^ word, 16) * 33 & MASK
            state ^= state >> 23
        result = mix(result, state)
    return result


def checksum(data):
    quarter, result = -(-len(data) // 1024) * 256, len(data)
    for number in range(4):
        result = mix(result, quarter_sum(data[number * quarter:(number + 1) * quarter]))
    return result


data = open(sys.argv[1], "rb").read()
if len(data) < 192 or data[:8] != b"\x89BVH\r\n\x1a\n" or struct.unpack_from("<2I", data, 8) != (1, 0x01020304):
    sys.exit("not a tree file of version 1")
layout, objective, count, objects, _, cost, _, _, seed, work, scene = struct.unpack_from("<2I3Q3d3Q", data, 16)
if layout != 0 or len(data) != 192 + 32 * count + 4 * objects:
    sys.exit("not a tree, or cut")
if checksum(data[:184] + struct.pack("<Q", checksum(data[192:]))) != struct.unpack_from("<Q", data, 184)[0]:
    sys.exit("damaged")
nodes = list(struct.iter_unpack("<6f2I", data[192:192 + 32 * count]))
ids = struct.unpack_from("<%dI" % objects, data, 192 + 32 * count)

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
    method = data[120:184].rstrip(b"\0").decode()
    facts = {"method": method, "seed": seed, "work": work, "objects": objects, "nodes": count}
    facts |= {"inner nodes": count - leaves, "leaves": leaves, "depth": max(depth, default=0)}
    facts |= {"cost when saved": cost, "internal area": area, "ids": sorted(ids) == list(range(objects))}
    print(*(f"{what}: {value}" for what, value in facts.items()), sep="\n")
