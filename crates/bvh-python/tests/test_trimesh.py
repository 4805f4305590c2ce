"""Compares the ray queries of trimesh with its own engine in Python."""

import copy
import pickle
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest

trimesh = pytest.importorskip("trimesh")

from bvh_search.trimesh import RayMeshIntersector  # noqa: E402

RANDOM = np.random.default_rng(12)


def meshes():
    far = trimesh.creation.icosphere(subdivisions=2)
    far.apply_translation([1e6, -2e6, 5e5])
    return [trimesh.creation.box(), trimesh.creation.icosphere(subdivisions=3), trimesh.creation.torus(2, 0.5), far]


def rays_of(mesh, count=300):
    origins = mesh.bounds.mean(axis=0) + RANDOM.normal(size=(count, 3)) * mesh.extents.max()
    targets = mesh.bounds.mean(axis=0) + RANDOM.uniform(-0.6, 0.6, (count, 3)) * mesh.extents
    return origins, targets - origins


@pytest.mark.parametrize("mesh", meshes())
def test_answers_are_those_of_the_python_engine(mesh):
    pytest.importorskip("rtree")
    from trimesh.ray.ray_triangle import RayMeshIntersector as Python

    ours, python = RayMeshIntersector(mesh), Python(mesh)
    origins, directions = rays_of(mesh)
    first = ours.intersects_first(origins, directions)
    np.testing.assert_array_equal(first, python.intersects_first(origins, directions))
    np.testing.assert_array_equal(ours.intersects_any(origins, directions), first >= 0)
    locations, index_ray, index_tri = ours.intersects_location(origins, directions)
    order = np.lexsort((index_tri, index_ray))
    theirs, their_ray, their_tri = python.intersects_location(origins, directions)
    their_order = np.lexsort((their_tri, their_ray))
    np.testing.assert_array_equal(index_ray[order], their_ray[their_order])
    np.testing.assert_array_equal(index_tri[order], their_tri[their_order])
    np.testing.assert_allclose(locations[order], theirs[their_order], rtol=1e-9, atol=1e-6 * mesh.scale)
    points = mesh.bounds.mean(axis=0) + RANDOM.uniform(-0.6, 0.6, (300, 3)) * mesh.extents
    np.testing.assert_array_equal(ours.contains_points(points), python.contains_points(points))
    index_tri, index_ray = ours.intersects_id(origins, directions, multiple_hits=False)
    np.testing.assert_array_equal(index_tri, first[index_ray])
    index_tri, index_ray = ours.intersects_id(origins, directions, max_hits=1)
    np.testing.assert_array_equal(index_ray, np.nonzero(first >= 0)[0])


def test_a_ray_that_touches_an_edge_or_a_corner_has_a_hit_in_every_query():
    mesh = trimesh.creation.box()
    # At the middle of an edge, at a corner, through a corner, past all, and through two faces.
    origins = [[1.5, 0.1, -0.5], [1.5, 0.5, -0.5], [1.5, 1.5, 1.5], [1.5, 0.1, -0.4], [0.1, 0.2, 1.5]]
    directions = [[-1, 0, 1], [-1, 0, 1], [-1, -1, -1], [-1, 0, 1], [0, 0, -1]]
    ours = RayMeshIntersector(mesh)
    hits = np.array([True, True, True, False, True])
    np.testing.assert_array_equal(ours.intersects_any(origins, directions), hits)
    locations, index_ray, index_tri = ours.intersects_location(origins, directions)
    np.testing.assert_array_equal(index_ray, [0, 1, 2, 2, 4, 4])
    np.testing.assert_allclose(locations[:2], [[0.5, 0.1, 0.5], [0.5, 0.5, 0.5]])
    first = ours.intersects_first(origins, directions)
    np.testing.assert_array_equal(index_tri[:2], first[:2])


