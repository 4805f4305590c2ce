"""The move of far coordinates to zero, because trees have `float32` coordinates."""

import numpy as np

# Coordinates this many times as large as the extent of their points are far.
_FAR = 16.0


def center_of(points):
    """Returns the middle of far points, and zero for other points."""
    points = points.reshape((-1, 3))
    if len(points) == 0:
        return np.zeros(3)
    low, high = points.min(axis=0), points.max(axis=0)
    is_far = np.abs([low, high]).max() > _FAR * (high - low).max()
    return (low + high) / 2 if is_far else np.zeros(3)
