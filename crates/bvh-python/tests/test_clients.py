"""Tests all hits, points, copies and the classes for users of trimesh and Open3D."""

import ast
import copy
import doctest
import importlib
import importlib.util
import inspect
import os
import pickle
from pathlib import Path

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


def test_points_are_inside_meshes_with_overlaps_holes_and_mixed_corners_by_the_right_rule():
    vertices, faces = box()
    triangles = vertices[faces].astype(np.float32)
    points = RANDOM.uniform(-2, 2, (5000, 3)).astype(np.float32)
    inside = (np.abs(points) < 1).all(axis=1)
    both = inside | (np.abs(points - [0.75, 0.25, 0.5]) < 1).all(axis=1)
    # Parity does not care for the direction of corners, and auto chooses it for such a mesh.
    mixed = np.where(np.arange(12)[:, None, None] % 2 == 0, triangles, triangles[:, ::-1])
    overlapping = np.concatenate([triangles, triangles + [0.75, 0.25, 0.5]])
    for mesh, expected, rules in [
        (overlapping, both, ("auto", "winding")),
        (mixed, inside, ("auto", "parity")),
    ]:
        tracer = Tracer(Tree.from_triangles(mesh, work=1000))
        assert tracer.watertight
        for rule in ("auto", "winding", "parity"):
            is_right = rule in rules
            assert (tracer.contains(points, by=rule) == expected).all() == is_right
            assert ((tracer.signed_distance(points, by=rule) < 0) == expected).all() == is_right
    opened = Tracer(Tree.from_triangles(triangles[1:], work=1000))
    assert not opened.watertight
    assert opened.contains([[0, 0.9, 0.9], [0, 0, 3]]).tolist() == [True, False]


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize(
    ("limits", "is_hit"),
    [
        ((0, 1 - 1e-9), False),
        ((1 + 1e-9, np.inf), False),
        ((1 - 1e-9, 1 + 1e-9), True),
        ((1, 1), True),
        ((1e-60, 1e300), True),
        ((1e300, np.inf), False),
        ((0, -1e-60), False),
    ],
)
def test_limits_in_float64_exclude_every_distance_beyond_them(precision, limits, is_hit):
    corners = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1]], precision)
    tracer = Tracer(Tree.from_mesh(corners, [[0, 1, 2]], work=10, precision=precision))
    rays = [[0.25, 0.25, 0]], [[0, 0, 1]], limits[0], [limits[1]]
    expected = [[is_hit], [is_hit], [0] * is_hit, [is_hit]]
    found = [tracer.any(*rays), tracer.nearest(*rays)[1] == 0, tracer.all(*rays)[1], tracer.counts(*rays)]
    assert [answer.tolist() for answer in found] == expected
    scene = RaycastingScene(seconds=0.01)
    scene.add_triangles(corners, [[0, 1, 2]])
    assert scene.test_occlusions([[0.25, 0.25, 0, 0, 0, 1]], *limits).tolist() == [is_hit]


@pytest.mark.parametrize("places", [[0, 1e4], [0, 0, 1e5], [1e9, 1e9], [0, -1e7], [5e8, 6e8, 5e8]])
def test_a_scene_keeps_the_shape_of_meshes_that_are_far_apart(places):
    vertices, faces = box()
    scene = RaycastingScene(seconds=0.01)
    for place in places:
        scene.add_triangles(vertices + [place, 0, 0], faces)
    rays = np.array([[place + 0.3, 0.2, 9, 0, 0, -1] for place in places])
    assert scene.cast_rays(rays)["t_hit"].tolist() == [8] * len(places)
    beside = rays + [1 - 0.3 + 1e-6, 0, 0, 0, 0, 0]
    assert not scene.test_occlusions(beside).any()


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
    with pytest.raises(ValueError, match="accepted: a tree of vertices and faces"):
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


