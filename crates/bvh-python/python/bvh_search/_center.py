"""The move of far coordinates to zero, because trees have `float32` coordinates."""

import numpy as np
from numpy.typing import NDArray

# Coordinates this many times as large as the extent of their points are far.
_FAR = 16.0
# The part of a mesh's size that one rounding of its coordinates may be.
_ROUNDING = 1e-3


def center_of(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the middle of far points, and zero for other points."""
    points = points.reshape((-1, 3))
    if len(points) == 0:
        return np.zeros(3)
    low, high = points.min(axis=0), points.max(axis=0)
    is_far = np.abs([low, high]).max() > _FAR * (high - low).max()
    center: NDArray[np.float64] = (low + high) / 2
    return center if is_far else np.zeros(3)


def check_rounding(name: str, points: NDArray[np.float64]) -> None:
    """Raises a `ValueError` if `float32` is too coarse for the shape of the points."""
    points = points.reshape((-1, 3))
    if len(points) == 0:
        return
    size = np.ptp(points, axis=0).max()
    step = float(np.spacing(np.float32(np.abs(points).max())))
    if size > 0 and step > _ROUNDING * size:
        raise ValueError(
            f"{name} has the size {size:.3g}, and its coordinates would be rounded to multiples of {step:.3g}, because "
            "the meshes of the scene are far apart and trees have float32 coordinates; accepted: multiples of at most "
            f"{_ROUNDING:g} of the size. Use a scene for every place"
        )
