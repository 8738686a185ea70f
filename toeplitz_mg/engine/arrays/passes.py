"""The passes of a product over whole arrays of any library, which suit a GPU.

Axes other than the last are extended by zeros for one part of the frequencies of the last axis at a
time, so that memory for little more than the vectors is needed. The axis to transform is moved to
the end first; libraries would otherwise copy the array to that order and back. A product reads no
values on the host, so that it never waits for the GPU.
"""

from math import pi, prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg.engine.arrays.jax_programs import compile_as_a_whole
from toeplitz_mg.engine.embedding import parts_of, phases
from toeplitz_mg.engine.products import Transforms
from toeplitz_mg.engine.work import axes_of


class PlainPasses:
    """The passes of a `MultilevelProduct` (see `engine.passes.PanelPasses`)."""

    def __init__(
        self,
        library: Any,
        grid_shape: tuple[int, ...],
        dtype: np.dtype[Any],
        lengths: tuple[int, ...],
        spectrum: Any,
    ) -> None:
        self.library, self.grid_shape, self.lengths = library, grid_shape, lengths
        self.dtype, self._w = dtype, None
        self._moved = [[s if s is None else self._move(s) for s in row] for row in spectrum]
        if dtype.kind != "c":
            angle, precision = pi / (2 * lengths[-1]), dtype.char.upper()
            self._w = phases(library, grid_shape[-1], angle, precision)

    def _move(self, s: Any) -> Any:
        """Return eigenvalues with their axes in the order that `columns_through` needs."""
        xp = self.library.xp
        return xp.asarray(xp.moveaxis(s, 0, -1), copy=True) if len(self.lengths) > 1 else s

    @property
    def spectrum(self) -> Any:
        """The eigenvalues for each pair of components, None if they are all zero."""
        xp = self.library.xp
        return [[s if s is None else xp.moveaxis(s, -1, 0) for s in row] for row in self._moved]

    @compile_as_a_whole("_moved", "_w")
    def multiply(self, X: Any, out: Any = None) -> Any:
        """Return the products with rows of `X`, shape (rows, N), in the precision of the matrix."""
        xp = self.library.xp
        # Calls are nested, so that no name keeps the memory of intermediate arrays.
        Y = self.rows_out(self._columns(self.rows_in(xp.reshape(X, (-1, *self.grid_shape)))))
        return xp.reshape(Y, X.shape)

    def _columns(self, Z: Any) -> Any:
        """Return all frequencies multiplied by their matrices, one part after the other."""
        for part in parts_of(self.lengths[-1], prod(self.lengths)):
            columns = self.columns_through(Z[..., part], part.start)
            Z = self.library.replace_part(Z, (..., part), columns)
            del columns
        return Z

    def rows_in(self, Z: Any) -> Any:
        """Return the transforms along the last axis of fields (rows, components, n₁, ...)."""
        Z = self.library.cast(Z, self.dtype)
        Z = Z if self._w is None else Z * self._w
        return self.library.xp.fft.fft(Z, n=self.lengths[-1], axis=-1)

    def columns_through(self, Z: Any, first: int = 0) -> Any:
        """Return frequencies of the last axis multiplied by their matrices on the other axes."""
        xp, columns = self.library.xp, slice(first, first + Z.shape[-1])
        lengths, grid = self.lengths[:-1], self.grid_shape[1:-1]
        for axis in reversed(range(len(grid))):
            Z = xp.fft.fft(xp.moveaxis(Z, -1, 2), n=lengths[axis], axis=-1)
        own = (..., columns, slice(None)) if grid else (..., columns)
        rows = [[(j, s[own]) for j, s in enumerate(row) if s is not None] for row in self._moved]
        if len(rows) == 1:
            Z *= rows[0][0][1] if rows[0] else 0.0
        else:
            zero = xp.zeros_like(Z[:, 0, ...])
            Z = xp.stack([sum((Z[:, j, ...] * s for j, s in row), zero) for row in rows], axis=1)
        for n in grid:
            Z = xp.moveaxis(xp.fft.ifft(Z, axis=-1, norm="forward")[..., :n], 2, -1)
        return Z

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
        grid = grid_shape[-len(fft_shape) :]
        self._components = grid_shape[: -len(fft_shape)]  # () or (number of components,).
        self.points = prod(self._components) * prod(fft_shape) / 2 ** axes_of(grid)
        self.library, self.grid_shape, self.dtype = library, grid_shape, np.dtype(dtype)
        self.spectrum = library.cast_numbers(spectrum, dtype)
        self.fft_shape, self.transforms = fft_shape, transforms
        adjoint = library.conj(self._flipped(self.spectrum))
        self.is_hermitian = bool(library.xp.all(self.spectrum == adjoint))

    def _flipped(self, spectrum: Any) -> Any:
        """Return the spectrum with the matrices that couple components transposed."""
        return self.library.xp.moveaxis(spectrum, 0, 1) if self._components else spectrum

    def adjoint(self) -> "PlainDiagonalised":
        """Return the multiplication by the conjugate transpose; for circulants only."""
        spectrum = self.library.conj(self._flipped(self.spectrum))
        shapes = self.fft_shape, self.grid_shape
        return PlainDiagonalised(self.library, spectrum, *shapes, self.dtype, self.transforms)

    def __call__(self, X: Any, out: Any = None) -> Any:
        """Return the products with the rows of `X`, shape (..., N)."""
        return self.library.multiply_rows(self, X, out)

    @compile_as_a_whole("spectrum")
    def multiply(self, X: Any, out: Any = None) -> Any:
        """Return the products with rows of `X`, shape (rows, N), in the precision of the matrix."""
        first, last = 1 + len(self._components), 1 + len(self.grid_shape)
        xp, axes = self.library.xp, tuple(range(first, last))
        Z = self.library.pad(xp.reshape(X, (-1, *self.grid_shape)), self.fft_shape)
        Z = self.transforms.forward(Z, axes=axes)
        if self._components:
            Z = xp.sum(self.spectrum * Z[:, None, ...], axis=2)
        else:
            Z *= self.spectrum
        Z = self.transforms.backward(Z, s=self.fft_shape, axes=axes)
        index: Any = (..., *map(slice, self.grid_shape[len(self._components) :]))
        Z = Z[index]
        return xp.reshape(Z, X.shape)
