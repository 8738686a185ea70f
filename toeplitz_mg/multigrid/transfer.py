"""Restriction (paper, Eq. 13), interpolation (Eq. 14) and the coarse matrices that go with them."""

from collections.abc import Callable
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.operators import MaskedOperator, ToeplitzOperator
from toeplitz_mg.operators.masked import toeplitz_and_mask

Array = NDArray[Any]
Coarsening = Callable[[LinearOperator], LinearOperator]


def coarse_shape(grid_shape: tuple[int, ...]) -> tuple[int, ...]:
    """Halve every level of a grid; the last element of an odd one is left over."""
    return tuple(max(n // 2, 1) for n in grid_shape)


def coarse_mask(mask: Array) -> Array:
    """Return the coarse elements all of whose fine elements are in contact."""
    return np.asarray(_pairs(mask).all(axis=_pair_axes(mask.shape)))


def galerkin(A: LinearOperator) -> LinearOperator:
    """Return R A P, the Galerkin coarse matrix, which is again Toeplitz.

    Parameters
    ----------
    A : ToeplitzOperator or MaskedOperator of one

    Returns
    -------
    ToeplitzOperator or MaskedOperator
        On half the elements in each level. On a mask the coarse elements are those all of whose
        fine elements are in contact; the matrix is exactly R A P there too.

    Raises
    ------
    TypeError, ValueError
        Where `A` is no Toeplitz operator, or not symmetric; where no coarse element of a mask is
        in contact as a whole.

    Notes
    -----
    In each level a_H[k] = ½ (a[2k-1] + 2 a[2k] + a[2k+1]).

    Examples
    --------
    >>> from toeplitz_mg import ToeplitzOperator, galerkin
    >>> galerkin(ToeplitzOperator([4.0, 2.0, 1.0, 0.0])).toarray()
    array([[6., 2.],
           [2., 6.]])
    """
    full, mask = toeplitz_and_mask(A)
    lags = full.lags
    for level, n in enumerate(full.grid_shape):
        if n > 1:
            m = n // 2
            # The window of coarse lag k is 2k-1, 2k, 2k+1; the first is at k = -(m - 1).
            first = np.arange(2 * m - 1) * 2 + n - 2 * m
            left, centre, right = (np.take(lags, first + j, axis=level) for j in range(3))
            lags = centre + (left + right) / 2
    H = ToeplitzOperator.from_lags(lags)
    return H if mask is None else MaskedOperator(H, coarse_mask(mask))


def rediscretised(
    operator_of_grid_shape: Callable[[tuple[int, ...]], ToeplitzOperator],
) -> Coarsening:
    """Return a coarsening that discretises the problem anew on the coarse grid (the paper's).

    Parameters
    ----------
    operator_of_grid_shape : callable
        Maps a grid's shape to the Toeplitz operator of the same problem on that grid.

    Returns
    -------
    callable
        For the argument `coarsen` of `multigrid`.

    Raises
    ------
    TypeError
        Where the argument cannot be called.

    Examples
    --------
    >>> import toeplitz_mg as tmg
    >>> problem = tmg.contact.problems.test1(64)
    >>> coarsen = tmg.rediscretised(problem.operator_of_grid_shape)
    >>> coarsen(problem.A).grid_shape
    (32,)
    """
    if not callable(operator_of_grid_shape):
        raise TypeError(f"operator_of_grid_shape is {operator_of_grid_shape!r}, but must be called")

    def coarsen(A: LinearOperator) -> LinearOperator:
        full, mask = toeplitz_and_mask(A)
        H = operator_of_grid_shape(coarse_shape(full.grid_shape))
        return H if mask is None else MaskedOperator(H, coarse_mask(mask))

    return coarsen


@dataclass(frozen=True)
class Transfer:
    """Restriction and interpolation between a grid, or the unknowns of a mask, and the next.

    Attributes
    ----------
    fine_shape : tuple of int
    fine_mask, coarse_mask : ndarray of bool, or None where the whole grid is unknown
    leftover : ndarray of int
        The fine unknowns that belong to no coarse one: the last of an odd number, and the
        elements in contact beside one that is not.
    """

    fine_shape: tuple[int, ...]
    fine_mask: Array | None
    coarse_mask: Array | None
    leftover: Array

    @classmethod
    def of(cls, A: LinearOperator) -> "Transfer | None":
        """Return the transfer from `A` to its coarse matrix, or None where it has no unknowns."""
        full, mask = toeplitz_and_mask(A)
        whole = np.ones(full.grid_shape, dtype=bool) if mask is None else mask
        if full.shape[0] == 1 or not (coarse := coarse_mask(whole)).any():
            return None
        covered = _spread(coarse, full.grid_shape)
        leftover = np.flatnonzero(~covered[whole])
        return cls(full.grid_shape, mask, None if mask is None else coarse, leftover)

    def check_coarse(self, H: LinearOperator) -> None:
        """Raise ValueError or TypeError where `H` does not live on the coarse grid."""
        full, mask = toeplitz_and_mask(H)
        if full.grid_shape != (shape := coarse_shape(self.fine_shape)):
            raise ValueError(f"coarsen gave the grid {full.grid_shape}, but it must be {shape}")
        if mask is None or self.coarse_mask is None:
            same = mask is self.coarse_mask
        else:
            same = np.array_equal(mask, self.coarse_mask)
        if not same:
            raise ValueError(f"coarsen gave {H!r} with another mask than the coarse one")

    @property
    def elements_per_coarse(self) -> int:
        """The number s of fine elements in a coarse one: Pᵀ = s R."""
        return prod(min(n, 2) for n in self.fine_shape)

    def restrict(self, r: Array) -> Array:
        """Average each pair of rows' elements; in d levels each 2^d (Eq. 13)."""
        grid = _on_grid(r, self.fine_mask, self.fine_shape)
        rows = r.ndim - 1
        axes = tuple(rows + axis for axis in _pair_axes(self.fine_shape))
        coarse = _pairs(grid, rows).mean(axis=axes, dtype=r.dtype)
        if self.coarse_mask is not None:
            return np.asarray(coarse[..., self.coarse_mask])
        return np.asarray(coarse.reshape(*r.shape[:-1], prod(coarse_shape(self.fine_shape))))

    def interpolate(self, e: Array) -> Array:
        """Copy each coarse value to its fine elements, and zero to those left over (Eq. 14)."""
        grid = _on_grid(e, self.coarse_mask, coarse_shape(self.fine_shape))
        fine = _spread(grid, self.fine_shape)
        if self.fine_mask is not None:
            return np.asarray(fine[..., self.fine_mask])
        return fine.reshape(*e.shape[:-1], prod(self.fine_shape))


def _on_grid(x: Array, mask: Array | None, shape: tuple[int, ...]) -> Array:
    if mask is None:
        return x.reshape(x.shape[:-1] + shape)
    grid = np.zeros(x.shape[:-1] + shape, dtype=x.dtype)
    grid[..., mask] = x
    return grid


def _pairs(grid: Array, rows: int = 0) -> Array:
    """Split each level of the grid of each row into (pair, element of the pair)."""
    shape = grid.shape[rows:]
    cut: Any = (..., *(slice(n - n % 2 if n > 1 else 1) for n in shape))
    split = [k for n in shape for k in (max(n // 2, 1), min(n, 2))]
    return np.asarray(grid[cut]).reshape(*grid.shape[:rows], *split)


def _pair_axes(shape: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(range(1, 2 * len(shape), 2))


def _spread(coarse: Array, shape: tuple[int, ...]) -> Array:
    """Copy the coarse grid of each row to the fine grid of `shape`; zero where none covers."""
    rows = coarse.ndim - len(shape)
    for level, n in enumerate(shape):
        if n > 1:
            coarse = np.repeat(coarse, 2, axis=rows + level)
    if coarse.shape[rows:] == shape:
        return coarse
    fine = np.zeros(coarse.shape[:rows] + shape, dtype=coarse.dtype)
    covered: Any = (..., *(slice(n) for n in coarse.shape[rows:]))
    fine[covered] = coarse
    return fine
