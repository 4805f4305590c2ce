"""Tests the errors of numbers, meshes and pickles, and the shapes that scenes accept."""

import pickle

import numpy as np
import pytest

from bvh_search import RaycastingScene, Tracer, Tree

CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
FACE = [[0, 1, 2]]
BOXES = [[0, 0, 0, 1, 1, 1]]
PINHOLE = RaycastingScene.create_rays_pinhole
NAN = [[0, 0, np.nan], [1, 0, 0], [0, 1, 0]]
ALL_BITS = "0 to 18446744073709551615"


def mesh():
    return Tree.from_mesh(CORNERS, FACE, work=10)


def from_mesh(**arguments):
    return Tree.from_mesh(CORNERS, FACE, **arguments)


def from_triangles(**arguments):
    return Tree.from_triangles([CORNERS], **arguments)


def from_boxes(**arguments):
    return Tree.from_boxes(BOXES, **arguments)


def improve(**arguments):
    mesh().improve(**arguments)


SEARCHES = [from_mesh, from_triangles, from_boxes]


@pytest.mark.parametrize("number", [-1, 2**64, np.int64(-1)])
@pytest.mark.parametrize(
    ("search", "name"),
    [(search, name) for search in SEARCHES for name in ("work", "seed")] + [(improve, "work")],
)
def test_numbers_outside_their_range_are_named_with_the_range(search, name, number):
    with pytest.raises(ValueError, match=f"^{name} is {number}; accepted: {ALL_BITS}"):
        search(**{name: number})


@pytest.mark.parametrize(
    ("name", "accepted"),
    [("work", ALL_BITS), ("seed", ALL_BITS), ("seconds", "0 to 1e19"), ("references", "1 to 16")],
)
def test_numbers_that_are_too_long_to_print_are_named(name, accepted):
    with pytest.raises(ValueError, match=f"^{name} is too long to print; accepted: {accepted}"):
        from_mesh(**{name: 10**5000})


def test_numbers_within_their_range_are_accepted():
    for search in SEARCHES:
        assert len(search(work=np.int32(9), seed=2**64 - 1, seconds=None)) == 1
        assert len(search(work=2**64 - 1, seed=0, seconds=0)) == 1
    improve(work=None, seconds=np.float32(0))
    for name, number in [("work", 1.5), ("seed", None), ("seed", "1"), ("references", "1")]:
        with pytest.raises(TypeError, match=f"^{name}: "):
            from_mesh(**{name: number})


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Tree.from_mesh(CORNERS, [[0, 1, 3]]), "^faces: face 0 names vertex 3; accepted: indices below 3$"),
        (lambda: Tree.from_mesh(CORNERS, [[0, 1, -1]]), "^faces: face 0 names vertex -1; accepted: indices below 3$"),
        (lambda: Tree.from_mesh(CORNERS, [[0, 1, 2**32]]), "^faces: face 0 names vertex 4294967296; accepted"),
        (lambda: Tree.from_mesh(NAN, FACE), r"^vertices: vertex 0 of face 0 is \[0.0, 0.0, NaN\]; accepted: finite"),
        (lambda: mesh().update([[0, 0, 0]]), r"^vertices has shape \(1, 3\); accepted: \(3, 3\), as the tree's mesh$"),
        (lambda: mesh().update([*CORNERS, [0, 0, 0]]), r"^vertices has shape \(4, 3\); accepted: \(3, 3\)"),
        (lambda: pickle.loads(pickle.dumps(mesh())).update([*CORNERS, [0, 0, 0]]), r"^vertices has shape \(4, 3\)"),
        (lambda: mesh().update(NAN), r"^vertices: vertex 0 of face 0 is \[0.0, 0.0, NaN\]; accepted: finite numbers of float32, up to 3.4e38$"),
        (lambda: mesh().update([[0, 0]] * 3), r"^vertices has shape \(3, 2\); accepted: \(v, 3\)$"),
    ],
)
def test_errors_of_meshes_name_the_argument(call, message):
    with pytest.raises((TypeError, ValueError), match=message):
        call()


