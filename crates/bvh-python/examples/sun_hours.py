"""Counts the hours of direct sun on every face of a mesh, on three days of the year.

Run `python sun_hours.py [mesh.glb]`, or cell by cell in an editor that knows `# %%`. Needs pandas
and trimesh. Lengths are in metres; x points to the east, y to the north and z up.
"""
# %% The mesh: a file, or a hundred houses on a ground, in faces of at most five metres.
import sys

import numpy as np
import pandas as pd
import trimesh
from bvh_search import Tracer, Tree

if len(sys.argv) > 1 and not hasattr(sys, "ps1"):
    mesh = trimesh.load(sys.argv[1], force="mesh")
else:
    corners = 20.0 * np.stack([*np.divmod(np.arange(100), 10), np.zeros(100)], axis=1)
    sizes = np.random.default_rng(1).uniform([8, 8, 5], [14, 14, 25], (100, 3))
    lower, upper = np.vstack([corners, [-20, -20, -1]]), np.vstack([corners + sizes, [214, 214, 0]])
    mesh = trimesh.util.concatenate([trimesh.creation.box(bounds=box) for box in zip(lower, upper)])
    mesh = mesh.subdivide_to_size(5)
# %% The sun every ten minutes, in solar time, 52° north, with the declination of Cooper (1969).
latitude, days = np.radians(52), {"March 21": 80, "June 21": 172, "December 21": 355}
tilt = np.radians(23.45) * np.sin(2 * np.pi * (284 + np.array(list(days.values()))) / 365)
turn = np.radians(15 * (np.arange(0, 24, 1 / 6) - 12))[:, None]
north = np.cos(latitude) * np.sin(tilt) - np.sin(latitude) * np.cos(tilt) * np.cos(turn)
up = np.sin(latitude) * np.sin(tilt) + np.cos(latitude) * np.cos(tilt) * np.cos(turn)
time, day = np.nonzero(up > 0)
suns = np.stack([-np.cos(tilt) * np.sin(turn), north, up], axis=-1)[time, day]
# %% The hours of each face and day: a direction weighs ten minutes of its day.
tracer = Tracer(Tree.from_mesh(mesh.vertices, mesh.faces, seconds=1, precision="double"))
n, weights = mesh.face_normals, np.eye(3)[day] / 6
hours = tracer.visible(mesh.triangles_center, suns, weights, normals=n, t_min=1e-3)
# %% The faces, and the means of their sides, by area.
faces = pd.DataFrame(hours, columns=list(days)).assign(area=mesh.area_faces)
compass = np.rint(np.arctan2(n[:, 0], n[:, 1]) / (np.pi / 2)).astype(int) % 4
faces["side"] = np.array(["north", "east", "south", "west", "above"])[np.where(n[:, 2] > 0.7, 4, compass)]
print(faces[n[:, 2] > -0.7].round(2))
means = {side: np.average(part[list(days)], axis=0, weights=part.area) for side, part in faces[n[:, 2] > -0.7].groupby("side")}
print(pd.DataFrame(means, index=list(days)).round(2))
