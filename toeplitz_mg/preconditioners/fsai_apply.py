"""The levels of a multilevel sparse approximate inverse on a mask, and their application."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve
from scipy.sparse import csc_array, csr_array

from toeplitz_mg.preconditioners.fsai_table import Stencil

Array = NDArray[Any]


@dataclass(frozen=True)
class Cells:
    """The matrix c_i T(i-j) c_j with the diagonal d, on the flattened grid of a `Stencil`.

    Attributes
    ----------
    c : ndarray
        The load of an unknown, 1 in full contact.
    d : ndarray
        1 where there is no contact.
    smooth : ndarray
        What the vector of ones is on this level; 0 where there is no contact.
    finest : bool
        Whether it is A itself: c = smooth = 1 and d = T(0) in contact.
    """

    c: Array
    d: Array
    smooth: Array
    finest: bool = False

    @classmethod
    def of_mask(cls, stencil: Stencil, mask: Array) -> "Cells":
        """Return those of A."""
        contact = stencil.place(mask, False)
        return cls(contact, np.broadcast_to(stencil.T[0, 0], contact.shape), contact, True)

    def changed_from(self, old: "Cells") -> Array:
        """Where the unknowns are not those of `old`."""
        changed = self.c != old.c
        if not self.finest:
            changed |= (self.d != old.d) | (self.smooth != old.smooth)
        return np.asarray(changed)


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
    smooth : ndarray of shape (any,)
        Their products with the vector `Cells.smooth`.
    place : ndarray of int
        Where the row of each cell in contact is.
    """

    rows: Array
    smooth: Array
    place: Array


@dataclass(frozen=True)
class Level:
    """Gᵀ (I - W Wᵀ + W E⁻¹ Wᵀ) G, with the next level for E⁻¹.

    Attributes
    ----------
    cells : Cells
    rows : Rows
    G, W : csr_array
        Their rows are the unknowns, in the order of the grid.
    coarse : Level or Direct
    """

    cells: Cells
    rows: Rows
    G: csr_array
    W: csr_array
    coarse: "Level | Direct"

    @property
    def sizes(self) -> tuple[int, ...]:
        """The number of unknowns on each level."""
        return (self.G.shape[0], *self.coarse.sizes)

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