def test_a_loaded_tree_of_a_mesh_moves(tmp_path):
    vertices, faces = box()
    Tree.from_mesh(vertices, faces, work=1000).save(tmp_path / "box.bvh")
    tree = Tree.load(tmp_path / "box.bvh", vertices=vertices, faces=faces)
    tree.update(vertices + [0, 0, 7])
    tracer = Tracer(tree)
    assert tracer.nearest([0.1, 0.2, 0], [0, 0, 1])[0].tolist() == [6]
    assert repr(tracer) == "<Tracer of 12 triangles>"


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("kind", ["f4", "f8"])
def test_one_origin_or_direction_is_for_all_rays(precision, kind):
    tracer = Tracer(Tree.from_mesh(*box(), work=1000, precision=precision))
    many = np.random.default_rng(1).uniform(-0.9, 0.9, (3000, 3)).astype(kind)
    one = np.array([3, 0.1, 0.2], kind)
    for name in ("nearest", "any", "all", "counts"):
        ask = getattr(tracer, name)
        for all_of_one in (one, one[None]):
            for rays, whole in [((all_of_one, many), (np.tile(one, (3000, 1)), many)), ((many, all_of_one), (many, np.tile(one, (3000, 1))))]:
                np.testing.assert_equal(ask(*rays), ask(*whole))
    assert tracer.any(one, np.empty((0, 3))).shape == (0,)


def test_a_search_follows_seed_work_rays_and_progress():
    low = RANDOM.uniform(0, 10, (3000, 3))
    boxes = np.stack([low, low + RANDOM.uniform(0, 1, (3000, 3))], axis=1)
    # Within less work reinsertion, which has no seed, is ahead.
    same = [Tree.from_boxes(boxes, work=3_000_000, seed=seed).nodes() for seed in (1, 1, 2)]
    np.testing.assert_array_equal(same[0], same[1])
    assert (same[0] != same[2]).any()
    rays = RANDOM.uniform(0, 2, (500, 2, 3))
    assert (Tree.from_boxes(boxes, work=3_000_000, rays=rays).nodes() != same[0]).any()
    with pytest.raises(ValueError, match="rays has NaN in row 3; accepted: finite"):
        Tree.from_boxes(boxes, rays=np.where(np.arange(500)[:, None, None] == 3, np.nan, rays))
    calls = []
    tree = Tree.from_boxes(boxes, 0.5, progress=lambda *state: calls.append(state))
    assert len(calls) > 2 and calls == sorted(calls, key=lambda call: (call[0], -(call[1] or np.inf)))
    assert calls[-1][1] >= tree.cost() * (1 - 1e-9)
    calls.clear()
    # A greedy tree over so many takes longer than the time between two calls.
    many = np.random.default_rng(1).uniform(0, 10, (400_000, 1, 3)) + [[0, 0, 0], [1, 1, 1]]
    Tree.from_boxes(many, 0.1, progress=lambda *state: calls.append(state))
    assert calls[0][1] is None and all(cost is None or 0 < cost < np.inf for _, cost in calls)

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


class Tensor:
    """The parts of Open3D's tensors that matter here."""

    def __init__(self, array):
        self.array = np.array(array)

    def __dlpack__(self, stream=None):
        raise AssertionError("numpy asks with max_version first, and the refusal prints all numbers")

    def __dlpack_device__(self):
        return self.array.__dlpack_device__()

    @staticmethod
    def from_numpy(array):
        return Tensor(array)

    def numpy(self):
        return self.array

    def __len__(self):
        return len(self.array)

    def __getitem__(self, index):
        raise AssertionError("nobody reads a tensor number by number")


class NoTensor:
    def __init__(self, **attributes):
        self.__dict__.update(attributes)


def test_a_scene_takes_and_answers_open3ds_meshes_and_tensors():
    vertices, faces = box()
    tensors = NoTensor(vertex={"positions": Tensor(vertices)}, triangle={"indices": Tensor(faces)})
    legacy = NoTensor(vertices=vertices, triangles=faces)
    rays, points = np.array([[3, 0.1, 0.2, -1, 0, 0]], "f4"), np.array([[0, 0, 0.5]], "f4")
    for mesh in ((tensors,), (legacy,), (Tensor(vertices), Tensor(faces))):
        scene = RaycastingScene(seconds=0)
        assert scene.add_triangles(*mesh) == 0
        for name, question in [
            *[(name, rays) for name in ("cast_rays", "test_occlusions", "count_intersections", "list_intersections")],
            *[(f"compute_{name}", points) for name in ("closest_points", "distance", "signed_distance", "occupancy")],
        ]:
            arrays, answers = getattr(scene, name)(question), getattr(scene, name)(Tensor(question))
            if not isinstance(arrays, dict):
                arrays, answers = {"": arrays}, {"": answers}
            for key, array in arrays.items():
                assert type(answers[key]) is Tensor and type(array.cpu().numpy()) is np.ndarray
                assert isinstance(array, np.ndarray) and array.isfinite().all()
                assert answers[key].numpy().dtype == array.dtype
                np.testing.assert_array_equal(answers[key].numpy(), array)
    camera = RaycastingScene.create_rays_pinhole(Tensor(np.eye(3)), Tensor(np.eye(4)), 2, 3)
    assert type(camera) is Tensor and camera.numpy().shape == (3, 2, 6)
    assert Tracer(Tree.from_mesh(vertices, faces, 0)).any(Tensor(rays[:, :3]), Tensor(rays[:, 3:])).tolist() == [True]


