"""Tests that every array argument is read in its own order: the answer for an array in any layout is
the answer for a fresh copy of it in row order."""

import inspect

import numpy as np
import pytest

from bvh_search import RaycastingScene, Tracer, Tree

RANDOM = np.random.default_rng(5)
COUNT = 37

VERTICES = RANDOM.uniform(-1, 1, (60, 3))
FACES = RANDOM.permutation(60).reshape(20, 3)
TRIANGLES = VERTICES[FACES]
BOXES = np.stack([TRIANGLES.min(axis=1), TRIANGLES.max(axis=1)], axis=1)
SEGMENTS = RANDOM.uniform(-2, 2, (COUNT, 2, 3))
ORIGINS = RANDOM.uniform(-2, 2, (COUNT, 3))
DIRECTIONS = -ORIGINS + RANDOM.uniform(-0.5, 0.5, (COUNT, 3))
LIMITS = {"t_min": RANDOM.uniform(0, 0.8, COUNT), "t_max": RANDOM.uniform(0.8, 2, COUNT)}
RAYS = {"origins": ORIGINS, "directions": DIRECTIONS}
SCENE_RAYS = {"rays": np.concatenate([ORIGINS, DIRECTIONS], axis=1).reshape(1, COUNT, 6)}
POINTS = {"query_points": ORIGINS.reshape(1, COUNT, 3)}
TRIMESH_RAYS = {"ray_origins": ORIGINS, "ray_directions": DIRECTIONS}
TREE = Tree.from_mesh(VERTICES, FACES, work=1000)
DOUBLE = Tree.from_mesh(VERTICES, FACES, work=1000, precision="double")


def trees(make):
    def answer(**arrays):
        tree = make(**arrays, work=1000)
        return tree.nodes(), tree.object_ids()

    return answer


def updated(vertices):
    tree = Tree.from_mesh(VERTICES[::-1], FACES, work=1000)
    tree.update(vertices)
    return tree.nodes(), tree.object_ids()


def added(**arrays):
    scene = RaycastingScene(seconds=0)
    scene.add_triangles(**arrays)
    return scene.cast_rays(SCENE_RAYS["rays"])


def of_scene(name):
    def answer(**arrays):
        scene = RaycastingScene(seconds=0)
        scene.add_triangles(VERTICES, FACES)
        return getattr(scene, name)(**arrays)

    return answer


def of_trimesh(name):
    def answer(**arrays):
        trimesh = pytest.importorskip("trimesh")
        from bvh_search.trimesh import RayMeshIntersector

        mesh = trimesh.Trimesh(VERTICES, FACES, process=False)
        return getattr(RayMeshIntersector(mesh, seconds=0), name)(**arrays)

    return answer


def loaded(tmp_path_factory, **arrays):
    path = tmp_path_factory.mktemp("trees") / "tree.bvh"
    make = {"boxes": Tree.from_boxes, "triangles": Tree.from_triangles, "vertices": Tree.from_mesh}[next(iter(arrays))]
    make(*[array.copy(order="C") for array in arrays.values()], work=1000).save(path)
    return Tree.load(path, **arrays).nodes()


# Every call that takes arrays, with valid values of all its array arguments.
CALLS = {
    "Tree.from_mesh": (trees(Tree.from_mesh), {"vertices": VERTICES, "faces": FACES, "rays": SEGMENTS}),
    "Tree.from_triangles": (trees(Tree.from_triangles), {"triangles": TRIANGLES, "rays": SEGMENTS}),
    "Tree.from_boxes": (trees(Tree.from_boxes), {"boxes": BOXES, "rays": SEGMENTS}),
    "Tree.load": (loaded, {"triangles": TRIANGLES}),
    "Tree.load of boxes": (loaded, {"boxes": BOXES}),
    "Tree.load of a mesh": (loaded, {"vertices": VERTICES, "faces": FACES}),
    "Tree.update": (updated, {"vertices": VERTICES}),
    **{f"Tracer.{name}": (getattr(Tracer(TREE), name), RAYS | LIMITS) for name in ("nearest", "any", "all", "counts")},
    "Tracer.surface": (Tracer(TREE).surface, RAYS | {"triangle": RANDOM.integers(-1, 20, COUNT)}),
    **{
        f"Tracer.{name}": (getattr(Tracer(TREE), name), {"points": ORIGINS})
        for name in ("contains", "closest", "signed_distance")
    },
    "RaycastingScene.add_triangles": (added, {"vertex_positions": VERTICES, "triangle_indices": FACES}),
    **{
        f"RaycastingScene.{name}": (of_scene(name), SCENE_RAYS)
        for name in ("cast_rays", "test_occlusions", "count_intersections", "list_intersections")
    },
    **{
        f"RaycastingScene.compute_{name}": (of_scene(f"compute_{name}"), POINTS)
        for name in ("closest_points", "distance", "signed_distance", "occupancy")
    },
    **{
        f"RayMeshIntersector.{name}": (of_trimesh(name), TRIMESH_RAYS)
        for name in ("intersects_id", "intersects_location", "intersects_first", "intersects_any")
    },
    **{
        f"Tracer.{name} of a double tree": (getattr(Tracer(DOUBLE), name), RAYS | {"exclude": RANDOM.integers(-1, 20, (COUNT, 2))})
        for name in ("nearest", "any")
    },
    **{
        f"Tracer.visible of a {tree.precision} tree": (
            Tracer(tree).visible,
            {
                "points": ORIGINS,
                "directions": DIRECTIONS,
                "weights": RANDOM.uniform(0, 9, (COUNT, 2)),
                "normals": ORIGINS[::-1],
            },
        )
        for tree in (TREE, DOUBLE)
    },
    "RayMeshIntersector.contains_points": (of_trimesh("contains_points"), {"points": ORIGINS}),
}

