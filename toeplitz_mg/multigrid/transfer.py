"""Restriction (paper, Eq. 13), interpolation (Eq. 14) and the coarse matrices that go with them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.operators import MaskedOperator, ToeplitzOperator
from toeplitz_mg.operators.masked import toeplitz_and_mask
from toeplitz_mg.operators.workspace import workspace

Array = NDArray[Any]
Coarsening = Callable[[LinearOperator], LinearOperator]

WEAK = 0.5  # coupling of neighbours in a level, relative to the strongest, that is not coarsened


@dataclass(frozen=True)
class Interpolation:
    """How a value of the coarse grid is spread over the fine one, in each level of the matrix.

    Parameters
    ----------
    weights : tuple of float
        Of a coarse value in the fine elements that it covers; the next one begins 2 elements
        further on. The restriction is the transpose, halved.
    coarser : Interpolation, optional
        For the coarser grids, if another.

    See Also
    --------
    piecewise_constant, linear_interpolation, modulated_interpolation

    Examples
    --------
    >>> from toeplitz_mg import Interpolation
    >>> Interpolation((0.5, 1.0, 0.5)).coarse_length(7)
    3
    """

    weights: tuple[float, ...]
    coarser: "Interpolation | None" = None

    def __post_init__(self) -> None:
        if len(self.weights) < 2 or not np.isfinite(self.weights).all():
            raise ValueError(f"weights are {self.weights}, but must be 2 finite numbers or more")

    def coarse_length(self, n: int) -> int:
        """Return the coarse elements of n fine ones; too few are left as they are."""
        covered = len(self.weights)
        return n if n < covered else (n - covered) // 2 + 1

    def slices(self, n: int) -> Iterator[tuple[float, slice]]:
        """Yield each weight, and the fine elements where it stands."""
        m = self.coarse_length(n)
        for i, weight in enumerate(self.weights):
            yield weight, slice(i, i + 2 * m - 1, 2)


piecewise_constant = Interpolation((1.0, 1.0))
"""Copies (paper, Eq. 14), and averages (Eq. 13): for a positive symbol."""

linear_interpolation = Interpolation((0.5, 1.0, 0.5))
"""For a symbol with a zero of order 2 at θ = 0, such as 2 - 2 cos θ."""

modulated_interpolation = Interpolation((-0.5, 1.0, -0.5), linear_interpolation)
"""For a symbol with a zero of order 2 at θ = π, such as 2 + 2 cos θ.

