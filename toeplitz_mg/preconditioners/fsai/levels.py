"""The levels of a multilevel sparse approximate inverse on a mask, and their application."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_solve
from scipy.sparse import csc_array, csr_array

from toeplitz_mg._typing import Array
from toeplitz_mg.preconditioners.fsai.stencil import Stencil


@dataclass(frozen=True)
class Cells:
    """The matrix c_i T(i-j) c_j with the diagonal d, on the places of a `Stencil`.

    Attributes
    ----------
    c : ndarray
        The load of an unknown, 1 in full contact; 0 where there is no contact.
    d : ndarray
        1 where there is no contact.
    finest : bool
        Whether it is A itself: c = 1 and d = T(0) in contact.
    """

    c: Array
    d: Array
    finest: bool = False

    @classmethod
    def of_mask(cls, stencil: Stencil, mask: Array) -> "Cells":
        """Return those of A, for a mask of shape (n1, n2), or (2, n1, n2) of two components."""
        grids = mask.reshape(stencil.T.shape[1:])
        contact = np.concatenate([stencil.grid.place(grid, False) for grid in grids])
        return cls(contact, stencil.on_places(stencil.zero), True)

    def changed_from(self, old: "Cells", kept: float) -> Array:
        """Where the unknowns are others, by more than this relative to the old ones."""
        if self.finest:
            return np.asarray(self.c != old.c)
        load = np.abs(self.c - old.c) > kept * old.c
        return np.asarray(load | (np.abs(self.d - old.d) > kept * old.d))

    def where(self, changed: Array, old: "Cells") -> "Cells":
        """Return these cells where they have changed, the old ones elsewhere."""
        if self.finest:
            return self
        return Cells(np.where(changed, self.c, old.c), np.where(changed, self.d, old.d))

    @cached_property
    def contact(self) -> Array:
        """Where there are unknowns."""
        return self.c.astype(bool, copy=False)

    @property
    def count(self) -> int:
        """The number of unknowns."""
        return int(np.count_nonzero(self.contact))

    @property
    def number(self) -> Array:
        """The number of the unknown in each place, in the order of their places."""
        at = np.flatnonzero(self.contact)
        number = np.zeros(len(self.c), np.int32)
        number[at] = np.arange(len(at), dtype=np.int32)
        return number


@dataclass(frozen=True)
class Direct:
    """The coarsest level, by Cholesky's factorisation.

    Attributes
    ----------
    cells : Cells
    factor : ndarray of shape (N, N)
    """

    cells: Cells
    factor: Array

    @property
    def sizes(self) -> tuple[int, ...]:
        """The number of unknowns."""
        return (len(self.factor),)

    @property
    def length(self) -> int:
        """Of the vectors that it is applied to."""
        return len(self.factor)

    @cached_property
    def number(self) -> Array:
        """The number of the unknown in each place."""
        return self.cells.number

    @property
    def multiplications(self) -> int:
        """Multiplications of one application."""
        return self.factor.size

    def __call__(self, x: Array) -> Array:
        """Apply it to a vector, or to the columns of x."""
        return np.asarray(cho_solve((self.factor, False), x, check_finite=False))

    def multiply(self, X: Array, out: Array) -> None:
        """Apply it to rows."""
        out[...] = self(X.T).T


@dataclass(frozen=True)
class Rows:
    """Rows of G in float64, on the finest level by pattern, else by unknown.

    Attributes
    ----------
    rows : ndarray of shape (K, any)
        A row of G in a column.
    sums : ndarray of shape (d, any)
        Their products with the vector c, on the finest level of ones, in their own component, and
        the other.
    place : ndarray of int
        Where the row of each cell in contact is.
    """

    rows: Array
    sums: Array
    place: Array


@dataclass(frozen=True)
class Level:
    """Gᵀ (I - W Wᵀ + W E⁻¹ Wᵀ) G, with the next level for E⁻¹.

    Attributes
    ----------
    cells : Cells
    rows : Rows
    block : ndarray of int, shape (N, d)
        The places of the aggregates of each unknown, in each component, on the next level.
    G, W : csr_array
        Their rows are the unknowns, in the order of their places.
    coarse : Level or Patched or Direct
    """

    cells: Cells
    rows: Rows
    block: Array
    G: csr_array
    W: csr_array
    coarse: "AnyLevel"

    @property
    def sizes(self) -> tuple[int, ...]:
        """The number of unknowns on each level."""
        return (self.length, *self.coarse.sizes)

    @property
    def length(self) -> int:
        """Of the vectors that it is applied to."""
        return len(self.block)

    @cached_property
    def number(self) -> Array:
        """The number of the unknown in each place."""
        return self.cells.number

    @property
    def multiplications(self) -> int:
        """Multiplications of one application."""
        return 2 * int(self.G.nnz + self.W.nnz) + self.coarse.multiplications

    @cached_property
    def transposed(self) -> tuple[csc_array, csc_array]:
        """Views of G and W, which would take their time in each application."""
        return self.G.T, self.W.T

    def __call__(self, x: Array) -> Array:
        """Apply it to a vector, or to the columns of x."""
        y = self.G @ x
        a = self.transposed[1] @ y
        y += self.W @ (self.coarse(a) - a)
        return np.asarray(self.transposed[0] @ y)

    def multiply(self, X: Array, out: Array) -> None:
        """Apply it to rows."""
        out[...] = self(X.T).T


@dataclass(frozen=True)
class Patched:
    """The same for cells that differ in some places from those of another level.

    The unknowns of that one keep their numbers, also where they are none any more; there x is 0,
    and what comes back is not used. New ones come after them.

    Attributes
    ----------
    base : Level
    cells : Cells
    rows : Rows
    block : ndarray of int, shape (n, d)
        As those of `Level`, n of the numbers.
    number : ndarray of int
        The number of the unknown in each place.
    gone : ndarray of int
        Numbers of those that are no unknowns any more.
    lines : ndarray of int
        Numbers of those whose rows of G are not those of `base`.
    G : csr_array
        The rows of these.
    W : csr_array
        Its rows are the numbers.
    coarse : Level or Patched or Direct
    """

    base: Level
    cells: Cells
    rows: Rows
    block: Array
    number: Array
    gone: Array
    lines: Array
    G: csr_array
    W: csr_array
    coarse: "AnyLevel"

    @classmethod
    def of(cls, level: Level) -> "Patched":
        """Return a level of which nothing has changed yet."""
        none = np.zeros(0, np.int32)
        G = csr_array((0, level.length), dtype=level.G.dtype)
        own = level.cells, level.rows, level.block, level.number
        return cls(level, *own, none, none, G, level.W, level.coarse)

    @property
    def sizes(self) -> tuple[int, ...]:
        """The number of unknowns on each level."""
        return (self.cells.count, *self.coarse.sizes)

    @property
    def length(self) -> int:
        """Of the vectors that it is applied to."""
        return len(self.block)

    @property
    def multiplications(self) -> int:
        """Multiplications of one application."""
        nnz = int(self.base.G.nnz + self.G.nnz + self.W.nnz)
        return 2 * nnz + self.coarse.multiplications

    @cached_property
    def transposed(self) -> tuple[csc_array, csc_array]:
        """Views of G and W, which would take their time in each application."""
        return self.G.T, self.W.T

    def __call__(self, x: Array) -> Array:
        """Apply it to a vector, or to the columns of x."""
        n = self.base.length
        born = np.zeros((self.length - n, *x.shape[1:]), x.dtype)
        y = np.concatenate([self.base.G @ x[:n], born])
        y[self.gone] = 0.0
        y[self.lines] = self.G @ x
        a = self.transposed[1] @ y
        y += self.W @ (self.coarse(a) - a)
        z = self.transposed[0] @ y[self.lines]
        y[self.lines] = 0.0
        z[:n] += self.base.transposed[0] @ y[:n]
        return np.asarray(z)

    @cached_property
    def of_unknowns(self) -> Array:
        """Their numbers, in the order of their places."""
        return self.number.take(np.flatnonzero(self.cells.contact)).astype(np.intp)

    def multiply(self, X: Array, out: Array) -> None:
        """Apply it to rows, whose entries are the unknowns in the order of their places."""
        x = np.zeros((self.length, *X.T.shape[1:]), X.dtype)
        x[self.of_unknowns] = X.T
        out[...] = self(x)[self.of_unknowns].T


AnyLevel = Level | Patched | Direct
