"""The matrix of steady rolling, and approximate inverses of it."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy import fft

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.threads import keep_bits, share_slices
from toeplitz_mg.engine.vectors import ALONE
from toeplitz_mg.engine.work import count_transforms, count_work
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.operators import CoupledOperator, ToeplitzOperator

WRAPPED = 0.03  # What goes around a circulant comes back so many times as large.
# Addition where nothing slides, over the largest of the symbol and by the number of elements along
# the rolling direction: it bounds the inverse. A fixed one fades what comes from far ahead.
LEAST = 1.0
# Additions to the matrix whose inverses are interpolated, over its diagonal.
ADDITIONS = np.array([0.0, 0.3, 2.0])
LEAST_UNIT, MOST_UNIT = 1e-12, 1e12  # Diagonals of a matrix that single precision is good for.
PANEL_BYTES = 2**20  # Bytes of a panel of frequencies, or of lines: it stays in the cache.


def subtract_operators(A: Any, S: Any) -> Any:
    """Return A - S, of Toeplitz operators or coupled ones; None is zero, as in their blocks."""
    if S is None:
        return A
    if isinstance(S, CoupledOperator):
        pairs = (zip(*rows, strict=True) for rows in zip(A.blocks, S.blocks, strict=True))
        return CoupledOperator([[subtract_operators(a, s) for a, s in row] for row in pairs])
    # On a single row of elements S couples the components, and A does not.
    return ToeplitzOperator.from_lags(-S.lags if A is None else A.lags - S.lags)


class SteadyArray:
    """The matrix of steady rolling on the elements in contact, as an array.

    Parameters
    ----------
    K : ToeplitzOperator or CoupledOperator
    contact : ndarray of bool
        The elements in contact: the fields of these are one axis.

    Attributes
    ----------
    array : ndarray
        In double precision.
    """

    vectors = ALONE

    def __init__(self, K: Any, contact: Array) -> None:
        m = K.shape[0] // contact.size
        self.array = K.block(np.flatnonzero(np.tile(contact.ravel(), m)))
        # In single precision, where its range is that of the numbers.
        is_single = LEAST_UNIT < self.array[0, 0] < MOST_UNIT
        self._rough = self.array.astype(np.float32) if is_single else self.array
        self._rough_inverse = np.linalg.inv(self._rough)
        for array in (self.array, self._rough, self._rough_inverse):
            array.flags.writeable = False

    @cached_property
    def _inverse(self) -> Array:
        inverse = np.linalg.inv(self.array)
        inverse.flags.writeable = False
        return inverse

    def choose(self, *, inverse: bool, precisely: bool) -> Array:
        """Return the matrix, or its inverse, in double precision or in single."""
        if precisely:
            return self._inverse if inverse else self.array
        return self._rough_inverse if inverse else self._rough

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply a field of the elements in contact."""
        count_work(1, X.size)
        return self.array @ X

    def solve(self, u: Array) -> Array:
        """Return the tractions that have these displacements in a step, to some 10 digits."""
        rough: Array = self._rough_inverse @ u.astype(self._rough.dtype)
        q = rough.astype(np.float64)
        return q + self._rough_inverse @ (u - self.array @ q).astype(self._rough.dtype)


