"""Ray queries for trimesh: `mesh.ray = RayMeshIntersector(mesh)` replaces the engine of a mesh.

>>> import trimesh
>>> from bvh_search.trimesh import RayMeshIntersector
>>> mesh = trimesh.creation.box()
>>> mesh.ray = RayMeshIntersector(mesh)
>>> mesh.ray.intersects_first([[0.1, 0.2, 5]], [[0, 0, -1]]) >= 0
array([ True])
"""

import numpy as np

from ._bvh_search import Tracer, Tree, locations
from ._center import center_of

__all__ = ["RayMeshIntersector"]


class RayMeshIntersector:
    """Answers the ray queries of trimesh, with the names and results of its own engines.

    All hits of a ray count each crossing of the surface once, also through edges and corners. Rays
    whose direction is zero or not finite hit nothing. Rays may begin far away: they are advanced to
    the mesh in `float64`, and locations are in `float64`. The tree is found at the first query, in about
    `seconds`, and again after the mesh has changed.
    """

    def __init__(self, geometry, scale_to_box=True, seconds=None):
        """`scale_to_box` is accepted for compatibility: answers do not depend on the scale. The default
        of `seconds` is a microsecond per face, up to one second."""
        self.mesh = geometry
        self._scale_to_box = scale_to_box
        self._seconds = seconds
        self._made = None

    def _tracer(self):
        """Returns the tracer of the mesh as it is."""
        state = hash(self.mesh)
        if self._made is None or self._made[0] != state:
            vertices = np.asarray(self.mesh.vertices, dtype=np.float64)
            faces = np.asarray(self.mesh.faces, dtype=np.int64).reshape((-1, 3))
            seconds = self._seconds
            if seconds is None:
                seconds = min(1.0, 1e-6 * len(faces))
            # A vertex that no face uses may be anywhere.
            is_used = np.isin(np.arange(len(vertices)), faces)
            center = center_of(vertices[is_used])
            tree = Tree.from_mesh(vertices - center, faces, seconds=seconds)
            self._made = state, Tracer(tree, center=center)
        return self._made[1]

    @staticmethod
    def _rays(ray_origins, ray_directions):
        origins = np.ascontiguousarray(ray_origins, dtype=np.float64).view(np.ndarray)
        directions = np.ascontiguousarray(ray_directions, dtype=np.float64).view(np.ndarray)
        if origins.shape != directions.shape:
            raise ValueError("Ray origin and direction don't match!")
        if origins.size == 0:
            return np.empty((0, 3)), np.empty((0, 3))
        return origins, directions

    def intersects_location(self, ray_origins, ray_directions, multiple_hits=True, **kwargs):
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
        self, ray_origins, ray_directions, multiple_hits=True, max_hits=100, return_locations=False
    ):
        """Returns the indices of the faces that are hit and of their rays, and with
        `return_locations` the locations. Hits are sorted by ray, then by distance.

        >>> mesh.ray.intersects_id([[0.1, 0.2, 5]], [[0, 0, -1]])[1]
        array([0, 0])
        """
        rays = self._rays(ray_origins, ray_directions)
        if multiple_hits:
            _, index_tri, index_ray = self._tracer().all(*rays, invalid="miss")
            # A ray has more hits if the hit so many places later is its own, too.
            if (index_ray[max_hits:] == index_ray[: max(len(index_ray) - max_hits, 0)]).any():
                first = np.searchsorted(index_ray, index_ray)
                kept = np.arange(len(index_ray)) - first < max_hits
                index_tri, index_ray = index_tri[kept], index_ray[kept]
        else:
            _, index_tri = self._tracer().nearest(*rays, invalid="miss")
            index_ray = np.nonzero(index_tri >= 0)[0]
            index_tri = index_tri[index_ray]
        if not return_locations:
            return index_tri.astype(np.int64), index_ray
        corners = np.ascontiguousarray(self.mesh.triangles, dtype=np.float64).view(np.ndarray)
        found = locations(corners, *rays, index_tri, index_ray)
        return index_tri.astype(np.int64), index_ray, found

    def intersects_first(self, ray_origins, ray_directions):
        """Returns the index of the first face that each ray hits, or -1.

        >>> mesh.ray.intersects_first([[5, 5, 5]], [[0, 0, -1]])
        array([-1], dtype=int32)
        """
        return self._tracer().nearest(*self._rays(ray_origins, ray_directions), invalid="miss")[1]

    def intersects_any(self, ray_origins, ray_directions):
        """Returns whether each ray hits the mesh.

        >>> mesh.ray.intersects_any([[5, 5, 5]], [[0, 0, -1]])
        array([False])
        """
        return self._tracer().any(*self._rays(ray_origins, ray_directions), invalid="miss")

    def contains_points(self, points):
        """Returns whether each point is inside the mesh, by `Tracer.contains`: also for meshes that
        overlap themselves, and by the generalised winding number for meshes with holes. Vertices and
        points are rounded to `float32`, next to the middle of a mesh that is far from zero.

        >>> mesh.ray.contains_points([[0, 0, 0.25], [0, 0, 1]])
        array([ True, False])
        """
        points = np.ascontiguousarray(points, dtype=np.float64).view(np.ndarray)
        if points.ndim != 2 or points.shape[1] != 3:
            raise ValueError("points must be (n, 3)!")
        return self._tracer().contains(points)

    def __getstate__(self):
        return {**self.__dict__, "_made": None}

    def __copy__(self):
        return RayMeshIntersector(self.mesh, self._scale_to_box, self._seconds)

    def __deepcopy__(self, memo):
        return self.__copy__()
