"""Ray queries for trimesh: `mesh.ray = RayMeshIntersector(mesh)` replaces the engine of a mesh.

>>> import trimesh
>>> from bvh_search.trimesh import RayMeshIntersector
>>> mesh = trimesh.creation.box()
>>> mesh.ray = RayMeshIntersector(mesh)
>>> mesh.ray.intersects_first([[0.1, 0.2, 5]], [[0, 0, -1]]) >= 0
array([ True])
"""

# The names of types in signatures, for help().
from __future__ import annotations

import gc
import time
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._bvh_search import Tracer, Tree
from ._numbers import Progress, without_tiny

__all__ = ["RayMeshIntersector"]

# The number of faces after which Python's collector is called: some 300 MB with their trees.
_COLLECTED = 1_000_000
_faces_since_collection = 0


def _collect(faces: int) -> None:
    """Frees the meshes that nobody uses any more.

    A mesh of trimesh is a cycle of references, and keeps itself, its engine and its tree in memory
    until Python's collector runs. That waits for hundreds of new objects, of whatever size.
    """
    global _faces_since_collection
    _faces_since_collection += faces
    if _faces_since_collection >= _COLLECTED and gc.isenabled():
        _faces_since_collection = faces
        gc.collect()


def _part(
    progress: Progress | None, begin: float, low: float, high: float
) -> Progress | None:
    """Returns the progress of one of several queries, whose fractions are from `low` to `high`."""
    if progress is None:
        return None
    return lambda _, fraction: progress(time.monotonic() - begin, low + (high - low) * fraction)


class _Mesh(Protocol):
    @property
    def vertices(self) -> Any: ...
    @property
    def faces(self) -> Any: ...