The coarser grids, where the zero is at θ = 0, have linear interpolation.
"""


Directions = tuple[Interpolation | None, ...]


def directions(A: ToeplitzOperator, transfer: Interpolation = piecewise_constant) -> Directions:
    """Return the interpolation of each level of `A`, or None where that is not coarsened.

    Those are coarsened in which neighbours are coupled most. Where the elements are stretched,
    the smoother leaves errors that vary along the long side from element to element, which a
    grid that is coarser in that direction cannot represent.
    """
    strengths = [0.0] * len(A.grid_shape)
    for level, n in enumerate(A.grid_shape):
        if transfer.coarse_length(n) < n:
            neighbour = tuple(int(k == level) for k in range(len(strengths)))
            strengths[level] = abs(float(A.c[neighbour]))
    least = max(WEAK * max(strengths), np.finfo(np.float64).tiny)
    return tuple(transfer if strength >= least else None for strength in strengths)


def _coarse_shape(grid_shape: tuple[int, ...], by: Directions) -> tuple[int, ...]:
    """Halve some levels of a grid; elements at its end may be left over."""
    return tuple(t.coarse_length(n) if t else n for n, t in zip(grid_shape, by, strict=True))


def _coarse_mask(mask: Array, by: Directions) -> Array:
    """Return the coarse elements all of whose fine elements are in contact."""
    for level, (n, t) in enumerate(zip(mask.shape, by, strict=True)):
        if t:
            mask = np.all([mask[_at(level, s)] for _, s in t.slices(n)], axis=0)
    return mask


def galerkin(A: LinearOperator, transfer: Interpolation = piecewise_constant) -> LinearOperator:
    """Return R A P, the Galerkin coarse matrix, which is again Toeplitz.

    Parameters
    ----------
    A : ToeplitzOperator or MaskedOperator of one
    transfer : Interpolation

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
    In each level a_H[k] = ½ (a[2k-1] + 2 a[2k] + a[2k+1]), or, where the weights are w, the mean
    of the a[2k+j] with half of w convolved with itself.

    Examples
    --------
    >>> from toeplitz_mg import ToeplitzOperator, galerkin
    >>> galerkin(ToeplitzOperator([4.0, 2.0, 1.0, 0.0])).toarray()
    array([[6., 2.],
           [2., 6.]])
    """
    full, mask = toeplitz_and_mask(A)
    lags = full.lags
    reach = len(transfer.weights) - 1
    weights = (np.convolve(transfer.weights, transfer.weights[::-1]) / 2.0).tolist()
    by = directions(full, transfer)
    for level, (n, m) in enumerate(
        zip(full.grid_shape, _coarse_shape(full.grid_shape, by), strict=True)
    ):
        if m < n:
            # Lag k takes from 2k - reach ... 2k + reach; the first is at k = -(m - 1).
            first = n - 1 - 2 * (m - 1)
            windows = [
                lags[_at(level, slice(first + j, first + j + 4 * m - 3, 2))]
                for j in range(-reach, reach + 1)
            ]
            lags = weights[reach] * windows[reach]
            for j in range(reach):  # in pairs, symmetric to the last bit
                lags = lags + weights[j] * (windows[j] + windows[-1 - j])
    H = ToeplitzOperator.from_lags(lags)
    return H if mask is None else MaskedOperator(H, _coarse_mask(mask, by))


def rediscretised(
    operator_of_grid_shape: Callable[[tuple[int, ...]], ToeplitzOperator],
    transfer: Interpolation = piecewise_constant,
) -> Coarsening:
    """Return a coarsening that discretises the problem anew on the coarse grid (the paper's).

    Parameters
    ----------
    operator_of_grid_shape : callable
        Maps a grid's shape to the Toeplitz operator of the same problem on that grid.
    transfer : Interpolation
        Which decides about the shape.

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
        by = directions(full, transfer)
        H = operator_of_grid_shape(_coarse_shape(full.grid_shape, by))
        return H if mask is None else MaskedOperator(H, _coarse_mask(mask, by))

    return coarsen


@dataclass(frozen=True)
class Transfer:
    """Restriction and interpolation between a grid, or the unknowns of a mask, and the next.

    Attributes
    ----------
    interpolation : Interpolation
    by : tuple of Interpolation or None
        That of each level, None where it is not coarsened.
    fine_shape : tuple of int
    fine_mask, coarse_mask : ndarray of bool, or None where the whole grid is unknown
    leftover : ndarray of int
        The fine unknowns that belong to no coarse one: at the end of the grid, and the elements
        in contact beside one that is not.
    """

    interpolation: Interpolation
    by: Directions
    fine_shape: tuple[int, ...]
    fine_mask: Array | None
    coarse_mask: Array | None
    leftover: Array

    @classmethod
    def of(
        cls, A: LinearOperator, interpolation: Interpolation = piecewise_constant
    ) -> "Transfer | None":
        """Return the transfer from `A` to its coarse matrix, or None where it has no unknowns."""
        full, mask = toeplitz_and_mask(A)
        whole = np.ones(full.grid_shape, dtype=bool) if mask is None else mask
        by = directions(full, interpolation)
        coarse = _coarse_mask(whole, by)
        if coarse.shape == full.grid_shape or not coarse.any():
            return None
        ones = Interpolation((1.0,) * len(interpolation.weights))
        covered = np.empty(full.grid_shape)
        _spread(coarse.astype(float), covered, tuple(ones if t else None for t in by))
        leftover = np.flatnonzero(covered[whole] == 0.0)
        of_mask = None if mask is None else coarse
        return cls(interpolation, by, full.grid_shape, mask, of_mask, leftover)

    @property
    def coarse_shape(self) -> tuple[int, ...]:
        """The shape of the coarse grid."""
        return _coarse_shape(self.fine_shape, self.by)

    def check_coarse(self, H: LinearOperator) -> None:
        """Raise ValueError or TypeError where `H` does not live on the coarse grid."""
        full, mask = toeplitz_and_mask(H)
        if full.grid_shape != (shape := self.coarse_shape):
            raise ValueError(f"coarsen gave the grid {full.grid_shape}, but it must be {shape}")
        if mask is None or self.coarse_mask is None:
            same = mask is self.coarse_mask
        else:
            same = np.array_equal(mask, self.coarse_mask)
        if not same:
            raise ValueError(f"coarsen gave {H!r} with another mask than the coarse one")

    @property
    def scale(self) -> int:
        """The number s for which Pᵀ = s R: 2 for each level that is coarsened."""
        pairs = zip(self.fine_shape, self.coarse_shape, strict=True)
        return int(2 ** sum(m < n for n, m in pairs))

    @property
    def border(self) -> tuple[Array, Array]:
        """Unknowns, shape (p, q), and weights (q,) of p vectors that enlarge the coarse space.

        At the end of a grid it is one, what there is room for of the next coarse element;
        elsewhere they are the unit vectors of the unknowns left over.
        """
        weights = np.array(self.interpolation.weights)
        if len(self.leftover) and len(self.fine_shape) == 1 and self.fine_mask is None:
            last = np.arange(2 * self.coarse_shape[0], self.fine_shape[0])
            return last[np.newaxis], weights[: len(last)]
        return self.leftover[:, np.newaxis], np.ones(1)

    def restrict(self, r: Array, purpose: str) -> Array:
        """Average over the fine elements of each coarse one; in d levels each 2^d (Eq. 13).

        The result is in the `workspace` of that purpose.
        """
        grid = _on_grid(r, self.fine_mask, self.fine_shape)
        rows = r.ndim - 1
        for level, (n, m) in enumerate(zip(self.fine_shape, self.coarse_shape, strict=True)):
            if m < n:
                shape = (*grid.shape[: rows + level], m, *grid.shape[rows + level + 1 :])
                coarse = workspace(f"{purpose}, {level}", shape, grid.dtype)
                part = workspace("part", shape, grid.dtype)
                for k, (weight, s) in enumerate(self.interpolation.slices(n)):
                    to = part if k else coarse
                    np.multiply(grid[_at(rows + level, s)], grid.dtype.type(weight / 2), out=to)
                    if k:
                        coarse += part
                grid = coarse
        if self.coarse_mask is not None:
            return np.asarray(grid[..., self.coarse_mask])
        return grid.reshape(*r.shape[:-1], prod(self.coarse_shape))

    def interpolate(self, e: Array, out: Array) -> None:
        """Copy each coarse value to its fine elements, and zero to those left over (Eq. 14)."""
        grid = _on_grid(e, self.coarse_mask, self.coarse_shape)
        if self.fine_mask is not None:
            fine = workspace("fine grid", (*e.shape[:-1], *self.fine_shape), e.dtype)
            _spread(grid, fine, self.by)
            out[...] = fine[..., self.fine_mask]
        else:
            _spread(grid, out.reshape(*e.shape[:-1], *self.fine_shape), self.by)


def _at(axis: int, part: slice) -> tuple[slice, ...]:
    return (slice(None),) * axis + (part,)


def _on_grid(x: Array, mask: Array | None, shape: tuple[int, ...]) -> Array:
    if mask is None:
        return x.reshape(x.shape[:-1] + shape)
    grid = workspace("on grid", x.shape[:-1] + shape, x.dtype)
    grid[...] = 0.0
    grid[..., mask] = x
    return grid


def _spread(coarse: Array, fine: Array, by: Directions) -> None:
    """Interpolate the coarse grid of each row to the fine grid, a level after the other."""
    rows = coarse.ndim - len(by)
    for axis, interpolation in enumerate(by, start=rows):
        if interpolation is None:
            continue
        last = all(coarse.shape[k] == fine.shape[k] for k in range(axis + 1, coarse.ndim))
        shape = (*fine.shape[: axis + 1], *coarse.shape[axis + 1 :])
        to = fine if last else np.empty(shape, coarse.dtype)
        part = workspace("part", coarse.shape, coarse.dtype)
        to[...] = 0.0
        for weight, s in interpolation.slices(fine.shape[axis]):
            np.multiply(coarse, coarse.dtype.type(weight), out=part)
            to[_at(axis, s)] += part
        coarse = to
    if coarse is not fine:
        fine[...] = coarse
