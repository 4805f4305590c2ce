"""A scene with the method names of Open3D's `RaycastingScene`."""

# The names of types in signatures, for help().
from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ._bvh_search import Tracer, Tree, corners, rows
from ._numbers import Numbers, Progress, without_tiny

__all__ = ["Answer", "RaycastingScene"]


class Answer(np.ndarray[Any, np.dtype[Any]]):
    """An array with the methods that programs call on the answers of Open3D."""

    def numpy(self) -> NDArray[Any]:
        """Returns a plain array of the same memory."""
        return self.view(np.ndarray)

    def cpu(self) -> Answer:
        """Returns the array itself."""
        return self

    def isfinite(self) -> Answer:
        """Returns which numbers are finite."""
        return np.isfinite(self).view(Answer)


def _answer(question: Any, answer: NDArray[Any]) -> Answer:
    """Returns an answer in the kind of its question: as a tensor of Open3D or as an array."""
    from_numpy = getattr(type(question), "from_numpy", None)
    tensor: Answer = from_numpy(answer) if from_numpy else answer.view(Answer)
    return tensor


def _answers(question: Any, answers: dict[str, NDArray[Any]]) -> dict[str, Answer]:
    return {name: _answer(question, answer) for name, answer in answers.items()}


class RaycastingScene:
    """Triangle meshes that answer rays and points, with the method names of
    `open3d.t.geometry.RaycastingScene`.

    Rays have the shape `(..., 6)`: origin, then direction. Points have the shape `(..., 3)`. Answers
    have the same leading shape. They are tensors of Open3D if the rays or points are, and otherwise
    numpy arrays with the methods `numpy`, `cpu` and `isfinite` of those tensors. Geometries are numbered in the order of `add_triangles`.
    The tree is found at the first query, in about `seconds`. Arrays of other shapes, and meshes that
    `Tree.from_mesh` would refuse, raise a `ValueError`. If the vertices of any mesh are `float64`, all
    queries are answered in it, exactly, however far from the origin; numbers below 2^-150 count as 0.
    Answers are `float32`, as those of Open3D.

    Ctrl-C ends every query, and `progress(seconds, fraction)` follows it as it does those of `Tracer`.
    `nthreads` and `device` are accepted for compatibility: all threads of the processor answer.

    >>> from bvh_search import RaycastingScene
    >>> scene = RaycastingScene(seconds=0.1)
    >>> scene.add_triangles([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    0
    >>> scene.cast_rays([[0.25, 0.25, 2, 0, 0, -1]])["t_hit"]
    Answer([2.], dtype=float32)
    """

    INVALID_ID = 0xFFFFFFFF

    def __init__(self, nthreads: int = 0, device: object = None, *, seconds: float = 1.0) -> None:
        self._seconds = seconds
        self._triangles: list[NDArray[Any]] = []
        self._made: tuple[Tracer, NDArray[np.int64]] | None = None

    def add_triangles(self, vertex_positions: Any, triangle_indices: Numbers | None = None) -> int:
        """Adds a mesh and returns its geometry id. Accepts vertices and indices, or a mesh of Open3D,
        of its tensors or not, or of trimesh.

        >>> scene.add_triangles([[0, 0, 5], [1, 0, 5], [0, 1, 5]], [[0, 1, 2]])
        1
        """
        if triangle_indices is None:
            vertex_positions, triangle_indices = _parts_of(vertex_positions)
        vertices = without_tiny(rows("vertex_positions", vertex_positions, 3))
        self._triangles.append(corners(vertices, triangle_indices))
        self._made = None
        return len(self._triangles) - 1

    def _scene(self) -> tuple[Tracer, NDArray[np.int64]]:
        if self._made is None:
            triangles = np.concatenate([np.empty((0, 3, 3), np.float32), *self._triangles])
            first = np.cumsum([0] + [len(part) for part in self._triangles])
            is_double = triangles.dtype == np.float64
            precision: Literal["single", "double"] = "double" if is_double else "single"
            tree = Tree.from_triangles(triangles, self._seconds, precision=precision)
            self._made = Tracer(tree), first
        return self._made

    @staticmethod
    def _split(rays: Numbers) -> tuple[tuple[int, ...], NDArray[Any], NDArray[Any]]:
        array = rows("rays", rays, 6)
        flat = array.reshape((-1, 6))
        return array.shape[:-1], flat[:, :3], flat[:, 3:]

    def _ids(
        self, triangle: NDArray[np.int32], first: NDArray[np.int64]
    ) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
        """Returns the geometry ids and the primitive ids of triangles."""
        geometry = np.searchsorted(first, triangle, side="right") - 1
        hit = triangle >= 0
        primitive = np.where(hit, triangle - first[np.where(hit, geometry, 0)], self.INVALID_ID)
        geometry = np.where(hit, geometry, self.INVALID_ID)
        return geometry.astype(np.uint32), primitive.astype(np.uint32)

    def cast_rays(
        self, rays: Numbers, nthreads: int = 0, *, progress: Progress | None = None
    ) -> dict[str, Answer]:
        """Returns the nearest hits: `t_hit`, `geometry_ids`, `primitive_ids`, `primitive_uvs` and
        `primitive_normals`.

        >>> scene.cast_rays([0.25, 0.25, 2, 0, 0, 1])["geometry_ids"]
        Answer(1, dtype=uint32)
        """
        shape, origins, directions = self._split(rays)
        tracer, first = self._scene()
        t, triangle = tracer.nearest(origins, directions, invalid="miss", progress=progress)
        u, v, normals = tracer.surface(origins, directions, triangle)
        geometry, primitive = self._ids(triangle, first)
        answers = {
            "t_hit": t.astype(np.float32).reshape(shape),
            "geometry_ids": geometry.reshape(shape),
            "primitive_ids": primitive.reshape(shape),
            "primitive_uvs": np.stack([u, v], axis=-1).astype(np.float32).reshape((*shape, 2)),
            "primitive_normals": normals.astype(np.float32).reshape((*shape, 3)),
        }
        return _answers(rays, answers)

    def test_occlusions(
        self,
        rays: Numbers,
        tnear: float = 0.0,
        tfar: float = np.inf,
        nthreads: int = 0,
        *,
        progress: Progress | None = None,
    ) -> Answer:
        """Returns whether each ray hits anything between `tnear` and `tfar`.

        >>> scene.test_occlusions([[0.25, 0.25, 2, 0, 0, 1]], tfar=1)
        Answer([False])
        """
        shape, origins, directions = self._split(rays)
        tracer, _ = self._scene()
        hits = tracer.any(origins, directions, tnear, tfar, invalid="miss", progress=progress)
        return _answer(rays, hits.reshape(shape))

    def count_intersections(
        self, rays: Numbers, nthreads: int = 0, *, progress: Progress | None = None
    ) -> Answer:
        """Returns the number of crossings of the surface by each ray.

        >>> scene.count_intersections([[0.25, 0.25, -1, 0, 0, 1]])
        Answer([2], dtype=int32)
        """
        shape, origins, directions = self._split(rays)
        tracer, _ = self._scene()
        counts = tracer.counts(origins, directions, invalid="miss", progress=progress)
        return _answer(rays, counts.astype(np.int32).reshape(shape))

    def list_intersections(
        self, rays: Numbers, nthreads: int = 0, *, progress: Progress | None = None
    ) -> dict[str, Answer]:
        """Returns all crossings of the surface, ray after ray: `ray_splits`, `ray_ids`, `t_hit`,
        `geometry_ids`, `primitive_ids` and `primitive_uvs`.

        >>> scene.list_intersections([[0.25, 0.25, -1, 0, 0, 1]])["t_hit"]
        Answer([1., 6.], dtype=float32)
        """
        _, origins, directions = self._split(rays)
        tracer, first = self._scene()
        t, triangle, ray = tracer.all(origins, directions, invalid="miss", progress=progress)
        u, v, _ = tracer.surface(origins[ray], directions[ray], triangle)
        geometry, primitive = self._ids(triangle, first)
        answers: dict[str, NDArray[Any]] = {
            "ray_splits": np.searchsorted(ray, np.arange(len(origins) + 1)).astype(np.uint32),
            "ray_ids": ray.astype(np.uint32),
            "t_hit": t.astype(np.float32),
            "geometry_ids": geometry,
            "primitive_ids": primitive,
            "primitive_uvs": np.stack([u, v], axis=-1).astype(np.float32),
        }
        return _answers(rays, answers)

    @staticmethod
    def _points(query_points: Numbers) -> tuple[tuple[int, ...], NDArray[Any]]:
        points = rows("query_points", query_points, 3)
        return points.shape[:-1], points.reshape((-1, 3))

    def compute_closest_points(
        self, query_points: Numbers, nthreads: int = 0, *, progress: Progress | None = None
    ) -> dict[str, Answer]:
        """Returns the closest points of the surface: `points`, as precise as `query_points`,
        `geometry_ids`, `primitive_ids`, `primitive_uvs` and `primitive_normals`.

        >>> scene.compute_closest_points([[0.25, 0.25, 4]])["points"]
        Answer([[0.25, 0.25, 5.  ]])
        """
        shape, points = self._points(query_points)
        tracer, first = self._scene()
        closest, triangle, _ = tracer.closest(points, progress=progress)
        geometry, primitive = self._ids(triangle, first)
        # The weights and normals of a hit there, along any direction.
        normals = tracer.surface(closest, np.ones_like(closest), triangle)[2]
        u, v, _ = tracer.surface(closest, normals, triangle)
        answers = {
            "points": closest.astype(points.dtype).reshape((*shape, 3)),
            "geometry_ids": geometry.reshape(shape),
            "primitive_ids": primitive.reshape(shape),
            "primitive_uvs": np.stack([u, v], axis=-1).astype(np.float32).reshape((*shape, 2)),
            "primitive_normals": normals.astype(np.float32).reshape((*shape, 3)),
        }
        return _answers(query_points, answers)

    def compute_distance(
        self, query_points: Numbers, nthreads: int = 0, *, progress: Progress | None = None
    ) -> Answer:
        """Returns the distances of points from the surface.

        >>> scene.compute_distance([[0.25, 0.25, 4]])
        Answer([1.], dtype=float32)
        """
        shape, points = self._points(query_points)
        distances = self._scene()[0].closest(points, progress=progress)[2]
        return _answer(query_points, distances.astype(np.float32).reshape(shape))

    def compute_signed_distance(
        self,
        query_points: Numbers,
        nthreads: int = 0,
        nsamples: int = 1,
        *,
        progress: Progress | None = None,
    ) -> Answer:
        """Returns the distances of points from the surface, negative inside as `Tracer.contains` has
        it. Every answer is certain with one sample; `nsamples` is an odd number, as in Open3D.

        >>> scene.compute_signed_distance([[0.25, 0.25, 6]])
        Answer([1.], dtype=float32)
        """
        _check_samples(nsamples)
        shape, points = self._points(query_points)
        distances = self._scene()[0].signed_distance(points, progress=progress)
        return _answer(query_points, distances.astype(np.float32).reshape(shape))

    def compute_occupancy(
        self,
        query_points: Numbers,
        nthreads: int = 0,
        nsamples: int = 1,
        *,
        progress: Progress | None = None,
    ) -> Answer:
        """Returns 1 for points inside the surface, as `Tracer.contains` has it, and 0 for others.

        >>> scene.compute_occupancy([[0.25, 0.25, 6]])
        Answer([0.], dtype=float32)
        """
        _check_samples(nsamples)
        shape, points = self._points(query_points)
        inside = self._scene()[0].contains(points, progress=progress)
        return _answer(query_points, inside.astype(np.float32).reshape(shape))

    @staticmethod
    def create_rays_pinhole(*args: Any, **kwargs: Any) -> Answer:
        """Returns the rays of a pinhole camera through the middles of all pixels, `(height, width, 6)`
        in `float64`, row by row from the top left. A direction advances by 1 along the view. Takes the
        arguments of either of Open3D's functions:

        - `intrinsic_matrix`, `(3, 3)`, `extrinsic_matrix`, `(4, 4)` from the world to the camera,
          `width_px`, `height_px`;
        - `fov_deg`, the horizontal angle of view, `center`, the point that the camera at `eye` looks
          at, `up`, `width_px`, `height_px`. As in Open3D, `up` points down in the image.

        >>> RaycastingScene.create_rays_pinhole(90, [0, 0, 0], [0, 0, -3], [0, 1, 0], 2, 2)[0, 0]
        Answer([ 0. ,  0. , -3. , -0.5, -0.5,  1. ])
        """
        if len(args) + len(kwargs) == 4:
            rays = _rays_by_matrices(*args, **kwargs)
        else:
            rays = _rays_by_view(*args, **kwargs)
        return _answer(next(iter((*args, *kwargs.values()))), rays)