class RayMeshIntersector:
    """Answers the ray queries of trimesh, with the names and results of its own engines.

    All hits of a ray count each crossing of the surface once, also through edges and corners. Rays
    whose direction is zero or not finite hit nothing. Vertices and rays are in `float64`, and answers
    exact, however far from the origin; numbers below 2^-150 count as 0. The tree is found at the first query, in about
    `seconds`, and again after the mesh has changed. Ctrl-C ends every query, and
    `progress(seconds, fraction)` follows it as it does those of `Tracer`.
    """

    def __init__(self, geometry: _Mesh, scale_to_box: bool = True, seconds: float | None = None) -> None:
        """`scale_to_box` is accepted for compatibility: answers do not depend on the scale. The default
        of `seconds` is a microsecond per face, up to one second."""
        self.mesh = geometry
        self._scale_to_box = scale_to_box
        self._seconds = seconds
        self._made: tuple[int, Tracer] | None = None

    def _tracer(self) -> Tracer:
        """Returns the tracer of the mesh as it is."""
        state = hash(self.mesh)
        if self._made is None or self._made[0] != state:
            # The old tracer need not be in memory any longer.
            self._made = None
            vertices = np.asarray(self.mesh.vertices, dtype=np.float64)
            faces = np.asarray(self.mesh.faces, dtype=np.int64).reshape((-1, 3))
            seconds = self._seconds
            if seconds is None:
                seconds = min(1.0, 1e-6 * len(faces))
            _collect(len(faces))
            tree = Tree.from_mesh(without_tiny(vertices), faces, seconds=seconds, precision="double")
            self._made = state, Tracer(tree)
        return self._made[1]

    @staticmethod
    def _rays(
        ray_origins: ArrayLike, ray_directions: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        origins = np.ascontiguousarray(ray_origins, dtype=np.float64).view(np.ndarray)
        directions = np.ascontiguousarray(ray_directions, dtype=np.float64).view(np.ndarray)
        if origins.shape != directions.shape:
            raise ValueError("Ray origin and direction don't match!")
        if origins.size == 0:
            return np.empty((0, 3)), np.empty((0, 3))
        return origins, directions

    def intersects_location(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, multiple_hits: bool = True, **kwargs: Any
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        """Returns the locations of hits, `(h, 3)`, and the indices of their rays and faces.

        >>> mesh.ray.intersects_location([[0.1, 0.2, 5]], [[0, 0, -1]])[0]
        array([[ 0.1,  0.2,  0.5],
               [ 0.1,  0.2, -0.5]])
        """
        index_tri, index_ray, found = self.intersects_id(
            ray_origins, ray_directions, multiple_hits=multiple_hits, return_locations=True, **kwargs
        )
        return found, index_ray, index_tri

    def intersects_id(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        max_hits: int = 100,
        return_locations: bool = False,
        *,
        progress: Progress | None = None,
    ) -> Any:
        """Returns the indices of the faces that are hit and of their rays, and with
        `return_locations` the locations. Hits are sorted by ray, then by distance. Through an edge or a
        corner a ray enters once and leaves once; one that only touches the mesh hits its first face.

        >>> mesh.ray.intersects_id([[0.1, 0.2, 5]], [[0, 0, -1]])[1]
        array([0, 0])
        """
        rays = self._rays(ray_origins, ray_directions)
        if multiple_hits:
            begin = time.monotonic()
            whole = _part(progress, begin, 0, 0.8)
            t, index_tri, index_ray = self._tracer().all(*rays, invalid="miss", progress=whole)
            misses = np.bincount(index_ray, minlength=len(rays[0])) == 0
            others = [vectors[misses] for vectors in rays]
            rest = _part(progress, begin, 0.8, 1)
            touches = self._tracer().any(*others, invalid="miss", progress=rest)
            if touches.any():
                touched = (vectors[touches] for vectors in others)
                end = _part(progress, begin, 1, 1)
                nearest = self._tracer().nearest(*touched, invalid="miss", progress=end)
                index_ray = np.concatenate([index_ray, np.nonzero(misses)[0][touches]])
                order = np.argsort(index_ray, kind="stable")
                t, index_tri = (np.concatenate(both)[order] for both in zip((t, index_tri), nearest))
                index_ray = index_ray[order]
            # A ray has more hits if the hit so many places later is its own, too.
            if (index_ray[max_hits:] == index_ray[: max(len(index_ray) - max_hits, 0)]).any():
                first = np.searchsorted(index_ray, index_ray)
                kept = np.arange(len(index_ray)) - first < max_hits
                t, index_tri, index_ray = t[kept], index_tri[kept], index_ray[kept]
        else:
            t, index_tri = self._tracer().nearest(*rays, invalid="miss", progress=progress)
            index_ray = np.nonzero(index_tri >= 0)[0]
            t, index_tri = t[index_ray], index_tri[index_ray]
        if not return_locations:
            return index_tri.astype(np.int64), index_ray
        origins, directions = (vectors.take(index_ray, axis=0) for vectors in rays)
        found = origins + t[:, None] * directions
        return index_tri.astype(np.int64), index_ray, found

    def intersects_first(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, *, progress: Progress | None = None
    ) -> NDArray[np.int32]:
        """Returns the index of the first face that each ray hits, or -1.

        >>> mesh.ray.intersects_first([[5, 5, 5]], [[0, 0, -1]])
        array([-1], dtype=int32)
        """
        rays = self._rays(ray_origins, ray_directions)
        return self._tracer().nearest(*rays, invalid="miss", progress=progress)[1]

    def intersects_any(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, *, progress: Progress | None = None
    ) -> NDArray[np.bool_]:
        """Returns whether each ray hits the mesh.

        >>> mesh.ray.intersects_any([[5, 5, 5]], [[0, 0, -1]])
        array([False])
        """
        rays = self._rays(ray_origins, ray_directions)
        return self._tracer().any(*rays, invalid="miss", progress=progress)

    def contains_points(
        self, points: ArrayLike, *, progress: Progress | None = None
    ) -> NDArray[np.bool_]:
        """Returns whether each point is inside the mesh, by `Tracer.contains`: also for meshes that
        overlap themselves, and by the generalised winding number for meshes with holes.

        >>> mesh.ray.contains_points([[0, 0, 0.25], [0, 0, 1]])
        array([ True, False])
        """
        array = np.ascontiguousarray(points, dtype=np.float64).view(np.ndarray)
        if array.ndim != 2 or array.shape[1] != 3:
            raise ValueError("points must be (n, 3)!")
        return self._tracer().contains(array, progress=progress)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_made": None}

    def __copy__(self) -> RayMeshIntersector:
        return RayMeshIntersector(self.mesh, self._scale_to_box, self._seconds)

    def __deepcopy__(self, memo: Any) -> RayMeshIntersector:
        return self.__copy__()
