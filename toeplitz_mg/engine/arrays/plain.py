"""The engine for arrays of any library with the array API standard, for example on a GPU.

Products are passes over whole arrays (`passes`) instead of panels for a CPU cache, and cosine
transforms use Fourier transforms (`transforms`). This file implements the interface of
`library.NumPy` for such a library, and its vector operations.
"""

from collections.abc import Callable
from functools import partial
from math import inf, prod, sqrt
from operator import truediv
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays import transforms
from toeplitz_mg.engine.arrays.passes import PlainDiagonalised, PlainPasses
from toeplitz_mg.engine.embedding import zeros
from toeplitz_mg.engine.multilevel import MultilevelProduct
from toeplitz_mg.engine.products import Transforms
from toeplitz_mg.engine.vectors import Gather, largest, least
from toeplitz_mg.engine.work import count_work
from toeplitz_mg.values import name_library, refuse_mixed

try:
    import array_api_compat as compat
except ImportError as error:
    raise ImportError(
        "arrays of libraries other than NumPy need array-api-compat: install toeplitz-mg[arrays]"
    ) from error

LESS = {"float64": "float32", "complex128": "complex64"}  # Used if double precision is missing.


class Plain:
    """An array library on one device, with the interface of `library.NumPy`."""

    def __init__(self, xp: Any, device: Any) -> None:
        self.xp, self.fft, self.device = xp, xp.fft, device
        self.dense, self.in_place = 0, dict[str, Any]()  # No dense products, no `fft` in place.
        self.name = xp.__name__.removeprefix("array_api_compat.")
        self.compiles = self.name == "jax.numpy"  # Its single operations are slow to dispatch.
        self.vectors, self.vectors_of = PlainVectors(self), partial(PlainVectors, self)
        pair, pairs = transforms.PlainTransforms, (("dct", "idct"), ("dst", "idst"))
        self.fourier: Any = pair(self, xp.fft.rfftn, xp.fft.irfftn)
        self.complex_fourier: Any = pair(self, xp.fft.fftn, xp.fft.ifftn)
        self.cosine, self.sine = (
            Transforms(*(partial(transforms.along, getattr(transforms, f), self) for f in names))
            for names in pairs
        )
        self.cosine_sums, self.invert = partial(transforms.cosine_sums, self), partial(truediv, 1.0)
        self.diagonalise = partial(PlainDiagonalised, self)
        self.passes = partial(PlainPasses, self)
        self.basis = PlainBasis

    @classmethod
    def of(cls, array: Any) -> "Plain":
        """Return the library of an array."""
        xp, device = compat.array_namespace(array), compat.device(array)
        if (n := len(getattr(device, "device_set", ()))) > 1:  # JAX has distributed the array.
            raise TypeError(
                f"an array of {xp.__name__} lies on {n} devices, but must lie on one: "
                "jax.device_put(x, jax.devices()[0])"
            )
        key = xp.__name__, str(device)  # Devices of CuPy are not hashable.
        return _LIBRARIES.get(key) or _LIBRARIES.setdefault(key, cls(xp, device))

    def __reduce__(self) -> Any:
        # A module cannot be pickled, and the device may not exist later. An array restores both.
        return Plain.of, (self.xp.zeros(1, device=self.device),)

    def read(self, name: str, values: Any) -> Array:
        """Return the values; TypeError if they are not an array of this library."""
        if not compat.is_array_api_obj(values) or compat.array_namespace(values) is not self.xp:
            refuse_mixed(name, name_library(values), self.name)
        return values

    def dtype(self, array: Any) -> np.dtype[Any]:
        """Return the dtype of an array as a NumPy dtype."""
        return np.dtype(str(array.dtype).rpartition(".")[2])

    def cast(self, array: Any, dtype: DTypeLike) -> Any:
        """Return an array in the given dtype, without a copy if it has that dtype."""
        return self.xp.astype(array, self.native(dtype), copy=False)

    def cast_numbers(self, array: Any, dtype: DTypeLike) -> Any:
        """Return a copy in the precision of a dtype; real stay real, complex stay complex."""
        char = np.dtype(dtype).char
        native = self.native(char.upper() if self.dtype(array).kind == "c" else char.lower())
        return self.xp.astype(array, native, copy=True)

    def native(self, dtype: DTypeLike) -> Any:
        """Return the library's dtype for a NumPy dtype, or a less precise one if it is missing."""
        dtypes, name = self.xp.__array_namespace_info__().dtypes(), np.dtype(dtype).name
        return dtypes[name if name in dtypes else LESS[name]]

    def require(self, what: str, dtype: DTypeLike) -> None:
        """Raise a TypeError if the library lacks the precision that `what` needs."""
        wanted = np.dtype(dtype).name
        if wanted not in self.xp.__array_namespace_info__().dtypes():
            raise TypeError(
                f"{what} needs {wanted}, but {self.name} has no double precision here: in JAX, "
                'enable it by jax.config.update("jax_enable_x64", True)'
            )

    def conj(self, array: Any) -> Any:
        """Return the complex conjugate of an array, which is the array itself if it is real."""
        return self.xp.conj(array) if self.dtype(array).kind == "c" else array

    def real(self, array: Any) -> Any:
        """Return the real part of an array, which is the array itself if it is real."""
        return self.xp.real(array) if self.dtype(array).kind == "c" else array

    def arange(self, n: int) -> Any:
        """Return 0, 1, ... n - 1, in double precision."""
        return self.xp.arange(n, dtype=self.native(np.float64), device=self.device)

    def sum(self, array: Any) -> float:
        """Return the sum of real numbers, in double precision."""
        return float(self.xp.sum(array, dtype=self.native(np.float64)))

    def sizes(self, array: Any) -> Any:
        """Return absolute values; for complex numbers |Re| + |Im|."""
        if self.dtype(array).kind == "c":
            return self.sizes(self.xp.real(array)) + self.sizes(self.xp.imag(array))
        return self.xp.abs(array)

    def replace_part(self, array: Any, index: Any, values: Any) -> Any:
        """Return an array with some entries replaced, in place unless arrays are immutable."""
        if compat.is_jax_array(array):
            return array.at[index].set(values)
        array[index] = values
        return array

    def number(self, factor: Any) -> Any:
        """Return a factor as a Python number, by which arrays of any library can be multiplied."""
        return np.asarray(factor).item()

    def keep(self, array: Any) -> Any:
        """Return the array itself: it is not changed and need not be contiguous."""
        return array

    copy = keep

    def to_numpy(self, array: Any) -> Array:
        """Return the array as a NumPy array in CPU memory."""
        if compat.is_jax_array(array):
            return np.asarray(array)
        on_host = compat.is_cupy_array(array) or compat.is_torch_array(array)
        return np.from_dlpack(compat.to_device(array, "cpu") if on_host else array)

    def from_numpy(self, array: Array) -> Any:
        """Return a NumPy array as an array of this library, on its device."""
        array = array if array.flags.writeable else array.copy()  # torch warns if read-only.
        return self.xp.asarray(array, dtype=self.native(array.dtype), device=self.device)

    def multiplication(self, a: Any) -> MultilevelProduct:
        """Return the product with the matrix of some `Coefficients`; this takes a transform."""
        return MultilevelProduct.of(self, [[a]], a.dtype)

    def multiply_rows(self, product: Any, X: Any, out: Any = None) -> Any:
        """Return the products with rows (see `products.multiply_rows`), in the dtype of `out`."""
        xp, given = self.xp, self.dtype(X)
        dtype = np.result_type(given, product.dtype) if out is None else self.dtype(out)
        if given.kind == "c" != product.dtype.kind:
            real, imag = (self.multiply_rows(product, part(X)) for part in (xp.real, xp.imag))
            return self.cast(real, dtype) + 1j * self.cast(imag, dtype)
        rows = xp.reshape(X, (-1, X.shape[-1]))
        count_work(rows.shape[0], product.points)
        if product.dtype.char not in "fF" or given.char not in "dD" or not rows.shape[0]:
            Y = product.multiply(self.cast(rows, product.dtype), None)
            return self.cast(xp.reshape(Y, X.shape), dtype)
        # Scale rows, as single precision has a smaller range than double precision.
        peaks = xp.max(self.sizes(rows), axis=1, keepdims=True)
        peaks = xp.where((peaks > 0.0) & (peaks < inf), peaks, xp.ones_like(peaks))
        Y = product.multiply(self.cast(rows / peaks, product.dtype), None)
        return self.cast(xp.reshape(self.cast(Y, dtype) * peaks, X.shape), dtype)

    def pad(self, array: Any, shape: tuple[int, ...]) -> Any:
        """Return an array whose last axes are extended by zeros to a shape."""
        for axis, length in enumerate(shape, array.ndim - len(shape)):
            if array.shape[axis] < length:
                behind = zeros(self, array, axis, length - array.shape[axis])
                array = self.xp.concat([array, behind], axis=axis)
        return array

    def enlarge(self, array: Any, shape: tuple[int, ...], dtype: DTypeLike) -> Any:
        """Return an array whose last axes are extended by zeros, in another precision."""
        return self.pad(self.cast(array, dtype), shape)

    def cells(self, index: Array, size: int) -> tuple[Any, Any]:
        """Return the `cells` of a mask for `extend` and `restrict`, from flat grid indices."""
        small = np.dtype(np.int32 if size < 2**31 else np.int64)
        lookup = np.full(size, len(index), small)  # Other points look up a zero at the end.
        lookup[index] = np.arange(len(index))
        return self.from_numpy(index.astype(small)), self.from_numpy(lookup)

    def extend(self, X: Any, cells: tuple[Any, Any], out: Any) -> Any:
        """Return rows of unknowns, extended by zeros to the grid, in the precision of `out`."""
        rows = self.xp.reshape(X, (prod(X.shape[:-1]), X.shape[-1]))
        rows = self.pad(self.xp.astype(rows, out.dtype, copy=False), (rows.shape[1] + 1,))
        return self.xp.take(rows, cells[1], axis=-1)

    def restrict(self, grid: Any, cells: tuple[Any, Any], out: Any) -> Any:
        """Return the unknowns of rows on the grid, in the shape of `out`."""
        return self.xp.reshape(self.xp.take(grid, cells[0], axis=-1), out.shape)

    def replace(self, field: Any, cells: tuple[Any, Any], compute: Callable[[Any], Any]) -> Any:
        """Return a field whose unknowns are replaced by the values computed from them."""
        xp, (index, lookup), n = self.xp, cells, cells[0].shape[0]
        x = xp.reshape(field, (-1,))
        y = xp.take(self.pad(compute(xp.take(x, index)), (n + 1,)), lookup)
        return xp.reshape(xp.where(lookup < n, y, x), field.shape)

    def each(self, multiply: Any, X: Any, out: Any) -> Any:
        """Return the products with each row of X, in the dtype of `out`."""
        rows = self.xp.reshape(X, (prod(X.shape[:-1]), X.shape[-1]))
        Y = self.xp.stack([multiply(rows[k, ...], None) for k in range(rows.shape[0])])
        return self.xp.astype(self.xp.reshape(Y, X.shape), out.dtype, copy=False)

    def join(self, parts: list[Any], out: Any) -> Any:
        """Return arrays joined along their last axis."""
        return self.xp.concat(parts, axis=-1)

    def allocate(self, X: Any, dtype: DTypeLike) -> Any:
        """Return an array with the shape and dtype of the product of X with a matrix."""
        return self.cast(X, np.result_type(self.dtype(X), dtype))


