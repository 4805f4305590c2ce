"""Better bounding volume hierarchies by stochastic search: find, save, load and trace trees over
numpy arrays."""

from collections.abc import Callable
from os import PathLike
from typing import Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .raycasting import RaycastingScene as RaycastingScene

__all__ = ["RaycastingScene", "Tracer", "Tree", "__version__"]

__version__: str

_Invalid = Literal["error", "miss"]
_Rule = Literal["auto", "parity", "winding"]
_Progress = Callable[[float, float], object]

@final
class Tree:
    """A copy is like the tree in everything. A pickle keeps the tree, its objects and its faces, but
    forgets the `rays`, the `seed` and the `references` of its search."""

    @staticmethod
    def from_mesh(
        vertices: ArrayLike,
        faces: ArrayLike,
        seconds: float | None = None,
        *,
        references: float = 1.0,
        seed: int = 1,
        work: int | None = None,
        progress: _Progress | None = None,
        rays: ArrayLike | None = None,
        frame: Literal["auto", "file"] = "auto",
    ) -> Tree: ...
    @staticmethod
    def from_triangles(
        triangles: ArrayLike,
        seconds: float | None = None,
        *,
        references: float = 1.0,
        seed: int = 1,
        work: int | None = None,
        progress: _Progress | None = None,
        rays: ArrayLike | None = None,
        frame: Literal["auto", "file"] = "auto",
    ) -> Tree: ...
    @staticmethod
    def from_boxes(
        boxes: ArrayLike,
        seconds: float | None = None,
        *,
        seed: int = 1,
        work: int | None = None,
        progress: _Progress | None = None,
        rays: ArrayLike | None = None,
    ) -> Tree: ...
    @staticmethod
    def load(
        path: str | PathLike[str], *, triangles: ArrayLike | None = None, boxes: ArrayLike | None = None
    ) -> Tree: ...
    def save(self, path: str | PathLike[str]) -> None: ...
    def export(self, tracer: str) -> bytes: ...
    def improve(
        self, seconds: float | None = None, *, work: int | None = None, progress: _Progress | None = None
    ) -> None: ...
    def update(self, vertices: ArrayLike) -> None: ...
    def cost(
        self, kind: Literal["internal_area", "goldsmith_salmon", "sah", "layout"] = "internal_area"
    ) -> float: ...
    @property
    def frame(self) -> tuple[list[list[float]], list[float]] | None: ...
    def nodes(self) -> NDArray[np.void]: ...
    def object_ids(self) -> NDArray[np.uint32]: ...
    def __len__(self) -> int: ...

@final
class Tracer:
    def __new__(cls, tree: Tree, *, center: ArrayLike | None = None) -> Tracer: ...
    @property
    def watertight(self) -> bool: ...
    def nearest(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: ArrayLike | None = None,
        t_max: ArrayLike | None = None,
        *,
        coherent: bool | None = None,
        invalid: _Invalid = "error",
    ) -> tuple[NDArray[np.float32], NDArray[np.int32]]: ...
    def any(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: ArrayLike | None = None,
        t_max: ArrayLike | None = None,
        *,
        coherent: bool | None = None,
        invalid: _Invalid = "error",
    ) -> NDArray[np.bool_]: ...
    def all(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: ArrayLike | None = None,
        t_max: ArrayLike | None = None,
        *,
        invalid: _Invalid = "error",
    ) -> tuple[NDArray[np.float32], NDArray[np.int32], NDArray[np.int64]]: ...
    def counts(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: ArrayLike | None = None,
        t_max: ArrayLike | None = None,
        *,
        invalid: _Invalid = "error",
    ) -> NDArray[np.uint32]: ...
    def contains(self, points: ArrayLike, *, by: _Rule = "auto") -> NDArray[np.bool_]: ...
    def closest(
        self, points: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float64]]: ...
    def signed_distance(self, points: ArrayLike, *, by: _Rule = "auto") -> NDArray[np.float64]: ...
    def surface(
        self, origins: ArrayLike, directions: ArrayLike, triangle: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float32]]: ...
    def __len__(self) -> int: ...
