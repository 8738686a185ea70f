"""Approximate inverses of the matrix of steady rolling on slabs, by circulants.

They are those of `contact.steady_matrices.ShiftedInverses`, but that all of them are added.
"""

from collections.abc import Callable, Iterator
from math import prod
from typing import Any

import numpy as np
from scipy.fft import next_fast_len

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.steady_matrices import ADDITIONS, LEAST, fade_rate, interpolate
from toeplitz_mg.engine.lengths import embedding_lengths
from toeplitz_mg.engine.work import count_work
from toeplitz_mg.slabs.coupled import CoupledOperator
from toeplitz_mg.slabs.line import LongTransform
from toeplitz_mg.slabs.operators import ToeplitzOperator
from toeplitz_mg.slabs.product import SlabProduct
from toeplitz_mg.slabs.slab import Slab


class ShiftedInverses:
    """Approximate inverses of K + ν, of the matrix of steady rolling and additions ν."""

    def __init__(self, K: CoupledOperator, dtype: np.dtype[Any], k0: float) -> None:
        slab = K.slab
        self.dtype, self.diagonal = dtype, k0
        rate = fade_rate(embedding_lengths(slab.shape)[0])
        fade = np.exp(rate * np.arange(slab.rows.start, slab.rows.stop))[:, None]
        self._fade = fade.astype(dtype)
        blocks: list[Any] = [row[i] for i, row in enumerate(K.blocks)]
        faded = [
            ToeplitzOperator(A.c / fade, slab, parity=A.parity, behind=A.behind * fade)
            for A in blocks
        ]
        circulants = LineCirculants if slab.is_line else GridCirculants
        self._multiply = circulants(slab, faded, k0 * ADDITIONS, dtype)

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


class GridCirculants:
    """The inverses of the circulants of products, with these additions, of each component.

    Called with a field, (components, ...), it yields the products with those of each addition.
    """

    def __init__(
        self, slab: Slab, blocks: list[ToeplitzOperator], additions: Array, dtype: np.dtype[Any]
    ) -> None:
        m = len(blocks)
        self._products = []
        for nu in additions:
            spectra: list[list[Array | None]] = [[None] * m for _ in range(m)]
            for i, A in enumerate(blocks):
                s, points = A.spectrum, A.product.points
                # Those of the inverse, as those of K, are divided by the points of a transform.
                spectra[i][i] = _invert(slab, s * points, nu) / points
            self._products.append(SlabProduct(slab, blocks[0].library, spectra, dtype))

    def __call__(self, x: Array) -> Iterator[Array]:
        """Yield a field times the circulants of each addition, in memory that is used again."""
        y = np.empty_like(x)
        for product in self._products:
            product.apply(x.reshape(-1), y.reshape(-1))
            yield y


class LineCirculants:
    """The same on a line, whose products are those of a matrix that has no circulant of its own."""

    def __init__(
        self, slab: Slab, blocks: list[ToeplitzOperator], additions: Array, dtype: np.dtype[Any]
    ) -> None:
        n = prod(slab.shape)
        length = next_fast_len(2 * n - 1)
        self._transform = LongTransform(slab, n, length, dtype)
        exact = LongTransform(slab, n, length)
        self._inverses = []
        for A in blocks:
            ahead, back = A.c.ravel(), A.opposite.ravel().copy()
            if slab.comm.rank == 0:
                back[0] = 0.0  # That of the lag zero is ahead.
            s = exact.forward(ahead) + exact.forward(back).conj()
            inverses = [_invert(slab, s, nu) for nu in additions]
            self._inverses.append(np.array(inverses, dtype.char.upper()))

    def __call__(self, x: Array) -> Iterator[Array]:
        """Yield a field times the circulants of each addition."""
        transformed = [self._transform.forward(part.reshape(-1)) for part in x]
        for inverses in zip(*self._inverses, strict=True):
            count_work(1, float(x.size))
            pairs = zip(transformed, inverses, strict=True)
            parts = [self._transform.backward(X * inverse) for X, inverse in pairs]
            yield np.reshape(parts, x.shape)


def _invert(slab: Slab, spectrum: Array, addition: float) -> Array:
    """Return the reciprocals of eigenvalues and an addition, bounded where both are near zero."""
    least = LEAST / slab.shape[0] * max(slab.gather(np.abs(spectrum).max(initial=0.0)))
    return 1.0 / (spectrum + addition + least)
