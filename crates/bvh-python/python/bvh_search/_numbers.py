"""The types of arguments that all classes have."""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Tensor(Protocol):
    """Numbers of another library, which numpy reads without a copy."""

    def __dlpack__(self) -> Any: ...


# Numbers that are converted to an array.
Numbers = ArrayLike | Tensor
# Called with the elapsed seconds and the part that is answered.
Progress = Callable[[float, float], object]
# Called with the elapsed seconds and the cost of the best tree, if there is one.
SearchProgress = Callable[[float, float | None], object]

# The least size of a number but 0 in a tree with precision="double".
_LEAST = 2.0**-150


def without_tiny(numbers: NDArray[Any]) -> NDArray[Any]:
    """Returns 0 for what is too small for a tree with precision="double"."""
    is_least: NDArray[np.bool_] = np.abs(numbers) >= _LEAST
    return numbers * is_least