def test_a_refused_update_leaves_the_tree_as_it_was():
    tree = mesh()
    nodes = tree.nodes()
    with pytest.raises(ValueError, match="vertices"):
        tree.update(NAN)
    np.testing.assert_array_equal(tree.nodes(), nodes)
    tree.update(np.array(CORNERS) + 1)
    assert tree.nodes()["max"].tolist() == [[2, 2, 1]]


def test_forged_pickles_are_refused():
    restore, (shape, objects, file, faces, count) = mesh().__reduce__()
    boxes = from_boxes(work=10).__reduce__()[1]
    assert len(restore(shape, objects, file, faces, count)) == 1
    assert len(restore(shape, objects, file, None, 0)) == 1
    with pytest.raises(ValueError, match="^vertices has shape"):
        restore(shape, objects, file, faces, 1).update(CORNERS[:1])
    for state, message in [
        ((shape, objects, file, b""), "^faces has 0 faces; accepted: 1, as objects$"),
        ((shape, objects, file, 2 * faces), "^faces has 2 faces; accepted: 1, as objects$"),
        ((shape, objects, file, faces[1:]), "^faces has 11 bytes; accepted: multiples of 12$"),
        ((*boxes[:3], faces), "^faces has 1 faces; accepted: 0, as objects$"),
        ((shape, objects + bytes(12), file, faces), "^objects has 48 bytes; accepted: multiples of 36$"),
        (("doubles", bytes(64) + np.float64(np.nan).tobytes(), file, None), "^objects: triangle 0 has the corner .*2\\^-150 to 2\\^120$"),
        (("spheres", objects, file, None), '^shape is "spheres"; accepted: triangles, doubles, boxes$'),
        ((shape, objects, file[:-1], None), "^tree: "),
    ]:
        with pytest.raises(ValueError, match=message):
            restore(*state, count)
    assert len(pickle.loads(pickle.dumps(mesh()))) == 1


@pytest.mark.parametrize(
    ("vertices", "indices", "message"),
    [
        (np.ones((12, 3)), np.arange(12).reshape(3, 4), r"^triangle_indices has shape \(3, 4\); accepted: \(n, 3\)$"),
        (np.ones((9, 4)), np.arange(9).reshape(3, 3), r"^vertex_positions has shape \(9, 4\); accepted: \(..., 3\)$"),
        (CORNERS, [[0.9, 1.2, 2.7]], "^triangle_indices has dtype float64; accepted: integers$"),
        (CORNERS, [[0, 1, -1]], "^triangle_indices: face 0 names vertex -1; accepted: indices below 3$"),
        (CORNERS, [[0, 1, 3]], "^triangle_indices: face 0 names vertex 3; accepted: indices below 3$"),
        (np.array(CORNERS) + 0j, FACE, "^vertex_positions has dtype complex128; accepted: real numbers$"),
        (NAN, FACE, r"^vertex_positions: vertex 0 of face 0 is \[0.0, 0.0, NaN\]; accepted: 0 or 2\^-150 to 2\^120 in size$"),
        (np.float32(NAN), FACE, "^vertex_positions: vertex 0 of face 0 is .*; accepted: finite numbers of float32, up to 3.4e38$"),
    ],
)
def test_scenes_refuse_what_trees_of_meshes_refuse(vertices, indices, message):
    scene = RaycastingScene(seconds=0)
    with pytest.raises(ValueError, match=message):
        scene.add_triangles(vertices, indices)
    # A refused mesh has no geometry id.
    assert scene.add_triangles(CORNERS, FACE) == 0
    assert scene.cast_rays([0.2, 0.2, 5, 0, 0, -1])["t_hit"] == 5


@pytest.mark.parametrize(
    ("array", "found"),
    [
        (np.ones((2, 3)), r"has shape \(2, 3\)"),
        (np.ones(12), r"has shape \(12,\)"),
        (np.ones((1, 7)), r"has shape \(1, 7\)"),
        (np.ones((1, 6)) + 0j, "has dtype complex128"),
        (1.0, r"has shape \(\)"),
    ],
)
def test_scenes_refuse_rays_of_other_shapes(array, found):
    scene = RaycastingScene(seconds=0)
    scene.add_triangles(CORNERS, FACE)
    for ask in (scene.cast_rays, scene.test_occlusions, scene.count_intersections, scene.list_intersections):
        with pytest.raises(ValueError, match=f"^rays {found}; accepted: "):
            ask(array)


