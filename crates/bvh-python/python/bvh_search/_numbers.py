"""The types of arguments that all classes have."""

from collections.abc import Callable
from typing import Any, Protocol

from numpy.typing import ArrayLike


class Tensor(Protocol):
    """Numbers of another library, which numpy reads without a copy."""

    def __dlpack__(self) -> Any: ...


# Numbers that are converted to an array.
Numbers = ArrayLike | Tensor
# Called with the elapsed seconds and a state.
Progress = Callable[[float, float], object]
