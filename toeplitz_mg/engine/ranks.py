"""The processes that share the rows of a vector; by default, a single process has all of them.

An operator may have an attribute `ranks`; the default is `SERIAL`. The operators of
`toeplitz_mg.slabs` have several processes, each of which multiplies its own rows.
"""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np

from toeplitz_mg.engine.vectors import VECTORS

Callback = Callable[..., object] | None


class Ranks:
    """One process that has all rows; `slabs.messages.Messages` implements several."""

    def agree(self) -> AbstractContextManager[dict[str, Any]]:
        """Return a context in which arguments are checked, so that all processes raise one error.

        Its dictionary takes, by name, the values that must be the same in all processes.
        """
        return nullcontext({})

    def share_errors(self, callback: Callback) -> Callback:
        """Return the callback, changed to raise in all processes if it raises in one."""
        return callback

    def gather(self, number: Any) -> Sequence[Any]:
        """Return the numbers (or arrays) of all processes, in the order of the processes."""
        return (number,)

    def vectors_for(self, A: Any, dtype: np.dtype[Any]) -> Any:
        """Return the vector operations for an iteration with A in a dtype."""
        return getattr(A, "vectors", VECTORS)


SERIAL = Ranks()


def ranks_of(A: Any) -> Ranks:
    """Return the processes that share the rows of A: `A.ranks`, or `SERIAL` if it has none."""
    return getattr(A, "ranks", SERIAL)


def is_serial(A: Any) -> bool:
    """Whether a single process has all rows of the vectors that A multiplies."""
    return ranks_of(A) is SERIAL
