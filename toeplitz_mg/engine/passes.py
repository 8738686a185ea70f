"""The passes of a product along several axes, arranged for a CPU cache (see `multilevel`).

Forward transforms skip lines of zeros, and inverse transforms skip lines that are cut off. They
work on panels of some frequencies of the last axis, which stay in the cache.
"""

from functools import cached_property
from math import prod
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.fourier import backward, forward
from toeplitz_mg.engine.fourstep import BLOCK_BYTES, PANEL_BYTES
from toeplitz_mg.engine.threads import TRANSFORM, share_slices
from toeplitz_mg.engine.transforms import in_batches, phase_factors
from toeplitz_mg.engine.workspace import workspace

WHOLE_BYTES = 2**22  # Largest extended field in bytes that fits the cache, so needs no panels.
NARROW = 8  # Fewest frequencies in a panel: copying shorter pieces of a line takes as long.


class PanelPasses:
    """The passes of a `multilevel.MultilevelProduct` for NumPy arrays.

    Parameters
    ----------
    grid_shape, dtype, lengths, spectrum
        As for the product.
    """

    def __init__(
        self, grid_shape: tuple[int, ...], dtype: Any, lengths: tuple[int, ...], spectrum: Any
    ) -> None:
        self._components, *grid = grid_shape
        self._grid, self.lengths, self.spectrum = tuple(grid), lengths, spectrum
        self.precision = np.dtype(dtype.char.upper())  # The dtype of the transforms.
        self._is_complex = dtype.kind == "c"

    def multiply(self, X: Array, out: Array) -> Array:
        """Multiply the rows of `X`, of shape (rows, N), into `out`."""
        in_batches(self._multiply, X, out, self._components * prod(self.lengths))
        return out

    def _multiply(self, X: Array, out: Array) -> None:
        fields = (len(X), self._components, *self._grid)
        extended = (*fields[:2], *self.lengths)
        if prod(extended) * self.precision.itemsize > WHOLE_BYTES:
            Z = self.rows_in(X.reshape(fields))
            self.rows_out(self.columns_through(Z), out.reshape(fields))
            return
        lines = self._lines(workspace(extended, self.precision))
        self._enter(X.reshape(fields), lines[-1])
        self._columns(lines, slice(None))
        self._leave(lines[-1], out.reshape(fields))

    def rows_in(self, fields: Array) -> Array:
        """Return the transforms along the last axis of fields (rows, components, n₁, ..., n)."""
        n, L = self._grid[-1], self.lengths[-1]
        x = fields.reshape(-1, n)
        Z = workspace((len(x), L), self.precision)
        height = max(1, BLOCK_BYTES // (L * Z.itemsize))

        def work(rows: slice) -> None:
            self._enter(x[rows], Z[rows])

        share_slices(work, len(x), height, TRANSFORM * Z.size)
        return Z.reshape(*fields.shape[:-1], L)

    def columns_through(self, matrix: Array, first: int = 0) -> Array:
        """Multiply frequencies of the last axis by their matrices on the other axes, in place.

        Parameters
        ----------
        matrix : ndarray of shape (rows, components, n₁, ..., frequencies)
        first : int
            The index of the first of these frequencies in the spectrum.
        """
        count = matrix.shape[-1]
        line = len(matrix) * self._components * prod(self.lengths[:-1]) * matrix.itemsize
        width = max(1, min(count, max(NARROW, PANEL_BYTES // line)))

        def work(columns: slice) -> None:
            frequencies = slice(first + columns.start, first + columns.stop)
            part = matrix[..., columns]
            extended = (*part.shape[:2], *self.lengths[:-1], part.shape[-1])
            lines = self._lines(workspace(extended, part.dtype))
            lines[-1][...] = part
            self._columns(lines, frequencies)
            part[...] = lines[-1]

        share_slices(work, count, width, TRANSFORM * matrix.size)
        return matrix

    def rows_out(self, Z: Array, fields: Array) -> Array:
        """Return `fields`, with the inverse of `rows_in` applied to `Z`."""
        n, L = self._grid[-1], self.lengths[-1]
        Z, y = Z.reshape(-1, L), fields.reshape(-1, n)
        height = max(1, BLOCK_BYTES // (L * Z.itemsize))

        def work(rows: slice) -> None:
            self._leave(Z[rows], y[rows])

        share_slices(work, len(y), height, TRANSFORM * Z.size)
        return fields

    @cached_property
    def _phases(self) -> tuple[Array, Array] | None:
        """The factors that shift the frequencies by 1/4 and back; None for a complex matrix."""
        if self._is_complex:
            return None
        w = phase_factors(self.lengths[-1], 0.25, self.precision)[: self._grid[-1]]
        return w, w.conj()

    def _enter(self, x: Array, R: Array) -> None:
        """Write the transforms of lines along the last axis, extended by zeros, to `R`."""
        n, phases = x.shape[-1], self._phases
        if phases is None:
            R[..., :n] = x
        else:
            np.multiply(x, phases[0], out=R[..., :n], casting="same_kind")
        R[..., n:] = 0.0
        forward(R)

    def _leave(self, R: Array, y: Array) -> None:
        """Write the inverse of `_enter`, applied to `R`, to `y`."""
        backward(R)
        R, phases = R[..., : y.shape[-1]], self._phases
        if phases is None:
            y[...] = R
        else:
            R *= phases[1]
            y[...] = R.real

    def _lines(self, P: Array) -> list[Array]:
        """Return views of an extended field, one for each axis.

        View k contains the lines along axis k; the axes before k are restricted to the grid.
        """
        return [P[cut] for cut in self._cuts]

    @cached_property
    def _cuts(self) -> list[tuple[slice, ...]]:
        """The indices of the views in `_lines`."""
        whole = (slice(None),) * 2
        return [(*whole, *map(slice, self._grid[:k])) for k in range(len(self._grid))]

    def _columns(self, lines: list[Array], columns: slice) -> None:
        """Multiply some frequencies of the last axis, given the views of `_lines`, in place."""
        grid = self._grid[:-1]
        for k in reversed(range(len(grid))):
            lines[k][:, :, *self._cuts[k][2:], grid[k] :] = 0.0
            forward(lines[k], 2 + k)
        self._times_spectrum(lines[0], columns)
        for k in range(len(grid)):
            backward(lines[k], 2 + k)

    def _times_spectrum(self, P: Array, columns: slice) -> None:
        if self._components == 1:
            spectrum = self.spectrum[0][0]
            P[:, 0] *= 0.0 if spectrum is None else spectrum[..., columns]
            return
        Q = workspace(P.shape, P.dtype)
        part = workspace(P[:, 0].shape, P.dtype)
        for i, row in enumerate(self.spectrum):
            terms = [(j, s) for j, s in enumerate(row) if s is not None]
            if not terms:
                Q[:, i] = 0.0
            for k, (j, spectrum) in enumerate(terms):
                np.multiply(P[:, j], spectrum[..., columns], out=part if k else Q[:, i])
                if k:
                    Q[:, i] += part
        P[...] = Q
