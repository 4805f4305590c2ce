"""Better bounding volume hierarchies by stochastic search: find, save, load and trace trees over
numpy arrays."""

from os import PathLike
from typing import Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Tracer", "Tree"]

@final
class Tree:
    """A tree with its objects. `from_triangles`, `from_boxes` and `load` create trees; `len` is the
    number of objects."""

    @staticmethod
    def from_triangles(triangles: ArrayLike, seconds: float = 1.0, *, references: float = 1.0) -> Tree: ...
    @staticmethod
    def from_boxes(boxes: ArrayLike, seconds: float = 1.0) -> Tree: ...
    @staticmethod
    def load(
        path: str | PathLike[str], *, triangles: ArrayLike | None = None, boxes: ArrayLike | None = None
    ) -> Tree: ...
    def save(self, path: str | PathLike[str]) -> None: ...
    def improve(self, seconds: float = 1.0) -> None:
        """Until the call returns, other threads see the old tree, and a second `improve` raises a
        `RuntimeError`."""
    def cost(
        self, kind: Literal["internal_area", "goldsmith_salmon", "sah", "layout"] = "internal_area"
    ) -> float: ...
    def nodes(self) -> NDArray[np.void]: ...
    def object_ids(self) -> NDArray[np.uint32]: ...
    def __len__(self) -> int: ...

@final
class Tracer:
    """The triangles of a tree in a layout for fast traversal. Later improvements of the tree do not
    change the tracer."""

    def __new__(cls, tree: Tree) -> Tracer: ...
    def nearest(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: ArrayLike | None = None,
        t_max: ArrayLike | None = None,
        *,
        coherent: bool = False,
    ) -> tuple[NDArray[np.float32], NDArray[np.int32]]: ...
    def any(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_min: ArrayLike | None = None,
        t_max: ArrayLike | None = None,
        *,
        coherent: bool = False,
    ) -> NDArray[np.bool_]: ...
