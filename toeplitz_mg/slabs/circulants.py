"""Transforms of fields for inverses of causal matrices; each rank has some of the frequencies."""

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.engine import fourier
from toeplitz_mg.engine.arrays.library import NUMPY
from toeplitz_mg.engine.embedding import split
from toeplitz_mg.engine.threads import keep_bits
from toeplitz_mg.preconditioners.causal import FieldTransform
from toeplitz_mg.slabs.operators import ToeplitzOperator
from toeplitz_mg.slabs.slab import Slab


class SlabTransform(FieldTransform):
    """Transforms of fields of two axes, distributed by rows and by frequencies of the last axis."""

    def __init__(self, slab: Slab, dtype: DTypeLike) -> None:
        super().__init__(slab.shape, dtype)
        self._slab, self.vectors, self.share = slab, slab.vectors, slab.local[0] / slab.shape[0]
        self.rows, self._local, self._rows = self.rows[slab.rows], slab.local, slab.local[0]

    def in_double(self) -> "SlabTransform":
        """Return the same transforms in double precision."""
        return SlabTransform(self._slab, np.float64)

    def halves(self, K: ToeplitzOperator) -> tuple[Array, Array]:
        """Return this rank's coefficients of the lags of both signs along the first axis."""
        ahead, back = (
            np.concatenate(split(NUMPY, half, 1, K.parity[1])[::-1], axis=1)
            for half in (K.c, K.opposite)
        )
        return ahead, back

    def _to_columns(self, Z: Array) -> Array:
        slab, points = self._slab, Z.shape[2]
        mine = slab.columns(points)
        out = np.empty((len(Z), self._length, mine.stop - mine.start), Z.dtype)
        with keep_bits(self.dtype):
            for own, turn in slab.turns_of((self._length, points), Z.itemsize):
                for z, columns in zip(Z, out, strict=True):
                    columns[:, own] = fourier.fft(slab.to_columns(z, turn), self._length, axis=0)
        return out

    def _to_rows(self, Z: Array) -> Array:
        slab, points = self._slab, self._last // 2 + 1
        out = np.empty((len(Z), self._rows, points), Z.dtype)
        with keep_bits(self.dtype):
            for own, turn in slab.turns_of((self._length, points), Z.itemsize):
                for columns, rows in zip(Z, out, strict=True):
                    slab.to_rows(fourier.ifft(columns[:, own], axis=0)[: self.grid[0]], rows, turn)
        return out