# Parameters that are no arrays of numbers.
OTHERS = {"self", "seconds", "references", "seed", "work", "progress", "path", "kind", "coherent", "invalid", "tracer"}
OTHERS |= {"divided", "cosine", "precision", "orientation", "by", "frame", "nthreads", "nsamples", "args", "tnear", "tfar", "multiple_hits", "max_hits", "return_locations", "kwargs", "memo"}


def unaligned(array):
    numbers = np.zeros(array.nbytes + 1, np.uint8)[1:].view(array.dtype).reshape(array.shape)
    numbers[...] = array
    return numbers


def strided(array):
    numbers = np.full([2 * size + 1 for size in array.shape], array.flat[0])
    part = numbers[tuple(slice(1, None, 2) for _ in array.shape)]
    part[...] = array
    return part


def read_only(array):
    array = np.asfortranarray(array)
    array.flags.writeable = False
    return array


LAYOUTS = {
    "columns": np.asfortranarray,
    "columns, stacked": lambda array: np.array(list(np.moveaxis(array, -1, 0))).transpose(*range(1, array.ndim), 0),
    "middle axis first": lambda array: np.swapaxes(np.swapaxes(array, 0, -1).copy(), 0, -1),
    "strided": strided,
    "reversed": lambda array: np.flip(np.flip(array).copy()),
    "read-only columns": read_only,
    "unaligned": unaligned,
    "broadcast": lambda array: np.broadcast_to(array[:1], array.shape),
    "matrix": lambda array: np.asmatrix(array) if array.ndim == 2 else array,
    "masked columns": lambda array: np.ma.array(np.asfortranarray(array)),
}


@pytest.mark.filterwarnings("ignore:the matrix subclass:PendingDeprecationWarning")
@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
@pytest.mark.parametrize("call", CALLS)
def test_the_layout_of_an_array_changes_no_answer(call, layout, tmp_path_factory):
    ask, arrays = CALLS[call]
    context = {"tmp_path_factory": tmp_path_factory} if ask is loaded else {}
    for name, array in arrays.items():
        kinds = "i8 >i8 i4 >u2" if array.dtype.kind == "i" else "f8 >f8 f4 >f4 f2 g"
        for kind in kinds.split():
            if kind == ">u2" and (array < 0).any():
                continue
            given = layout(array.astype(kind))
            expected = ask(**context, **(arrays | {name: np.array(given, kind, order="C", subok=False)}))
            np.testing.assert_equal(ask(**context, **(arrays | {name: given})), expected, f"{name}, {kind}")


def test_every_array_argument_has_a_layout_test():
    pytest.importorskip("trimesh")
    from bvh_search.trimesh import RayMeshIntersector

    # One number each, for all directions.
    limits = {"visible": {"t_min", "t_max"}}
    for kind in (Tree, Tracer, RaycastingScene, RayMeshIntersector):
        for name, call in inspect.getmembers(kind, callable):
            if name.startswith("_"):
                continue
            tested = {argument for key, (_, arrays) in CALLS.items() if key.startswith(f"{kind.__name__}.{name}") for argument in arrays}
            assert set(inspect.signature(call).parameters) - OTHERS - limits.get(name, set()) <= tested, f"{kind.__name__}.{name}"
