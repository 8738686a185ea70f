"""Transfer between a grid and the next coarser one: restriction, interpolation, coarse matrices."""

from collections.abc import Callable
from dataclasses import dataclass
from math import prod

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array, Coarsening
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.multigrid_cycle.interpolation import (
    AreaWeighted,
    Interpolation,
    along,
    at,
    piecewise_constant,
)
from toeplitz_mg.operators import MaskedOperator, ToeplitzOperator
from toeplitz_mg.operators.lifting import unwrap_toeplitz

# An axis is not coarsened if the coupling of neighbours along it, relative to the strongest axis,
# is below this: the smoother leaves errors that vary along it from element to element.
WEAK_COUPLING = 0.5

# The interpolation along each axis; None if it is not coarsened.
ByAxis = tuple[Interpolation | AreaWeighted | None, ...]


@dataclass(frozen=True)
class Transfer:
    """Restriction and interpolation between a grid, or a mask, and the next coarser one.

    Attributes
    ----------
    interpolation : Interpolation
    by_axis : tuple of Interpolation or None
        The interpolation along each axis; None if it is not coarsened.
    fine_shape : tuple of int
    fine_mask, coarse_mask : ndarray of bool, or None if the whole grid is unknown
    leftover : ndarray of int
        The fine unknowns that belong to no coarse one: at the end of a grid of one axis, or in a
        coarse element that is not active.
    """

    interpolation: Interpolation
    by_axis: ByAxis
    fine_shape: tuple[int, ...]
    fine_mask: Array | None
    coarse_mask: Array | None
    leftover: Array

    @classmethod
    def of(cls, A: LinearOperator, interpolation: Interpolation = piecewise_constant) -> "Transfer":
        """Choose the coarse grid of `A`; it may have no unknowns (see `has_coarse_grid`)."""
        full, mask = unwrap_toeplitz(A)
        by_axis = _by_axis(full, interpolation)
        active = np.ones(full.grid_shape, dtype=bool) if mask is None else mask
        coarse = active
        for axis, t in enumerate(by_axis):
            if t:
                coarse = t.coarse_mask(coarse, axis)
        covered = coarse
        for axis, (n, t) in enumerate(zip(full.grid_shape, by_axis, strict=True)):
            if t:
                fine = np.zeros((*covered.shape[:axis], n, *covered.shape[axis + 1 :]), bool)
                for _, to, of in t.pieces(n):
                    fine[at(axis, to)] |= covered[at(axis, of)]
                covered = fine
        leftover = np.flatnonzero(~covered[active])
        coarse_mask = None if mask is None else coarse
        return cls(interpolation, by_axis, full.grid_shape, mask, coarse_mask, leftover)

    @property
    def coarse_shape(self) -> tuple[int, ...]:
        """The shape of the coarse grid."""
        pairs = zip(self.fine_shape, self.by_axis, strict=True)
        return tuple(t.coarse_length(n) if t else n for n, t in pairs)

    @property
    def has_coarse_grid(self) -> bool:
        """Whether the coarse grid has unknowns and is coarser than the fine one."""
        is_empty = self.coarse_mask is not None and not self.coarse_mask.any()
        return self.coarse_shape != self.fine_shape and not is_empty

    def coarse_matrix(self, A: LinearOperator) -> LinearOperator:
        """Return R A P on the coarse grid, or a Toeplitz matrix near it (see `galerkin`)."""
        lags = unwrap_toeplitz(A)[0].lags
        for axis, t in enumerate(self.by_axis):
            if t:
                lags = t.coarse_lags(lags, axis)
        return self.on_coarse_mask(ToeplitzOperator.from_lags(lags))

    def on_coarse_mask(self, H: ToeplitzOperator) -> LinearOperator:
        """Restrict a matrix of the whole coarse grid to the unknowns of that grid."""
        return H if self.coarse_mask is None else MaskedOperator(H, self.coarse_mask)

    def check_coarse_matrix(self, H: LinearOperator) -> LinearOperator:
        """Return a coarse matrix given by the user, if it fits the coarse grid."""
        full, mask = unwrap_toeplitz(H)
        if full.grid_shape != (shape := self.coarse_shape):
            raise ValueError(f"coarsen gave the grid {full.grid_shape}, but it must be {shape}")
        if mask is None or self.coarse_mask is None:
            same = mask is self.coarse_mask
        else:
            same = np.array_equal(mask, self.coarse_mask)
        if not same:
            raise ValueError(f"coarsen gave {H!r}, but its mask must be that of the coarse grid")
        return H

    @property
    def scale(self) -> float:
        """The number s with Pᵀ = s R, the product over the axes."""
        return prod(t.ratio(n) for n, t in zip(self.fine_shape, self.by_axis, strict=True) if t)

    @property
    def border_vectors(self) -> tuple[Array, Array]:
        """Unknowns (p, q) and weights (q,) of p vectors that enlarge the coarse space.

        At the end of a line it is one vector, the part of the next coarse element that fits;
        otherwise they are the unit vectors of the leftover unknowns.
        """
        if len(self.leftover) and len(self.fine_shape) == 1 and self.fine_mask is None:
            last = np.arange(2 * self.coarse_shape[0], self.fine_shape[0])
            return last[np.newaxis], np.array(self.interpolation.weights[: len(last)])
        return self.leftover[:, np.newaxis], np.ones(1)

    def restrict(self, r: Array) -> Array:
        """Average over the fine elements of each coarse one, axis by axis (Eq. 13).

        The result is a `workspace`: copy it to keep it.
        """
        grid = _on_grid(r, self.fine_mask, self.fine_shape)
        rows = r.ndim - 1
        for axis, (n, t) in enumerate(zip(self.fine_shape, self.by_axis, strict=True), start=rows):
            if t is None:
                continue
            m = t.coarse_length(n)
            shape = (*grid.shape[:axis], m, *grid.shape[axis + 1 :])
            coarse = workspace(shape, grid.dtype)
            for k, (weight, fine, to) in enumerate(t.pieces(n)):
                target, values = coarse[at(axis, to)], grid[at(axis, fine)]
                scaled = along((weight / t.ratio(n)).astype(grid.dtype), axis, grid.ndim)
                if k:
                    _add_product(target, values, scaled)
                else:  # The first piece has all coarse elements.
                    np.multiply(values, scaled, out=target)
            grid = coarse
        if self.coarse_mask is not None:
            return grid[..., self.coarse_mask]
        return grid.reshape(*r.shape[:-1], prod(self.coarse_shape))

    def interpolate(self, e: Array, out: Array) -> None:
        """Copy each coarse value to its fine elements, and zero to the leftover ones (Eq. 14)."""
        grid = _on_grid(e, self.coarse_mask, self.coarse_shape)
        if self.fine_mask is not None:
            fine = workspace((*e.shape[:-1], *self.fine_shape), e.dtype)
            _spread(grid, fine, self.by_axis)
            out[...] = fine[..., self.fine_mask]
        else:
            _spread(grid, out.reshape(*e.shape[:-1], *self.fine_shape), self.by_axis)


