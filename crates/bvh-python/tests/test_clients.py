"""Tests all hits, points, copies and the classes for users of trimesh and Open3D."""

import copy
import doctest
import importlib
import importlib.util
import inspect
import pickle

import numpy as np
import pytest

import bvh_search
from bvh_search import RaycastingScene, Tracer, Tree

RANDOM = np.random.default_rng(11)


def box(low=-1.0, high=1.0):
    """Vertices and faces of a closed box whose faces run counterclockwise from outside."""
    vertices = np.array([[x, y, z] for x in (low, high) for y in (low, high) for z in (low, high)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [face for a, b, c, d in quads for face in [(a, b, c), (a, c, d)]]
    return vertices, np.array(faces)


def test_all_hits_count_edges_and_corners_once():
    vertices, faces = box()
    tracer = Tracer(Tree.from_mesh(vertices, faces, work=1000))
    # Through corners, through edges of faces, and along their diagonals.
    targets = np.concatenate([vertices, vertices[faces].mean(axis=1), vertices[faces][:, :2].mean(axis=1)])
    inside = np.zeros_like(targets) + [0.1, 0.2, 0.3]
    assert (tracer.counts(inside, targets - inside) == 1).all()
    outside = inside + [0, 0, 9]
    assert (tracer.counts(outside, targets - outside) % 2 == 0).all()
    t, triangle, ray = tracer.all([[-3, 0, 0], [9, 9, 9]], [[1, 0, 0], [1, 0, 0]], t_max=[3, 9])
    assert (t.tolist(), ray.tolist(), len(triangle)) == ([2], [0], 1)
    assert (t.dtype, triangle.dtype, ray.dtype) == (np.float32, np.int32, np.int64)
    points = RANDOM.uniform(-2, 2, (500, 3))
    np.testing.assert_array_equal(tracer.contains(points), (np.abs(points) < 1).all(axis=1))


def test_points_have_closest_points_and_signed_distances():
    tracer = Tracer(Tree.from_mesh(*box(), work=1000))
    points = RANDOM.uniform(-3, 3, (500, 3)).astype(np.float32)
    closest, triangle, distance = tracer.closest(points)
    inside = (np.abs(points) < 1).all(axis=1)
    expected = np.linalg.norm(points - points.clip(-1, 1), axis=1)
    np.testing.assert_allclose(distance[~inside], expected[~inside], rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(closest - points, axis=1), distance)
    signed = tracer.signed_distance(points)
    np.testing.assert_allclose(signed[inside], np.abs(points[inside]).max(axis=1) - 1)
    np.testing.assert_array_equal(signed < 0, inside)
    assert (triangle >= 0).all()
    closest, triangle, distance = tracer.closest([[np.nan, 0, 0]])
    assert (np.isnan(closest).all(), triangle[0], distance[0]) == (True, -1, np.inf)


def test_surfaces_have_weights_and_normals():
    vertices, faces = box()
    tracer = Tracer(Tree.from_mesh(vertices, faces, work=1000))
    origins, directions = np.zeros((200, 3)), RANDOM.normal(size=(200, 3))
    t, triangle = tracer.nearest(origins, directions)
    u, v, normals = tracer.surface(origins, directions, triangle)
    a, b, c = np.moveaxis(vertices[faces][triangle], 1, 0)
    found = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    np.testing.assert_allclose(found, directions * t[:, None], atol=1e-6)
    assert ((normals * directions).sum(axis=1) > 0).all()
    assert [part[0].tolist() for part in tracer.surface([[0, 0, 0]], [[0, 0, 1]], [-1])] == [0, 0, [0, 0, 0]]
    with pytest.raises(ValueError, match="triangle: accepted: an index below 12 per ray, or -1"):
        tracer.surface([[0, 0, 0]], [[0, 0, 1]], [12])


def test_invalid_rays_are_misses_on_request():
    tracer = Tracer(Tree.from_mesh(*box(), work=1000))
    origins = [[0, 0, 0], [0, 0, 0], [np.inf, 0, 0], [0, 0, 0]]
    directions = [[0, 0, 0], [np.nan, 0, 1], [0, 0, 1], [0, 0, 1]]
    t, triangle = tracer.nearest(origins, directions, invalid="miss")
    assert t.tolist() == [np.inf, np.inf, np.inf, 1]
    assert tracer.any(origins, directions, invalid="miss").tolist() == [False, False, False, True]
    assert tracer.counts(origins, directions, invalid="miss").tolist() == [0, 0, 0, 1]
    assert tracer.all(origins, directions, invalid="miss")[2].tolist() == [3]
    for ask in (tracer.nearest, tracer.any, tracer.all, tracer.counts):
        with pytest.raises(ValueError, match="ray 0: the ray's direction"):
            ask(origins, directions)
        with pytest.raises(ValueError, match='invalid is "hit"; accepted: error, miss'):
            ask(origins, directions, invalid="hit")


def test_trees_and_tracers_are_copied_and_pickled():
    vertices, faces = box()
    for tree in (Tree.from_mesh(vertices, faces, work=1000), Tree.from_boxes([[0, 0, 0, 1, 1, 1]] * 3, work=9)):
        for twin in (pickle.loads(pickle.dumps(tree)), copy.deepcopy(tree), copy.copy(tree)):
            np.testing.assert_array_equal(twin.nodes(), tree.nodes())
            assert twin.cost() == tree.cost()
    tree = Tree.from_mesh(vertices, faces, work=1000)
    twin, tracer = pickle.loads(pickle.dumps(tree)), Tracer(tree)
    twin.update(2 * vertices)
    assert twin.cost() == pytest.approx(4 * tree.cost())
    for tracer, t in [(tracer, 1), (pickle.loads(pickle.dumps(tracer)), 1), (Tracer(twin), 2)]:
        assert tracer.nearest([[0, 0, 0]], [[1, 0.1, 0.2]])[0].tolist() == [t]
    with pytest.raises(ValueError, match="accepted: a tree from Tree.from_mesh"):
        Tree.from_boxes([[0, 0, 0, 1, 1, 1]], work=9).update(vertices)
    with pytest.raises(ValueError, match="faces: face 1 names vertex -1"):
        Tree.from_mesh(vertices, [[0, 1, 2], [0, -1, 2]])


def test_copies_keep_the_rays_of_the_search_and_change_alone():
    low = RANDOM.uniform(0, 10, (3000, 1, 3))
    triangles = (low + RANDOM.uniform(0, 1, (3000, 3, 3))).astype(np.float32)
    rays = RANDOM.uniform(0, 2, (500, 2, 3))
    tree = Tree.from_triangles(triangles, work=300_000, rays=rays, seed=5, references=1.2)
    twins = [copy.copy(tree), copy.deepcopy(tree), copy.deepcopy([tree, tree])[1]]
    before = tree.nodes()
    twins[0].improve(work=300_000)
    # Only the improved tree has changed.
    assert len(twins[0].nodes()) != len(before) or (twins[0].nodes() != before).any()
    for other in (tree, *twins[1:]):
        np.testing.assert_array_equal(other.nodes(), before)
    # The same search over the same tree has the same result.
    for other in (tree, *twins[1:]):
        other.improve(work=300_000)
        np.testing.assert_array_equal(other.nodes(), twins[0].nodes())


def test_copies_keep_the_faces_and_move_alone():
    vertices, faces = box()
    tree = Tree.from_mesh(vertices, faces, work=1000)
    inside = [[0, 0, 0]], [[1, 0.1, 0.2]]
    for twin in (copy.copy(tree), copy.deepcopy(tree)):
        tracer = Tracer(twin)
        twin.update(3 * vertices)
        assert twin.cost() == pytest.approx(9 * tree.cost())
        for moved in (Tracer(twin), copy.copy(Tracer(twin)), copy.deepcopy(Tracer(twin))):
            assert moved.nearest(*inside)[0].tolist() == [3]
        # A tracer and its copies remain at the old places.
        for old in (tracer, copy.copy(tracer), copy.deepcopy(tracer), Tracer(tree)):
            assert old.nearest(*inside)[0].tolist() == [1]


def test_a_search_follows_seed_work_rays_and_progress():
    low = RANDOM.uniform(0, 10, (3000, 3))
    boxes = np.stack([low, low + RANDOM.uniform(0, 1, (3000, 3))], axis=1)
    same = [Tree.from_boxes(boxes, work=300_000, seed=seed).nodes() for seed in (1, 1, 2)]
    np.testing.assert_array_equal(same[0], same[1])
    assert (same[0] != same[2]).any()
    rays = RANDOM.uniform(0, 2, (500, 2, 3))
    assert (Tree.from_boxes(boxes, work=300_000, rays=rays).nodes() != same[0]).any()
    with pytest.raises(ValueError, match="rays: segment 3 has a coordinate that is not finite"):
        Tree.from_boxes(boxes, rays=np.where(np.arange(500)[:, None, None] == 3, np.nan, rays))
    calls = []
    tree = Tree.from_boxes(boxes, 0.5, progress=lambda *state: calls.append(state))
    assert len(calls) > 2 and calls == sorted(calls, key=lambda call: (call[0], -call[1]))
    assert calls[-1][1] >= tree.cost() * (1 - 1e-9)

    def stop(seconds, cost):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        tree.improve(60, progress=stop)


def test_a_scene_has_open3ds_answers():
    scene = RaycastingScene(seconds=0.05)
    vertices, faces = box()
    assert [scene.add_triangles(vertices, faces), scene.add_triangles(vertices + [5, 0, 0], faces)] == [0, 1]
    rays = [[[-3, 0.1, 0.2, 1, 0, 0], [9, 9, 9, 0, 0, 1]], [[3, 0.1, 0.2, 1, 0, 0], [0, 0, 0, 0, 0, 0]]]
    hits = scene.cast_rays(rays)
    assert hits["t_hit"].tolist() == [[2, np.inf], [1, np.inf]]
    assert hits["geometry_ids"].tolist() == [[0, scene.INVALID_ID], [1, scene.INVALID_ID]]
    assert (hits["primitive_ids"] < 12).tolist() == [[True, False], [True, False]]
    assert hits["primitive_normals"][0, 0].tolist() == [-1, 0, 0]
    assert scene.test_occlusions(rays).tolist() == [[True, False], [True, False]]
    assert scene.test_occlusions(rays, tfar=1.5).tolist() == [[False, False], [True, False]]
    assert scene.count_intersections(rays).tolist() == [[4, 0], [2, 0]]
    every = scene.list_intersections(rays)
    assert every["ray_splits"].tolist() == [0, 4, 4, 6, 6]
    assert every["geometry_ids"].tolist() == [0, 0, 1, 1, 1, 1]
    points = [[0, 0, 0.5], [5, 0, 3]]
    assert scene.compute_signed_distance(points).tolist() == [-0.5, 2]
    assert scene.compute_distance(points).tolist() == [0.5, 2]
    assert scene.compute_occupancy(points).tolist() == [1, 0]
    closest = scene.compute_closest_points(points)
    assert closest["points"].tolist() == [[0, 0, 1], [5, 0, 1]]
    assert closest["geometry_ids"].tolist() == [0, 1]
    assert closest["primitive_normals"].tolist() == [[0, 0, 1]] * 2
    corners = (vertices[faces], vertices[faces] + [5, 0, 0])
    for i, point in enumerate(closest["points"]):
        a, b, c = corners[closest["geometry_ids"][i]][closest["primitive_ids"][i]]
        u, v = closest["primitive_uvs"][i]
        np.testing.assert_allclose(a + u * (b - a) + v * (c - a), point, atol=1e-6)


def test_every_public_function_has_an_example_and_all_examples_run():
    parts = [(bvh_search, Tree), (bvh_search, Tracer), (bvh_search, RaycastingScene)]
    if importlib.util.find_spec("trimesh"):
        module = importlib.import_module("bvh_search.trimesh")
        parts.append((module, module.RayMeshIntersector))
    for module, part in parts:
        names = [name for name in vars(part) if not name.startswith("_") and name.islower()]
        documentation = {name: getattr(part, name).__doc__ for name in names}
        assert {name for name, text in documentation.items() if ">>>" not in text} == set()
        texts = [module.__doc__, part.__doc__, *documentation.values()]
        examples = "\n\n".join(map(inspect.cleandoc, texts))
        test = doctest.DocTestParser().get_doctest(examples, {}, part.__name__, None, None)
        assert doctest.DocTestRunner().run(test).failed == 0
