"""What ranks tell each other. No other file sends messages.

A condition on which the next message depends rests on gathered numbers only, which are the same
bits on all ranks: otherwise one would wait for ever for a message that no other sends.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import prod
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.ranks import Callback, Ranks
from toeplitz_mg.preconditioners.fsai.rows import Refused

# What all ranks raise alike; in the place of any other error a RuntimeError.
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
    """The messages of this rank to the others, and of the others to this one.

    All ranks have to call the same methods in the same order.

    Parameters
    ----------
    comm : mpi4py.MPI.Intracomm
        As ``MPI.COMM_WORLD``.
    """

    _agreeing = 0  # In how many `agree` this process is, with ranks of any communicator.

    def __init__(self, comm: Any) -> None:
        self.comm = _check(comm)

    @contextmanager
    def agree(self) -> Iterator[dict[str, Any]]:
        """Do what may be refused on some ranks only, so that all ranks raise the same error.

        Without it the others would wait for ever for the rank that has raised one, whatever it is:
        with ``python -W error`` a warning too. The dictionary is to be filled with what has to be
        the same on all ranks, by its name; otherwise it is a ValueError.
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
        """Return a callback that all ranks have to call, or None where no rank has one.

        Where it raises on one rank, it does on all: there its own error, elsewhere that of `agree`.
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
        """Return a number, or an array of numbers, of each rank, in the order of the ranks.

        Integers, of 64 bits, are exchanged as they are, others in double precision.
        """
        own = np.asarray(number)
        if own.dtype != np.int64:
            own = own.astype(np.result_type(own, np.float64), copy=False)
        numbers = np.empty((self.comm.size, *own.shape), own.dtype)
        self.comm.Allgather(np.ascontiguousarray(own), numbers)
        return numbers.tolist() if own.ndim == 0 else list(numbers)

    def of_first(self, found: Any) -> Any:
        """Return what the first rank has found, of few numbers, on all ranks."""
        return self.comm.bcast(found)

    def everywhere(self, x: Array, lengths: Array | None = None) -> Array:
        """Return the rows of all ranks, one after the other, on each of them.

        It is for what is small: nothing of the size of the grid may go this way. Where the number
        of rows of each rank is known, `lengths`, one message less is sent.
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
        """Send each rank some rows, from `starts` on, and return those that all ranks send.

        Rank k is sent `lengths[k]` rows, and sends `expected[k]`, into `got` where that is given.
        """
        size = prod(x.shape[1:])
        if got is None:
            got = np.empty((int(expected.sum()), *x.shape[1:]), x.dtype)
        self.swap(
            [np.ascontiguousarray(x), (lengths * size, starts * size)], [got, expected * size]
        )
        return got

    def swap(self, sent: list[Any], got: list[Any]) -> None:
        """Send each rank some numbers of an array, and put those of each rank into another."""
        self.comm.Alltoallv(sent, got)


class SharedProgress:
    """A `progress` of contact; an error that it raises on one rank all ranks raise.

    They agree on it after each product that they make together. On a grid of which each rank has
    all, none waits for another: there an error is kept until they do.
    """

    def __init__(self, ranks: Messages, progress: Callback) -> None:
        self._ranks, self._progress = ranks, progress
        self._error: Exception | None = None

    def __call__(self, *arguments: Any) -> None:
        """Tell of a product, by itself or with ranks that agree."""
        try:
            if self._progress is not None and self._error is None:
                self._progress(*arguments)
        except Exception as error:
            self._error = error
        if Messages._agreeing:
            self._raise()

    @contextmanager
    def heard(self) -> Iterator[None]:
        """Solve a problem, of which all ranks raise an error: on the rank of that it is its own."""
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
    """Return which error all ranks raise for that of one, and what it says."""
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
            'toeplitz_mg.slabs needs mpi4py, but it is not there: pip install "toeplitz-mg[mpi]"'
        ) from error
    if not isinstance(comm, MPI.Intracomm) or comm == MPI.COMM_NULL:
        name = "MPI.COMM_NULL" if comm == MPI.COMM_NULL else f"a {type(comm).__name__}"
        raise TypeError(f"comm is {name}, but must be a communicator, as MPI.COMM_WORLD of mpi4py")
    return comm