class Circulants:
    """Sums of circulants of a field on a grid, each with weights, by fast transforms.

    Rolling is known from the leading edge backwards, so that an inverse that is periodic would have
    its ends disturb each other: what is constant along the rolling direction, where K̂ is zero, most
    of all. So the fields are multiplied by an exponential, K by the same from both sides, and the
    circulant that embeds it is inverted: what goes around comes back `WRAPPED` times as large.

    Attributes
    ----------
    additions : ndarray
        Those whose inverses are interpolated, over the diagonal of K.
    lengths : tuple of int
        Those of the circulants.
    """

    additions = ADDITIONS

    def __init__(self, grid: tuple[int, ...], dtype: DTypeLike) -> None:
        self.dtype = np.dtype(dtype)
        self.lengths = tuple(fft.next_fast_len(2 * n - 1) for n in grid)
        fade = np.exp(fade_rate(self.lengths[0]) * np.arange(grid[0])).astype(dtype)
        self._fade = fade.reshape(-1, *(1,) * (len(grid) - 1))

    def prepare(self, weights: Array) -> Array:
        """Return weights as `add` takes them, for many fields."""
        return weights * self._fade

    def add(self, r: Array, weights: Array, eigenvalues: Array) -> Array:
        """Return the sum of the circulants of a field, (components, ...), each with its weights."""
        # A single axis is the last one of two.
        length, last = (1, *self.lengths)[-2:]
        number, components = len(eigenvalues), len(r)
        count_transforms((1 + number) * components, length, last)
        n = r.shape[-1]
        with keep_bits(self.dtype, r.size // n):
            R = fft.rfft((r / self._fade).reshape(components, -1, n), last)
        weights = weights.reshape(number, -1, n)
        rows, frequencies = R.shape[1:]
        Y = workspace((number, components, rows, frequencies), R.dtype)
        total = np.empty((components, rows, n), self.dtype)

        def multiply(columns: slice) -> None:
            Z = fft.fft(R[..., columns], length, axis=1) * eigenvalues[..., columns]
            Y[..., columns] = fft.ifft(Z, axis=2, overwrite_x=True)[:, :, :rows]

        def add(lines: slice) -> None:
            y = fft.irfft(Y[:, :, lines], last)[..., :n]
            np.einsum("krn,kcrn->crn", weights[:, lines], y, out=total[:, lines])

        of_column, of_row = (number * components * m * R.itemsize for m in (length, frequencies))
        share_slices(multiply, frequencies, 1 + PANEL_BYTES // of_column, Y.size)
        share_slices(add, rows, 1 + PANEL_BYTES // of_row, Y.size)
        return total.reshape(r.shape)


class ShiftedInverses:
    """Approximate inverses of K + ν, of the matrix of steady rolling and additions ν.

    Their fields are added with weights that depend on the place: where an element slides, what is
    to be inverted is K + λ with a λ of its own. They are circulants (see `Circulants`), and for
    large λ a multiple of the field itself.

    Parameters
    ----------
    K : ToeplitzOperator or CoupledOperator
        The components of a coupled one are inverted each by itself: the coupling is weak, and
        inverted too, it saves no iteration.
    dtype : float32 or float64
    circulants : type, optional
        How the circulants are multiplied with.

    Attributes
    ----------
    diagonal : float
        That of K.
    """

    def __init__(self, K: Any, dtype: DTypeLike, circulants: Any = Circulants) -> None:
        is_coupled = isinstance(K, CoupledOperator)
        blocks = [K.component(i) for i in range(len(K.blocks))] if is_coupled else [K]
        grid: tuple[int, ...] = blocks[0].grid_shape
        self.dtype, self.diagonal = np.dtype(dtype), float(blocks[0].c.flat[0])
        self._circulants = circulants(grid, dtype)
        lengths, n = self._circulants.lengths, grid[0]
        lags = np.exp(-fade_rate(lengths[0]) * np.arange(1 - n, n))
        lags = lags.reshape(-1, *(1,) * (len(grid) - 1))
        spectra = []
        for block in blocks:
            count_transforms(1, *lengths)
            circulant = ToeplitzOperator.from_lags(block.lags * lags).circulant(lengths)
            spectra.append(fft.rfftn(circulant))
        inverses = [
            [1.0 / (s + nu + LEAST / n * np.abs(s).max()) for s in spectra]
            for nu in self.diagonal * self._circulants.additions
        ]
        shape = (len(inverses), len(blocks), (1, *lengths)[-2], -1)
        precision = np.result_type(self.dtype, np.complex64)
        self._inverses = np.array(inverses, precision).reshape(shape)

    def at(self, addition: Array) -> Callable[[Array], Array]:
        """Return the approximate inverse of K + an addition to the diagonal at each place.

        It takes a field, (components, ...), to another one.
        """
        circulants = self._circulants
        weights, local = interpolate(addition / self.diagonal, self.dtype, circulants.additions)
        used = np.flatnonzero(weights.reshape(len(weights), -1).any(axis=1))
        some = slice(int(used[0]), int(used[-1]) + 1)
        weights, inverses = circulants.prepare(weights[some]), self._inverses[some]
        local /= self.diagonal

        def invert(r: Array) -> Array:
            r = r.astype(self.dtype, copy=False)
            return circulants.add(r, weights, inverses) + local * r

        return invert


def interpolate(
    addition: Array, dtype: DTypeLike, additions: Array = ADDITIONS
) -> tuple[Array, Array]:
    """Return the weights of the inverses, (k, ...), and of 1/k₀ in one for an addition over k₀.

    In x = 1/(k₀ + ν) the inverse of K + ν is x - x² (K - k₀) + ...: the first term is known, and
    what the others are over x² is interpolated. So it is exact where K is its diagonal k₀, and
    nearly so beyond the last ν.
    """
    x, nodes = (1.0 / (1.0 + given).astype(dtype) for given in (addition, additions))
    nodes = nodes.reshape(-1, *(1,) * x.ndim)
    here, after = nodes[:-1], nodes[1:]
    weights = np.empty((len(nodes), *x.shape), dtype)
    # How much of what is interpolated is of the nodes up to each: of the last ones, all of it.
    weights[-1] = 1.0
    share = np.multiply(x - after, 1.0 / (here - after), out=weights[:-1])
    np.minimum(np.maximum(share, 0.0, out=share), 1.0, out=share)
    weights[1:] -= weights[:-1].copy()
    weights *= x * x / nodes**2
    return weights, x - (nodes.ravel() @ weights.reshape(len(nodes), -1)).reshape(x.shape)


def fade_rate(length: int) -> float:
    """Return the rate, for an element, of the exponential that fades what goes around."""
    return float(np.log(WRAPPED) / length)
