"""Tests that queries of many rays and points can be interrupted and followed."""

import os
import signal
import threading
import time

import numpy as np
import pytest

from bvh_search import RaycastingScene, Tracer, Tree, sky

RANDOM = np.random.default_rng(3)
# An open mesh, near whose surface winding numbers are slow.
VERTICES = RANDOM.uniform(-1, 1, (900, 3))
FACES = np.arange(900).reshape(300, 3)
TRACER = Tracer(Tree.from_mesh(VERTICES, FACES, work=1000))
SCENE = RaycastingScene(seconds=0)
SCENE.add_triangles(VERTICES, FACES)


def of_trimesh(name):
    def ask(*arguments, **options):
        trimesh = pytest.importorskip("trimesh")
        from bvh_search.trimesh import RayMeshIntersector

        engine = RayMeshIntersector(trimesh.Trimesh(VERTICES, FACES, process=False), seconds=0)
        return getattr(engine, name)(*arguments, **options)

    return ask


def rays(count):
    origins = np.resize(RANDOM.uniform(-2, 2, (1000, 3)).astype(np.float32), (count, 3))
    return origins, -origins


# Every query that takes long for many rays or points, with the arguments for so many.
QUERIES = {
    **{f"Tracer.{name}": (getattr(TRACER, name), rays) for name in ("nearest", "any", "all", "counts")},
    **{
        f"Tracer.{name}": (getattr(TRACER, name), lambda count: rays(count)[:1])
        for name in ("contains", "closest", "signed_distance")
    },
    "Tracer.visible": (TRACER.visible, lambda count: rays(count)[:1] + (sky()[0],)),
    **{
        f"RaycastingScene.{name}": (getattr(SCENE, name), lambda count: [np.concatenate(rays(count), axis=1)])
        for name in ("cast_rays", "test_occlusions", "count_intersections", "list_intersections")
    },
    **{
        f"RaycastingScene.compute_{name}": (getattr(SCENE, f"compute_{name}"), lambda count: rays(count)[:1])
        for name in ("closest_points", "distance", "signed_distance", "occupancy")
    },
    **{
        f"RayMeshIntersector.{name}": (of_trimesh(name), rays)
        for name in ("intersects_location", "intersects_id", "intersects_first", "intersects_any")
    },
    "RayMeshIntersector.contains_points": (of_trimesh("contains_points"), lambda count: rays(count)[:1]),
}


# The other queries of the adapters ask the tracer once, too.
SLOW = [name for name in QUERIES if name.startswith("Tracer.")]
SLOW += ["RaycastingScene.list_intersections", "RayMeshIntersector.intersects_location"]


@pytest.mark.parametrize("query", SLOW)
def test_an_interrupt_ends_a_query(query):
    # Shells start jobs in the background with interrupts ignored, and then Python raises none.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    ask, arguments = QUERIES[query]
    count, whole = 10_000, 0.0
    while whole < 0.7:
        # Slow queries need fewer rays, in all builds of this module.
        count *= 2 if whole > 0.1 else 4
        given = arguments(count)
        start = time.monotonic()
        ask(*given)
        whole = time.monotonic() - start
    threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGINT)).start()
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        ask(*given)
    assert time.monotonic() - start < 0.6 * whole


@pytest.mark.parametrize("query", QUERIES)
def test_a_query_tells_its_progress_and_ends_with_an_exception_there(query):
    ask, arguments = QUERIES[query]
    calls = []
    ask(*arguments(5_000), progress=lambda *state: calls.append(state))
    assert calls == sorted(calls) and calls[-1][1] == 1

    def stop(seconds, fraction):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        ask(*arguments(5_000), progress=stop)


def test_progress_is_the_part_of_the_points_that_is_answered():
    calls = []
    points = np.resize(VERTICES, (1_000, 3))
    while len(calls) < 4:
        calls.clear()
        points = np.concatenate([points, points])
        TRACER.contains(points, progress=lambda *state: calls.append(state))
    fractions = [fraction for _, fraction in calls]
    assert fractions == sorted(fractions) and fractions[-1] == 1
    # In proportion to the time, though the machine may be busy.
    assert 0 <= fractions[0] < 0.9
    assert any(0.1 < fraction < 0.9 for fraction in fractions)
