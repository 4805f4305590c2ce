"""Draws the error of trees, relative to the best tree found, over the times of their searches.

Run `python error_against_time.py [error.svg]`, or cell by cell in an editor that knows `# %%`.
Needs matplotlib.
"""

# %% A scene: a tube along a knot, with posts of all heights around it.
import sys
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from bvh_search import Tracer, Tree

along, around = np.meshgrid(np.linspace(0, 2 * np.pi, 400), np.linspace(0, 2 * np.pi, 17), indexing="ij")


def knot(angle):
    radius = 2 + np.cos(5 * angle)
    return np.stack([radius * np.cos(3 * angle), radius * np.sin(3 * angle), np.sin(5 * angle)], axis=-1)


forward = knot(along + 1e-3) - knot(along)
side = np.cross(forward, [0, 0, 1])
side /= np.linalg.norm(side, axis=-1, keepdims=True)
up = np.cross(forward, side)
up /= np.linalg.norm(up, axis=-1, keepdims=True)
tube = knot(along) + 0.4 * (np.cos(around)[..., None] * side + np.sin(around)[..., None] * up)
a, b, c, d = tube[:-1, :-1], tube[1:, :-1], tube[1:, 1:], tube[:-1, 1:]
knots = np.concatenate([np.stack(corners, axis=-2).reshape(-1, 3, 3) for corners in ((a, b, c), (a, c, d))])

random = np.random.default_rng(1)
foot = random.uniform(-4, 4, (4000, 1, 3)) * [1, 1, 0] - [0, 0, 1.5]
posts = foot + random.uniform(0, 0.1, (4000, 3, 3)) + random.uniform(0, 3, (4000, 1, 1)) * [[[0, 0, 0], [0, 0, 0], [0, 0, 1]]]
triangles = np.concatenate([knots, posts]).astype(np.float32)
print(f"{len(triangles)} triangles")

# %% A tree for every budget. One search of a second finds a better tree than ten searches of a
# tenth, so each budget begins again.
budgets = [0, 0.03, 0.1, 0.3, 1, 3]
trees, seconds = [], []
for budget in budgets:
    start = time.perf_counter()
    trees.append(Tree.from_triangles(triangles, seconds=budget))
    seconds.append(time.perf_counter() - start)

# %% The best tree found: the last one, improved for as long again.
best = Tree.from_triangles(triangles, seconds=budgets[-1])
best.improve(budgets[-1])
least = min(tree.cost() for tree in [*trees, best])
errors = [tree.cost() / least - 1 for tree in trees]

# %% The speeds of rays from outside to points of the scene.
directions = random.normal(size=(200_000, 3))
origins = random.uniform(-3, 3, directions.shape) - 20 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
answers = []
print("  budget    took    error   rays per second")
for budget, tree, took, error in zip(budgets, trees, seconds, errors):
    tracer = Tracer(tree)
    start = time.perf_counter()
    answers.append(tracer.nearest(origins, directions))
    rate = len(origins) / (time.perf_counter() - start)
    print(f"{budget:6.2f} s {took:5.2f} s {error:8.2%} {rate / 1e6:8.1f} million")
assert all(np.array_equal(answer, answers[0]) for answer in answers), "every tree gives the same answers"

# %% The figure.
figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
axes.loglog(seconds, errors, "o-")
axes.set(xlabel="run time in seconds", ylabel="internal area over the best found, less 1")
axes.set_title(f"Error against run time, {len(triangles)} triangles")
axes.grid(which="both", alpha=0.3)
out = Path(sys.argv[1] if len(sys.argv) > 1 and not hasattr(sys, "ps1") else "error_against_time.svg")
figure.savefig(out)
print(f"wrote {out}")
