"""Approximate inverses of the matrix of steady rolling, on slabs."""

from math import prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy import fft

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import NUMPY
from toeplitz_mg.engine.embedding import around, split
from toeplitz_mg.engine.threads import keep_bits
from toeplitz_mg.preconditioners.causal import (
    LEAST,
    ShiftedInverses,
    bound_from_zero,
    fade_rate,
    find_causal_factor,
    find_lengths,
    find_longest_lag,
    weigh_causally,
)
from toeplitz_mg.slabs.coupled import CoupledOperator
from toeplitz_mg.slabs.cuts import cuts_of
from toeplitz_mg.slabs.line import LongTransform
from toeplitz_mg.slabs.operators import ToeplitzOperator
from toeplitz_mg.slabs.product import turns_of
from toeplitz_mg.slabs.slab import Slab


def invert_shifted(K: CoupledOperator, dtype: DTypeLike, k0: float) -> ShiftedInverses:
    """Return approximate inverses of the matrix of steady rolling and additions."""
    slab, lengths = K.slab, find_lengths(K.slab.shape)
    blocks: list[Any] = [row[i] for i, row in enumerate(K.blocks)]
    spectra = [_find_spectrum(block, lengths) for block in blocks]
    return ShiftedInverses(
        FieldTransforms(slab, lengths, dtype),
        lengths,
        np.arange(slab.rows.start, slab.rows.stop),
        spectra,
        [_find_causal_factor(slab, 1.0 / s, lengths) for s in spectra],
        k0,
        vectors=slab.vectors,
        share=slab.local[0] / slab.shape[0],
    )


def _find_spectrum(A: ToeplitzOperator, lengths: tuple[int, ...]) -> Array:
    """Return this rank's eigenvalues of the circulant that has the lags of A, faded."""
    slab, exact = A.slab, FieldTransforms(A.slab, lengths, np.float64)
    kept = max(0, find_longest_lag(slab.shape[0], lengths[0]) + 1 - slab.rows.start)
    fade = np.exp(fade_rate(lengths[0]) * np.arange(slab.rows.start, slab.rows.stop))[:, None]
    ahead, back = A.c / fade, A.opposite * fade
    ahead[kept:] = back[kept:] = 0.0
    if not slab.is_line:  # Lags along the last axis are of both signs.
        ahead, back = (
            around(NUMPY, *split(NUMPY, a, 1, A.parity[1]), 1, lengths[1]) for a in (ahead, back)
        )
    if slab.comm.rank == 0:
        # The lag zero is ahead, and on a grid all lags that are zero along the first axis.
        back[0, : 1 if slab.is_line else None] = 0.0
    s, of_back = exact.forward(np.array([ahead, back]))
    s += of_back.conj()
    largest = max(slab.gather(np.abs(s).max(initial=0.0)))
    bound_from_zero(s, LEAST / slab.shape[0] * largest)
    return s


def _find_causal_factor(slab: Slab, spectrum: Array, lengths: tuple[int, ...]) -> Array:
    """Return the causal factor of eigenvalues (see `preconditioners.causal`)."""
    length = lengths[0]
    if not slab.is_line or length == 1:
        return find_causal_factor(spectrum, lengths)
    # All its lags are wanted, not those of the grid alone.
    whole = slab.alike((length, 1), cuts_of(length, slab.comm.size))
    transform = LongTransform(whole, length, length)
    cepstrum = transform.backward(np.log(spectrum))
    lags = np.arange(whole.rows.start, whole.rows.stop)
    return np.exp(transform.forward(weigh_causally(lags, length) * cepstrum))


class FieldTransforms:
    """Transforms of fields, one after the other (see `preconditioners.causal.FieldTransform`)."""

    def __init__(self, slab: Slab, lengths: tuple[int, ...], dtype: DTypeLike) -> None:
        self._local, self.dtype = slab.local, np.dtype(dtype)
        self._one: GridTransform | LongTransform = (
            LongTransform(slab, prod(slab.shape), prod(lengths), dtype)
            if slab.is_line
            else GridTransform(slab, lengths, dtype)
        )

    def forward(self, x: Array) -> Array:
        """Return the transforms of fields, whose rows may be longer than those of the grid."""
        return np.array([self._one.forward(field.reshape(-1)) for field in x])

    def backward(self, Z: Array) -> Array:
        """Return the fields of transforms, cut: `Z` is overwritten."""
        return np.array([self._one.backward(z).reshape(self._local) for z in Z])


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
