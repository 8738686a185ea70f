"""The passes of a product over whole arrays of any library, as a GPU wants them (see `multilevel`).

All axes but the last are extended by zeros for a part of the frequencies of the last one at a time,
so that little more than the vectors is ever held. No array is written to, but by ``y += x``, as
those of JAX cannot be changed, and no number of one is looked at in a product.
"""

from math import pi, prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg.engine.embedding import cut, parts_of, phases
from toeplitz_mg.engine.products import Transforms
from toeplitz_mg.engine.work import axes_of


class PlainPasses:
    """The passes of a `multilevel.MultilevelProduct` (see `passes.PanelPasses`)."""

    def __init__(
        self,
        library: Any,
        grid_shape: tuple[int, ...],
        dtype: np.dtype[Any],
        lengths: tuple[int, ...],
        spectrum: Any,
    ) -> None:
        self.library, self.grid_shape, self.lengths = library, grid_shape, lengths
        self.spectrum, self.dtype, self._w = spectrum, dtype, None
        if dtype.kind != "c":
            angle, precision = pi / (2 * lengths[-1]), dtype.char.upper()
            self._w = phases(library, grid_shape[-1], angle, precision)

    def multiply(self, X: Any, out: Any = None) -> Any:
        """Multiply the rows of `X`, of shape (rows, N), in the precision of the matrix."""
        xp = self.library.xp
        Z = self.rows_in(xp.reshape(X, (-1, *self.grid_shape)))
        parts = [self.columns_through(Z[..., p], p.start) for p in parts_of(self.lengths)]
        del Z  # The memory is for what comes.
        Z = xp.concat(parts, axis=-1)
        del parts
        return xp.reshape(self.rows_out(Z), X.shape)

    def rows_in(self, Z: Any) -> Any:
        """Transform fields, of shape (rows, components, n₁, ...), along their last axis."""
        Z = self.library.cast(Z, self.dtype)
        Z = Z if self._w is None else Z * self._w
        return self.library.xp.fft.fft(Z, n=self.lengths[-1], axis=-1)

    def columns_through(self, Z: Any, first: int = 0) -> Any:
        """Multiply frequencies of the last axis by their matrices of the others."""
        xp, columns = self.library.xp, slice(first, first + Z.shape[-1])
        lengths, grid = self.lengths[:-1], self.grid_shape[1:-1]
        for axis in reversed(range(len(grid))):
            Z = xp.fft.fft(Z, n=lengths[axis], axis=2 + axis)
        rows = [
            [(j, s[..., columns]) for j, s in enumerate(row) if s is not None]
            for row in self.spectrum
        ]
        if len(rows) == 1:
            Z *= rows[0][0][1] if rows[0] else 0.0
        else:
            zero = xp.zeros_like(Z[:, 0, ...])
            Z = xp.stack([sum((Z[:, j, ...] * s for j, s in row), zero) for row in rows], axis=1)
        for axis, n in enumerate(grid):
            Z = xp.fft.ifft(Z, axis=2 + axis, norm="forward")[cut(2 + axis, 0, n)]
        # A view would keep the memory of the zeros.
        return xp.asarray(Z, copy=True) if grid else Z

    def rows_out(self, Z: Any, out: Any = None) -> Any:
        """Return fields from their transforms along the last axis."""
        xp = self.library.xp
        Z = xp.fft.ifft(Z, axis=-1, norm="forward")[..., : self.grid_shape[-1]]
        if self._w is None:
            return Z
        Z *= xp.conj(self._w)
        return xp.asarray(xp.real(Z), copy=True)


class PlainDiagonalised:
    """Multiplication by a matrix that a transform diagonalises (see `DiagonalisedProduct`)."""

    def __init__(
        self,
        library: Any,
        spectrum: Any,
        fft_shape: tuple[int, ...],
        grid_shape: tuple[int, ...],
        dtype: DTypeLike,
        transforms: Transforms,
    ) -> None:
        self.points = prod(grid_shape) / 2 ** axes_of(grid_shape)
        self.library, self.grid_shape, self.dtype = library, grid_shape, np.dtype(dtype)
        self.spectrum = library.cast_numbers(spectrum, dtype)
        self.fft_shape, self.transforms = fft_shape, transforms
        self.is_hermitian = library.dtype(spectrum).kind != "c"

    def adjoint(self) -> "PlainDiagonalised":
        """Return the multiplication by the conjugate transpose of a circulant."""
        spectrum = self.library.conj(self.spectrum)
        shapes = self.fft_shape, self.grid_shape
        return PlainDiagonalised(self.library, spectrum, *shapes, self.dtype, self.transforms)

    def __call__(self, X: Any, out: Any = None) -> Any:
        """Multiply the rows of `X`, shape (..., N)."""
        return self.library.multiply_rows(self, X, out)

    def multiply(self, X: Any, out: Any = None) -> Any:
        """Multiply the rows of `X`, of shape (rows, N), in the precision of the matrix."""
        xp, axes = self.library.xp, tuple(range(1, 1 + len(self.grid_shape)))
        Z = self.library.pad(xp.reshape(X, (-1, *self.grid_shape)), self.fft_shape)
        Z = self.transforms.forward(Z, axes=axes)
        Z *= self.spectrum
        Z = self.transforms.backward(Z, s=self.fft_shape, axes=axes)
        for axis, n in enumerate(self.grid_shape):
            Z = Z[cut(1 + axis, 0, n)]
        return xp.reshape(Z, X.shape)
