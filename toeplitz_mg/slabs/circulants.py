"""Circulants that are near the matrix of steady rolling, on slabs."""

from math import prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy import fft

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.circulants import (
    LEAST,
    Sums,
    bound_from_zero,
    fade_rate,
    find_causal_factor,
    find_lengths,
    find_longest_lag,
    weigh_causally,
)
from toeplitz_mg.contact.shifted_inverses import ShiftedInverses
from toeplitz_mg.engine.arrays.library import NUMPY
from toeplitz_mg.engine.embedding import around, split
from toeplitz_mg.engine.threads import keep_bits
from toeplitz_mg.engine.work import count_work, points_of_transform
from toeplitz_mg.slabs.coupled import CoupledOperator
from toeplitz_mg.slabs.cuts import cuts_of
from toeplitz_mg.slabs.line import LongTransform
from toeplitz_mg.slabs.operators import ToeplitzOperator
from toeplitz_mg.slabs.product import turns_of
from toeplitz_mg.slabs.slab import Slab


def invert_shifted(K: CoupledOperator, dtype: DTypeLike, k0: float) -> ShiftedInverses:
    """Return approximate inverses of the matrix of steady rolling and additions."""
    circulants = Circulants(K.slab, dtype)
    blocks: list[Any] = [row[i] for i, row in enumerate(K.blocks)]
    spectra = [circulants.find_spectrum(block) for block in blocks]
    causal = [circulants.find_causal_factor(1.0 / s) for s in spectra]
    return ShiftedInverses(circulants, spectra, causal, k0, vectors=K.slab.vectors)


class Circulants:
    """Products of fields on a slab with circulants, as `contact.circulants.Circulants` has them."""

    def __init__(self, slab: Slab, dtype: DTypeLike) -> None:
        self._slab, self.dtype = slab, np.dtype(dtype)
        self.lengths = tuple(map(fft.next_fast_len, find_lengths(slab.shape)))
        rows = np.arange(slab.rows.start, slab.rows.stop)[:, None]
        self._fade = np.exp(fade_rate(self.lengths[0]) * rows)
        self._faded = self._fade.astype(dtype)
        self._transform = _transform(slab, self.lengths, dtype)
        # Of the work of a transform a rank has the share that it has of the rows.
        self._points = points_of_transform(*self.lengths) * slab.local[0] / slab.shape[0]

    def forward(self, x: Array) -> Array:
        """Return the transforms of fields, (..., components, ...)."""
        fields = (x / self._faded).reshape(-1, prod(self._slab.local))
        count_work(1, len(fields) * self._points)
        X = np.array([self._transform.forward(field) for field in fields])
        return X.reshape(*x.shape[:-2], *X.shape[1:])

    def multiply(self, sums: Sums) -> Array:
        """Return the fields, (k, components, ...), that are sums of circulants times transforms."""
        components = len(sums[0][0][0])
        count_work(1, len(sums) * components * self._points)
        fields = np.empty((len(sums), components, *self._slab.local), self.dtype)
        for field, terms in zip(fields, sums, strict=True):
            for k in range(components):
                Z = sum(X[k] * eigenvalues[k] for X, eigenvalues in terms)
                field[k] = self._transform.backward(Z).reshape(self._slab.local)
        fields *= self._faded
        return fields

    def find_spectrum(self, A: ToeplitzOperator) -> Array:
        """Return this rank's eigenvalues of the circulant that has the lags of A, faded."""
        slab, exact = self._slab, _transform(self._slab, self.lengths, np.float64)
        kept = max(0, find_longest_lag(slab.shape[0], self.lengths[0]) + 1 - slab.rows.start)
        ahead, back = A.c / self._fade, A.opposite * self._fade
        ahead[kept:] = back[kept:] = 0.0
        if not slab.is_line:  # Lags along the last axis are of both signs.
            ahead, back = (
                around(NUMPY, *split(NUMPY, a, 1, A.parity[1]), 1, self.lengths[1])
                for a in (ahead, back)
            )
        if slab.comm.rank == 0:
            # The lag zero is ahead, and on a grid all lags that are zero along the first axis.
            back[0, : 1 if slab.is_line else None] = 0.0
        s = exact.forward(ahead.reshape(-1)) + exact.forward(back.reshape(-1)).conj()
        largest = max(slab.gather(np.abs(s).max(initial=0.0)))
        bound_from_zero(s, LEAST / slab.shape[0] * largest)
        return s

    def find_causal_factor(self, spectrum: Array) -> Array:
        """Return the causal factor of eigenvalues (see `contact.circulants`)."""
        slab, (length, *_) = self._slab, self.lengths
        if not slab.is_line or length == 1:
            return find_causal_factor(spectrum, self.lengths)
        # All its lags are wanted, not those of the grid alone.
        whole = slab.alike((length, 1), cuts_of(length, slab.comm.size))
        transform = LongTransform(whole, length, length)
        cepstrum = transform.backward(np.log(spectrum))
        lags = np.arange(whole.rows.start, whole.rows.stop)
        return np.exp(transform.forward(weigh_causally(lags, length) * cepstrum))


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
