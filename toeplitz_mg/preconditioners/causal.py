"""Approximate inverses of a Toeplitz matrix that is not symmetric along its first axis.

An example is the matrix K of steady rolling, where the state is known from the leading edge
backwards. It is inverted with additions to its diagonal, on the elements whose tractions may
change.

In a periodic inverse the two ends would disturb each other, most of all for fields that are
constant along the first axis, where K̂ is zero. So fields and K are multiplied by an exponential,
and the inverted circulant has all lags except the longest ones. What wraps around the period then
comes back `WRAPPED` times as large.

The inverse of a circulant near K approximates that of K except at the edges of the area where
tractions may change: the leading edge of the contact, and the edge behind which elements slide. The
error there has no length scale: iterations would grow with the number of elements.

Along the first axis K is the product of two factors, one with the lags ≥ 0 and one with the lags ≤
0 (Wiener and Hopf). From an edge on, the inverse of K is that of one factor, cut at the edge,
followed by that of the other; up to an edge the order is reversed. At an edge of the other kind,
either order gives the inverse of the circulant. So the sum of both orders minus the inverse of the
circulant is right at both edges, and the number of products does not depend on that of elements.

On a fragmented area the edges are close to each other. There the caller passes an inverse of K for
each component (see `runs`), and circulants are used only for K + ν.

References
----------
I. Gohberg, I. A. Feldman, Convolution equations and projection methods for their solution, AMS
(1974).
"""

from collections.abc import Callable, Sequence
from math import ceil
from typing import Any, Self

import numpy as np
from numpy.typing import DTypeLike
from scipy.fft import next_fast_len

from toeplitz_mg._typing import Array
from toeplitz_mg.engine import fourier
from toeplitz_mg.engine.arrays.library import NUMPY
from toeplitz_mg.engine.embedding import around, split
from toeplitz_mg.engine.fourstep import PANEL_BYTES
from toeplitz_mg.engine.threads import keep_bits, share_slices
from toeplitz_mg.engine.vectors import VECTORS
from toeplitz_mg.engine.work import count_work, points_of_transform
from toeplitz_mg.engine.workspace import workspace

WRAPPED = 0.03  # Factor by which a field is reduced when it wraps around a circulant.
# Added to the eigenvalues: this fraction of the largest one, divided by the number of elements
# along the first axis. It bounds the inverse; a fixed fraction would damp the influence from far
# ahead.
LEAST = 0.5
# Length of the circulants divided by that of the grid along the first axis, and the least number of
# extra elements; with all lags the iterations are as many. Across, all lags are needed: without
# them some narrow contacts do not converge if the elements are longer than wide.
LONGER, GAP = 1.5, 8
# Additions ν for which K + ν is inverted, divided by the diagonal; others are interpolated.
ADDITIONS = np.array([0.0, 0.3, 2.0])

# Projects fields (k, components, ...), in place, onto those by which the tractions may change.
Projection = Callable[[Array], object]