def _on_grid(x: Array, mask: Array | None, shape: tuple[int, ...]) -> Array:
    if mask is None:
        return x.reshape(x.shape[:-1] + shape)
    grid = workspace(x.shape[:-1] + shape, x.dtype)
    grid[...] = 0.0
    grid[..., mask] = x
    return grid


def _add_product(target: Array, values: Array, weights: Array) -> None:
    target += np.multiply(values, weights, out=workspace(values.shape, values.dtype))


def _spread(coarse: Array, fine: Array, by_axis: ByAxis) -> None:
    """Interpolate the coarse grid of each row to the fine grid, axis by axis."""
    rows = coarse.ndim - len(by_axis)
    for axis, t in enumerate(by_axis, start=rows):
        if t is None:
            continue
        last = all(coarse.shape[k] == fine.shape[k] for k in range(axis + 1, coarse.ndim))
        shape = (*fine.shape[: axis + 1], *coarse.shape[axis + 1 :])
        to = fine if last else workspace(shape, coarse.dtype)
        to[...] = 0.0
        for weight, at_fine, of in t.pieces(fine.shape[axis]):
            scaled = along(weight.astype(coarse.dtype), axis, coarse.ndim)
            _add_product(to[at(axis, at_fine)], coarse[at(axis, of)], scaled)
        coarse = to
    if coarse is not fine:
        fine[...] = coarse


