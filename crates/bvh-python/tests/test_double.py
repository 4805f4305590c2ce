"""Tests trees with precision="double". That their answers are exact is tested by rationals in bvh-core."""

import copy
import pickle

import numpy as np
import pytest

from bvh_search import Tracer, Tree

RANDOM = np.random.default_rng(68)
PLACES = [(0, 0, 0), (5e5, 5e6, 100), (1e9, -2e9, 3e9)]


def box(size=1.0, place=(0, 0, 0)):
    """Vertices and faces of a closed box whose faces run counterclockwise from outside."""
    vertices = np.array([[x, y, z] for x in (-size, size) for y in (-size, size) for z in (-size, size)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [face for a, b, c, d in quads for face in [(a, b, c), (a, c, d)]]
    return vertices + place, np.array(faces)


def tracer_of(vertices, faces):
    return Tracer(Tree.from_mesh(vertices, faces, work=2000, precision="double"))


def soup(place, size, count=60):
    """Triangles of this size around a place, and rays at them of which most hit one."""
    triangles = (place + size * RANDOM.uniform(-1, 1, (count, 1, 3))) + size * RANDOM.uniform(-0.5, 0.5, (count, 3, 3))
    origins = place + size * RANDOM.uniform(-3, 3, (100, 3))
    return triangles, origins, triangles[RANDOM.integers(0, count, 100)].mean(axis=1) - origins


def test_answers_are_those_of_a_single_tree_where_float32_has_all_numbers():
    triangles, origins, directions = (array.astype(np.float32) for array in soup((0, 0, 0), 1.0))
    single, double = (Tracer(Tree.from_triangles(triangles, work=2000, precision=name)) for name in ("single", "double"))
    excluded = single.nearest(origins, directions)[1]
    several = np.stack([excluded, np.full(len(excluded), -1), RANDOM.integers(0, len(triangles), len(excluded))], axis=1)
    selections = [{"orientation": side, "exclude": ids} for side in ("exiting", "entering", "any") for ids in (excluded, several, several[:, :0])]
    for name in ("nearest", "any", "all", "counts"):
        for limits, select in [((), {}), ((0.25, 1.5), {}), *(((), select) for select in selections if name in ("nearest", "any"))]:
            answers = [getattr(tracer, name)(origins, directions, *limits, **select) for tracer in (single, double)]
            for expected, found in zip(*answers) if isinstance(answers[0], tuple) else [answers]:
                np.testing.assert_array_equal(np.asarray(found, expected.dtype), expected)
    for name in ("contains", "signed_distance", "closest"):
        np.testing.assert_equal(getattr(double, name)(origins), getattr(single, name)(origins))
    hits = origins, directions, single.nearest(origins, directions)[1]
    for expected, found in zip(single.surface(*hits), double.surface(*hits)):
        assert found.dtype == np.float64
        np.testing.assert_array_equal(found.astype(expected.dtype), expected)


@pytest.mark.parametrize("place", PLACES)
def test_details_of_a_millionth_remain_far_from_the_origin(place):
    detail = 1e-6 * max(1, np.abs(place).max() / 5e6)
    vertices, faces = box(detail, place)
    # The corners as they are after the rounding of their sums.
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    tracer = tracer_of(vertices, faces)
    points = place + detail * RANDOM.uniform(-2, 2, (400, 3))
    points = points[((points != low) & (points != high)).all(axis=1)]
    inside = ((low < points) & (points < high)).all(axis=1)
    assert 20 < inside.sum() < 200
    np.testing.assert_array_equal(tracer.contains(points), inside)
    np.testing.assert_array_equal(tracer.signed_distance(points) < 0, inside)
    beside = points - points.clip(low, high)
    closest, _, distance = tracer.closest(points)
    step = np.spacing(np.abs(vertices).max())
    np.testing.assert_allclose(closest[~inside], points.clip(low, high)[~inside], rtol=0, atol=2 * step)
    np.testing.assert_allclose(distance[~inside], np.linalg.norm(beside, axis=1)[~inside], rtol=1e-12)
    above = points * [1, 1, 0] + [0, 0, high[2] + 1]
    t, triangle = tracer.nearest(above, [0, 0, -1])
    within = ((low < points) & (points < high))[:, :2].all(axis=1)
    np.testing.assert_array_equal(triangle >= 0, within)
    assert set(t[within].tolist()) == {above[0, 2] - high[2]}
    u, v, normals = tracer.surface(above, [0, 0, -1], triangle)
    a, b, c = np.moveaxis(vertices[faces][triangle[within]], 1, 0)
    found = a + u[within, None] * (b - a) + v[within, None] * (c - a)
    np.testing.assert_allclose(found[:, :2], points[within, :2], rtol=0, atol=2 * step)
    assert (normals.dtype, normals[within].tolist()) == (np.float64, [[0, 0, 1]] * within.sum())


def test_a_ray_walks_through_nested_boxes_by_excluding_its_last_face():
    sizes = (1, 2, 3)
    meshes = [box(size, (5e5, 5e6, 100)) for size in sizes]
    vertices = np.concatenate([mesh[0] for mesh in meshes])
    faces = np.concatenate([mesh[1] + 8 * number for number, mesh in enumerate(meshes)])
    tracer = tracer_of(vertices, faces)
    points = np.array([5e5, 5e6, 100]) + RANDOM.integers(-512, 512, (300, 3)) / 1024
    points[:, 0] -= 4
    # Beside the diagonals, where a ray meets two faces.
    points[:, 2] += 1 / 2048
    last = np.full(300, -1)
    for x in (-3, -2, -1, 1, 2, 3):
        t, face = tracer.nearest(points, [1, 0, 0], exclude=last)
        points[:, 0] += t
        assert (points[:, 0] == 5e5 + x).all()
        # Without the exclusion the ray stays where it is, and so it does with another one.
        again = tracer.nearest(points, [1, 0, 0])
        assert (again[0].tolist(), again[1].tolist()) == ([0] * 300, face.tolist())
        both = np.stack([np.full(300, -1), face], axis=1)
        assert (tracer.nearest(points, [1, 0, 0], exclude=both)[1] != face).all()
        sides = [tracer.nearest(points, [1, 0, 0], orientation=side)[0] == 0 for side in ("entering", "exiting")]
        assert (sides[0].all(), sides[1].any()) == ((True, False) if x < 0 else (False, True))
        last = face
    assert not tracer.any(points, [1, 0, 0], exclude=last).any()
    one = tracer.nearest(points[:1], [1, 0, 0])[1][0]
    assert tracer.any(points[:1], [1, 0, 0]).tolist() == [True]
    assert tracer.any(points[:1], [1, 0, 0], exclude=one).tolist() == [False]
    assert tracer.any(points, [1, 0, 0], exclude=np.empty((300, 0), int)).all()


def test_trees_are_kept_moved_and_copied_in_their_precision(tmp_path):
    vertices, faces = box(1e-6, (5e5, 5e6, 100))
    tree = Tree.from_mesh(vertices, faces, work=1000, precision="double")
    tree.improve(work=1000)
    tree.save(tmp_path / "box.bvh")
    loaded = Tree.load(tmp_path / "box.bvh", vertices=vertices, faces=faces, precision="double")
    loose = Tree.load(tmp_path / "box.bvh", triangles=vertices[faces], precision="double")
    with pytest.raises(ValueError, match='path: .*precision="double"'):
        Tree.load(tmp_path / "box.bvh", vertices=vertices, faces=faces)
    Tree.from_mesh(vertices, faces, work=1000).save(tmp_path / "single.bvh")
    with pytest.raises(ValueError, match='path: .*precision="single"'):
        Tree.load(tmp_path / "single.bvh", vertices=vertices, faces=faces, precision="double")
    ray = vertices.mean(axis=0), [1, 0.125, 0.25]
    expected = tracer_of(vertices, faces).nearest(*ray)
    assert expected[1][0] >= 0
    for twin in (loaded, loose, copy.copy(tree), copy.deepcopy(tree), pickle.loads(pickle.dumps(tree))):
        assert (twin.precision, len(twin)) == ("double", 12)
        np.testing.assert_array_equal(twin.nodes(), tree.nodes())
        for tracer in (Tracer(twin), pickle.loads(pickle.dumps(Tracer(twin)))):
            np.testing.assert_equal(tracer.nearest(*ray), expected)
        if twin is not loose:
            moved = vertices + [0, 0, 0.5e-6]
            twin.update(moved)
            np.testing.assert_equal(Tracer(twin).nearest(*ray), tracer_of(moved, faces).nearest(*ray))
    assert Tree.from_mesh(vertices, faces, work=9).precision == "single"
    assert Tree.from_boxes([[0, 0, 0, 1, 1, 1]], work=9).precision == "single"


def test_numbers_too_small_for_a_tree_are_nothing_where_invalid_rays_are_misses():
    tracer = tracer_of(*box())
    origins, directions = [[0, 1e-60, 0], [0, 0, 0], [0, 1e40, 0]], [[0, 0, 1], [1e-60, 0, 1], [0, 0, 1]]
    assert tracer.nearest(origins, directions, invalid="miss")[0].tolist() == [1, 1, np.inf]
