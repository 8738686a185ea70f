"""The matrix of steady rolling, and approximate inverses of it."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import fft

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.operators import CoupledOperator, ToeplitzOperator

WRAPPED = 0.03  # What goes around a circulant comes back so many times as large.
LEAST = 0.01  # Addition where nothing slides, over the largest of the symbol: bounds the inverse.


def subtract_operators(A: Any, S: Any) -> Any:
    """Return A - S, of Toeplitz operators or coupled ones; None is zero, as in their blocks."""
    if S is None:
        return A
    if isinstance(S, CoupledOperator):
        pairs = (zip(*rows, strict=True) for rows in zip(A.blocks, S.blocks, strict=True))
        return CoupledOperator([[subtract_operators(a, s) for a, s in row] for row in pairs])
    # On a single row of elements S couples the components, and A does not.
    return ToeplitzOperator.from_lags(-S.lags if A is None else A.lags - S.lags)


class ShiftedInverses:
    """Approximate inverses of K + ν, of the matrix of steady rolling and additions ν.

    Their fields are added with weights that depend on the place: where an element slides, what is
    to be inverted is K + λ with a λ of its own.

    Rolling is known from the leading edge backwards, so that an inverse that is periodic would have
    its ends disturb each other: what is constant along the rolling direction, where K̂ is zero, most
    of all. So the vectors are multiplied by an exponential, K by the same from both sides, and the
    circulant that embeds it is inverted: what goes around comes back `WRAPPED` times as large.

    Parameters
    ----------
    K : ToeplitzOperator or CoupledOperator
        The components of a coupled one are inverted each by itself: the coupling is weak, and
        inverted too, it saves no iteration.
    shifts : ndarray
        The additions ν.
    dtype : float32 or float64
    """

    def __init__(self, K: Any, shifts: Array, dtype: np.dtype[Any]) -> None:
        is_coupled = isinstance(K, CoupledOperator)
        blocks = [K.component(i) for i in range(len(K.blocks))] if is_coupled else [K]
        grid: tuple[int, ...] = blocks[0].grid_shape
        self.dtype, self._lengths = dtype, tuple(fft.next_fast_len(2 * n - 1) for n in grid)
        n = grid[0]
        rate, axes = fade_rate(self._lengths[0]), (1,) * (len(grid) - 1)
        self._fade = np.exp(rate * np.arange(n)).astype(dtype).reshape(-1, *axes)
        lags = np.exp(-rate * np.arange(1 - n, n)).reshape(-1, *axes)
        spectra = []
        for block in blocks:
            count_transforms(1, *self._lengths)
            circulant = ToeplitzOperator.from_lags(block.lags * lags).circulant(self._lengths)
            spectra.append(fft.rfftn(circulant))
        self._spectra = [
            np.stack([1.0 / (s + nu + LEAST * np.abs(s).max()) for s in spectra]).astype(
                np.result_type(dtype, np.complex64)
            )
            for nu in shifts
        ]

    def __call__(self, r: Array, weights: Sequence[Array]) -> Array:
        """Return the sum of the inverses of a field, (components, ...), each with its weights."""
        *columns, last = self._lengths
        *rows, n = r.shape[1:]
        count_transforms((1 + len(weights)) * len(r), *self._lengths)
        R = fft.rfft(r.astype(self.dtype, copy=False) / self._fade, last)
        if columns:
            R = fft.fft(R, columns[0], axis=1, overwrite_x=True)
        total = np.zeros(r.shape, self.dtype)
        for spectrum, weight in zip(self._spectra, weights, strict=True):
            Y = R * spectrum
            if columns:
                Y = fft.ifft(Y, axis=1, overwrite_x=True)[:, : rows[0]]
            total += weight * fft.irfft(Y, last)[..., :n]
        return total * self._fade


def fade_rate(length: int) -> float:
    """Return the rate, for an element, of the exponential that fades what goes around."""
    return float(np.log(WRAPPED) / length)