@pytest.mark.parametrize("away", [1e3, 1e5, 1e7, 1e9])
def test_rays_from_far_away_hit_the_faces_of_exact_arithmetic(away):
    mesh = trimesh.creation.icosphere(subdivisions=1)
    corners = [[list(map(Fraction, corner)) for corner in face] for face in mesh.triangles.tolist()]
    directions = RANDOM.normal(size=(60, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origins = RANDOM.normal(size=(60, 3)) * 0.4 - directions * away
    rays = [[list(map(Fraction, part)) for part in ray] for ray in zip(origins.tolist(), directions.tolist())]
    expected = [first_face(corners, *ray) for ray in rays]
    assert RayMeshIntersector(mesh).intersects_first(origins, directions).tolist() == expected
    locations, index_ray, index_tri = RayMeshIntersector(mesh).intersects_location(origins, directions)
    assert len(locations) == 2 * sum(face >= 0 for face in expected)
    heights = ((locations - mesh.triangles[index_tri, 0]) * mesh.face_normals[index_tri]).sum(axis=1)
    offsets = np.linalg.norm(np.cross(locations - origins[index_ray], directions[index_ray]), axis=1)
    np.testing.assert_allclose(heights, 0, atol=1e-14 * max(away, 10))
    np.testing.assert_allclose(offsets, 0, atol=1e-14 * max(away, 10))


def first_face(faces, origin, direction):
    """Returns the first face that a ray of rationals hits, or -1."""
    nearest = (None, -1)
    for number, (a, b, c) in enumerate(faces):
        normal = cross(minus(b, a), minus(c, a))
        along = dot(normal, direction)
        if along == 0:
            continue
        t = dot(normal, minus(a, origin)) / along
        point = [x + t * y for x, y in zip(origin, direction)]
        sides = (dot(cross(minus(q, p), minus(point, p)), normal) for p, q in ((a, b), (b, c), (c, a)))
        if t >= 0 and min(sides) >= 0 and (nearest[0] is None or t < nearest[0]):
            nearest = (t, number)
    return nearest[1]


def minus(p, q):
    return [a - b for a, b in zip(p, q)]


def dot(p, q):
    return sum(a * b for a, b in zip(p, q))


def cross(p, q):
    return [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]


def test_a_mesh_with_a_hole_has_an_inside():
    mesh = trimesh.creation.icosphere(subdivisions=2)
    points = RANDOM.uniform(-1.2, 1.2, (1000, 3))
    radius = np.linalg.norm(points, axis=1)
    points = points[(radius < 0.9) | (radius > 1.05)]
    mesh.update_faces(np.arange(len(mesh.faces)) != 7)
    assert not mesh.is_watertight
    inside = RayMeshIntersector(mesh).contains_points(points)
    np.testing.assert_array_equal(inside, np.linalg.norm(points, axis=1) < 1)


@pytest.mark.parametrize("stray", [[0, 0, 0], [np.nan] * 3, [-1e12, 1e12, 3]])
def test_vertices_that_no_face_uses_change_no_answer(stray):
    mesh = trimesh.creation.icosphere(subdivisions=2)
    mesh.apply_translation([512345.678, 5412345.678, 321.5])
    strayed = trimesh.Trimesh(np.concatenate([mesh.vertices, [stray]]), mesh.faces, process=False)
    ours, same = RayMeshIntersector(mesh), RayMeshIntersector(strayed)
    rays = rays_of(mesh)
    assert 0.2 < (ours.intersects_first(*rays) >= 0).mean() < 0.9
    for expected, found in zip(ours.intersects_location(*rays), same.intersects_location(*rays)):
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(same.contains_points(rays[0]), ours.contains_points(rays[0]))


def test_an_engine_follows_its_mesh_and_is_copied():
    mesh = trimesh.creation.box()
    mesh.ray = RayMeshIntersector(mesh)
    above, down = [[0.1, 0.2, 5]], [[0, 0, -1]]
    assert mesh.ray.intersects_location(above, down, multiple_hits=False)[0].tolist() == [[0.1, 0.2, 0.5]]
    mesh.apply_scale(2)
    assert mesh.ray.intersects_location(above, down, multiple_hits=False)[0].tolist() == [[0.1, 0.2, 1]]
    assert mesh.contains([[0, 0, 0.9]]).tolist() == [True]
    for twin in (copy.copy(mesh.ray), copy.deepcopy(mesh.ray), pickle.loads(pickle.dumps(mesh.ray))):
        assert twin.intersects_any(above, down).tolist() == [True]
    assert mesh.ray.intersects_first([[0, 0, 5]] * 2, [[0, 0, 0], [np.nan, 0, 1]]).tolist() == [-1, -1]
    assert mesh.ray.intersects_first(np.empty((0, 3)), np.empty((0, 3))).shape == (0,)


MANY_MESHES = """
import gc, trimesh, weakref
from bvh_search.trimesh import RayMeshIntersector
# The collector itself would not run here.
gc.set_threshold(1_000_000)
sphere, engines = trimesh.creation.icosphere(subdivisions=5), []
for _ in range(100):
    mesh = trimesh.Trimesh(sphere.vertices, sphere.faces, process=False)
    mesh.ray = RayMeshIntersector(mesh, seconds=0)
    mesh.ray.intersects_any([[0, 0, 5]], [[0, 0, -1]])
    engines.append(weakref.ref(mesh.ray))
print(sum(engine() is not None for engine in engines) * len(sphere.faces))
"""


def test_meshes_that_nobody_uses_are_freed_before_they_fill_the_memory():
    ended = subprocess.run([sys.executable, "-c", MANY_MESHES], capture_output=True, text=True, check=True)
    assert int(ended.stdout) <= 1_100_000
