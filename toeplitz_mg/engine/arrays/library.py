"""Whose arrays are multiplied: NumPy's, or those of another library. It is chosen here alone.

What is written for arrays of any library takes its functions from `xp`, and what libraries do not
have in common from a `Library`: `NUMPY`, which has the engine of this package, or one of
`plain.Plain`, whose products are plain passes over whole arrays, as a GPU wants them.
"""

from collections.abc import Callable
from math import prod
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.engine import fourier, products
from toeplitz_mg.engine.krylov_space import Basis
from toeplitz_mg.engine.multilevel import MultilevelProduct
from toeplitz_mg.engine.passes import PanelPasses
from toeplitz_mg.engine.threads import share_rows
from toeplitz_mg.engine.transforms import cosine_sums
from toeplitz_mg.engine.vectors import VECTORS, Gather, Vectors
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.values import is_foreign, name_library, refuse_masked, refuse_mixed

if TYPE_CHECKING:
    from toeplitz_mg.engine.arrays.plain import Plain

Library: TypeAlias = "NumPy | Plain"


class NumPy:
    """The library of NumPy's arrays, and of all that NumPy makes arrays of, as lists."""

    name, xp, fft, device, vectors = "numpy", np, fourier, "cpu", VECTORS
    in_place = MappingProxyType({"overwrite_x": True})  # It lets `fft` use an array's memory.
    fourier, complex_fourier = products.FOURIER, products.COMPLEX_FOURIER
    cosine, sine = products.COSINE, products.SINE
    dense, passes = products.DENSE, PanelPasses
    diagonalise = staticmethod(products.DiagonalisedProduct)
    multiply_rows, cosine_sums = staticmethod(products.multiply_rows), staticmethod(cosine_sums)

    def basis(self, like: Array, dtype: DTypeLike, most: int) -> Basis:
        """Return memory for the vectors of a Krylov space, which are as another."""
        return Basis(like.shape, dtype, most)

    def __reduce__(self) -> str:
        return "NUMPY"

    def read(self, name: str, values: Any) -> Array:
        """Return an array of this library, or say whose it is."""
        if is_foreign(values):
            refuse_mixed(name, name_library(values), self.name)
        return refuse_masked(name, values)

    def dtype(self, array: Array) -> np.dtype[Any]:
        """Return NumPy's dtype for that of an array."""
        return array.dtype

    def cast(self, array: Array, dtype: DTypeLike) -> Array:
        """Return an array in the precision of one of NumPy's dtypes, itself where it has that."""
        return array.astype(dtype, copy=False)

    def cast_numbers(self, array: Array, dtype: DTypeLike) -> Array:
        """Return real or complex numbers in the precision of a dtype of either kind."""
        return np.ascontiguousarray(products.cast_numbers(array, dtype))

    def native(self, dtype: DTypeLike) -> DTypeLike:
        """Return the dtype of the library for one of NumPy's."""
        return dtype

    def require(self, what: str, dtype: DTypeLike) -> None:
        """Raise a TypeError where the library has not the precision that something needs."""

    def number(self, factor: Any) -> Any:
        """Return a number that an array may be multiplied with."""
        return factor

    def keep(self, array: Array) -> Array:
        """Return an array that nobody is to change."""
        array.flags.writeable = False
        return array

    def to_numpy(self, array: Any) -> Array:
        """Return an array of NumPy's, in the memory of the processor."""
        return array

    from_numpy = to_numpy

    def multiplication(self, a: Any) -> products.ToeplitzProduct | MultilevelProduct:
        """Make the product with the matrix of some `Coefficients`, which takes a transform."""
        if a.array.ndim > 1:
            return MultilevelProduct.of(self, [[a]], a.dtype)
        column = a.column
        row = column if a.is_even else a.array[len(column) - 1 :: -1]
        return products.ToeplitzProduct.of(column, row, a.dtype)

    def pad(self, array: Array, shape: tuple[int, ...]) -> Array:
        """Extend an array by zeros behind its last axes."""
        if array.shape[-len(shape) :] == shape:
            return array
        padded = np.zeros((*array.shape[: -len(shape)], *shape), array.dtype)
        index: Any = (..., *map(slice, array.shape[-len(shape) :]))
        padded[index] = array
        return padded

    def enlarge(self, array: Array, shape: tuple[int, ...], dtype: DTypeLike) -> Array:
        """Extend an array by zeros behind its last axes, in memory that may be overwritten."""
        padded = workspace((*array.shape[: array.ndim - len(shape)], *shape), dtype)
        if padded.shape != array.shape:
            padded[...] = 0.0
        padded[tuple(map(slice, array.shape))] = array
        return padded

    def cells(self, index: Array, size: int) -> tuple[Array, Any]:
        """Prepare the unknowns of a mask, by their positions among the points of the grid."""
        return index, size

    def extend(self, X: Array, cells: tuple[Array, Any], out: Array) -> Array:
        """Extend rows of unknowns to the grid, by zeros, in the precision of `out`."""
        index, size = cells
        x = X.reshape(prod(X.shape[:-1]), X.shape[-1])
        grid = workspace((len(x), size), out.dtype)

        def fill(part: slice) -> None:
            # The part of the grid up to the first unknown of the next one is zero but for these.
            start = index[part.start] if part.start else 0
            stop = index[part.stop] if part.stop < len(index) else size
            grid[:, start:stop] = 0.0
            for row, to in zip(x, grid, strict=True):  # Twice as fast as all at once.
                to[index[part]] = row[part]

        share_rows(fill, index)
        return grid

    def restrict(self, grid: Array, cells: tuple[Array, Any], out: Array) -> Array:
        """Return the unknowns of rows on the grid, in `out`."""
        index, y = cells[0], out.reshape(prod(out.shape[:-1]), out.shape[-1])

        def fill(part: slice) -> None:
            # The index is right: where NumPy checks it, this takes four times as long.
            np.take(grid, index[part], axis=1, out=y[:, part], mode="clip")

        share_rows(fill, index)
        return out

    def replace(
        self, field: Array, cells: tuple[Array, Any], compute: Callable[[Array], Array]
    ) -> Array:
        """Return a field with what is computed from its unknowns in their place."""
        index, y = cells[0], field.flatten()
        y[index] = compute(y[index])
        return y.reshape(field.shape)

    def copy(self, array: Array) -> Array:
        """Return an array in one piece."""
        return np.ascontiguousarray(array)

    def real(self, array: Array) -> Array:
        """Return the real part of numbers, themselves where they are real."""
        return array.real

    def invert(self, array: Array) -> Array:
        """Return the inverses of numbers, in the place of these where that can be."""
        return np.reciprocal(array, out=array)

    def arange(self, n: int) -> Array:
        """Return 0, 1, ... n - 1, in double precision."""
        return np.arange(float(n))

    def conj(self, array: Array) -> Array:
        """Return the complex conjugate of numbers."""
        return array.conj()

    def vectors_of(self, gather: Gather) -> Vectors:
        """Return the operations with vectors of which each process has a part."""
        return Vectors(gather)

    def each(self, multiply: Any, X: Array, out: Array) -> Array:
        """Multiply each row of X into `out`."""
        rows = (prod(X.shape[:-1]), X.shape[-1])
        for x, y in zip(X.reshape(rows), out.reshape(rows), strict=True):
            multiply(x, y)
        return out

    def join(self, parts: list[Array], out: Array | None) -> Array:
        """Put the columns of some arrays side by side."""
        return np.concatenate(parts, axis=-1, out=out, casting="same_kind")

    def allocate(self, X: Array, dtype: DTypeLike) -> Array:
        """Return memory for the product of rows with a matrix of a dtype."""
        return np.empty(X.shape, np.result_type(X, dtype))


NUMPY = NumPy()


def library_of(values: Any) -> "Library":
    """Return the library of an array; of all that is no array it is NumPy's."""
    if not is_foreign(values):
        return NUMPY
    from toeplitz_mg.engine.arrays.plain import Plain  # This needs array-api-compat.

    return Plain.of(values)
