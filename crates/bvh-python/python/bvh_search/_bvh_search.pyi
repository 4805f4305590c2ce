"""Better bounding volume hierarchies by stochastic search: find, save, load and trace trees over
numpy arrays."""

from os import PathLike
from typing import Any, Literal, final

import numpy as np
from numpy.typing import NDArray

from ._numbers import Numbers, Progress, SearchProgress

__all__ = ["Tracer", "Tree", "__version__", "corners", "rows", "sky"]

__version__: str

_Invalid = Literal["error", "miss"]
_Orientation = Literal["any", "exiting", "entering"]
_Precision = Literal["single", "double"]
_Real = np.float32 | np.float64
_Rule = Literal["auto", "parity", "winding"]

@final
class Tree:
    """A tree with its objects. `from_mesh`, `from_triangles`, `from_boxes` and `load` create trees;
    `len` is the number of objects.

    Trees can be copied and pickled. A copy is like the tree in everything. A pickle keeps the tree,
    its objects and its faces, but forgets the `rays`, the `seed` and the `references` of its
    search, as a file does: `improve` then minimises the cost for random lines.

    Searches have these arguments. They end after `seconds` or after `work` nodes created or
    visited, and minimise the cost `internal_area`, for `rays` the cost of a `Tracer`. Without
    either, a search chooses its work: up to a minute or so for large meshes, and longer for
    millions of objects. It also chooses what else is not given, by the tests that rays from
    anywhere need in a `Tracer`, so that `internal_area` may end higher than after a few `seconds`;
    `reasons` says why. With `work` and without `seconds`, the same `seed` gives the same tree on
    every machine, and the same file as `bvh bake`. `progress(seconds, cost)` is called about twenty
    times per second with the elapsed time and the lowest cost so far, which is `None` until there
    is a tree; if it raises an exception, the search ends. `rays` are recorded rays of the shape
    `(m, 2, 3)`, from their origins to their hits: the tree is then for rays like these.
    `references` above 1, up to 16, divides triangles among leaves, on average into that many parts
    each; 1 keeps them whole. With `precision="double"` the triangles have `float64` coordinates,
    each 0 or 2^-150 to 2^120 in size, and `Tracer` answers in `float64`.

    >>> from bvh_search import Tree
    >>> corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    >>> square = Tree.from_mesh(corners, [[0, 1, 2], [0, 2, 3]], work=100)
    >>> len(square)
    2
    """

    @staticmethod
    def from_mesh(
        vertices: Numbers,
        faces: Numbers,
        seconds: float | None = None,
        *,
        references: float | None = None,
        seed: int = 1,
        work: int | None = None,
        progress: SearchProgress | None = None,
        rays: Numbers | None = None,
        frame: Literal["auto", "file"] = "auto",
        precision: _Precision = "single",
    ) -> Tree:
        """Searches for the best tree over the triangles of a mesh: vertices, `(v, 3)`, and faces, `(n,
        3)`, of three vertices each. `update` moves the vertices later. The boxes lie along other
        axes than the vertices' where that saves area, see `frame`; `frame="file"` keeps the axes.
        Without `seconds` and `work`, large meshes take up to a minute or longer, see `Tree`.

        >>> mesh = Tree.from_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], work=100)
        """
    @staticmethod
    def from_triangles(
        triangles: Numbers,
        seconds: float | None = None,
        *,
        references: float | None = None,
        seed: int = 1,
        work: int | None = None,
        progress: SearchProgress | None = None,
        rays: Numbers | None = None,
        frame: Literal["auto", "file"] = "auto",
        precision: _Precision = "single",
    ) -> Tree:
        """Searches for the best tree over triangles, `(n, 3, 3)`.

        >>> triangle = Tree.from_triangles([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], seconds=0.1)
        """
    @staticmethod
    def from_boxes(
        boxes: Numbers,
        seconds: float | None = None,
        *,
        seed: int = 1,
        work: int | None = None,
        progress: SearchProgress | None = None,
        rays: Numbers | None = None,
    ) -> Tree:
        """Searches for the best tree over boxes, `(n, 2, 3)` or `(n, 6)`, lower corners first.

        >>> two = Tree.from_boxes([[0, 0, 0, 1, 1, 1], [2, 0, 0, 3, 1, 1]], work=100)
        """
    @staticmethod
    def load(
        path: str | PathLike[str],
        *,
        triangles: Numbers | None = None,
        boxes: Numbers | None = None,
        vertices: Numbers | None = None,
        faces: Numbers | None = None,
        precision: _Precision = "single",
    ) -> Tree:
        """Loads the tree in a file. The mesh, triangles or boxes must be the ones that it was saved for.
        With `vertices` and `faces`, `update` moves the vertices later. `precision` is that of the saved
        tree.

        >>> import tempfile
        >>> folder = tempfile.TemporaryDirectory()
        >>> triangle.save(folder.name + "/scene.bvh")
        >>> Tree.load(folder.name + "/scene.bvh", triangles=[[[0, 0, 0], [1, 0, 0], [0, 1, 0]]])
        <Tree of 1 nodes over 1 objects>
        """
    def save(self, path: str | PathLike[str]) -> None:
        """Writes the tree to a file. An existing file is replaced when the new one is complete; a
        failure leaves the old one.

        >>> square.save(folder.name + "/square.bvh")
        """
    def export(self, tracer: str, *, divided: bool = False) -> bytes:
        """Returns the file of `bvh export` for the tracer of another library, by its name there
        (docs/use/INTEROP.md). A query for all hits of three-mesh-bvh, of the crate bvh and of a reader of
        json finds a divided triangle more than once: `divided=True` says that yours are for the
        nearest or any hit. Otherwise such a tree is rejected.

        >>> import json
        >>> json.loads(square.export("json"))["nodes"]
        [[0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0, 2]]
        """
    def improve(
        self, seconds: float | None = None, *, work: int | None = None, progress: SearchProgress | None = None
    ) -> None:
        """Improves the tree for about `seconds`, by default 1, or for `work`. Ctrl-C ends the search early, and the tree keeps its
        gains. Until the call returns, other threads see the old tree, and a second `improve` raises
        a `RuntimeError`.

        >>> square.improve(work=1000)
        """
    def update(self, vertices: Numbers) -> None:
        """Moves the vertices, `(v, 3)`, of a tree from `from_mesh` or `load`, which are as many as
        before. The nodes remain and their boxes become tight, in milliseconds; `improve` may find
        better nodes. Tracers of the tree do not change.

        >>> mesh.update([[0, 0, 1], [1, 0, 1], [0, 1, 1]])
        """
    def cost(
        self, kind: Literal["internal_area", "goldsmith_salmon", "sah", "layout"] = "internal_area"
    ) -> float:
        """Returns a cost of the tree for random lines: `internal_area`, which searches with `seconds`
        or `work` and without `rays` minimise, `goldsmith_salmon`, `sah` with both constants 1, or
        `layout`, the cost of a `Tracer`, which compares trees of all searches.

        >>> square.cost("sah") > 0
        True
        """
    @property
    def precision(self) -> _Precision:
        """The numbers of the triangles' coordinates: `single`, `float32`, as those of all boxes, or
        `double`, `float64`.

        >>> square.precision
        'single'
        """
    @property
    def reasons(self) -> list[str]:
        """What the search chose by itself, and why: one line each. A loaded tree has none.

        >>> square.reasons
        ["frame: the budget is too small to try others; kept are the file's axes"]
        """
    @property
    def frame(self) -> tuple[list[list[float]], list[float]] | None:
        """The frame of the boxes, a rotation and a centre: they contain `rotation @ (p - centre)` for
        the points p of their objects. `None` if they lie along the axes.

        >>> square.frame
        """
    def nodes(self) -> NDArray[np.void]:
        """Returns the nodes, the root first, as an array with the fields `min`, `first`, `max` and
        `count`. An inner node has the `count` 0, and its two children begin at `first`. The objects
        of a leaf are `object_ids()[first:first + count]`. Boxes lie in the `frame`, if there is one.

        >>> square.nodes()["max"][0]
        array([1., 1., 0.], dtype=float32)
        """
    def object_ids(self) -> NDArray[np.uint32]:
        """Returns the object ids, to which leaves refer by position.

        >>> sorted(square.object_ids().tolist())
        [0, 1]
        """
    def __len__(self) -> int: ...
    def __copy__(self) -> Tree: ...
    def __deepcopy__(self, memo: object, /) -> Tree: ...

