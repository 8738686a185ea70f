"""Approximate inverses of the matrix of steady rolling on slabs, by circulants.

They are those of `contact.steady_matrices.ShiftedInverses`, but that all of them are added.
"""

from collections.abc import Callable, Iterator
from math import prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy import fft

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.steady_matrices import ADDITIONS, LEAST, fade_rate, interpolate
from toeplitz_mg.engine.embedding import around, split
from toeplitz_mg.engine.library import NUMPY
from toeplitz_mg.engine.threads import keep_bits
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.slabs.coupled import CoupledOperator
from toeplitz_mg.slabs.line import LongTransform
from toeplitz_mg.slabs.product import turns_of
from toeplitz_mg.slabs.slab import Slab


class ShiftedInverses:
    """Approximate inverses of K + ν, of the matrix of steady rolling and additions ν.

    The matrices in which the products embed K are no help: what goes around has a factor i there,
    which products cut off. Their inverses do not, and are far from that of K on grids that are
    long and narrow.
    """

    def __init__(self, K: CoupledOperator, dtype: np.dtype[Any], k0: float) -> None:
        slab, shape = K.slab, K.slab.shape
        self.dtype, self.diagonal = dtype, k0
        lengths = tuple(fft.next_fast_len(2 * n - 1) for n in shape)
        fade = np.exp(fade_rate(lengths[0]) * np.arange(slab.rows.start, slab.rows.stop))[:, None]
        self._fade = fade.astype(dtype)
        self._transform = _transform(slab, lengths, dtype)
        exact = _transform(slab, lengths, np.float64)
        self._inverses = []
        for i, row in enumerate(K.blocks):
            A: Any = row[i]
            ahead, back = A.c / fade, A.opposite * fade
            if not slab.is_line:  # Lags along the last axis are of both signs.
                ahead, back = (
                    around(NUMPY, *split(NUMPY, a, 1, A.parity[1]), 1, lengths[1])
                    for a in (ahead, back)
                )
            if slab.comm.rank == 0:
                # The lag zero is ahead, and on a grid all lags that are zero along the first axis.
                back[0, : 1 if slab.is_line else None] = 0.0
            s = exact.forward(ahead.reshape(-1)) + exact.forward(back.reshape(-1)).conj()
            least = LEAST / shape[0] * max(slab.gather(np.abs(s).max(initial=0.0)))
            inverses = [1.0 / (s + nu + least) for nu in k0 * ADDITIONS]
            self._inverses.append(np.array(inverses, dtype.char.upper()))

    def at(self, addition: Array) -> Callable[[Array], Array]:
        """Return the approximate inverse of K + an addition to the diagonal at each place."""
        weights, local = interpolate(addition / self.diagonal, self.dtype)
        local /= self.diagonal

        def invert(r: Array) -> Array:
            x = (r / self._fade).astype(self.dtype)
            total = np.zeros_like(x)
            for y, weight in zip(self._multiply(x), weights, strict=True):
                total += weight * y
            return total * self._fade + local * r.astype(self.dtype, copy=False)

        return invert

    def _multiply(self, x: Array) -> Iterator[Array]:
        """Yield a field, (components, ...), times the circulants of each addition."""
        count_transforms((1 + len(ADDITIONS)) * len(x), *(2 * n for n in x.shape[1:]))
        transformed = [self._transform.forward(part.reshape(-1)) for part in x]
        for inverses in zip(*self._inverses, strict=True):
            pairs = zip(transformed, inverses, strict=True)
            parts = [self._transform.backward(X * inverse) for X, inverse in pairs]
            yield np.reshape(parts, x.shape)


class GridTransform:
    """Real transforms of fields on a grid, extended by zeros, whose frequencies ranks share.

    A rank has some of those of the last axis. It is what `LongTransform` is for one axis.
    """

    def __init__(self, slab: Slab, lengths: tuple[int, ...], dtype: DTypeLike) -> None:
        self._slab, self._lengths, self.dtype = slab, lengths, np.dtype(dtype)
        self._points = lengths[0], lengths[1] // 2 + 1

    def forward(self, x: Array) -> Array:
        """Return the transform of a field, whose rows may be longer than those of the grid."""
        slab, (length, last) = self._slab, self._lengths
        x = x.astype(self.dtype, copy=False).reshape(slab.local[0], -1)
        mine = slab.columns(self._points[1])
        with keep_bits(self.dtype):
            rows = fft.rfft(x, last)
            Z = np.empty((length, mine.stop - mine.start), rows.dtype)
            for own, turn in turns_of(slab, self._points, rows.itemsize):
                Z[:, own] = fft.fft(slab.to_columns(rows, turn), length, axis=0)
        return Z

    def backward(self, Z: Array) -> Array:
        """Return the field of a transform, cut."""
        slab = self._slab
        rows = np.empty((slab.local[0], self._points[1]), Z.dtype)
        with keep_bits(self.dtype):
            for own, turn in turns_of(slab, self._points, rows.itemsize):
                slab.to_rows(fft.ifft(Z[:, own], axis=0)[: slab.shape[0]], rows, turn)
            return fft.irfft(rows, self._lengths[1])[:, : slab.shape[1]]


def _transform(
    slab: Slab, lengths: tuple[int, ...], dtype: DTypeLike
) -> GridTransform | LongTransform:
    if slab.is_line:
        return LongTransform(slab, prod(slab.shape), prod(lengths), dtype)
    return GridTransform(slab, lengths, dtype)