def _by_axis(A: ToeplitzOperator, interpolation: Interpolation) -> ByAxis:
    """Return the interpolation along each axis of `A`; None for an axis that is not coarsened.

    The axes with the strongest coupling of neighbours are coarsened. On stretched elements the
    smoother leaves errors that vary along the long side from element to element, which a coarser
    grid in that direction cannot represent.

    Copies to an odd number of elements are `AreaWeighted`, except on one axis: there R A P is
    Toeplitz for the elements with a partner, and the last one is cheap as a `Border`.
    """
    strengths = [0.0] * len(A.grid_shape)
    for axis, n in enumerate(A.grid_shape):
        if interpolation.coarse_length(n) < n:
            neighbour = tuple(int(k == axis) for k in range(len(strengths)))
            strengths[axis] = abs(float(A.c[neighbour]))
    least = max(WEAK_COUPLING * max(strengths), np.finfo(np.float64).tiny)
    several = sum(n > 1 for n in A.grid_shape) > 1
    odd = AreaWeighted() if several and interpolation == piecewise_constant else interpolation
    return tuple(
        (odd if n % 2 else interpolation) if strength >= least else None
        for n, strength in zip(A.grid_shape, strengths, strict=True)
    )


def galerkin(
    A: LinearOperator, interpolation: Interpolation = piecewise_constant
) -> LinearOperator:
    """Return the Galerkin coarse matrix R A P, or a Toeplitz matrix close to it.

    Parameters
    ----------
    A : ToeplitzOperator or MaskedOperator of one
    interpolation : Interpolation

    Returns
    -------
    ToeplitzOperator or MaskedOperator
        The matrix on half the elements along each axis; on a mask, on the coarse elements whose
        fine elements are all active. It is exactly R A P, except for piecewise constant
        interpolation to an odd number n of elements on several axes: there are then (n + 1)/2
        coarse elements, each slightly shorter than two fine ones, R A P is not Toeplitz, and a
        Toeplitz matrix close to it is returned.

    Raises
    ------
    TypeError, ValueError
        If `A` is not a Toeplitz operator, or not symmetric, or if no coarse element of a mask has
        active fine elements only.

    See Also
    --------
    rediscretised : the paper's coarse matrices.
    multigrid : takes it as ``coarsen=``.

    Notes
    -----
    Along each axis a_H[k] = ½ (a[2k-1] + 2 a[2k] + a[2k+1]). With other weights w it is the mean of
    the a[2k+j], weighted by half of w convolved with itself. For copies to an odd n on several
    axes, with m = (n + 1)/2, it is the mean of the a[j] weighted by a hat about k n/m, n/m wide on
    each side; for even n the hat is the same with n/m = 2.

    Examples
    --------
    >>> from toeplitz_mg import ToeplitzOperator, galerkin
    >>> galerkin(ToeplitzOperator([4.0, 2.0, 1.0, 0.0])).toarray()
    array([[6., 2.],
           [2., 6.]])
    """
    return Transfer.of(A, interpolation).coarse_matrix(A)


def rediscretised(
    operator_of_grid_shape: Callable[[tuple[int, ...]], ToeplitzOperator],
    interpolation: Interpolation = piecewise_constant,
) -> Coarsening:
    """Return a coarsening that discretises the problem on each coarse grid, as in the paper.

    Parameters
    ----------
    operator_of_grid_shape : callable
        Maps a grid's shape to the Toeplitz operator of the same problem on that grid.
    interpolation : Interpolation
        The interpolation of the cycle, which determines the shape of the coarse grid.

    Returns
    -------
    callable
        For the argument `coarsen` of `multigrid`.

    Raises
    ------
    TypeError
        If `operator_of_grid_shape` is not callable.

    See Also
    --------
    galerkin : the default.
    multigrid : takes it as ``coarsen=``.

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
        transfer = Transfer.of(A, interpolation)
        return transfer.on_coarse_mask(operator_of_grid_shape(transfer.coarse_shape))

    return coarsen