@pytest.mark.parametrize("shape", [(1, 6), (3, 2), (9,), ()])
def test_scenes_refuse_points_of_other_shapes(shape):
    scene = RaycastingScene(seconds=0)
    scene.add_triangles(CORNERS, FACE)
    questions = ("closest_points", "distance", "signed_distance", "occupancy")
    for ask in [getattr(scene, f"compute_{question}") for question in questions]:
        with pytest.raises(ValueError, match=r"^query_points has shape .*; accepted: \(..., 3\)$"):
            ask(np.zeros(shape))
    assert scene.compute_distance(np.zeros((2, 1, 3))).tolist() == [[0], [0]]
    assert scene.compute_distance([0, 0, 1]).tolist() == 1


def test_scenes_accept_rays_of_any_leading_shape():
    scene = RaycastingScene(seconds=0)
    scene.add_triangles(np.array(CORNERS, "f8"), np.array(FACE, "u4"))
    for shape in [(6,), (0, 6), (2, 6), (2, 0, 6), (2, 1, 3, 6)]:
        rays = np.broadcast_to([0.2, 0.2, 5, 0, 0, -1], shape)
        assert scene.cast_rays(rays)["t_hit"].shape == shape[:-1]
        assert scene.count_intersections(rays.astype(np.float32)).shape == shape[:-1]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Tracer(mesh()).contains(CORNERS, by="rays"), '^by is "rays"; accepted: auto, parity, winding$'),
        (lambda: Tracer(mesh()).signed_distance(CORNERS, by=""), '^by is ""; accepted: auto, parity, winding$'),
        (lambda: RaycastingScene().compute_occupancy(CORNERS, nsamples=2), "^nsamples is 2; accepted: odd numbers from 1$"),
        (lambda: RaycastingScene().compute_signed_distance(CORNERS, nsamples=0), "^nsamples is 0; accepted: odd"),
        (lambda: RaycastingScene().add_triangles(RaycastingScene()), "^add_triangles: found one RaycastingScene; accepted: "),
        (lambda: PINHOLE(np.eye(4), np.eye(4), 2, 2), r"^intrinsic_matrix has shape \(4, 4\); accepted: \(..., 3\)$"),
        (lambda: PINHOLE(np.eye(3), np.eye(4)[:3], 2, 2), r"^extrinsic_matrix has shape \(3, 4\); accepted: \(4, 4\)$"),
        (lambda: PINHOLE(60, [0, 0, 0], [0, 0, 5], [0, 0, 1], 2, 2), "^up is parallel to the view"),
    ],
)
def test_errors_of_insides_and_cameras_name_the_argument(call, message):
    with pytest.raises((TypeError, ValueError), match=message):
        call()


HUGE = [[1e300, 0, 0], [1, 0, 0], [0, 1, 0]]


