"""What is computed of small grids, and kept for the next case.

Tables are made of many small cases on one grid, whose matrices take longer than a case. They are
kept by all that a grid is, never changed, and no part of any result.
"""

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import Any, TypeVar

KEPT = 32  # Results of a function that are kept, by default.

Result = TypeVar("Result")


def keep(function: Callable[..., Result], most: int = KEPT) -> Callable[..., Result]:
    """Let a function keep what it returns for small grids; what is returned must not be changed.

    Its first argument is a grid, and the others are what can be hashed.
    """
    kept = lru_cache(maxsize=most)(function)

    @wraps(function)
    def look_up(grid: Any, *arguments: Any) -> Result:
        return (kept if grid.is_small else function)(grid, *arguments)

    return look_up
