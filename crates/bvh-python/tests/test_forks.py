"""Tests what a child process may do with the trees of its parent, whose threads it does not have."""

import contextlib
import os
import pickle
import signal
import threading
import time
import traceback

import numpy as np
import pytest

from bvh_search import Tracer, Tree

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")

RANDOM = np.random.default_rng(13)
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])


def ends_in_a_child(function, seconds=60):
    """Returns whether a child process calls the function without an exception, and in time."""
    child = os.fork()
    if child == 0:
        # Nothing of the test's own process may go on in the child.
        status = 1
        try:
            function()
            status = 0
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(status)
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        time.sleep(0.01)
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return status == 0
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return False


def grid(side):
    """Vertices and faces of a rough square of so many vertices along a side."""
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    vertices = np.stack([x.ravel(), y.ravel(), RANDOM.random(side * side)], axis=1)
    low = (y[:-1, :-1] * side + x[:-1, :-1]).ravel()
    faces = [[low, low + 1, low + side], [low + 1, low + side + 1, low + side]]
    return vertices, np.concatenate([np.stack(corners, axis=1) for corners in faces])


def test_a_child_process_searches_and_traces_after_its_parent_did():
    origins = np.tile([0.2, 0.2, 3.0], (100_000, 1))
    directions = np.tile([0.0, 0.0, -1.0], (100_000, 1))

    def answers():
        tracer = Tracer(Tree.from_mesh(CORNERS, [[0, 1, 2]], seconds=0.05))
        return tracer.nearest(origins, directions)[0]

    before = answers()

    def compare():
        np.testing.assert_array_equal(answers(), before)

    assert ends_in_a_child(compare)


def test_a_child_process_saves_loads_pickles_and_exports_after_its_parent_did(tmp_path):
    vertices, faces = grid(100)
    tree = Tree.from_mesh(vertices, faces, work=1000)

    def save_and_load():
        pickle.loads(pickle.dumps(tree))
        tree.save(tmp_path / "tree.bvh")
        Tree.load(tmp_path / "tree.bvh", triangles=vertices[faces])
        tree.export("three-mesh-bvh")

    save_and_load()
    assert ends_in_a_child(save_and_load, seconds=20)


def test_a_child_process_uses_a_tree_that_a_thread_of_its_parent_moves():
    vertices, faces = grid(400)
    tree = Tree.from_mesh(vertices, faces, work=1000)
    ended = threading.Event()

    def move():
        while not ended.is_set():
            tree.update(vertices)

    thread = threading.Thread(target=move)
    thread.start()
    try:
        for _ in range(20):
            # Different times within the call of the thread.
            time.sleep(RANDOM.random() * 0.1)
            assert ends_in_a_child(tree.cost, seconds=20)
        assert ends_in_a_child(lambda: tree.update(vertices))
    finally:
        ended.set()
        thread.join()


def test_a_child_process_improves_a_tree_that_a_thread_of_its_parent_improves():
    vertices, faces = grid(30)
    tree = Tree.from_mesh(vertices, faces, work=1000)
    started, ended = threading.Event(), threading.Event()

    class Enough(Exception):
        pass

    def progress(seconds, cost):
        started.set()
        if ended.is_set():
            raise Enough

    def improve():
        with contextlib.suppress(Enough):
            tree.improve(60, progress=progress)

    def improve_twice_and_move():
        # The first call ends the right of the parent's thread, and its own.
        tree.improve(work=1000)
        tree.improve(work=1000)
        tree.update(vertices)

    thread = threading.Thread(target=improve)
    thread.start()
    try:
        assert started.wait(60)
        assert ends_in_a_child(improve_twice_and_move)
        # The parent's own threads still exclude each other, and a refusal does not change that.
        for _ in range(2):
            with pytest.raises(RuntimeError, match="another thread is improving this tree"):
                tree.update(vertices)
    finally:
        ended.set()
        thread.join()
    tree.update(vertices)