@final
class Tracer:
    """The triangles of a tree in a layout for fast traversal. Later improvements and updates of the
    tree do not change the tracer.

    Rays have `origins` and `directions` of the shape `(m, 3)`; one of the shape `(3,)` or `(1, 3)` is
    for all rays. `t_min` and `t_max`, by default 0 and infinity, are one number or have the shape
    `(m,)`. Distances are in multiples of the directions' lengths. `coherent` tells whether consecutive
    rays begin close to each other and have similar directions; by default a look at the rays decides.
    It changes the speed and no answer. An invalid ray, with a direction that is zero or a number that
    is not finite, raises a `ValueError`; with `invalid="miss"` it hits nothing.

    The tracer of a tree with `precision="double"` answers in `float64`, exactly, however far the
    triangles and the rays are from the origin. Coordinates are up to 2^120 in size, and
    count as 0 below 2^-150. In other tracers, rays and points are
    rounded to `float32`, and `t_min` and `t_max` inwards.

    `nearest` and `any` choose which triangles count: those with the `orientation` `"exiting"`, which the ray meets along their normal as where it leaves a solid,
    `"entering"`, against it, or `"any"`, and none of the indices `exclude`. That is one index,
    an array `(m,)` or `(m, k)` of some for each ray; -1 excludes nothing. Of a side, each crossing of
    the surface counts once: a ray that touches a corner enters as often as it leaves.

    Ctrl-C ends every call. `progress(seconds, fraction)` is called about twenty times per second with
    the elapsed time and the part of the rays or points that is answered, and at the end with 1; if it
    raises an exception, the call ends.

    >>> import numpy as np
    >>> from bvh_search import Tracer, Tree
    >>> corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    >>> square = Tree.from_mesh(corners, [[0, 1, 2], [0, 2, 3]])
    >>> tracer = Tracer(square)
    """

    def __new__(cls, tree: Tree) -> Tracer: ...
    @property
    def watertight(self) -> bool:
        """Whether the mesh has no holes: every edge runs as often in one direction as in the other, or
        belongs to two triangles. Positions count, not indices. Computed once.

        >>> tracer.watertight
        False
        """
    def nearest(
        self,
        origins: Numbers,
        directions: Numbers,
        t_min: Numbers | None = None,
        t_max: Numbers | None = None,
        *,
        orientation: _Orientation = "any",
        exclude: Numbers | None = None,
        coherent: bool | None = None,
        invalid: _Invalid = "error",
        progress: Progress | None = None,
    ) -> tuple[NDArray[_Real], NDArray[np.int32]]:
        """Returns the distances of the nearest hits and the triangles' indices. A ray without a hit
        has infinity and −1.

        >>> tracer.nearest([[0.25, 0.5, 3], [2, 2, 3]], [[0, 0, -1], [0, 0, -1]])
        (array([ 3., inf], dtype=float32), array([ 1, -1], dtype=int32))
        """
    def any(
        self,
        origins: Numbers,
        directions: Numbers,
        t_min: Numbers | None = None,
        t_max: Numbers | None = None,
        *,
        orientation: _Orientation = "any",
        exclude: Numbers | None = None,
        coherent: bool | None = None,
        invalid: _Invalid = "error",
        progress: Progress | None = None,
    ) -> NDArray[np.bool_]:
        """Returns whether each ray hits any triangle.

        >>> tracer.any([[0.25, 0.5, 3], [2, 2, 3]], [[0, 0, -1], [0, 0, -1]])
        array([ True, False])
        """
    def all(
        self,
        origins: Numbers,
        directions: Numbers,
        t_min: Numbers | None = None,
        t_max: Numbers | None = None,
        *,
        invalid: _Invalid = "error",
        progress: Progress | None = None,
    ) -> tuple[NDArray[_Real], NDArray[np.int32], NDArray[np.int64]]:
        """Returns all hits, ray after ray and the nearest first: distances, triangles, and the indices
        of the rays. Each crossing of the surface counts once, although triangles share edges and
        corners, so the number of hits of a line with a closed mesh is even.

        >>> tracer.all([[0.5, 0.5, 3], [2, 2, 3]], [[0, 0, -1], [0, 0, -1]])
        (array([3.], dtype=float32), array([0], dtype=int32), array([0]))
        """
    def counts(
        self,
        origins: Numbers,
        directions: Numbers,
        t_min: Numbers | None = None,
        t_max: Numbers | None = None,
        *,
        invalid: _Invalid = "error",
        progress: Progress | None = None,
    ) -> NDArray[np.uint32]:
        """Returns the number of hits of each ray, as `all` counts them.

        >>> tracer.counts([[0.5, 0.5, 3], [2, 2, 3]], [[0, 0, -1], [0, 0, -1]])
        array([1, 0], dtype=uint32)
        """
    def contains(self, points: Numbers, *, by: _Rule = "auto", progress: Progress | None = None) -> NDArray[np.bool_]:
        """Returns whether each point, `(m, 3)`, is inside the mesh. A point on the surface may count as
        either.

        `by="winding"` counts how often the triangles wind round the point: right for meshes that
        have holes or overlap themselves, if the corners of all triangles run in the same direction.
        It is exact for watertight meshes, and otherwise the generalised winding number of all
        triangles, at a hundred times the cost, and near an open terrain, where it is nearly one half
        everywhere, at the cost of most triangles. `by="parity"` counts the crossings along one
        direction: right for watertight meshes that do not overlap themselves, in whatever direction
        their corners run. `by="auto"` is parity for watertight meshes with corners in both
        directions, and otherwise winding.

        >>> tracer.contains([[0.5, 0.5, 1]])
        array([False])
        """
    def closest(
        self, points: Numbers, *, progress: Progress | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float64]]:
        """Returns the closest points of the triangles to each point, `(m, 3)`, in `float64`, with the
        triangles' indices and the distances. Among triangles at the same distance the lowest index
        wins. A point that is not finite has NaN, −1 and infinity. Triangles without area do not
        count.

        >>> tracer.closest([[0.5, 0.25, 2]])
        (array([[0.5 , 0.25, 0.  ]]), array([0], dtype=int32), array([2.]))
        """
    def signed_distance(self, points: Numbers, *, by: _Rule = "auto", progress: Progress | None = None) -> NDArray[np.float64]:
        """Returns the distance of each point, `(m, 3)`, from the triangles, negative for points that
        the mesh contains. `by` is as for `contains`.

        >>> tracer.signed_distance([[0.5, 0.25, 2]])
        array([2.])
        """
    def visible(
        self,
        points: Numbers,
        directions: Numbers,
        weights: Numbers | None = None,
        *,
        normals: Numbers | None = None,
        cosine: bool = False,
        t_min: Numbers | None = None,
        t_max: Numbers | None = None,
        progress: Progress | None = None,
    ) -> NDArray[Any]:
        """Returns which of the `directions`, `(m, 3)`, are free from each of the `points`, `(n, 3)`: an
        array `(n, m)` that is true where `any` finds no hit from `t_min` to `t_max`. With `weights`,
        `(m,)` or `(m, k)`, returns instead their sums over each point's free directions, `(n,)` or
        `(n, k)`, in `float64`: hours of sun, energies, view factors, in memory for these sums alone.

        With `normals`, `(n, 3)` and of any length, only directions d above the surface, n · d > 0,
        count as free; `cosine=True` multiplies weights by the cosine of the angle between the two.
        Surfaces stop directions at 0, so points on a surface need a `t_min`, or a place a
        little above it.

        >>> below = [[0.5, 0.5, -1]]
        >>> tracer.visible(below, [[0, 0, 1], [0, 1, 0]])
        array([[False,  True]])
        >>> tracer.visible(below, [[0, 0, 1], [0, 1, 0], [1, 0, 0]], [4, 2, 1])
        array([3.])
        """
    def surface(
        self, origins: Numbers, directions: Numbers, triangle: Numbers
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[_Real]]:
        """Returns the weights `u` and `v` of the second and third corner at hits, and the unit normals
        of the triangles, on the side from which their corners run counterclockwise. `triangle` has
        one index per ray; where it is −1 all numbers are 0.

        >>> tracer.surface([[0.5, 0.25, 3]], [[0, 0, -1]], [0])
        (array([0.25]), array([0.25]), array([[0., 0., 1.]], dtype=float32))
        """
    def __len__(self) -> int: ...

