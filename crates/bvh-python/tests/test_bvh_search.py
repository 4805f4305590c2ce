"""Compares trees and hits with brute force and with the Rust crates, and tests the errors."""

import json
import os
import signal
import struct
import subprocess
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from bvh_search import Tracer, Tree

RANDOM = np.random.default_rng(7)
TRIANGLES = (RANDOM.uniform(0, 10, (500, 1, 3)) + RANDOM.uniform(-1, 1, (500, 3, 3))).astype(np.float32)


def boxes_of(triangles):
    return np.stack([triangles.min(axis=1), triangles.max(axis=1)], axis=1)


def brute_force(triangles, origins, directions, t_min=0.0, t_max=np.inf):
    """Distances by Möller & Trumbore's test of every triangle, in float64: (rays, triangles)."""
    a, b, c = np.moveaxis(triangles.astype(np.float64), 1, 0)
    rays = origins.astype(np.float64)[:, None], directions.astype(np.float64)[:, None]
    across = np.cross(rays[1], c - a)
    det = ((b - a) * across).sum(axis=-1)
    from_a = rays[0] - a
    around = np.cross(from_a, b - a)
    u = (from_a * across).sum(axis=-1) / det
    v = (rays[1] * around).sum(axis=-1) / det
    t = ((c - a) * around).sum(axis=-1) / det
    return np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t >= t_min) & (t <= t_max), t, np.inf)


@pytest.mark.parametrize("references", [1.0, 1.5])
@pytest.mark.parametrize("coherent", [False, True])
def test_hits_equal_brute_force(references, coherent):
    tracer = Tracer(Tree.from_triangles(TRIANGLES, 0.05, references=references))
    random = np.random.default_rng(8)
    origins = random.uniform(0, 10, (3000, 3)).astype(np.float32)
    directions = random.normal(size=(3000, 3)).astype(np.float32)
    t_max = random.uniform(0, 20, 3000).astype(np.float32)
    for limits in [{}, {"t_min": 0.5, "t_max": t_max}, {"t_max": 3}]:
        columns = {name: np.reshape(value, (-1, 1)) for name, value in limits.items()}
        all_t = brute_force(TRIANGLES, origins, directions, **columns)
        t, triangle = tracer.nearest(origins, directions, **limits, coherent=coherent)
        assert (t.dtype, triangle.dtype) == (np.float32, np.int32)
        hit = np.isfinite(all_t.min(axis=1))
        assert 100 < hit.sum() < 3000
        np.testing.assert_array_equal(np.isfinite(t), hit)
        np.testing.assert_array_equal(triangle >= 0, hit)
        np.testing.assert_array_equal(triangle[hit], all_t.argmin(axis=1)[hit])
        np.testing.assert_allclose(t[hit], all_t.min(axis=1)[hit], rtol=1e-4, atol=1e-5)
        np.testing.assert_array_equal(tracer.any(origins, directions, **limits, coherent=coherent), hit)


def test_costs_agree_with_the_nodes_and_with_the_file(tmp_path):
    tree = Tree.from_boxes(boxes_of(TRIANGLES).reshape(-1, 6), seconds=0.05)
    nodes = tree.nodes()
    assert nodes.dtype.names == ("min", "first", "max", "count") and len(nodes) == 2 * len(tree) - 1
    x, y, z = (nodes["max"].astype(np.float64) - nodes["min"]).T
    area, inner = x * y + y * z + z * x, nodes["count"] == 0
    assert tree.cost() == pytest.approx(area[inner].sum(), rel=1e-12)
    assert tree.cost("sah") == pytest.approx(area.sum() / area[0], rel=1e-12)
    tree.save(tmp_path / "tree.bvh")
    assert struct.unpack_from("<d", (tmp_path / "tree.bvh").read_bytes(), 56) == (tree.cost(),)
    # Leaves contain every object once, and each inner node is the union of its children.
    assert sorted(tree.object_ids()) == list(range(len(tree)))
    first = nodes["first"][inner]
    np.testing.assert_array_equal(nodes["min"][inner], np.minimum(nodes["min"][first], nodes["min"][first + 1]))
    before = tree.cost()
    tree.improve(0.2)
    assert tree.cost() <= before
    assert all(tree.cost(kind) > 0 for kind in ("goldsmith_salmon", "layout"))