def test_a_scene_answers_like_open3d():
    o3d = pytest.importorskip("open3d", exc_type=ImportError)
    mesh = o3d.t.geometry.TriangleMesh.create_sphere(1.0, 12)
    theirs, ours = o3d.t.geometry.RaycastingScene(), RaycastingScene(seconds=0)
    for place in (0.0, 3.0):
        moved = mesh.clone().translate([place, 0, 0])
        assert ours.add_triangles(moved) == theirs.add_triangles(moved)
    assert ours.add_triangles(mesh.to_legacy()) == 2
    ours = RaycastingScene(seconds=0)
    for place in (0.0, 3.0):
        ours.add_triangles(mesh.clone().translate([place, 0, 0]))
    origins = RANDOM.uniform(-3, 3, (40, 50, 3)).astype("f4")
    rays = o3d.core.Tensor(np.concatenate([origins, [1, 0, 0] - origins + 0.3 * RANDOM.normal(size=origins.shape)], 2).astype("f4"))
    hits, same = ours.cast_rays(rays), theirs.cast_rays(rays)
    assert set(hits) == set(same)
    for name, answer in hits.items():
        assert (type(answer), answer.dtype, answer.shape) == (type(same[name]), same[name].dtype, same[name].shape)
    # A few rays meet an edge, where Open3D may name either face.
    assert (hits["primitive_ids"] == same["primitive_ids"]).numpy().mean() > 0.99
    assert (hits["geometry_ids"] == same["geometry_ids"]).numpy().mean() > 0.99
    hit = hits["t_hit"].isfinite()
    np.testing.assert_allclose(hits["t_hit"][hit].numpy(), same["t_hit"][hit].numpy(), rtol=1e-3)
    points = o3d.core.Tensor(origins)
    for name in ("compute_distance", "compute_signed_distance", "compute_occupancy"):
        answer, expected = getattr(ours, name)(points), getattr(theirs, name)(points)
        assert (type(answer), answer.dtype, answer.shape) == (type(expected), expected.dtype, expected.shape)
        np.testing.assert_allclose(answer.numpy(), expected.numpy(), atol=1e-4)
    for name in ("test_occlusions", "count_intersections"):
        answer, expected = getattr(ours, name)(rays), getattr(theirs, name)(rays)
        assert (answer.dtype, answer.shape) == (expected.dtype, expected.shape)
        assert (answer == expected).numpy().mean() > 0.98
    every, expected = ours.list_intersections(rays), theirs.list_intersections(rays)
    assert {name: answer.dtype for name, answer in every.items()} == {name: expected[name].dtype for name in every}
    cloud = rays.reshape((-1, 6)).numpy()[:, :3]
    assert o3d.t.geometry.PointCloud(ours.compute_closest_points(cloud)["points"]).point.positions.shape == (2000, 3)


def test_a_scene_far_from_zero_keeps_the_precision_of_its_coordinates():
    vertices, faces = box()
    offset = np.array([4.5e5, 5.4e6, 100])
    scene = RaycastingScene(seconds=0.05, nthreads=2)
    scene.add_triangles(vertices + offset, faces)
    rays = np.concatenate([offset + [3, 0.125, 0.25], [-1, 0, 0]])
    assert scene.cast_rays(rays, nthreads=1)["t_hit"] == 2
    assert scene.cast_rays(rays + [1e7, 0, 0, 0, 0, 0])["t_hit"] == np.float32(1e7 + 2)
    assert scene.compute_closest_points(offset + [0, 0, 0.75])["points"].tolist() == (offset + [0, 0, 1]).tolist()
    assert scene.compute_signed_distance([offset + [0, 0, 0.75]], nsamples=3).tolist() == [-0.25]
    assert scene.compute_occupancy([offset, offset + 2], 0, 1).tolist() == [1, 0]


