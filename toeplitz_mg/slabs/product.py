"""The passes of a product: rows, an exchange, columns, an exchange, rows."""

from math import prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import NUMPY, Library
from toeplitz_mg.engine.embedding import split, transform_around, transform_last
from toeplitz_mg.engine.lengths import embedding_lengths
from toeplitz_mg.engine.multilevel import MultilevelProduct
from toeplitz_mg.engine.work import count_transforms, count_work
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.slabs.line import Line
from toeplitz_mg.slabs.slab import Slab


class SlabProduct:
    """Multiplication of this rank's rows by a Toeplitz matrix, or by blocks of such matrices.

    It is made in turns, so that a rank has only a few columns at a time. Arrays of other libraries
    are transformed by their library, and exchanged in the memory of the processor, which any MPI
    can read.

    Parameters
    ----------
    slab : Slab
    library : Library
    spectrum : list of lists of array or None
        The eigenvalues of the embedding for each pair of components, as in `MultilevelProduct`, at
        this rank's frequencies of the last axis. They may be NumPy arrays.
    dtype : float32 or float64
    """

    def __init__(self, slab: Slab, library: Library, spectrum: Any, dtype: DTypeLike) -> None:
        self._given, self.line = slab, Line(slab) if slab.is_line else None
        self.slab, self.library = self.line.slab if self.line else slab, library
        casts = [
            [s if s is None else library.from_numpy(NUMPY.cast_numbers(s, dtype)) for s in row]
            for row in spectrum
        ]
        self._own = MultilevelProduct(library, (len(casts), *self.slab.shape), dtype, None, casts)
        self.points = prod(self._own.lengths)  # The eigenvalues are divided by this number.

    @property
    def spectra(self) -> Any:
        """The eigenvalues for all pairs of components, as NumPy arrays."""
        own: Any = self._own.spectrum
        return [[s if s is None else self.library.to_numpy(s) for s in row] for row in own]

    @property
    def norm_bound(self) -> float:
        """An upper bound of the 2-norm, the largest of the bounds of all ranks."""
        return max(self.slab.gather(self._own.norm_bound))

    def astype(self, dtype: DTypeLike) -> "SlabProduct":
        """Return the multiplication in another precision, without any transform."""
        return SlabProduct(self._given, self.library, self.spectra, dtype)

    def apply(self, x: Any, y: Any) -> Any:
        """Multiply a vector into another, which may be the same; return the result."""
        count_work(1, float(prod(x.shape)))
        if self.line is None:
            return self._multiply(x, y)
        parts = self.library.to_numpy(x).reshape(self._own.grid_shape[0], -1)
        # The result is written into it; MPI supports only the native byte order.
        parts = parts.astype(np.result_type(parts, self._own.dtype), copy=False)
        X = np.stack([self.line.rows(part) for part in parts])
        X = self.library.to_numpy(self._multiply(self.library.from_numpy(X), X))
        return self.library.join([self.library.from_numpy(self.line.part(part)) for part in X], y)

    def _multiply(self, x: Any, y: Any) -> Any:
        slab, library, passes = self.slab, self.library, self._own.passes
        fields = (1, self._own.grid_shape[0], *slab.local)
        if slab.comm.size == 1:  # This rank has all rows of its columns.
            out = None if y is None else y.reshape(1, -1)
            return library.xp.reshape(passes.multiply(library.xp.reshape(x, (1, -1)), out), x.shape)
        Z = library.to_numpy(passes.rows_in(library.xp.reshape(x, fields)))
        rows = Z[0] if Z.flags.writeable else Z[0].copy()
        for own, turn in slab.turns_of(self._own.lengths, len(rows) * rows.itemsize):
            C = workspace((1, len(rows), *slab.shape[:-1], own.stop - own.start), rows.dtype)
            for part, columns in zip(rows, C[0], strict=True):
                slab.to_columns(part, turn, columns)
            C = library.to_numpy(passes.columns_through(library.from_numpy(C), own.start))
            for part, columns in zip(rows, C[0], strict=True):
                slab.to_rows(columns, part, turn)
        out = None if y is None else y.reshape(fields)
        result = passes.rows_out(library.from_numpy(rows[np.newaxis]), out)
        return library.xp.reshape(result, x.shape)


def embed_on_slab(A: Any) -> Array:
    """Return the eigenvalues of the embedding of a `slabs.ToeplitzOperator`.

    They are those at this rank's frequencies of the last axis.
    """
    slab, c, behind, parity = A.slab, A.c, A.behind, A.parity
    if slab.is_line:
        line, c, back = Line(slab), c.reshape(-1), A.opposite.reshape(-1)
        slab, parity = line.slab, (0, 0)
        # For a symmetric matrix the transform of the opposite lags is the conjugate.
        c, behind = line.lags(c, back), None if A.is_symmetric else line.lags(back, c)[:, ::-1]
    lengths = embedding_lengths(slab.shape)
    count_transforms(1, *(2 * n for n in slab.local))
    halves = [_transform_rows(a, parity, lengths) for a in (c, behind) if a is not None]
    mine = slab.columns(lengths[-1])
    kind = np.float64 if A.is_symmetric else np.complex128
    spectrum = np.empty((*lengths[:-1], mine.stop - mine.start), kind)
    for own, turn in slab.turns_of(lengths, np.dtype(np.complex128).itemsize):
        ahead, *other = (slab.to_columns(half, turn) for half in halves)
        back = other[0] if other else parity[0] * ahead if parity[0] else ahead.conj()
        S = transform_around(NUMPY, ahead, np.flip(back[1:], axis=0), 0, lengths[0])
        spectrum[..., own] = S.real if A.is_symmetric else S
    return spectrum


def _transform_rows(c: Array, parity: tuple[int, ...], lengths: tuple[int, ...]) -> Array:
    """Transform all axes except the first of a rank's coefficients."""
    Z = transform_last(NUMPY, c, parity[-1], lengths[-1])
    for axis in reversed(range(1, c.ndim - 1)):
        Z = transform_around(NUMPY, *split(NUMPY, Z, axis, parity[axis]), axis, lengths[axis])
    return Z