_LIBRARIES: dict[tuple[str, str], Plain] = {}


class PlainVectors:
    """Operations with vectors, which may be distributed over processes (see `engine.vectors`).

    Squares of the entries of a vector must neither overflow nor underflow.
    """

    cuts_fields = False  # Some libraries compile anew for each array size.

    def __init__(self, library: Plain, gather: Gather | None = None) -> None:
        self.library, self.xp, xp = library, library.xp, library.xp
        self.gather = gather or (lambda number: (number,))

        def extreme(of: Any, combine: Any, empty: float) -> Callable[[Any], float]:
            return lambda x: combine(self.gather(float(of(x)) if x.size else empty))

        self.min, self.max = extreme(xp.min, least, inf), extreme(xp.max, largest, -inf)
        self.peak = extreme(lambda x: xp.max(library.sizes(x)), largest, 0.0)
        self.count = lambda x: int(sum(self.gather(int(xp.count_nonzero(x)))))
        self.sum: Callable[[Any], float] = lambda x: sum(self.gather(library.sum(x)))
        self.dot: Any = lambda x, y: self.sum(library.real(library.conj(x) * y))
        self.norm: Callable[[Any], float] = lambda x: sqrt(self.dot(x, x))
        # These ignore the memory in their last argument; `copy` takes its dtype from there.
        self.copy = lambda x, out: xp.astype(x, out.dtype, copy=True)
        self.divide = lambda x, a, out: x / a
        self.subtract = lambda x, y, out: x - y
        self.empty = lambda x, out=None: x
        self.cast, self.reshape = library.cast, xp.reshape
        self.elementwise = lambda function, *fields, out=None: function(*fields)

    def zeros(self, x: Any, dtype: DTypeLike | None = None) -> Any:
        """Return zeros in the shape of x and, by default, in its dtype."""
        return self.xp.zeros_like(x, dtype=x.dtype if dtype is None else self.library.native(dtype))

    def axpy(self, a: float, x: Any, y: Any) -> Any:
        """Return y + a x."""
        y += a * x
        return y

    def aypx(self, a: float, x: Any, y: Any) -> Any:
        """Return a y + x."""
        y *= a
        y += x
        return y