def test_a_pinhole_camera_has_open3ds_rays():
    intrinsic = np.array([[500, 3, 310], [0, 400, 250], [0, 0, 1]], dtype=float)
    angle = 0.3
    extrinsic = np.eye(4)
    extrinsic[:3, :3] = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    extrinsic[:3, 3] = [1, 2, 3]
    rays = RaycastingScene.create_rays_pinhole(intrinsic, np.asfortranarray(extrinsic), width_px=5, height_px=4)
    assert rays.shape == (4, 5, 6)
    # The camera sees a point of a ray in its pixel, at the depth of its distance.
    for distance in (0, 2.5):
        points = rays[..., :3] + distance * rays[..., 3:]
        seen = (points @ extrinsic[:3, :3].T + extrinsic[:3, 3]) @ intrinsic.T
        x, y = np.meshgrid(np.arange(5) + 0.5, np.arange(4) + 0.5)
        np.testing.assert_allclose(seen, distance * np.stack([x, y, np.ones_like(x)], axis=-1), atol=1e-9)
    view = {"fov_deg": 90, "center": [0, 0, 9], "eye": [0, 0, 5], "up": [0, 1, 0], "width_px": 3, "height_px": 1}
    rays = RaycastingScene.create_rays_pinhole(**view)
    np.testing.assert_allclose(rays[0], [[0, 0, 5, -2 / 3, 0, 1], [0, 0, 5, 0, 0, 1], [0, 0, 5, 2 / 3, 0, 1]], atol=1e-15)
    np.testing.assert_array_equal(RaycastingScene.create_rays_pinhole(*view.values()), rays)


def test_the_stub_has_the_documentation_of_the_module():
    """UPDATE_STUB=1 writes it."""
    path = Path(bvh_search.__file__).with_name("_bvh_search.pyi")
    module = importlib.import_module("bvh_search._bvh_search")
    lines, stale = path.read_text().splitlines(), []
    parts = [(node, module) for node in ast.parse(path.read_text()).body]
    parts += [(child, getattr(module, node.name)) for node, _ in parts if isinstance(node, ast.ClassDef) for child in node.body]
    # From the end, so that the numbers of earlier lines remain.
    for node, parent in sorted(parts, key=lambda part: -part[0].lineno):
        if not isinstance(node, (ast.ClassDef, ast.FunctionDef)) or node.name.startswith("_"):
            continue
        documentation = inspect.getdoc(getattr(parent, node.name))
        if ast.get_docstring(node) == documentation:
            continue
        stale.append(node.name)
        body, indent = node.body[0], " " * (node.col_offset + 4)
        written = [(indent + line).rstrip() for line in f'"""{documentation}\n"""'.splitlines()]
        first = min([body.lineno, *[decorator.lineno for decorator in getattr(body, "decorator_list", [])]])
        if ast.get_docstring(node):
            lines[body.lineno - 1 : body.end_lineno] = written
        elif isinstance(node, ast.ClassDef):
            lines[first - 1 : first - 1] = [*written, ""]
        else:
            lines[first - 1 : first] = [lines[first - 1][: body.col_offset].rstrip(), *written]
    if os.environ.get("UPDATE_STUB"):
        path.write_text("\n".join(lines) + "\n")
    else:
        assert stale == [], "UPDATE_STUB=1 writes the stub"


@pytest.mark.parametrize("name", ["raycasting", "trimesh"])
def test_signatures_name_their_types(name):
    pytest.importorskip(name if name == "trimesh" else "numpy")
    module = importlib.import_module(f"bvh_search.{name}")
    for part in map(vars(module).get, module.__all__):
        for function in filter(inspect.isfunction, vars(part).values()):
            assert "Sequence" not in str(inspect.signature(function)), function


def test_every_public_function_has_an_example_and_all_examples_run():
    parts = [(bvh_search, Tree), (bvh_search, Tracer), (bvh_search, RaycastingScene)]
    if importlib.util.find_spec("trimesh"):
        module = importlib.import_module("bvh_search.trimesh")
        parts.append((module, module.RayMeshIntersector))
    for module, part in parts:
        names = [name for name in vars(part) if not name.startswith("_") and name.islower()]
        documentation = {name: getattr(part, name).__doc__ for name in names}
        assert {name for name, text in documentation.items() if ">>>" not in text} == set()
        texts = [module.__doc__, part.__doc__, bvh_search.sky.__doc__, *documentation.values()]
        examples = "\n\n".join(map(inspect.cleandoc, texts))
        test = doctest.DocTestParser().get_doctest(examples, {}, part.__name__, None, None)
        assert doctest.DocTestRunner().run(test).failed == 0