def _parts_of(mesh: Any) -> tuple[Numbers, Numbers]:
    """Returns the vertices and the indices of a mesh. The triangles of trimesh are no indices."""
    if hasattr(mesh, "vertex") and hasattr(mesh, "triangle"):
        return mesh.vertex["positions"], mesh.triangle["indices"]
    for faces in ("faces", "triangles"):
        if hasattr(mesh, "vertices") and hasattr(mesh, faces):
            return mesh.vertices, getattr(mesh, faces)
    accepted = "vertices and indices, or a mesh of Open3D or trimesh"
    raise TypeError(f"add_triangles: found one {type(mesh).__name__}; accepted: {accepted}")


def _check_samples(nsamples: int) -> None:
    if nsamples < 1 or nsamples % 2 != 1:
        raise ValueError(f"nsamples is {nsamples}; accepted: odd numbers from 1")


def _array(name: str, argument: Numbers, shape: tuple[int, ...]) -> NDArray[np.float64]:
    array = np.asarray(rows(name, argument, shape[-1]), dtype=np.float64)
    if array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape}; accepted: {shape}")
    return array


def _rays_by_matrices(
    intrinsic_matrix: Numbers, extrinsic_matrix: Numbers, width_px: int, height_px: int
) -> NDArray[np.float64]:
    intrinsic = _array("intrinsic_matrix", intrinsic_matrix, (3, 3))
    extrinsic = _array("extrinsic_matrix", extrinsic_matrix, (4, 4))
    to_world = extrinsic[:3, :3].T
    x, y = np.meshgrid(np.arange(width_px) + 0.5, np.arange(height_px) + 0.5)
    pixels = np.stack([x, y, np.ones_like(x)], axis=-1)
    rays = np.empty((height_px, width_px, 6))
    rays[..., :3] = -to_world @ extrinsic[:3, 3]
    rays[..., 3:] = pixels @ (to_world @ np.linalg.inv(intrinsic)).T
    return rays


def _rays_by_view(
    fov_deg: float, center: Numbers, eye: Numbers, up: Numbers, width_px: int, height_px: int
) -> NDArray[np.float64]:
    begin = _array("eye", eye, (3,))
    forward = _array("center", center, (3,)) - begin
    right = np.cross(_array("up", up, (3,)), forward)
    if not (right != 0).any():
        raise ValueError("up is parallel to the view from eye to center; accepted: other directions")
    axes = np.stack([right, np.cross(forward, right), forward])
    extrinsic = np.eye(4)
    extrinsic[:3, :3] = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    extrinsic[:3, 3] = -extrinsic[:3, :3] @ begin
    focal = width_px / (2 * np.tan(np.radians(fov_deg) / 2))
    intrinsic = [[focal, 0, width_px / 2], [0, focal, height_px / 2], [0, 0, 1]]
    rays = _rays_by_matrices(intrinsic, extrinsic, width_px, height_px)
    # Without the rounding of a translation to a far eye and back.
    rays[..., :3] = begin
    return rays