@pytest.mark.parametrize("references", [1.0, 2.0])
def test_trees_come_back_from_files(tmp_path, references):
    tree, path = Tree.from_triangles(TRIANGLES, 0.05, references=references), tmp_path / "tree.bvh"
    tree.save(path)
    loaded = Tree.load(str(path), triangles=TRIANGLES)
    np.testing.assert_array_equal(loaded.nodes(), tree.nodes())
    np.testing.assert_array_equal(loaded.object_ids(), tree.object_ids())
    with pytest.raises(ValueError, match="path: the file is for a scene of 500 objects; this one has 499"):
        Tree.load(path, triangles=TRIANGLES[1:])
    with pytest.raises(ValueError, match="triangles or boxes"):
        Tree.load(path)
    with pytest.raises(FileNotFoundError, match="nothing.bvh"):
        Tree.load(tmp_path / "nothing.bvh", triangles=TRIANGLES)
    with pytest.raises(OSError, match="nowhere"):
        tree.save(tmp_path / "nowhere" / "tree.bvh")


@pytest.mark.parametrize("references", [1.0, 1.3, None])
@pytest.mark.parametrize("has_rays", [False, True])
def test_a_budget_of_work_and_none_at_all_give_the_file_of_the_program(tmp_path, references, has_rays):
    program = os.environ.get("BVH_PROGRAM")
    if not program:
        pytest.skip("BVH_PROGRAM is not the path of the program bvh")
    corners = "".join("v {!r} {!r} {!r}\n".format(*point) for point in TRIANGLES.reshape(-1, 3).tolist())
    faces = "".join(f"f {3 * i + 1} {3 * i + 2} {3 * i + 3}\n" for i in range(len(TRIANGLES)))
    (tmp_path / "mesh.obj").write_text(corners + faces)
    rays = RANDOM.uniform(0, 10, (90, 2, 3)).astype(np.float32)
    rays.astype("<f4").tofile(tmp_path / "rays.bin")
    is_limited = references is not None
    flags = ["--budget=300kwork", f"--references={references}"] if is_limited else []
    flags += ["--out=program.bvh"] + (["--rays=rays.bin"] if has_rays else [])
    subprocess.run([program, "bake", "mesh.obj", *flags], cwd=tmp_path, check=True)
    work = 300_000 if is_limited else None
    tree = Tree.from_triangles(TRIANGLES, work=work, references=references, rays=rays if has_rays else None)
    assert len(tree.reasons) == (1 if is_limited else 3 if has_rays else 5)
    tree.save(tmp_path / "python.bvh")
    assert (tmp_path / "python.bvh").read_bytes() == (tmp_path / "program.bvh").read_bytes()
    export = ["export", "program.bvh", "mesh.obj", "--for=obvhs", "--out=program.bin"]
    subprocess.run([program, *export], cwd=tmp_path, check=True)
    assert tree.export("obvhs") == (tmp_path / "program.bin").read_bytes()


def test_other_tracers_get_all_objects_and_unknown_ones_are_rejected():
    for tree in [Tree.from_triangles(TRIANGLES, 0.05), Tree.from_boxes(boxes_of(TRIANGLES), 0.05)]:
        plain = json.loads(tree.export("json"))
        assert sorted(plain["ids"]) == list(range(len(tree)))
        assert sum(node[7] for node in plain["nodes"]) == len(tree)
        assert tree.export("three-mesh-bvh").startswith(b"BVHX")
    with pytest.raises(ValueError, match='tracer is "embree"; accepted: three-mesh-bvh, '):
        tree.export("embree")


def test_a_tree_that_divides_triangles_is_for_tracers_that_count_hits_only_if_one_says_so():
    tree = Tree.from_triangles(TRIANGLES, work=300_000, references=1.5, frame="file")
    assert len(tree.object_ids()) > len(tree)
    tree.export("obvhs")
    for tracer in ["three-mesh-bvh", "bvh", "json"]:
        with pytest.raises(ValueError, match=f"references to {len(tree)} objects, and a query of {tracer}"):
            tree.export(tracer)
        tree.export(tracer, divided=True)


