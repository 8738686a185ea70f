"""The messages between ranks; no other file sends any.

A condition that decides about the next message may depend only on gathered numbers, which are
bitwise equal on all ranks. Otherwise a rank could wait forever for a message that no other sends.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import prod
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.ranks import Callback, Ranks
from toeplitz_mg.preconditioners.fsai.rows import Refused

# Errors that all ranks raise alike; any other error becomes a RuntimeError.
REFUSALS = (
    Refused,
    np.linalg.LinAlgError,
    ValueError,
    TypeError,
    OSError,
    MemoryError,
    FloatingPointError,
    OverflowError,
)


class Messages(Ranks):
    """The messages between this rank and the others.

    All ranks must call the same methods in the same order.

    Parameters
    ----------
    comm : mpi4py.MPI.Intracomm
        For example ``MPI.COMM_WORLD``.
    """

    _agreeing = 0  # The number of open `agree` contexts of this process, for any communicator.

    def __init__(self, comm: Any) -> None:
        self.comm = _check(comm)

    @contextmanager
    def agree(self) -> Iterator[dict[str, Any]]:
        """If the body raises an error on one rank, raise it on all ranks.

        Otherwise the others would wait forever for the rank with the error (or, with
        ``python -W error``, the warning). Fill the dictionary with values that must be the same on
        all ranks, by name; a ValueError is raised if they differ.
        """
        same: dict[str, Any] = {}
        refusal: Exception | None = None
        Messages._agreeing += 1
        try:
            yield same
        except Exception as error:
            refusal = error
        finally:
            Messages._agreeing -= 1
        told = self.comm.allgather((*_name_kind(refusal), same))
        for rank, (kind, text, _) in enumerate(told):
            if kind is not None:
                raise kind(f"rank {rank}: {text}") from refusal
        first = told[0][2]
        for rank, (_, _, other) in enumerate(told):
            if other.keys() != first.keys():
                raise ValueError(
                    f"rank 0 compares {list(first)}, and rank {rank} {list(other)}, but all ranks "
                    "must call the same functions in the same order, and give the same arguments"
                )
            for name, value in first.items():
                if other[name] != value:
                    raise ValueError(
                        f"{name} is {value} on rank 0 and {other[name]} on rank {rank}, but must "
                        "be the same on all"
                    )

    def share_errors(self, callback: Callback) -> Callback:
        """Return a callback that all ranks must call, or None if no rank has one.

        An error on one rank is raised on all: there the original one, elsewhere that of `agree`.
        """
        if not any(self.gather(callback is not None)):
            return None

        def tell(*arguments: Any) -> None:
            try:
                with self.agree():
                    if callback is not None:
                        callback(*arguments)
            except Exception as error:
                raise (error.__cause__ or error) from None

        return tell

    def gather(self, number: Any) -> Sequence[Any]:
        """Return the number, or array of numbers, of each rank, in the order of the ranks.

        64-bit integers are exchanged as they are, other numbers in double precision.
        """
        own = np.asarray(number)
        if own.dtype != np.int64:
            own = own.astype(np.result_type(own, np.float64), copy=False)
        numbers = np.empty((self.comm.size, *own.shape), own.dtype)
        self.comm.Allgather(np.ascontiguousarray(own), numbers)
        return numbers.tolist() if own.ndim == 0 else list(numbers)

    def of_first(self, found: Any) -> Any:
        """Return the (small) result of the first rank on all ranks."""
        return self.comm.bcast(found)

    def everywhere(self, x: Array, lengths: Array | None = None) -> Array:
        """Return the rows of all ranks, concatenated, on each rank.

        Use it only for small arrays, never for those of the size of the grid. If `lengths`, the
        numbers of rows, are given, one message less is sent.
        """
        if self.comm.size == 1:
            return x
        if lengths is None:
            lengths = np.array(self.gather(len(x)), int)
        whole = np.empty((int(lengths.sum()), *x.shape[1:]), x.dtype)
        self.comm.Allgatherv(np.ascontiguousarray(x), [whole, lengths * prod(x.shape[1:])])
        return whole

    def exchange(
        self, x: Array, starts: Array, lengths: Array, expected: Array, got: Array | None = None
    ) -> Array:
        """Send each rank some rows, from `starts` on, and return the received rows.

        Rank k is sent `lengths[k]` rows and sends `expected[k]`, into `got` if that is given.
        """
        size = prod(x.shape[1:])
        if got is None:
            got = np.empty((int(expected.sum()), *x.shape[1:]), x.dtype)
        self.swap(
            [np.ascontiguousarray(x), (lengths * size, starts * size)], [got, expected * size]
        )
        return got

    def swap(self, sent: list[Any], got: list[Any]) -> None:
        """Send parts of an array to each rank, and receive parts of another array from each."""
        self.comm.Alltoallv(sent, got)


class SharedProgress:
    """A `progress` callback of contact whose errors on one rank are raised on all ranks.

    The ranks agree after each product that they make together. On a grid that each rank stores as a
    whole none waits for another; there an error is kept until they agree.
    """

    def __init__(self, ranks: Messages, progress: Callback) -> None:
        self._ranks, self._progress = ranks, progress
        self._error: Exception | None = None

    def __call__(self, *arguments: Any) -> None:
        """Report a product; raise a kept error if the ranks are about to agree."""
        try:
            if self._progress is not None and self._error is None:
                self._progress(*arguments)
        except Exception as error:
            self._error = error
        if Messages._agreeing:
            self._raise()

    @contextmanager
    def heard(self) -> Iterator[None]:
        """Raise an error of one rank on all of them; on that rank it is the original error."""
        try:
            yield
            with self._ranks.agree():
                self._raise()
        except Exception:
            self._raise()
            raise

    def _raise(self) -> None:
        if self._error is not None:
            raise self._error


def _name_kind(refusal: Exception | None) -> tuple[type[Exception] | None, str]:
    """Return the type and the message of the error that all ranks raise for that of one."""
    if refusal is None:
        return None, ""
    for kind in REFUSALS:
        if isinstance(refusal, kind):
            return kind, str(refusal)
    return RuntimeError, f"{type(refusal).__name__}: {refusal}"


def _check(comm: Any) -> Any:
    try:
        from mpi4py import MPI
    except ImportError as error:
        raise ImportError(
            'toeplitz_mg.slabs needs mpi4py, which is not installed: pip install "toeplitz-mg[mpi]"'
        ) from error
    if not isinstance(comm, MPI.Intracomm) or comm == MPI.COMM_NULL:
        name = "MPI.COMM_NULL" if comm == MPI.COMM_NULL else f"of type {type(comm).__name__}"
        raise TypeError(f"comm is {name}, but must be a communicator, as MPI.COMM_WORLD of mpi4py")
    return comm
