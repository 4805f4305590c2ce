"""Counts the hours of direct sun on every face of a mesh, on some days of the year.

Run `python sun_hours.py [mesh.glb] [--latitude 52] [--dates 2026-06-21,...] [--step 10]`, or cell by
cell in an editor that knows `# %%`. Needs pandas, pillow and trimesh. Lengths are in metres; x points to the
east, y to the north and z up. The sun is simple: its declination is off by up to a degree, and noon
is when it is highest. The program `bvh sky` uses exact positions, and also writes pictures.
"""
# %% The mesh: a file, or a hundred houses on a ground, in faces of at most five metres.
import argparse
import datetime
import sys

import numpy as np
import pandas as pd
import trimesh
from bvh_search import Tracer, Tree

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("mesh", nargs="?", help="the path of a mesh file")
parser.add_argument("--latitude", type=float, default=52.0, help="degrees north")
parser.add_argument("--dates", default="2026-03-21,2026-06-21,2026-12-21", metavar="DATE,...")
parser.add_argument("--step", type=float, default=10.0, help="minutes between positions of the sun")
arguments = parser.parse_args([] if hasattr(sys, "ps1") else None)
if arguments.mesh:
    mesh = trimesh.load(arguments.mesh, force="mesh")
else:
    corners = 20.0 * np.stack([*np.divmod(np.arange(100), 10), np.zeros(100)], axis=1)
    sizes = np.random.default_rng(1).uniform([8, 8, 5], [14, 14, 25], (100, 3))
    lower, upper = np.vstack([corners, [-20, -20, -1]]), np.vstack([corners + sizes, [214, 214, 0]])
    mesh = trimesh.util.concatenate([trimesh.creation.box(bounds=box) for box in zip(lower, upper)])
    mesh = mesh.subdivide_to_size(5)
# %% The sun in the middle of every step, in solar time, with the declination of Cooper (1969).
latitude, step = np.radians(arguments.latitude), arguments.step / 60
names = arguments.dates.split(",")
days = [datetime.date.fromisoformat(name).timetuple().tm_yday for name in names]
tilt = np.radians(23.45) * np.sin(2 * np.pi * (284 + np.array(days)) / 365)
turn = np.radians(15 * (np.arange(step / 2, 24, step) - 12))[:, None]
north = np.cos(latitude) * np.sin(tilt) - np.sin(latitude) * np.cos(tilt) * np.cos(turn)
up = np.sin(latitude) * np.sin(tilt) + np.cos(latitude) * np.cos(tilt) * np.cos(turn)
time, day = np.nonzero(up > 0)
suns = np.stack([-np.cos(tilt) * np.sin(turn), north, up], axis=-1)[time, day]
# %% The hours of each face and day: a direction weighs a step of its day.
tracer = Tracer(Tree.from_mesh(mesh.vertices, mesh.faces, seconds=1, precision="double"))
n, weights = mesh.face_normals, step * np.eye(len(names))[day]
hours = tracer.visible(mesh.triangles_center, suns, weights, normals=n, t_min=1e-3)
# %% The faces, and the means of their sides, by area.
faces = pd.DataFrame(hours, columns=names).assign(area=mesh.area_faces)
compass = np.rint(np.arctan2(n[:, 0], n[:, 1]) / (np.pi / 2)).astype(int) % 4
faces["side"] = np.array(["north", "east", "south", "west", "above"])[np.where(n[:, 2] > 0.7, 4, compass)]
seen = faces[n[:, 2] > -0.7]
print(seen.round(2))
means = {side: np.average(part[names], axis=0, weights=part.area) for side, part in seen.groupby("side")}
print(pd.DataFrame(means, index=names).round(2))