def test_a_save_that_fails_leaves_the_old_file_whole(tmp_path):
    resource = pytest.importorskip("resource")
    path = tmp_path / "tree.bvh"
    Tree.from_triangles(TRIANGLES[:50], 0).save(path)
    old, limits = path.read_bytes(), resource.getrlimit(resource.RLIMIT_FSIZE)
    # No file may grow further, as on a full disk.
    resource.setrlimit(resource.RLIMIT_FSIZE, (2 * len(old), limits[1]))
    try:
        with pytest.raises(OSError, match="tree.bvh"):
            Tree.from_triangles(TRIANGLES, 0).save(path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert path.read_bytes() == old
    assert os.listdir(tmp_path) == ["tree.bvh"]


def test_anything_that_numpy_converts_to_an_array_is_accepted():
    tree = Tree.from_triangles(TRIANGLES[::2].astype(np.float64).tolist(), 0)
    reference = Tree.from_triangles(TRIANGLES[::2], 0)
    np.testing.assert_array_equal(tree.nodes(), reference.nodes())
    assert repr(tree) == "<Tree of 499 nodes over 250 objects>"
    empty = Tree.from_triangles(np.empty((0, 3, 3)), 0)
    assert (len(empty), len(empty.nodes())) == (0, 0)
    t, triangle = Tracer(empty).nearest([[0, 0, 0]], [[0, 0, 1]])
    assert (t[0], triangle[0]) == (np.inf, -1)


def test_arrays_may_be_misaligned():
    tree = Tree.from_triangles(misaligned(TRIANGLES), 0)
    tracer = Tracer(tree)
    rays = TRIANGLES[:, 0], np.ones((500, 3), np.float32)
    for dtype in (np.float32, np.float64):
        shifted = [misaligned(array.astype(dtype)) for array in rays]
        for answer, expected in zip(tracer.nearest(*shifted), tracer.nearest(*rays)):
            np.testing.assert_array_equal(answer, expected)


def misaligned(array):
    """Returns a copy of the array at an odd address."""
    copy = np.ndarray(array.shape, array.dtype, np.empty(array.nbytes + 1, np.uint8), offset=1)
    copy[:] = array
    assert not copy.flags.aligned
    return copy


CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def surface_of(triangle):
    tracer = Tracer(Tree.from_mesh(CORNERS, [[0, 1, 2]], work=10))
    return tracer.surface([[0.2, 0.2, 1]], [[0, 0, -1]], triangle)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Tree.from_triangles(TRIANGLES[0]), r"triangles has shape \(3, 3\); accepted: \(n, 3, 3\)"),
        (lambda: Tree.from_boxes(TRIANGLES), r"boxes has shape \(500, 3, 3\); accepted: \(n, 2, 3\) or \(n, 6\)"),
        (lambda: Tree.from_triangles([["a"]]), "triangles has dtype <U1; accepted: real numbers"),
        (lambda: Tree.from_triangles(TRIANGLES.astype(str)), "triangles has dtype <U.*; accepted: real numbers"),
        (lambda: Tree.from_triangles(TRIANGLES + 1j), "triangles has dtype complex64; accepted: real numbers"),
        (lambda: Tree.from_triangles(TRIANGLES.astype("M8[s]")), "triangles has dtype datetime64.*; accepted: real numbers"),
        (lambda: Tree.from_triangles(np.ma.masked_less(TRIANGLES, 5)), "triangles has masked elements; accepted: none"),
        (lambda: Tree.from_mesh(CORNERS, [[0.5, 1.2, 2.9]]), "faces has dtype float64; accepted: integers"),
        (lambda: Tree.from_mesh(CORNERS, np.ma.masked_equal([[0, 1, 2]], 1)), "faces has masked elements; accepted: none"),
        (lambda: Tree.from_mesh(CORNERS, np.array([[0, 1, 2**63]], "u8")), "faces has 9223372036854775808; accepted: integers of 63 bits"),
        (lambda: surface_of([0.7]), "triangle has dtype float64; accepted: integers"),
        (lambda: surface_of([1j]), "triangle has dtype complex128; accepted: integers"),
        (lambda: surface_of(np.ma.masked_equal([0], 0)), "triangle has masked elements; accepted: none"),
        (lambda: surface_of(np.array([2**64 - 1], "u8")), "triangle has 18446744073709551615; accepted: integers of 63 bits"),
        (lambda: Tree.from_triangles([[1, 2], [3]]), "triangles.*(inhomogeneous|dtype object).*; accepted"),
        (lambda: Tree.from_triangles(np.where(np.arange(500)[:, None, None] == 4, np.nan, TRIANGLES)), "triangles has NaN in row 4; accepted: finite"),
        (lambda: Tree.from_boxes(boxes_of(TRIANGLES)[:, ::-1]), "boxes: "),
        (lambda: Tree.from_triangles(TRIANGLES, -1), "seconds is -1.0; accepted: 0 to 1e19"),
        (lambda: Tree.from_triangles(TRIANGLES, references=17), "references is 17; accepted: 1 to 16"),
        (lambda: Tree.from_triangles(TRIANGLES, 0).cost("area"), 'kind is "area"; accepted: internal_area'),
        (lambda: Tracer(Tree.from_boxes(boxes_of(TRIANGLES), 0)), "tree is over boxes; accepted"),
    ],
)
def test_errors_name_the_argument(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize(
    ("rays", "message"),
    [
        (([[0, 0]], [[0, 0, 1]]), r"origins has shape \(1, 2\); accepted: \(m, 3\)"),
        (([[0, 0, 0]] * 3, [[0, 0, 1]] * 2), r"directions has shape \(2, 3\); accepted: \(3, 3\), as origins, or \(3,\)"),
        (([[0, 0, 0]] * 2, [[0, 0, 1]] * 2, [0]), r"t_min has shape \(1,\); accepted: a number or \(2,\), as origins"),
        (([[0, 0, 0]] * 2, [[0, 0, 1], [0, 0, 0]]), "ray 1: the ray's direction"),
    ],
)
def test_errors_name_the_ray(rays, message):
    tracer = Tracer(Tree.from_triangles(TRIANGLES, 0))
    for ask in (tracer.nearest, tracer.any):
        with pytest.raises(ValueError, match=message):
            ask(*rays)


def test_the_lines_of_the_readmes_run(tmp_path, monkeypatch, capsys):
    def run(folder):
        names = {}
        exec((folder / "README.md").read_text().split("```python\n")[1].split("```")[0], names)
        return names

    package = Path(__file__).parents[1]
    monkeypatch.chdir(tmp_path)
    run(package)
    assert capsys.readouterr().out == "0.0 [3.] [0]\n"
    assert (tmp_path / "scene.bvh").is_file()
    names = run(package.parents[1])
    assert (names["t"], names["triangle"]) == ([3], [0])


def recipes():
    page = Path(__file__).parents[3] / "docs/use/COOKBOOK.md"
    parts = page.read_text().split("\n## ")[1:]
    blocks = ((part.split("\n")[0], part.split("```python\n")[1:]) for part in parts)
    return {title: block.split("```")[0] for title, found in blocks for block in found}


def test_the_recipes_of_the_cookbook_run(tmp_path, monkeypatch):
    trimesh = pytest.importorskip("trimesh")
    monkeypatch.chdir(tmp_path)
    # Two houses beside each other, and a solid alone.
    houses = [trimesh.creation.box((4, 4, height)).apply_translation((5 * x, 0, 0)) for x, height in enumerate((3, 9))]
    trimesh.util.concatenate(houses).export("city.obj")
    trimesh.creation.icosphere(subdivisions=2, radius=3).export("scene.obj")
    names = {}
    for title, text in recipes().items():
        exec(text, names.setdefault(title, {}))
    views = names["Sun hours on a city"]["views"]
    up = names["Sun hours on a city"]["normals"][:, 2]
    # The upper roof is free, the lower one is not, and nothing is seen from below.
    np.testing.assert_allclose(np.sort(views[up > 0.9])[-2:], 1, atol=0.02)
    assert views[up > 0.9].min() < 0.9
    assert (views[up < -0.9] == 0).all()
    inside = names["Is my point inside?"]
    assert inside["tracer"].watertight and inside["inside"].tolist() == [True, False]
    np.testing.assert_array_equal(inside["distance"] < 0, inside["inside"])
    assert np.ptp(names["Replace embreex"]["places"][:, 2]) == pytest.approx(6)
    particles = names["Trace in f64 without losing a particle"]
    assert np.isinf(particles["t"]).all() and (particles["face"] == -1).all()


def test_an_interrupt_ends_a_search_which_keeps_its_gains():
    # Shells start jobs in the background with interrupts ignored, and then Python raises none.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    tree = Tree.from_triangles(TRIANGLES, 0)
    before, start = tree.cost(), time.monotonic()
    # The timer's thread runs only because the search lets it.
    for search in (lambda: tree.improve(60), lambda: Tree.from_triangles(TRIANGLES, 60)):
        threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
        with pytest.raises(KeyboardInterrupt):
            search()
    assert time.monotonic() - start < 20
    assert tree.cost() < before


def test_until_an_improvement_ends_other_threads_see_the_old_tree_and_cannot_improve_it():
    tree = Tree.from_triangles(TRIANGLES, 0)
    before, nodes = tree.cost(), tree.nodes()
    improvement = threading.Thread(target=tree.improve, args=(2,))
    improvement.start()
    time.sleep(0.3)
    with pytest.raises(RuntimeError, match="another thread is improving this tree; accepted: .* when its call has returned"):
        tree.improve(0.1)
    for _ in range(10):
        assert (tree.cost(), len(tree)) == (before, 500)
        np.testing.assert_array_equal(tree.nodes(), nodes)
        assert Tracer(tree).any([[0, 0, 0]], [[1, 1, 1]]).shape == (1,)
    assert improvement.is_alive()
    improvement.join()
    assert tree.cost() < before
