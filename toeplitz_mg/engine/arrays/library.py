"""The library of an array: NumPy or another one. Only this file chooses.

Code for arrays of any library uses the functions of `xp` that libraries have in common. Everything
else comes from a `Library`. `NUMPY` uses the engine of this package. An instance of `plain.Plain`
multiplies in passes over whole arrays, which suit a GPU.
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
    """The library of NumPy arrays, and of all that NumPy converts to arrays, such as lists."""

    name, xp, fft, device, vectors = "numpy", np, fourier, "cpu", VECTORS
    in_place = MappingProxyType({"overwrite_x": True})  # Lets `fft` overwrite its argument.
    fourier, complex_fourier = products.FOURIER, products.COMPLEX_FOURIER
    cosine, sine = products.COSINE, products.SINE
    dense, passes = products.DENSE, PanelPasses
    diagonalise = staticmethod(products.DiagonalisedProduct)
    multiply_rows, cosine_sums = staticmethod(products.multiply_rows), staticmethod(cosine_sums)

    def basis(self, like: Array, dtype: DTypeLike, most: int) -> Basis:
        """Return memory for a basis of a Krylov space, whose vectors have the shape of `like`."""
        return Basis(like.shape, dtype, most)

    def __reduce__(self) -> str:
        return "NUMPY"

    def read(self, name: str, values: Any) -> Array:
        """Return the values as an array; TypeError if they belong to another library."""
        if is_foreign(values):
            refuse_mixed(name, name_library(values), self.name)
        return refuse_masked(name, values)

    def dtype(self, array: Array) -> np.dtype[Any]:
        """Return the dtype of an array as a NumPy dtype."""
        return array.dtype

    def cast(self, array: Array, dtype: DTypeLike) -> Array:
        """Return an array in the given dtype, without a copy if it has that dtype."""
        return array.astype(dtype, copy=False)

    def cast_numbers(self, array: Array, dtype: DTypeLike) -> Array:
        """Return numbers in the precision of a dtype; real stay real, complex stay complex."""
        return np.ascontiguousarray(products.cast_numbers(array, dtype))

    def native(self, dtype: DTypeLike) -> DTypeLike:
        """Return the library's dtype for a NumPy dtype."""
        return dtype

    def require(self, what: str, dtype: DTypeLike) -> None:
        """Raise a TypeError if the library lacks the precision that `what` needs."""

    def number(self, factor: Any) -> Any:
        """Return a factor as a number by which arrays of this library can be multiplied."""
        return factor

    def keep(self, array: Array) -> Array:
        """Return the array, made read-only."""
        array.flags.writeable = False
        return array

    def to_numpy(self, array: Any) -> Array:
        """Return the array as a NumPy array in CPU memory."""
        return array

    from_numpy = to_numpy

    def multiplication(self, a: Any) -> products.ToeplitzProduct | MultilevelProduct:
        """Return the product with the matrix of some `Coefficients`; this takes a transform."""
        if a.array.ndim > 1:
            return MultilevelProduct.of(self, [[a]], a.dtype)
        column = a.column
        row = column if a.is_even else a.array[len(column) - 1 :: -1]
        return products.ToeplitzProduct.of(column, row, a.dtype)

    def pad(self, array: Array, shape: tuple[int, ...]) -> Array:
        """Return an array whose last axes are extended by zeros to a shape."""
        if array.shape[-len(shape) :] == shape:
            return array
        padded = np.zeros((*array.shape[: -len(shape)], *shape), array.dtype)
        index: Any = (..., *map(slice, array.shape[-len(shape) :]))
        padded[index] = array
        return padded

    def enlarge(self, array: Array, shape: tuple[int, ...], dtype: DTypeLike) -> Array:
        """Return an array whose last axes are extended by zeros, in memory to be overwritten."""
        padded = workspace((*array.shape[: array.ndim - len(shape)], *shape), dtype)
        if padded.shape != array.shape:
            padded[...] = 0.0
        padded[tuple(map(slice, array.shape))] = array
        return padded

    def cells(self, index: Array, size: int) -> tuple[Array, Any]:
        """Return the `cells` of a mask for `extend` and `restrict`, from flat grid indices."""
        return index, size

    def extend(self, X: Array, cells: tuple[Array, Any], out: Array) -> Array:
        """Return rows of unknowns, extended by zeros to the grid, in the precision of `out`."""
        index, size = cells
        x = X.reshape(prod(X.shape[:-1]), X.shape[-1])
        grid = workspace((len(x), size), out.dtype)

        def fill(part: slice) -> None:
            # Zero the grid up to the first unknown of the next part, then insert the unknowns.
            start = index[part.start] if part.start else 0
            stop = index[part.stop] if part.stop < len(index) else size
            grid[:, start:stop] = 0.0
            for row, to in zip(x, grid, strict=True):  # Twice as fast as all rows at once.
                to[index[part]] = row[part]

        share_rows(fill, index)
        return grid

    def restrict(self, grid: Array, cells: tuple[Array, Any], out: Array) -> Array:
        """Return the unknowns of rows on the grid, in `out`."""
        index, y = cells[0], out.reshape(prod(out.shape[:-1]), out.shape[-1])

        def fill(part: slice) -> None:
            # The indices are valid. Checking them, as "raise" does, would take four times as long.
            np.take(grid, index[part], axis=1, out=y[:, part], mode="clip")

        share_rows(fill, index)
        return out

    def replace(
        self, field: Array, cells: tuple[Array, Any], compute: Callable[[Array], Array]
    ) -> Array:
        """Return a field whose unknowns are replaced by the values computed from them."""
        index, y = cells[0], field.flatten()
        y[index] = compute(y[index])
        return y.reshape(field.shape)

    def copy(self, array: Array) -> Array:
        """Return an array in contiguous memory."""
        return np.ascontiguousarray(array)

    def real(self, array: Array) -> Array:
        """Return the real part of an array, which is the array itself if it is real."""
        return array.real

    def invert(self, array: Array) -> Array:
        """Return the reciprocals of an array, in place if possible."""
        return np.reciprocal(array, out=array)

    def arange(self, n: int) -> Array:
        """Return 0, 1, ... n - 1, in double precision."""
        return np.arange(float(n))

    def conj(self, array: Array) -> Array:
        """Return the complex conjugate of an array."""
        return array.conj()

    def vectors_of(self, gather: Gather) -> Vectors:
        """Return the operations with vectors distributed over several processes."""
        return Vectors(gather)

    def each(self, multiply: Any, X: Array, out: Array) -> Array:
        """Return `out`, after calling ``multiply(row, out_row)`` for each row of X."""
        rows = (prod(X.shape[:-1]), X.shape[-1])
        for x, y in zip(X.reshape(rows), out.reshape(rows), strict=True):
            multiply(x, y)
        return out

    def join(self, parts: list[Array], out: Array | None) -> Array:
        """Return arrays joined along their last axis."""
        return np.concatenate(parts, axis=-1, out=out, casting="same_kind")

    def allocate(self, X: Array, dtype: DTypeLike) -> Array:
        """Return memory for the product of the rows X with a matrix of this dtype."""
        return np.empty(X.shape, np.result_type(X, dtype))


NUMPY = NumPy()


def library_of(values: Any) -> "Library":
    """Return the library of an array, or `NUMPY` if the values are no array."""
    if not is_foreign(values):
        return NUMPY
    from toeplitz_mg.engine.arrays.plain import Plain  # Requires array-api-compat.

    return Plain.of(values)