def corners(vertex_positions: Numbers, triangle_indices: Numbers) -> NDArray[_Real]:
    """Returns the corners, `(n, 3, 3)`, of the triangles of a mesh, with the checks of
    `Tree.from_mesh`: in `float32` if the vertices are, and otherwise in `float64`.
    """
def sky(patches: int | None = None, *, uniform: int | None = None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns directions of the sky above the plane of x (east) and y (north), unit vectors `(m, 3)`,
    and their weights, `(m,)`: the solid angle of each over π. With `cosine=True`,
    `Tracer.visible` then returns sky view factors: of a free horizontal surface 1, to 0.6 % with 145
    patches.

    `patches` are the middles of the 145 patches of Tregenza, the default, or of the 577, 1297 and so
    on, 144 k² + 1, into which Reinhart divides them, in rows from the horizon to the zenith, from
    north over east. `uniform` directions have the same solid angle each.

    >>> from bvh_search import sky
    >>> directions, weights = sky(patches=145)
    >>> directions[0].round(3), float(weights.sum().round(9))
    (array([0.   , 0.995, 0.105]), 2.0)
    """
def rows(name: str, argument: Numbers, length: int) -> NDArray[Any]:
    """Converts the argument called `name` to `float32` or `float64` and checks that its last axis has
    this length.
    """