@pytest.mark.filterwarnings("ignore:overflow encountered in cast:RuntimeWarning")
@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Tree.from_mesh(HUGE, FACE, work=10), r"^vertices: vertex 0 of face 0 is \[1e300, 0.0, 0.0\]; accepted: .* 3.4e38$"),
        (lambda: Tree.from_triangles([HUGE], work=10), "^triangles has 1e300 in row 0; accepted: .* 3.4e38$"),
        (lambda: Tree.from_boxes([[0, 0, 0, 1, 1, 1e300]], work=10), "^boxes has 1e300 in row 0; accepted: .* 3.4e38$"),
        (lambda: from_boxes(rays=[HUGE[:2]]), "^rays has 1e300 in row 0; accepted: .* 3.4e38$"),
        (lambda: Tracer(mesh()).nearest(HUGE, CORNERS), r"^ray 0: the ray's origin is \[1e300, 0.0, 0.0\]; accepted: .* 3.4e38$"),
        (lambda: Tracer(mesh()).any(HUGE[1:], HUGE[:1]), r"^ray 0: the ray's direction is \[1e300, 0.0, 0.0\]; accepted: "),
    ],
)
def test_numbers_beyond_float32_are_named_as_they_were_given(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def double(**arguments):
    return Tree.from_mesh(CORNERS, FACE, work=10, precision="double", **arguments)


DOWN = [[0, 0, 5], [1, 0, 5]], [0, 0, -1]
RANGE = r"accepted: 0 or 2\^-150 to 2\^120 in size"


@pytest.mark.parametrize("number", [np.nan, np.inf, -2e36, 1e-46])
def test_numbers_beyond_the_exact_range_are_named_with_the_range(number):
    wrong = [[0, 0, 0], [1, 0, 0], [0, number, 0]]
    name = repr(float(number)).replace("nan", "NaN").replace("+", "")
    for call, message in [
        (lambda: Tree.from_mesh(wrong, FACE, precision="double"), rf"^vertices: vertex 2 of face 0 is \[0.0, {name}, 0.0\]; {RANGE}$"),
        (lambda: double().update(wrong), rf"^vertices: vertex 2 of face 0 is \[0.0, {name}, 0.0\]; {RANGE}$"),
        (lambda: Tree.from_triangles([CORNERS, wrong], precision="double"), f"^triangles has {name} in row 1; {RANGE}$"),
    ]:
        with pytest.raises(ValueError, match=message):
            call()
    if number == 1e-46:
        assert Tracer(double()).nearest(wrong, DOWN[1])[1].tolist() == Tracer(double()).nearest([[0, 0, 0], [1, 0, 0], [0, 0, 0]], DOWN[1])[1].tolist()
        return
    for call, message in [
        (lambda: Tracer(double()).nearest(wrong, DOWN[1]), rf"^ray 2: the ray's origin is \[0.0, {name}, 0.0\]; {RANGE}$"),
        (lambda: Tracer(double()).all([0, 0, 1], [0, number, 1]), rf"^ray 0: the ray's direction is \[0.0, {name}, 1.0\]; {RANGE}, the largest from 2\^-100 to 2\^100$"),
    ]:
        with pytest.raises(ValueError, match=message):
            call()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Tree.from_mesh(CORNERS, FACE, precision="half"), '^precision is "half"; accepted: single, double$'),
        (lambda: Tracer(double()).any(*DOWN, orientation="inward"), '^orientation is "inward"; accepted: any, exiting, entering$'),
        (lambda: Tracer(double()).nearest(*DOWN, exclude=[0, 1]), "^exclude has 1; accepted: indices below 1, or -1$"),
        (lambda: Tracer(double()).nearest(*DOWN, exclude=-2), "^exclude has -2; accepted: indices below 1, or -1$"),
        (lambda: Tracer(double()).nearest(*DOWN, exclude=[0]), r"^exclude has shape \(1,\); accepted: one index, \(2,\) or \(2, k\), as origins$"),
        (lambda: Tracer(double()).any(*DOWN, exclude=[[[0]], [[0]]]), r"^exclude has shape \(2, 1, 1\); accepted: "),
        (lambda: Tracer(double()).any(*DOWN, exclude=[0.0, 1.0]), "^exclude has dtype float64; accepted: integers$"),
        (lambda: double().export("json"), "accepted: a tree baked in single precision with the frame .file.$"),
    ],
)
def test_errors_of_precisions_and_selections_name_the_argument(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_what_interrupts_a_conversion_is_no_fault_of_the_argument():
    class Interrupted:
        def __init__(self, error):
            self.error = error

        def __array__(self, *_, **__):
            raise self.error

    for error in (KeyboardInterrupt, MemoryError):
        with pytest.raises(error):
            Tree.from_mesh(Interrupted(error), [[0, 1, 2]], seconds=0)
    with pytest.raises(ValueError, match="^vertices: "):
        Tree.from_mesh(Interrupted(TypeError("no")), [[0, 1, 2]], seconds=0)


def test_a_scene_is_made_as_open3d_makes_one():
    scene = RaycastingScene(4, device="CPU:0", seconds=0)
    scene.add_triangles([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    assert scene.cast_rays([[0.25, 0.25, 2, 0, 0, -1]])["t_hit"] == 2
