"""A grid cut into slabs of rows, one for each rank, and the exchange of rows for columns.

Every rank runs the same program on its own rows, which are plain arrays.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import prod
from typing import Any, NoReturn

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import NUMPY, library_of
from toeplitz_mg.engine.passes import NARROW
from toeplitz_mg.engine.vectors import Vectors
from toeplitz_mg.engine.work import axes_of
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.halfspace.influence import offsets
from toeplitz_mg.slabs.files import save_rows
from toeplitz_mg.slabs.messages import Messages
from toeplitz_mg.slabs.row_vectors import RowVectors, rows_of
from toeplitz_mg.values import count, refuse_masked

UNITS = (64, 16, 4, 1)  # Rows that may stay together; the cells of FSAI grow fourfold per level.
SHARE = 16  # Least number of units per rank, so that one more unit is a small imbalance.
TURN_BYTES = 2**23  # Bytes of the columns that a rank has at a time in an exchange.
UNKNOWN = 8  # Memory of an unknown (with `fsai_preconditioner` and `cg`) over that of a cell.

Turn = Sequence[tuple[int, int]]  # For each rank its first column, and the one behind its last.


class Slab(Messages):
    """The rows of a grid that this rank has.

    Parameters
    ----------
    comm : mpi4py.MPI.Intracomm
        For example ``MPI.COMM_WORLD``.
    shape : tuple of int
        The shape of the whole grid: (n₁, n₂, ...), or (n,).
    unit : int, optional
        Number of rows that stay together. The default suits the levels of FSAI and gives all ranks
        about the same number of rows.

    Attributes
    ----------
    comm, shape, unit
    rows : slice
        The rows of this rank.
    local : tuple of int
        The shape of this rank's part of the grid.
    starts : ndarray of int, of shape (ranks + 1,)
        The first row of each rank, and n₁.
    vectors : Vectors
        Inner products and other reductions of distributed vectors.

    See Also
    --------
    ToeplitzOperator : a matrix distributed like a slab.

    Examples
    --------
    >>> from mpi4py import MPI
    >>> slab = Slab(MPI.COMM_WORLD, (1000, 500))
    >>> slab
    <Slab of the grid (1000, 500): rows 0 to 999 on rank 0>
    >>> slab.sum(np.ones(slab.local))
    500000.0
    """

    def __init__(self, comm: Any, shape: tuple[int, ...], *, unit: int | None = None) -> None:
        super().__init__(comm)
        ranks = comm.size
        with self.agree() as same:
            if not isinstance(shape, Sequence) or not shape:
                raise ValueError(f"shape is {shape!r}, but must be a tuple of one axis at least")
            shape = tuple(count("each number of shape", n) for n in shape)
            if unit is None:
                unit = choose_unit(shape, ranks)
            units = -(-shape[0] // count("unit", unit))
            if ranks > units:
                of_units = "" if unit == 1 else f", {units} units of {unit} rows"
                raise ValueError(
                    f"the grid {shape} has {shape[0]} rows{of_units}, but each of {ranks} ranks "
                    "needs one at least: use fewer ranks, or make the longest axis the first one"
                )
            same["the shape of the grid"], same["unit"] = shape, unit
        self.unit = unit
        self._set(shape, np.minimum(unit * cuts_of(units, ranks), shape[0]))

    def _set(self, shape: tuple[int, ...], starts: Array) -> None:
        self.shape, self.starts = shape, starts
        first, end = starts[self.comm.rank : self.comm.rank + 2].tolist()
        self.rows = slice(first, end)
        self.local = (end - first, *shape[1:])
        self.vectors = Vectors(self.gather)

    def alike(self, shape: tuple[int, ...], starts: Array) -> "Slab":
        """Return the slab of another grid, cut at these rows."""
        slab = Slab.__new__(Slab)
        slab.comm, slab.unit = self.comm, self.unit
        slab._set(shape, starts)
        return slab

    def balanced(self, mask: Any) -> "Slab":
        """Return a slab of the same grid whose ranks have about equal numbers of unknowns.

        Parameters
        ----------
        mask : array_like of bool, of shape `local`, or (components, ...) of that
            True at the unknowns in this rank's rows.

        Returns
        -------
        Slab
            With other rows: evaluate the coefficients and the mask again for these.

        Examples
        --------
        >>> from mpi4py import MPI
        >>> slab = Slab(MPI.COMM_WORLD, (1000, 500))
        >>> rows = np.arange(1000)[slab.rows, np.newaxis]
        >>> slab = slab.balanced(rows + np.arange(500) < 700)  # A triangle.
        >>> slab.shape
        (1000, 500)
        """
        with self.agree():
            mask = refuse_masked("mask", library_of(mask).to_numpy(mask))
            if mask.dtype != np.bool_ or mask.shape[-len(self.local) :] != self.local:
                raise ValueError(
                    f"mask has dtype {mask.dtype} and shape {mask.shape}, but must be of booleans, "
                    f"of this rank's rows, {self.local}"
                )
        by_row = mask.reshape(-1, self.local[0], prod(self.local[1:]))
        weights = by_row.shape[2] + UNKNOWN * np.count_nonzero(by_row, axis=(0, 2))
        weights = self.everywhere(weights, np.diff(self.starts))
        units = np.add.reduceat(weights, np.arange(0, len(weights), self.unit))
        cuts = np.minimum(self.unit * balance(units, self.comm.size), self.shape[0])
        return self.alike(self.shape, cuts)

    @property
    def is_line(self) -> bool:
        """Whether the grid has one axis, besides those of one element."""
        return axes_of(self.shape) == 1

    def offsets(self, element: tuple[float, float]) -> tuple[Array, Array]:
        """Return the offsets of the first column for this rank's rows (see `halfspace.offsets`).

        Parameters
        ----------
        element : (float, float)
            Size h₁ × h₂ of an element.

        Returns
        -------
        x, y : ndarray of shape (rows, 1) and (1, n₂)
            The centres i h₁ and j h₂, for the rows i of this rank.
        """
        if len(self.shape) != 2:
            raise ValueError(f"the grid is {self.shape}, but must have the two axes x and y")
        x, y = offsets(self.shape, element)
        return x[self.rows], y

    def sum(self, x: Array) -> float:
        """Return the sum of a distributed real field, the same on all ranks."""
        vectors, x = self._read(x)
        if vectors is self.vectors:
            x = x.astype(np.float64, copy=False)  # Other dtypes overflow or round sooner.
        return float(vectors.sum(x))

    save = save_rows

    def extent(self, x: Array) -> tuple[float, float]:
        """Return the minimum and the maximum of a field; inf and -inf if it is empty."""
        vectors, x = self._read(x)
        if vectors is self.vectors and x.dtype.kind in "bui":
            x = x.astype(np.float64)  # Integers have no infinity.
        return vectors.min(x), vectors.max(x)

    def _read(self, x: Any) -> tuple[Any, Any]:
        """Return a real field of any library, preceded by the reductions for its numbers."""
        with self.agree():
            library = library_of(x)
            x = library.read("x", x)
            dtype = library.dtype(x)
            if dtype.kind not in "buif":
                raise TypeError(f"x has dtype {dtype}, but must be of real numbers")
            if dtype.kind == "b" and library is not NUMPY:  # Some libraries cannot sum booleans.
                x = library.xp.astype(x, library.native(np.float64))
        return self.vectors if library is NUMPY else library.vectors_of(self.gather), x

    def vectors_for(self, A: Any, dtype: np.dtype[Any]) -> Any:
        """Return the vector operations for an iteration with A, with inner products by rows.

        They are by rows only for all unknowns of the grid, or for those of a mask of A.
        """
        if dtype.kind == "c":
            raise TypeError(f"A and b have the dtype {dtype}, but must be real on slabs")
        mask = getattr(A, "mask", None)
        size = prod(A.grid_shape) if mask is None else np.count_nonzero(mask)
        rows = rows_of(self.shape, mask) if A.library is NUMPY and A.shape[0] == size else None
        return A.vectors if rows is None else RowVectors(self.gather, rows)

    def columns(self, n: int) -> slice:
        """Return this rank's part of n columns between `to_columns` and `to_rows`."""
        return slice(*cuts_of(n, self.comm.size)[self.comm.rank : self.comm.rank + 2].tolist())

    def turns(self, n: int, width: int) -> Iterator[tuple[slice, Turn]]:
        """Cut n columns into turns, in each of which a rank has at most `width` columns.

        Yields
        ------
        own : slice
            The columns of this rank in the turn, counted from its first column.
        turn : list of (int, int)
            The columns of each rank, counted from the first of all.
        """
        of_ranks = list(pairwise(cuts_of(n, self.comm.size).tolist()))
        turns = max(1, -(-max(b - a for a, b in of_ranks) // width))
        first, _ = of_ranks[self.comm.rank]
        for k in range(turns):
            turn = [(a + (b - a) * k // turns, a + (b - a) * (k + 1) // turns) for a, b in of_ranks]
            a, b = turn[self.comm.rank]
            yield slice(a - first, b - first), turn

    def turns_of(self, lengths: tuple[int, ...], size: int) -> Iterator[tuple[slice, Turn]]:
        """Return `turns` of columns for fields of these lengths, with numbers of `size` bytes."""
        return self.turns(lengths[-1], max(NARROW, TURN_BYTES // (size * prod(lengths[:-1]))))

    def to_columns(self, Z: Array, turn: Turn, out: Array | None = None) -> Array:
        """Exchange the columns of this rank's rows for the rows of this rank's columns.

        Parameters
        ----------
        Z : ndarray of shape (rows, ..., n)
        turn : list of (int, int)
            The columns of each rank.
        out : ndarray of shape (n₁, ..., k), C-contiguous, optional
            For the k columns of this rank.
        """
        own = slice(*turn[self.comm.rank])
        if out is None:
            out = np.empty((self.shape[0], *Z.shape[1:-1], own.stop - own.start), Z.dtype)
        sizes = self._sizes(turn, Z)
        sent = workspace((sum(sizes),), Z.dtype)
        for part, columns in self._pieces(sent, turn, Z):
            part[...] = Z[..., columns]
        out[self.rows] = Z[..., own]
        self.swap([sent, sizes], [out, self._places_of_rows(out)])
        return out

    def to_rows(self, C: Array, out: Array, turn: Turn) -> None:
        """Undo `to_columns`: write into the columns `turn` of `out`."""
        sizes = self._sizes(turn, out)
        got = workspace((sum(sizes),), out.dtype)
        self.swap([np.ascontiguousarray(C), self._places_of_rows(C)], [got, sizes])
        for part, columns in self._pieces(got, turn, out):
            out[..., columns] = part
        out[..., slice(*turn[self.comm.rank])] = C[self.rows]

    def _sizes(self, turn: Turn, Z: Array) -> list[int]:
        """Return the amount for each rank; 0 for this one, whose own part is copied directly."""
        sizes = [prod(Z.shape[:-1]) * (b - a) for a, b in turn]
        sizes[self.comm.rank] = 0
        return sizes

    def _places_of_rows(self, C: Array) -> tuple[list[int], list[int]]:
        """Return the size and the start of each rank's part of C; the size is 0 for this rank."""
        places = self.starts * prod(C.shape[1:])
        sizes = np.diff(places).tolist()
        sizes[self.comm.rank] = 0
        return sizes, places[:-1].tolist()

    def _pieces(self, flat: Array, turn: Turn, Z: Array) -> Iterator[tuple[Array, slice]]:
        """Yield the pieces of a message for the other ranks as arrays, with their columns."""
        end = 0
        for size, (a, b) in zip(self._sizes(turn, Z), turn, strict=True):
            start, end = end, end + size
            if size:
                yield flat[start:end].reshape(*Z.shape[:-1], b - a), slice(a, b)

    def __copy__(self) -> "Slab":
        """Return itself: a slab is immutable, and copies of objects on it stay on it."""
        return self

    def __deepcopy__(self, memo: Any) -> "Slab":
        return self

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            f"{self!r} belongs to the ranks of its communicator and cannot be pickled, nor can "
            "objects on it: pickle arrays, and make it anew by Slab(comm, shape)"
        )

    @property
    def name(self) -> str:
        """The grid and the number of ranks, the same text on all ranks."""
        return f"{' x '.join(map(str, self.shape))} on {self.comm.size} ranks"

    def __repr__(self) -> str:
        start, stop = self.rows.start, self.rows.stop
        return (
            f"<Slab of the grid {self.shape}: rows {start} to {stop - 1} on rank {self.comm.rank}>"
        )


def require_slab(slab: Any) -> None:
    """Raise an error for an object that is not a slab; without one the ranks cannot agree."""
    if not isinstance(slab, Slab):
        raise TypeError(f"slab is {slab!r}, but must be a Slab: Slab(MPI.COMM_WORLD, shape)")


def choose_unit(shape: tuple[int, ...], ranks: int) -> int:
    """Return the number of rows that stay together, so that ranks have about equal numbers."""
    of_line = () if prod(shape[1:]) > 1 else (line_width(shape[0]),)
    return next((k for k in (*of_line, *UNITS) if shape[0] >= SHARE * k * ranks), 1)


def line_width(n: int) -> int:
    """Return the row length with which n unknowns of one axis are treated as a matrix."""
    return 1 << n.bit_length() // 2


def balance(weights: Array, parts: int) -> Array:
    """Return the cuts of a sequence into parts of nearly equal weight, shape (parts + 1,).

    The weights are positive, and there are at least as many as parts. No part is empty.
    """
    ends, k = np.cumsum([0, *weights]), np.arange(parts + 1)
    goals = ends[-1] * k / parts
    cuts = np.searchsorted((ends[1:] + ends[:-1]) / 2, goals)  # The nearest ends.
    return np.minimum(np.maximum.accumulate(cuts - k), len(weights) - parts) + k


def cuts_of(n: int, parts: int) -> Array:
    """Return the cuts of n items into parts of nearly equal size, shape (parts + 1,)."""
    return np.array([n * k // parts for k in range(parts + 1)])
