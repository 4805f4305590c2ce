"""Better bounding volume hierarchies by stochastic search: find, save, load and trace trees over
numpy arrays."""

from ._bvh_search import Tracer, Tree, __version__, sky
from .raycasting import RaycastingScene

__all__ = ["RaycastingScene", "Tracer", "Tree", "__version__", "sky"]
