"""Interpolation from a coarse grid to the fine one, along one axis."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.values import refuse_masked

# The weights (one for all elements, or one for each), the fine elements that they belong to, and
# the coarse elements that they multiply. The first piece has all coarse elements.
Piece = tuple[Array, slice, slice]


@dataclass(frozen=True)
class Interpolation:
    """Interpolation from the coarse grid to the fine one, along each axis.

    Parameters
    ----------
    weights : tuple of float
        Weights of a coarse value in the fine elements that it covers; the next coarse value starts
        2 elements further. The restriction is half the transpose.
    coarser : Interpolation, optional
        The interpolation on the coarser grids, if it differs.

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
        numbers = refuse_masked("weights", self.weights)
        if numbers.ndim != 1 or numbers.dtype.kind not in "buif":
            raise TypeError(f"weights are {self.weights!r}, but must be real numbers")
        if not (self.coarser is None or isinstance(self.coarser, Interpolation)):
            raise TypeError(f"coarser is {self.coarser!r}, but must be an Interpolation")
        if len(self.weights) < 2 or not np.isfinite(self.weights).all():
            raise ValueError(f"weights are {self.weights}, but must be 2 finite numbers or more")

    def coarse_length(self, n: int) -> int:
        """Return the number of coarse elements for n fine ones; n if there are too few."""
        covered = len(self.weights)
        return n if n < covered else (n - covered) // 2 + 1

    def ratio(self, n: int) -> float:
        """Return the number s with Pᵀ = s R."""
        return 2.0

    def pieces(self, n: int) -> Iterator[Piece]:
        """Yield weights, with the fine and the coarse elements that they connect."""
        m = self.coarse_length(n)
        for i, weight in enumerate(self.weights):
            yield np.array(weight), slice(i, i + 2 * m - 1, 2), slice(0, m)

    def coarse_mask(self, mask: Array, axis: int) -> Array:
        """Return the coarse elements whose fine elements are all active."""
        n = refuse_masked("mask", mask).shape[axis]
        parts = np.array([mask[at(axis, fine)] for _, fine, _ in self.pieces(n)])
        return np.all(parts, axis=0)

    def coarse_lags(self, lags: Array, axis: int) -> Array:
        """Return the lags of R A P."""
        n = (refuse_masked("lags", lags).shape[axis] + 1) // 2
        m = self.coarse_length(n)
        reach = len(self.weights) - 1
        weights = (np.convolve(self.weights, self.weights[::-1]) / 2.0).tolist()
        # Coarse lag k uses the fine lags 2k - reach … 2k + reach; the first is k = -(m - 1).
        first = n - 1 - 2 * (m - 1)
        windows = [
            lags[at(axis, slice(first + j, first + j + 4 * m - 3, 2))]
            for j in range(-reach, reach + 1)
        ]
        coarse = weights[reach] * windows[reach]
        for j in range(reach):  # Add in pairs, so that the result is exactly symmetric.
            coarse = coarse + weights[j] * (windows[j] + windows[-1 - j])
        return coarse


piecewise_constant = Interpolation((1.0, 1.0))
"""Copies (paper, Eq. 14) and averages (Eq. 13), for a positive symbol.

On several axes of odd length they are weighted by area.
"""

linear_interpolation = Interpolation((0.5, 1.0, 0.5))
"""Linear interpolation, for a symbol with a zero of order 2 at θ = 0, such as 2 - 2 cos θ."""

modulated_interpolation = Interpolation((-0.5, 1.0, -0.5), linear_interpolation)
"""Weights of alternating sign, for a symbol with a zero of order 2 at θ = π, such as 2 + 2 cos θ.

On the coarser grids the zero is at θ = 0, and the interpolation is linear.
"""


@dataclass(frozen=True)
class AreaWeighted:
    """Copies from m = (n + 1)/2 equal coarse elements to an odd number n of equal fine ones.

    A coarse element is n/m fine ones long, so that no fine one is left over:

        |  0  |  1  |  2  |  3  |  4  |
        |    0    |    1    |    2    |

    Fine element 2j lies in coarse element j. The part (j + 1)/m of 2j + 1 lies in j + 1, the rest
    in j; its value is the mean of both, weighted by these parts. Restriction averages over the fine
    elements with the same parts.
    """

    def coarse_length(self, n: int) -> int:
        """Return the number of coarse elements for n fine ones."""
        return (n + 1) // 2

    def ratio(self, n: int) -> float:
        """Return the number s with Pᵀ = s R: the length of a coarse element in fine ones."""
        return n / self.coarse_length(n)

    def pieces(self, n: int) -> Iterator[Piece]:
        """Yield weights, with the fine and the coarse elements that they connect."""
        m = self.coarse_length(n)
        part = np.arange(1, m) / m
        yield np.array(1.0), slice(0, n, 2), slice(0, m)
        yield 1.0 - part, slice(1, n, 2), slice(0, m - 1)
        yield part, slice(1, n, 2), slice(1, m)

    def coarse_mask(self, mask: Array, axis: int) -> Array:
        """Return the coarse elements whose fine elements with a weight above 0.5 are all active."""
        coarse = mask[at(axis, slice(0, None, 2))].copy()
        for weight, fine, to in self.pieces(mask.shape[axis]):
            coarse[at(axis, to)] &= mask[at(axis, fine)] | along(weight <= 0.5, axis, mask.ndim)
        return coarse

    def coarse_lags(self, lags: Array, axis: int) -> Array:
        """Return n/m times the mean of the fine lags by a hat about each k n/m, of half width n/m.

        For equal elements of even number this is R A P, but here R A P is not Toeplitz. Let P_x
        copy to the fine element i from the coarse element that contains the point i + x; P is the
        mean of P_x over 0 < x < 1. The mean of R_x A P_x is Toeplitz, and given by these hats
        before they are scaled to a constant sum. It is positive definite and not below R A P, so a
        correction does not overshoot. The scaling, by at most 1/(2 n), keeps a smooth kernel smooth
        along the axis, as the preconditioners of the coarse matrix require.
        """
        n = (lags.shape[axis] + 1) // 2
        m = self.coarse_length(n)
        k = np.arange(1 - m, m)
        # With this order the sum is exactly symmetric.
        j = 2 * abs(k) + np.array([[-2], [-1], [1], [0]])
        hats = np.maximum(1.0 - abs(j * m / n - abs(k)), 0.0)
        hats *= n / m / hats.sum(axis=0)
        # Lag n, which A does not have, has the weight zero in the last hat.
        near = n - 1 + np.where(k < 0, -1, 1) * np.minimum(j, n - 1)
        coarse = np.zeros_like(lags, shape=(*lags.shape[:axis], len(k), *lags.shape[axis + 1 :]))
        for weights, of in zip(hats.astype(lags.dtype), near, strict=True):
            coarse += along(weights, axis, lags.ndim) * np.take(lags, of, axis)
        return coarse


def at(axis: int, part: slice) -> tuple[slice, ...]:
    """Return the index of a part of an axis."""
    return (slice(None),) * axis + (part,)


def along(x: Array, axis: int, ndim: int) -> Array:
    """Return a 1-d array so shaped that it varies along `axis` only; a number is unchanged."""
    return x.reshape(-1, *(1,) * (ndim - 1 - axis)) if x.ndim else x