class FieldTransform:
    """Real transforms of fields on a grid of one or two axes, padded with zeros to circulants.

    Parameters
    ----------
    grid : tuple of int
        The shape of the fields.
    dtype : float32 or float64

    Attributes
    ----------
    grid, dtype
    lengths : tuple of int
        The lengths of the circulants.
    rows : ndarray of int
        The row numbers of a field; in a distributed computation those of this rank.
    vectors : Vectors
        Reductions over a field, on all ranks.
    share : float
        The share of the work that this rank does.
    """

    vectors, share = VECTORS, 1.0

    def __init__(self, grid: tuple[int, ...], dtype: DTypeLike) -> None:
        self.grid, self.lengths, self.dtype = grid, find_lengths(grid), np.dtype(dtype)
        self.rows = np.arange(grid[0])
        self._local = grid
        # A single axis is the last one of two.
        (self._rows, self._columns), (self._length, self._last) = (
            (1, *shape)[-2:] for shape in (grid, self.lengths)
        )

    def in_double(self) -> "FieldTransform":
        """Return the same transforms in double precision."""
        return FieldTransform(self.grid, np.float64)

    def halves(self, K: Any) -> tuple[Array, Array]:
        """Return the coefficients of the lags ≥ 0 along the first axis, and of the lags ≤ 0.

        The latter are in the order 0, -1, …. Along the other axis both have all lags.
        """
        middle = self.grid[0] - 1
        return K.lags[middle:], np.flip(K.lags)[middle:]

    def forward(self, x: Array) -> Array:
        """Return the transforms of fields, of the shape (k, frequencies, frequencies).

        The rows of a field may be longer than those of the grid.
        """
        x = x.reshape(-1, self._rows, x.shape[-1])
        with keep_bits(self.dtype, len(x) * self._rows):
            Z = fourier.rfft(x, self._last)
        return self._to_columns(Z)

    def backward(self, Z: Array) -> Array:
        """Return the inverse transforms, cut to the grid."""
        Z = self._to_rows(Z)
        with keep_bits(self.dtype, len(Z) * self._rows):
            return fourier.irfft(Z, self._last)[..., : self._columns].reshape(-1, *self._local)

    def _to_columns(self, Z: Array) -> Array:
        """Transform the row transforms along the columns."""
        return self._along_columns(fourier.fft, Z, self._length)

    def _to_rows(self, Z: Array) -> Array:
        """Undo `_to_columns`."""
        return self._along_columns(fourier.ifft, Z, self._rows)

    def _along_columns(self, transform: Callable[..., Array], Z: Array, rows: int) -> Array:
        """Return the first `rows` rows of transforms along the columns, computed by threads."""
        if self._length == 1:
            return Z
        out = workspace((len(Z), rows, Z.shape[2]), Z.dtype)

        def work(part: slice) -> None:
            out[..., part] = transform(Z[..., part], self._length, axis=1)[:, :rows]

        column = len(Z) * self._length * Z.itemsize
        share_slices(work, Z.shape[2], 1 + PANEL_BYTES // column, Z.size)
        return out


class ShiftedInverses:
    """Approximate inverses of K + ν for several ν, where K is causal.

    `at` adds them with weights that vary in space, because a sliding element needs the inverse of
    K + λ with its own λ. For ν = 0 the factors of a circulant are inverted, for ν > 0 a circulant,
    and for large λ the inverse is a multiple of the identity.

    Parameters
    ----------
    transform : FieldTransform
        Diagonalises the circulants.
    spectra : list of ndarray
        The eigenvalues of circulants that approximate the diagonal blocks of K. The coupling of the
        components is weak; inverting it too would not save an iteration.
    causal : list of ndarray
        The causal factors of the inverse spectra (see `find_causal_factor`).
    own : sequence of callable, optional
        Functions of a field that replace the factors: approximate inverses of the diagonal blocks.
    diagonal : float
        The diagonal entry of K.

    Attributes
    ----------
    dtype : float32 or float64
        The precision of the fields.
    """

    def __init__(
        self,
        transform: FieldTransform,
        spectra: list[Array],
        causal: list[Array],
        diagonal: float,
        *,
        own: Sequence[Callable[[Array], Array]] = (),
    ) -> None:
        self._transform, self.dtype, self.diagonal = transform, transform.dtype, diagonal
        self._points = transform.share * points_of_transform(*transform.lengths)
        self._fade = _fade(transform).astype(self.dtype)
        precision = np.result_type(self.dtype, np.complex64)
        self._own, self._causal = own, np.array(causal, precision)
        anticausal = [1.0 / (s * factor) for s, factor in zip(spectra, causal, strict=not own)]
        self._anticausal = np.array(anticausal, precision)
        self._inverses = [
            np.array([1.0 / (s + nu) for s in spectra], precision)
            for nu in (diagonal * ADDITIONS[1:]).tolist()
        ]

    @classmethod
    def of(
        cls, K: Any, transform: FieldTransform, own: Sequence[Callable[[Array], Array]] = ()
    ) -> Self:
        """Return the inverses for a Toeplitz matrix or for several components."""
        blocks = [row[i] for i, row in enumerate(getattr(K, "blocks", ((K,),)))]
        exact = transform.in_double()
        spectra = [find_spectrum(block, exact) for block in blocks]
        causal = [] if own else [find_causal_factor(1.0 / s, exact.lengths) for s in spectra]
        return cls(transform, spectra, causal, float(blocks[0].diagonal_entry), own=own)

    def at(self, addition: Array) -> Callable[[Array, Projection], Array]:
        """Return the approximate inverse of K plus a diagonal matrix.

        It maps a field (components, ...) and a `Projection` to a field.
        """
        stiffness = addition / self.diagonal
        weights, local = interpolate(stiffness, self.dtype, ADDITIONS)
        within = (1.0 / np.sqrt(1.0 + stiffness)).astype(self.dtype)
        local /= self.diagonal
        used = [k for k in range(1, len(weights)) if self._transform.vectors.count(weights[k])]
        weights = weights[[0, *used]]

        def invert(r: Array, project_each: Projection) -> Array:
            r = r.astype(self.dtype, copy=False)
            R = self._forward(r) if used or not self._own else r
            others = [[(R, self._inverses[k - 1])] for k in used]
            if self._own:
                parts = zip(self._own, within * r, strict=True)
                fields = np.stack([inverse(part) for inverse, part in parts])[None]
                if others:
                    fields = np.concatenate([fields, self._multiply(others)])
            else:
                fields = self._multiply([self._cut(R, within, project_each), *others])
            return np.einsum("k...,kc...->c...", weights, fields) + local * r

        return invert

    def _cut(self, R: Array, within: Array, project_each: Projection) -> list[tuple[Array, Array]]:
        """Return K⁻¹ of a transform, with the factors cut at the edges, as terms of a sum."""
        first, second = self._causal, self._anticausal
        # Each order counts half of the circulant inverse, so that it is subtracted once in total.
        halves = self._multiply([[(R, first)], [(R, second)]])
        whole = 0.5 * halves
        project_each(halves)
        halves *= within
        halves -= whole
        X, Y = self._forward(halves).reshape(2, *R.shape)
        return [(X, second), (Y, first)]

    def _forward(self, x: Array) -> Array:
        """Return the transforms of fields (..., components, ...)."""
        fields = (x / self._fade).reshape(-1, *x.shape[-self._fade.ndim :])
        count_work(1, len(fields) * self._points)
        return self._transform.forward(fields)

    def _multiply(self, sums: Sequence[Sequence[tuple[Array, Array]]]) -> Array:
        """Return the fields (k, components, ...) whose transforms are Σ transform · eigenvalues."""
        components, *frequencies = sums[0][0][0].shape
        count_work(1, len(sums) * components * self._points)
        Z = workspace((len(sums), components, *frequencies), sums[0][0][0].dtype)
        for z, ((X, eigenvalues), *others) in zip(Z, sums, strict=True):
            np.multiply(X, eigenvalues, out=z)
            for other, factors in others:
                z += other * factors
        fields = self._transform.backward(Z.reshape(-1, *frequencies))
        fields *= self._fade
        return fields.reshape(-1, components, *fields.shape[1:])


def interpolate(addition: Array, dtype: DTypeLike, additions: Array) -> tuple[Array, Array]:
    """Return the weights (k, ...) of the inverses, and of the identity, for an addition over k₀.

    With x = 1/(k₀ + ν) the inverse of K + ν is x - x² (K - k₀) + …. The first term is known; the
    others, divided by x², are interpolated. So the result is exact if K is its diagonal k₀, and
    nearly exact beyond the last ν.
    """
    x, nodes = (1.0 / (1.0 + given).astype(dtype) for given in (addition, additions))
    nodes = nodes.reshape(-1, *(1,) * x.ndim)
    here, after = nodes[:-1], nodes[1:]
    weights = np.empty((len(nodes), *x.shape), dtype)
    # The share of the nodes up to each one in the interpolation: for the last node it is 1.
    weights[-1] = 1.0
    share = np.multiply(x - after, 1.0 / (here - after), out=weights[:-1])
    np.minimum(np.maximum(share, 0.0, out=share), 1.0, out=share)
    weights[1:] -= weights[:-1].copy()
    weights *= x * x / nodes**2
    return weights, x - (nodes.ravel() @ weights.reshape(len(nodes), -1)).reshape(x.shape)


# Circulants ---------------------------------------------------------------------------------------


def find_lengths(grid: tuple[int, ...]) -> tuple[int, ...]:
    """Return fast lengths of circulants for a grid; across the first axis they hold all lags."""
    all_lags, *across = (2 * n - 1 for n in grid)
    along = min(max(ceil(LONGER * grid[0]), grid[0] + GAP), all_lags)
    return tuple(map(next_fast_len, (along, *across)))


def find_spectrum(K: Any, transform: FieldTransform) -> Array:
    """Return the eigenvalues of the circulant with the exponentially weighted lags of K.

    Their shape is (frequencies, frequencies); a single axis is the last one.
    """
    n, (length, *across) = transform.grid[0], transform.lengths
    fade, rows = _fade(transform), transform.rows
    factors = 1.0 / fade, fade
    halves = [half * by for half, by in zip(transform.halves(K), factors, strict=True)]
    for half in halves:
        half[rows > find_longest_lag(n, length)] = 0.0
    halves[1][rows == 0] = 0.0  # The first half has the lag zero.
    for last in across:
        halves = [around(NUMPY, *split(NUMPY, half, 1, 0), 1, last) for half in halves]
    count_work(2, transform.share * points_of_transform(*transform.lengths))
    spectrum, of_back = transform.forward(np.array(halves))
    spectrum += of_back.conj()
    bound_from_zero(spectrum, LEAST / n * transform.vectors.max(np.abs(spectrum)))
    return spectrum


def find_longest_lag(n: int, length: int) -> int:
    """Return the longest lag that fits into a circulant of this length, for n elements."""
    return min(n, (length + 1) // 2) - 1


def bound_from_zero(spectrum: Array, least: float) -> None:
    """Raise the real parts of eigenvalues to at least `least`, in place.

    Those of K are not negative, but on a long and narrow grid those of its cut lags may be.
    """
    np.maximum(spectrum.real, 0.0, out=spectrum.real)
    spectrum += least


def find_causal_factor(spectrum: Array, lengths: tuple[int, ...]) -> Array:
    """Return the factor of the eigenvalues with the lags ≥ 0 along the first axis.

    The eigenvalues divided by it are the factor with the lags ≤ 0 (Wiener and Hopf): the logarithm
    turns the product into a sum. The real parts must be positive, so that it has a branch.
    """
    weights, logarithm = weigh_causally(np.arange(lengths[0]), lengths[0]), np.log(spectrum)
    if len(lengths) == 1:
        causal = fourier.rfft(weights * fourier.irfft(logarithm, lengths[0]))
    else:
        causal = fourier.fft(weights[:, None] * fourier.ifft(logarithm, axis=0), axis=0)
    factor: Array = np.exp(causal)
    return factor


def weigh_causally(lags: Array, length: int) -> Array:
    """Return the weights of a period's lags in the causal part of a logarithm.

    The lag zero is shared equally. This makes both factors depend as little as possible on the
    frequency across, which does not commute with the cut at an edge between them.
    """
    weights: Array = np.where(lags == 0, 0.5, (2 * lags <= length).astype(float))
    return weights


def _fade(transform: FieldTransform) -> Array:
    """Return the exponential by which the rows of fields are divided."""
    shape = -1, *(1,) * (len(transform.lengths) - 1)
    return np.exp(fade_rate(transform.lengths[0]) * transform.rows).reshape(shape)


def fade_rate(length: int) -> float:
    """Return the rate per element of the exponential that damps what wraps around."""
    return float(np.log(WRAPPED) / length)