class PlainBasis:
    """The vectors of a basis (see `engine.krylov_space.Basis`)."""

    def __init__(self, like: Any, dtype: DTypeLike, most: int) -> None:
        self.library = Plain.of(like)
        self.norm, self.most = self.library.vectors.norm, most
        self.vectors: list[Any] = []
        self._zero = self.library.xp.zeros_like(like, dtype=self.library.native(dtype))
        self.dtype = self.library.dtype(self._zero)

    def memory(self, k: int) -> Any:
        """Return an array with the shape and dtype of a product."""
        return self._zero

    def take(self, k: int, w: Any) -> Any:
        """Return w in the precision of the basis."""
        return self.library.cast(w, self.dtype)

    def put(self, k: int, w: Any, size: float) -> None:
        """Store w / size as vector k; zeros if the size is infinite."""
        self.vectors[k:] = [self._zero if size == inf else w / size]

    def dots(self, k: int, w: Any) -> Array:
        """Return the inner products of the first k vectors with w, in one transfer to the host."""
        xp, conj = self.library.xp, self.library.conj
        double = np.result_type(self.dtype, np.float64)
        native = self.library.native(double)
        sums = xp.stack([xp.sum(conj(v) * w, dtype=native) for v in self.vectors[:k]])
        return self.library.to_numpy(sums).astype(double)

    def add(self, weights: Array, w: Any) -> Any:
        """Return w plus the combination of the first vectors with these weights."""
        for a, v in zip(weights.tolist(), self.vectors, strict=False):
            w = w + a * v
        return w

    def zeros(self) -> Any:
        """Return a vector of zeros."""
        return self._zero
