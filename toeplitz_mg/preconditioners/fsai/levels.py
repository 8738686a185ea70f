"""The levels of a multilevel sparse approximate inverse on a mask, and their application."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import cho_factor
from scipy.linalg.lapack import dpotrs, spotrs
from scipy.sparse import csc_array, csr_array

from toeplitz_mg._typing import Array
from toeplitz_mg.preconditioners.fsai.refusals import refusal, require_definite
from toeplitz_mg.preconditioners.fsai.stencil import NEIGHBOURS, Stencil


@dataclass(frozen=True)
class LevelMatrix:
    """The matrix c_i K(i-j) c_j with the diagonal d, on the places of a `Stencil`.

    Attributes
    ----------
    c : ndarray
        The weight of each unknown, on a coarse level its load, which is 1 for an aggregate that is
        all active; 0 where there is no unknown.
    d : ndarray
        The diagonal; 1 where there is no unknown.
    by_table : bool
        Whether it is A itself, so that c is true or false and the rows of G are those of the table
        of patterns.
    """

    c: Array
    d: Array
    by_table: bool = False

    @classmethod
    def of_mask(cls, stencil: Stencil, mask: Array) -> "LevelMatrix":
        """Return the matrix of a mask, of shape (n1, n2), or (2, n1, n2) for two components."""
        grids = mask.reshape(len(stencil.kernel), -1, stencil.grid.shape[1])
        active = np.concatenate([stencil.grid.place(grid, False) for grid in grids])
        matrix = cls(active, stencil.on_places(stencil.zero), True)
        # More neighbours have too many patterns for a table.
        return matrix if stencil.neighbours <= NEIGHBOURS else matrix.without_table()

    def without_table(self) -> "LevelMatrix":
        """Return the same matrix, whose rows of G are computed one by one."""
        return LevelMatrix(self.c.astype(np.float64), np.where(self.active, self.d, 1.0))

    @cached_property
    def active(self) -> Array:
        """Where there are unknowns."""
        return self.c.astype(bool, copy=False)

    @property
    def count(self) -> int:
        """The number of unknowns."""
        return int(np.count_nonzero(self.active))

    @property
    def number(self) -> Array:
        """The number of the unknown in each place, in the order of their places."""
        return number_places(np.flatnonzero(self.active), len(self.c))


def number_places(at: Array, size: int) -> Array:
    """Return for each of so many places its number among these, 0 where it is none of them."""
    number = np.zeros(size, np.int32)
    number[at] = np.arange(len(at), dtype=np.int32)
    return number


@dataclass(frozen=True)
class Direct:
    """The last level, by Cholesky's factorisation.

    Attributes
    ----------
    factor : ndarray of shape (N, N)
        The upper factor in Fortran's order: another LAPACK would copy in each application.
    """

    factor: Array

    @classmethod
    def of(cls, matrix: Array, dtype: np.dtype[Any], grid_shape: tuple[int, ...]) -> "Direct":
        """Factorise a matrix, to be applied in this precision; `grid_shape` is for errors."""
        try:
            factor, _ = cho_factor(matrix)
        except np.linalg.LinAlgError:
            smallest = float(np.linalg.eigvalsh(matrix)[0])
            raise refusal("an eigenvalue of the coarsest matrix is", smallest, grid_shape) from None
        exact = cls(np.asfortranarray(factor))
        require_definite(matrix, exact, dtype)
        return cls(exact.factor.astype(dtype, copy=False))

    @property
    def sizes(self) -> tuple[int, ...]:
        """The number of unknowns."""
        return (len(self.factor),)

    @property
    def multiplications(self) -> int:
        """The number of multiplications in one application."""
        return self.factor.size

    def __call__(self, x: Array) -> Array:
        """Apply the inverse to a vector, or to the columns of x."""
        solve = spotrs if self.factor.dtype == np.float32 else dpotrs
        return solve(self.factor, x)[0]

    def multiply(self, X: Array, out: Array) -> None:
        """Apply the inverse to the rows of `X`."""
        out[...] = self(X.T).T


@dataclass(frozen=True)
class Level:
    """Gᵀ (I - W Wᵀ + W E⁻¹ Wᵀ) G, with the next level for E⁻¹.

    Attributes
    ----------
    G : csr_array
        The local factor. Its rows and columns are the unknowns in the order of their places.
    W : csr_array
        The tentative prolongator.
    coarse : Level or Direct, or what is alike
    """

    G: csr_array
    W: csr_array
    coarse: Any

    @property
    def sizes(self) -> tuple[int, ...]:
        """The number of unknowns on each level."""
        return (self.G.shape[0], *self.coarse.sizes)

    @property
    def multiplications(self) -> int:
        """The number of multiplications in one application."""
        return 2 * int(self.G.nnz + self.W.nnz) + self.coarse.multiplications

    @cached_property
    def transposed(self) -> tuple[csc_array, csc_array]:
        """Gᵀ and Wᵀ, views that would take their time if made in each application."""
        return self.G.T, self.W.T

    def __call__(self, x: Array) -> Array:
        """Apply the inverse to a vector, or to the columns of x."""
        y = self.G @ x
        a = self.transposed[1] @ y
        y += self.W @ (self.coarse(a) - a)
        return self.transposed[0] @ y

    def multiply(self, X: Array, out: Array) -> None:
        """Apply the inverse to the rows of `X`."""
        out[...] = self(X.T).T
