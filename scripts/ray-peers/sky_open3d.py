"""Traces the rays that sky.c writes to standard input by Open3D's `test_occlusions`, and prints a row of its table.

The rays of 4096 points are made at a time. The clock runs only while Open3D traces them.
"""
import sys
import time

import numpy as np
import open3d as o3d

ROUNDS = 5
POINTS = 4096

scene, *counts = sys.stdin.buffer.readline().decode().rstrip("\n").split("\t")
triangle_count, point_count, direction_count, free = map(int, counts)


def read(*shape):
    count = int(np.prod(shape))
    return np.frombuffer(sys.stdin.buffer.read(4 * count), np.float32).reshape(shape)


vertices, points, directions = read(3 * triangle_count, 3), read(point_count, 3), read(direction_count, 3)
tracer = o3d.t.geometry.RaycastingScene(nthreads=1)
tracer.add_triangles(vertices.copy(), np.arange(3 * triangle_count, dtype=np.uint32).reshape(-1, 3))


def answer():
    seconds, found = 0.0, 0
    for first in range(0, point_count, POINTS):
        origins = points[first : first + POINTS]
        rays = np.empty((len(origins), direction_count, 6), np.float32)
        rays[..., :3], rays[..., 3:] = origins[:, None], directions
        rays = o3d.core.Tensor.from_numpy(rays)
        start = time.process_time()
        hits = tracer.test_occlusions(rays, nthreads=1)
        seconds += time.process_time() - start
        found += np.count_nonzero(~hits.numpy())
    rays = point_count * direction_count
    if abs(found - free) > 1e-4 * rays:
        sys.exit(f"{scene}, Open3D: {found} rays are free, not {free}")
    return rays / seconds * 1e-6, found / rays


speeds, fractions = zip(*(answer() for _ in range(ROUNDS)))
speeds = sorted(speeds)
print(
    f'{scene},{triangle_count},{point_count},{direction_count},Open3D,"test_occlusions in the user\'s order",'
    f"{speeds[ROUNDS // 2]:.2f},{speeds[0]:.2f},{speeds[-1]:.2f},{fractions[0]:.4f}"
)
