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
from scipy import fft

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.threads import keep_bits, share_slices
from toeplitz_mg.engine.vectors import VECTORS, Vectors
from toeplitz_mg.engine.work import count_work, points_of_transform
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.operators import CoupledOperator, ToeplitzOperator

WRAPPED = 0.03  # What goes around a circulant comes back so many times as large.
# Addition where nothing slides, over the largest of the symbol and by the number of elements along
# the first axis: it bounds the inverse. A fixed one fades what comes from far ahead.
LEAST = 0.5
# Length of the circulants over that of the grid along the first axis, and how many elements they
# are longer at least: with all lags it takes as many iterations. Across they have all lags, or
# some narrow contacts of elements that are longer than wide do not converge.
LONGER, GAP = 1.5, 8
PANEL_BYTES = 2**20  # Bytes of the columns that are transformed at once: they stay in the cache.
# Additions to the matrix whose inverses are interpolated, over its diagonal.
ADDITIONS = np.array([0.0, 0.3, 2.0])

# It projects fields, (k, components, ...), to those by which the tractions may change, in place.
Projection = Callable[[Array], object]


class FieldTransform:
    """Real transforms of fields on a grid of one or two axes, extended by zeros.

    Parameters
    ----------
    grid, lengths : tuple of int
        The shapes of the fields, and of what they are extended to.
    dtype : float32 or float64
    """

    def __init__(self, grid: tuple[int, ...], lengths: tuple[int, ...], dtype: DTypeLike) -> None:
        self._grid, self.dtype = grid, np.dtype(dtype)
        # A single axis is the last one of two.
        (self._rows, self._columns), (self._length, self._last) = (
            (1, *shape)[-2:] for shape in (grid, lengths)
        )

    def forward(self, x: Array) -> Array:
        """Return the transforms of fields, of the shape (k, frequencies, frequencies)."""
        x = x.reshape(-1, self._rows, self._columns)
        with keep_bits(self.dtype, len(x) * self._rows):
            Z = fft.rfft(x, self._last)
        return self._along_columns(fft.fft, Z, self._length)

    def backward(self, Z: Array) -> Array:
        """Return the fields of transforms, cut to the grid."""
        Z = self._along_columns(fft.ifft, Z, self._rows)
        with keep_bits(self.dtype, len(Z) * self._rows):
            return fft.irfft(Z, self._last)[..., : self._columns].reshape(-1, *self._grid)

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
        What diagonalises the circulants; or another that has the same methods.
    lengths : tuple of int
        Those of the circulants.
    rows : ndarray of int
        The numbers of the rows of a field.
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
    vectors : Vectors
        How much of a field is not zero, where ranks share it.
    share : float
        That of this rank of the work.

    Attributes
    ----------
    dtype : float32 or float64
        That of the fields.
    """

    def __init__(
        self,
        transform: Any,
        lengths: tuple[int, ...],
        rows: Array,
        spectra: list[Array],
        causal: list[Array],
        diagonal: float,
        *,
        own: Sequence[Callable[[Array], Array]] = (),
        vectors: Vectors = VECTORS,
        share: float = 1.0,
    ) -> None:
        self._transform, self.dtype, self.diagonal = transform, transform.dtype, diagonal
        self._vectors, self._points = vectors, share * points_of_transform(*lengths)
        fade = np.exp(fade_rate(lengths[0]) * rows).astype(self.dtype)
        self._fade = fade.reshape(-1, *(1,) * (len(lengths) - 1))
        precision = np.result_type(self.dtype, np.complex64)
        self._own, self._causal = own, np.array(causal, precision)
        anticausal = [1.0 / (s * factor) for s, factor in zip(spectra, causal, strict=not own)]
        self._anticausal = np.array(anticausal, precision)
        self._inverses = [
            np.array([1.0 / (s + nu) for s in spectra], precision)
            for nu in (diagonal * ADDITIONS[1:]).tolist()
        ]

    @classmethod
    def of(cls, K: Any, dtype: DTypeLike, own: Sequence[Callable[[Array], Array]] = ()) -> Self:
        """Return those of a ToeplitzOperator or a CoupledOperator of some components."""
        is_coupled = isinstance(K, CoupledOperator)
        blocks = [K.component(i) for i in range(len(K.blocks))] if is_coupled else [K]
        grid = blocks[0].grid_shape
        lengths = find_lengths(grid)
        spectra = [find_spectrum(block, lengths) for block in blocks]
        causal = [] if own else [find_causal_factor(1.0 / s, lengths) for s in spectra]
        transform, diagonal = FieldTransform(grid, lengths, dtype), float(blocks[0].c.flat[0])
        return cls(transform, lengths, np.arange(grid[0]), spectra, causal, diagonal, own=own)

    def at(self, addition: Array) -> Callable[[Array, Projection], Array]:
        """Return the approximate inverse of K + an addition to the diagonal at each place.

        It takes a field, (components, ...), and the projection to those by which the tractions may
        change, to another field.
        """
        stiffness = addition / self.diagonal
        weights, local = interpolate(stiffness, self.dtype, ADDITIONS)
        within = (1.0 / np.sqrt(1.0 + stiffness)).astype(self.dtype)
        local /= self.diagonal
        used = [k for k in range(1, len(weights)) if self._vectors.count(weights[k])]
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
    return tuple(map(fft.next_fast_len, (along, *across)))


def find_spectrum(K: ToeplitzOperator, lengths: tuple[int, ...]) -> Array:
    """Return the eigenvalues of the circulant of these lengths that has the lags of K, faded.

    They are of the shape (frequencies, frequencies), those of a single axis along the last one.
    """
    n, *across = K.grid_shape
    longest = find_longest_lag(n, lengths[0])
    lags = np.arange(-longest, longest + 1).reshape(-1, *(1,) * len(across))
    faded = K.lags[n - 1 + lags.ravel()] * np.exp(-fade_rate(lengths[0]) * lags)
    count_work(1, points_of_transform(*lengths))
    spectrum = fft.rfftn(ToeplitzOperator.from_lags(faded).circulant(lengths))
    bound_from_zero(spectrum, LEAST / n * np.abs(spectrum).max())
    result: Array = spectrum.reshape((1, *lengths)[-2], -1)
    return result


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
        causal = fft.rfft(weights * fft.irfft(logarithm, lengths[0]))
    else:
        causal = fft.fft(weights[:, None] * fft.ifft(logarithm, axis=0), axis=0)
    factor: Array = np.exp(causal)
    return factor


def weigh_causally(lags: Array, length: int) -> Array:
    """Return the weights of the lags of a period in the causal part of a logarithm.

    The lag zero is shared: both factors are to depend as little as can be on the frequency across,
    as what is between them, the cut at an edge, does not commute with that.
    """
    weights: Array = np.where(lags == 0, 0.5, (2 * lags <= length).astype(float))
    return weights


def fade_rate(length: int) -> float:
    """Return the rate, for an element, of the exponential that fades what goes around."""
    return float(np.log(WRAPPED) / length)
