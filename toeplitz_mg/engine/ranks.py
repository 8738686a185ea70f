"""The processes that share the rows of a vector: one that has them all, unless an operator says so.

An operator names its `ranks`, by default `SERIAL`. `toeplitz_mg.slabs` has those of several
machines, of which each multiplies its own rows.
"""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np

from toeplitz_mg.engine.vectors import VECTORS

Callback = Callable[..., object] | None


class Ranks:
    """One process, which has all rows; in `slabs.messages.Messages` there are several."""

    def agree(self) -> AbstractContextManager[dict[str, Any]]:
        """Return what arguments are checked in, so that all processes raise the same error.

        What has to be the same in all of them is put into the dictionary, by its name.
        """
        return nullcontext({})

    def share_errors(self, callback: Callback) -> Callback:
        """Return a callback, or None; where it raises in one process, all raise an error."""
        return callback

    def gather(self, number: Any) -> Sequence[Any]:
        """Return a number, or an array of numbers, of each process, in the order of these."""
        return (number,)

    def vectors_for(self, A: Any, dtype: np.dtype[Any]) -> Any:
        """Return the inner products and updates of an iteration with A for numbers of a dtype."""
        return getattr(A, "vectors", VECTORS)


SERIAL = Ranks()


def ranks_of(A: Any) -> Ranks:
    """Return the processes that share the rows of an operator; of what names none it is one."""
    return getattr(A, "ranks", SERIAL)


def is_serial(A: Any) -> bool:
    """Whether an operator multiplies vectors that a single process has all of."""
    return ranks_of(A) is SERIAL
