"""Approximate inverses of a Toeplitz matrix that is not symmetric along its first axis.

The matrix K of steady rolling is one: what happens is known from the leading edge backwards. It is
to be inverted with additions to its diagonal, on elements whose tractions may change.

An inverse that is periodic would have its ends disturb each other: what is constant along the first
axis, where K̂ is zero, most of all. So fields are multiplied by an exponential, K by the same from
both sides, and a circulant is inverted that has all its lags but the longest: what goes around
comes back `WRAPPED` times as large.

The inverse of a circulant that is near K is one of K, but for the edges of where tractions may
change: the leading edge of the contact, and the edge behind which elements slide. What is wrong
there is so on any scale, and would take more iterations the more elements there are.

Along the first axis K is the product of two factors, of the lags from 0 on and of those from 0 down
(Wiener and Hopf). From an edge on, the inverse of K is that of the one, cut at the edge, and then
that of the other; up to an edge it is the same in the opposite order. And either is that of the
circulant at an edge of the other kind: so the sum of both orders, less the inverse of the
circulant, is right at both. With this the products do not depend on the number of elements.

On a fragmented area no edge is far from others. There the inverse of K itself is given, of each
component by its runs (see `runs`), and circulants are of K + ν only.

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
from toeplitz_mg.engine.passes import PANEL_BYTES
from toeplitz_mg.engine.threads import keep_bits, share_slices
from toeplitz_mg.engine.vectors import VECTORS
from toeplitz_mg.engine.work import count_work, points_of_transform
from toeplitz_mg.engine.workspace import workspace

WRAPPED = 0.03  # What goes around a circulant comes back so many times as large.
# Addition where nothing slides, over the largest of the symbol and by the number of elements along
# the first axis: it bounds the inverse. A fixed one fades what comes from far ahead.
LEAST = 0.5
# Length of the circulants over that of the grid along the first axis, and how many elements they
# are longer at least: with all lags it takes as many iterations. Across they have all lags, or
# some narrow contacts of elements that are longer than wide do not converge.
LONGER, GAP = 1.5, 8
# Additions to the matrix whose inverses are interpolated, over its diagonal.
ADDITIONS = np.array([0.0, 0.3, 2.0])

# It projects fields, (k, components, ...), to those by which the tractions may change, in place.
Projection = Callable[[Array], object]


class FieldTransform:
    """Real transforms of fields on a grid of one or two axes, extended by zeros to circulants.

    Parameters
    ----------
    grid : tuple of int
        The shape of the fields.
    dtype : float32 or float64

    Attributes
    ----------
    grid, dtype
    lengths : tuple of int
        Those of the circulants.
    rows : ndarray of int
        The numbers of the rows of a field: of several ranks each has some.
    vectors : Vectors
        How much of a field is not zero, on all ranks.
    share : float
        That of this rank of the work.
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
        """Return the coefficients of the lags from 0 on along the first axis, and from 0 down.

        The latter are those of the opposite lags. Along the other axis both have all lags.
        """
        middle = self.grid[0] - 1
        return K.lags[middle:], np.flip(K.lags)[middle:]

    def forward(self, x: Array) -> Array:
        """Return the transforms of fields, whose rows may be longer than those of the grid.

        They are of the shape (k, frequencies, frequencies).
        """
        x = x.reshape(-1, self._rows, x.shape[-1])
        with keep_bits(self.dtype, len(x) * self._rows):
            Z = fourier.rfft(x, self._last)
        return self._to_columns(Z)

    def backward(self, Z: Array) -> Array:
        """Return the fields of transforms, cut to the grid."""
        Z = self._to_rows(Z)
        with keep_bits(self.dtype, len(Z) * self._rows):
            return fourier.irfft(Z, self._last)[..., : self._columns].reshape(-1, *self._local)

    def _to_columns(self, Z: Array) -> Array:
        """Return the transforms along the columns of those of rows."""
        return self._along_columns(fourier.fft, Z, self._length)

    def _to_rows(self, Z: Array) -> Array:
        """Return the transforms of rows of what `_to_columns` returns."""
        return self._along_columns(fourier.ifft, Z, self._rows)

    def _along_columns(self, transform: Callable[..., Array], Z: Array, rows: int) -> Array:
        """Return so many rows of transforms along the columns, which threads share."""
        if self._length == 1:
            return Z
        out = workspace((len(Z), rows, Z.shape[2]), Z.dtype)

        def work(part: slice) -> None:
            out[..., part] = transform(Z[..., part], self._length, axis=1)[:, :rows]

        column = len(Z) * self._length * Z.itemsize
        share_slices(work, Z.shape[2], 1 + PANEL_BYTES // column, Z.size)
        return out


class ShiftedInverses:
    """Approximate inverses of K + ν, of a matrix that is causal and additions ν.

    Their fields are added with weights that depend on the place: where an element slides, what is
    to be inverted is K + λ with a λ of its own. They are circulants, of K itself by its factors,
    and for large λ a multiple of the field itself.

    Parameters
    ----------
    transform : FieldTransform
        What diagonalises the circulants.
    spectra : list of ndarray
        The eigenvalues of circulants that are near the components of K. The components are inverted
        each by itself: the coupling is weak, and inverted too, it saves no iteration.
    causal : list of ndarray
        The causal factors of the inverses of these (see `find_causal_factor`).
    own : sequence of callable, optional
        Approximate inverses of the components of K itself, from field to field, in the place of
        its factors.
    diagonal : float
        That of K.

    Attributes
    ----------
    dtype : float32 or float64
        That of the fields.
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
        """Return those of a Toeplitz matrix, or of several components, for the fields of `own`."""
        blocks = [row[i] for i, row in enumerate(getattr(K, "blocks", ((K,),)))]
        exact = transform.in_double()
        spectra = [find_spectrum(block, exact) for block in blocks]
        causal = [] if own else [find_causal_factor(1.0 / s, exact.lengths) for s in spectra]
        return cls(transform, spectra, causal, float(blocks[0].diagonal_entry), own=own)

    def at(self, addition: Array) -> Callable[[Array, Projection], Array]:
        """Return the approximate inverse of K + an addition to the diagonal at each place.

        It takes a field, (components, ...), and the projection to those by which the tractions may
        change, to another field.
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
        """Return the inverse of K itself of a transform, cut at the edges, as terms of a sum."""
        first, second = self._causal, self._anticausal
        # Without the half the sum of both orders would be twice the inverse of the circulant.
        halves = self._multiply([[(R, first)], [(R, second)]])
        whole = 0.5 * halves
        project_each(halves)
        halves *= within
        halves -= whole
        X, Y = self._forward(halves).reshape(2, *R.shape)
        return [(X, second), (Y, first)]

    def _forward(self, x: Array) -> Array:
        """Return the transforms of fields, (..., components, ...)."""
        fields = (x / self._fade).reshape(-1, *x.shape[-self._fade.ndim :])
        count_work(1, len(fields) * self._points)
        return self._transform.forward(fields)

    def _multiply(self, sums: Sequence[Sequence[tuple[Array, Array]]]) -> Array:
        """Return the fields, (k, components, ...), of sums of eigenvalues times transforms."""
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


# Circulants ---------------------------------------------------------------------------------------


def find_lengths(grid: tuple[int, ...]) -> tuple[int, ...]:
    """Return the lengths of circulants for a grid, at least; across, those of all lags."""
    all_lags, *across = (2 * n - 1 for n in grid)
    along = min(max(ceil(LONGER * grid[0]), grid[0] + GAP), all_lags)
    return tuple(map(next_fast_len, (along, *across)))


def find_spectrum(K: Any, transform: FieldTransform) -> Array:
    """Return the eigenvalues of the circulant that has the lags of a Toeplitz matrix, faded.

    They are of the shape (frequencies, frequencies), those of a single axis along the last one.
    """
    n, (length, *across) = transform.grid[0], transform.lengths
    fade, rows = _fade(transform), transform.rows
    factors = 1.0 / fade, fade
    halves = [half * by for half, by in zip(transform.halves(K), factors, strict=True)]
    for half in halves:
        half[rows > find_longest_lag(n, length)] = 0.0
    halves[1][rows == 0] = 0.0  # The lag zero is in the first half.
    for last in across:
        halves = [around(NUMPY, *split(NUMPY, half, 1, 0), 1, last) for half in halves]
    count_work(2, transform.share * points_of_transform(*transform.lengths))
    spectrum, of_back = transform.forward(np.array(halves))
    spectrum += of_back.conj()
    bound_from_zero(spectrum, LEAST / n * transform.vectors.max(np.abs(spectrum)))
    return spectrum


def find_longest_lag(n: int, length: int) -> int:
    """Return the longest lag along an axis of n elements that a circulant of this length has."""
    return min(n, (length + 1) // 2) - 1


def bound_from_zero(spectrum: Array, least: float) -> None:
    """Make the real parts of eigenvalues at least so large, in place.

    Those of K are not negative; of its lags on a long and narrow grid alone some are.
    """
    np.maximum(spectrum.real, 0.0, out=spectrum.real)
    spectrum += least


def find_causal_factor(spectrum: Array, lengths: tuple[int, ...]) -> Array:
    """Return the factor of eigenvalues whose lags along the first axis are those from 0 on.

    The other one, of the lags from 0 down, is the eigenvalues over this one (Wiener and Hopf): the
    logarithm of a product is a sum. Their real parts are to be positive, or it has no branch.
    """
    weights, logarithm = weigh_causally(np.arange(lengths[0]), lengths[0]), np.log(spectrum)
    if len(lengths) == 1:
        causal = fourier.rfft(weights * fourier.irfft(logarithm, lengths[0]))
    else:
        causal = fourier.fft(weights[:, None] * fourier.ifft(logarithm, axis=0), axis=0)
    factor: Array = np.exp(causal)
    return factor


def weigh_causally(lags: Array, length: int) -> Array:
    """Return the weights of the lags of a period in the causal part of a logarithm.

    The lag zero is shared: both factors are to depend as little as can be on the frequency across,
    as what is between them, the cut at an edge, does not commute with that.
    """
    weights: Array = np.where(lags == 0, 0.5, (2 * lags <= length).astype(float))
    return weights


def _fade(transform: FieldTransform) -> Array:
    """Return the exponential by which fields are divided, for each of their rows."""
    shape = -1, *(1,) * (len(transform.lengths) - 1)
    return np.exp(fade_rate(transform.lengths[0]) * transform.rows).reshape(shape)


def fade_rate(length: int) -> float:
    """Return the rate, for an element, of the exponential that fades what goes around."""
    return float(np.log(WRAPPED) / length)
