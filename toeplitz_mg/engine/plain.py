"""The engine for arrays of any library of the array API standard, as on a GPU.

It has plain passes over whole arrays, in the place of panels for a processor's cache. The products
are those of `products` and `multilevel`: the last axis is transformed at the frequencies k + 1/4,
without an extension by zeros; the others are extended, for a part of the frequencies of the last
one at a time, so that little more than the vectors is ever held. No array is written to, but by
``y += x``, as those of JAX cannot be changed, and no number of one is looked at in a product.
"""

from collections.abc import Callable
from functools import lru_cache, partial
from math import hypot, inf, pi, prod, sqrt
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.lengths import embedding_lengths
from toeplitz_mg.engine.library import cut, library_of, refuse_mixed
from toeplitz_mg.engine.products import Transforms
from toeplitz_mg.engine.vectors import Gather
from toeplitz_mg.engine.work import axes_of, count_transforms, count_work

try:
    import array_api_compat as compat
except ImportError as error:
    raise ImportError(
        "arrays of other libraries than NumPy need array-api-compat: install toeplitz-mg[arrays]"
    ) from error

PARTS = 8  # Parts of the frequencies: the memory for zeros is that share of the whole.
LEAST = 2**20  # Numbers of a part, with its zeros: a GPU would wait for the orders of smaller ones.


class Plain:
    """The library of some arrays, on one device (see `library.NumPy`)."""

    def __init__(self, xp: Any, device: Any) -> None:
        self.xp, self.device = xp, device
        self.name = xp.__name__.removeprefix("array_api_compat.")
        self.vectors = PlainVectors(self)
        self.fourier = Transforms(xp.fft.rfftn, self._of_complex(xp.fft.irfftn))
        self.complex_fourier = Transforms(xp.fft.fftn, self._of_complex(xp.fft.ifftn))
        self.cosine = Transforms(*(partial(self._each, f) for f in (dct, idct)))
        self.sine = Transforms(*(partial(self._each, f) for f in (dst, idst)))
        self.diagonalise = partial(PlainDiagonalised, self)

    @classmethod
    def of(cls, array: Any) -> "Plain":
        """Return the library of an array."""
        return _library(compat.array_namespace(array), compat.device(array))

    def __reduce__(self) -> Any:
        # A module cannot be pickled, and a device need not be there again; arrays know both.
        return library_of, (self.xp.zeros(1, device=self.device),)

    def read(self, name: str, values: Any) -> Array:
        """Return an array of this library, or say whose it is."""
        if not compat.is_array_api_obj(values) or compat.array_namespace(values) is not self.xp:
            refuse_mixed(name, library_of(values), self)
        return values

    def dtype(self, array: Any) -> np.dtype[Any]:
        """Return NumPy's dtype for that of an array."""
        return np.dtype(str(array.dtype).rpartition(".")[2])

    def cast(self, array: Any, dtype: DTypeLike) -> Any:
        """Return an array in the precision of one of NumPy's dtypes, itself where it has that."""
        return self.xp.astype(array, self.native(dtype), copy=False)

    def native(self, dtype: DTypeLike) -> Any:
        """Return a dtype of the library: that, or one of less precision where it has no other."""
        dtypes = self.xp.__array_namespace_info__().dtypes()
        name = np.dtype(dtype).name
        less = {"float64": "float32", "complex128": "complex64"}
        return dtypes[name if name in dtypes else less[name]]

    def conj(self, array: Any) -> Any:
        """Return the complex conjugate of numbers, themselves where they are real."""
        return self.xp.conj(array) if self.dtype(array).kind == "c" else array

    def real(self, array: Any) -> Any:
        """Return the real part of numbers, themselves where they are real."""
        return self.xp.real(array) if self.dtype(array).kind == "c" else array

    def invert(self, array: Any) -> Any:
        """Return the inverses of numbers."""
        return 1.0 / array

    def arange(self, n: int) -> Any:
        """Return 0, 1, ... n - 1, in double precision."""
        return self.xp.arange(n, dtype=self.native(np.float64), device=self.device)

    def sum(self, array: Any) -> float:
        """Return the sum of real numbers, in double precision."""
        return float(self.xp.sum(array, dtype=self.native(np.float64)))

    def sizes(self, array: Any) -> Any:
        """Return the sizes of numbers; of a complex one the sum of those of its parts."""
        if self.dtype(array).kind != "c":
            return self.xp.abs(array)
        return self.xp.abs(self.xp.real(array)) + self.xp.abs(self.xp.imag(array))

    def number(self, factor: Any) -> Any:
        """Return a number that an array may be multiplied with: Python's."""
        return np.asarray(factor).item()

    def keep(self, array: Any) -> Any:
        """Return an array that nobody is to change."""
        return array

    def to_numpy(self, array: Any) -> Array:
        """Return an array of NumPy's, in the memory of the processor."""
        if compat.is_jax_array(array):
            return np.asarray(array)
        on_host = compat.is_cupy_array(array) or compat.is_torch_array(array)
        return np.from_dlpack(compat.to_device(array, "cpu") if on_host else array)

    def from_numpy(self, array: Array) -> Any:
        """Return NumPy's array as one of this library, on its device."""
        return self.xp.asarray(array, dtype=self.native(array.dtype), device=self.device)

    def multiplication(self, a: Any) -> "PlainProduct":
        """Make the product with the matrix of some `Coefficients`, which takes a transform."""
        return PlainProduct.of(self, [[a]], a.dtype)

    def coupled(self, blocks: Any, dtype: DTypeLike, known: Any) -> "PlainProduct":
        """Make the product with a matrix of such blocks."""
        return PlainProduct.of(self, blocks, np.dtype(dtype))

    def pad(self, array: Any, shape: tuple[int, ...]) -> Any:
        """Extend an array by zeros behind its last axes."""
        for axis, length in enumerate(shape, array.ndim - len(shape)):
            if array.shape[axis] < length:
                zeros = self.zeros(array, axis, length - array.shape[axis])
                array = self.xp.concat([array, zeros], axis=axis)
        return array

    def zeros(self, array: Any, axis: int, length: int) -> Any:
        """Return zeros as an array has, of another length along an axis."""
        shape = [*array.shape[:axis], length, *array.shape[axis + 1 :]]
        return self.xp.zeros(tuple(shape), dtype=array.dtype, device=self.device)

    def phases(self, length: int, angle: float, dtype: DTypeLike) -> Any:
        """Return exp(-i k angle), k = 0 ... length - 1."""
        k = self.cast(self.arange(length), np.complex128)
        return self.cast(self.xp.exp(k * (-1j * angle)), dtype)

    def cells(self, index: Array, size: int) -> tuple[Any, Any]:
        """Prepare the unknowns of a mask, by their positions among the points of the grid."""
        small = np.dtype(np.int32 if size < 2**31 else np.int64)
        lookup = np.full(size, len(index), small)  # What is no unknown finds a zero at the end.
        lookup[index] = np.arange(len(index))
        return self.from_numpy(index.astype(small)), self.from_numpy(lookup)

    def extend(self, X: Any, cells: tuple[Any, Any], out: Any) -> Any:
        """Extend rows of unknowns to the grid, by zeros, in the precision of `out`."""
        rows = self.xp.astype(self.xp.reshape(X, (-1, X.shape[-1])), out.dtype, copy=False)
        return self.xp.take(self.pad(rows, (rows.shape[1] + 1,)), cells[1], axis=-1)

    def restrict(self, grid: Any, cells: tuple[Any, Any], out: Any) -> Any:
        """Return the unknowns of rows on the grid, of the shape and the dtype of `out`."""
        return self.xp.reshape(self.xp.take(grid, cells[0], axis=-1), out.shape)

    def copy(self, array: Any) -> Any:
        """Return an array as it is: it need not be in one piece."""
        return array

    def vectors_of(self, gather: Gather) -> "PlainVectors":
        """Return the operations with vectors of which each process has a part."""
        return PlainVectors(self, gather)

    def each(self, multiply: Any, X: Any, out: Any) -> Any:
        """Return the product with each row of X, of the dtype of `out`."""
        rows = self.xp.reshape(X, (prod(X.shape[:-1]), X.shape[-1]))
        Y = self.xp.stack([multiply(rows[k, ...], None) for k in range(rows.shape[0])])
        return self.xp.astype(self.xp.reshape(Y, X.shape), out.dtype, copy=False)

    def join(self, parts: list[Any], out: Any) -> Any:
        """Put the columns of some arrays side by side."""
        return self.xp.concat(parts, axis=-1)

    def allocate(self, X: Any, dtype: DTypeLike) -> Any:
        """Return what has the shape and the dtype of the product with a matrix of a dtype."""
        return self.cast(X, np.result_type(self.dtype(X), dtype))

    def _of_complex(self, transform: Any) -> Any:
        """Return a transform of complex numbers that takes real ones too."""
        complex64 = self.xp.complex64
        return lambda a, **options: transform(
            self.xp.astype(a, self.xp.result_type(a.dtype, complex64), copy=False), **options
        )

    def cosine_sums(self, column: Any) -> Any:
        """Return f_k = Σ a_j cos(πjk/n) over all lags (see `transforms.cosine_sums`)."""
        count_transforms(1, *(m - 1 for m in column.shape))
        for axis, m in enumerate(column.shape):
            inside = self.xp.flip(column[cut(axis, 1, m - 1)], axis=axis)
            period = self.xp.concat([column, inside], axis=axis)
            column = self.xp.real(self.xp.fft.rfft(period, axis=axis))
        return column

    def _each(self, transform: Any, a: Any, s: Any = None, axes: Any = None) -> Any:
        for axis in range(a.ndim)[slice(None) if axes is None else slice(-len(axes), None)]:
            a = transform(self, a, axis)
        return a


@lru_cache(maxsize=16)
def _library(xp: Any, device: Any) -> Plain:
    return Plain(xp, device)


class PlainProduct:
    """Multiplication by a Toeplitz matrix of any number of axes, or by blocks of such.

    Parameters
    ----------
    library : Plain
    grid_shape : tuple of int
        (components, n₁, ..., n_d).
    dtype : dtype
        NumPy's.
    spectra : sequence of sequences of list of array, or None
        For each pair of components the eigenvalues of the embedding, in parts along the last axis.
    """

    def __init__(
        self, library: Plain, grid_shape: tuple[int, ...], dtype: DTypeLike, spectra: Any
    ) -> None:
        self.library, self.grid_shape, self.dtype = library, grid_shape, np.dtype(dtype)
        self.points, self.spectra = float(prod(grid_shape)), spectra
        self.lengths = embedding_lengths(grid_shape[1:], is_complex=self.dtype.kind == "c")
        n, L, precision = grid_shape[-1], self.lengths[-1], self.dtype.char.upper()
        self._w = None if self.dtype.kind == "c" else library.phases(n, pi / (2 * L), precision)

    @classmethod
    def of(cls, library: Plain, blocks: Any, dtype: DTypeLike) -> "PlainProduct":
        """Make the product from the `Coefficients` of each pair of components, or None."""
        grid_shape = next(a.grid_shape for row in blocks for a in row if a is not None)
        spectra = [[a and _spectrum(library, a, np.dtype(dtype)) for a in row] for row in blocks]
        return cls(library, (len(blocks), *grid_shape), dtype, spectra)

    def _map(self, change: Callable[[Any], Any], dtype: DTypeLike, rows: Any) -> "PlainProduct":
        spectra = [[parts and list(map(change, parts)) for parts in row] for row in rows]
        return PlainProduct(self.library, self.grid_shape, dtype, spectra)

    def adjoint(self) -> "PlainProduct":
        """Return the multiplication by the conjugate transpose; no transform is made."""
        return self._map(self.library.conj, self.dtype, zip(*self.spectra, strict=True))

    def astype(self, dtype: DTypeLike) -> "PlainProduct":
        """Return the multiplication in another precision; no transform is made."""
        return self._map(partial(_cast, self.library, dtype=dtype), dtype, self.spectra)

    @property
    def norm_bound(self) -> float:
        """A bound of the 2-norm, by the largest eigenvalues of the blocks."""
        xp = self.library.xp
        blocks = [parts for row in self.spectra for parts in row if parts is not None]
        return hypot(*(max(float(xp.max(xp.abs(s))) for s in parts) for parts in blocks))

    def __call__(self, X: Any, out: Any = None) -> Any:
        """Multiply the rows of `X`, shape (..., N)."""
        return _multiply_rows(self, X, out)

    def multiply(self, X: Any) -> Any:
        """Multiply the rows of `X`, of shape (rows, N), in the precision of the matrix."""
        xp = self.library.xp
        Z = self.rows_in(xp.reshape(X, (-1, *self.grid_shape)))
        parts = [self.columns(Z[..., part], k) for k, part in enumerate(_parts(self.lengths))]
        del Z  # The memory is for what comes.
        Z = xp.concat(parts, axis=-1)
        del parts
        return xp.reshape(self.rows_out(Z), X.shape)

    def rows_in(self, Z: Any) -> Any:
        """Transform fields, of shape (rows, components, n₁, ...), along their last axis."""
        Z = Z if self._w is None else Z * self._w
        return self.library.xp.fft.fft(Z, n=self.lengths[-1], axis=-1)

    def columns(self, Z: Any, k: int) -> Any:
        """Multiply part k of the frequencies of the last axis."""
        xp = self.library.xp
        lengths, grid = self.lengths[:-1], self.grid_shape[1:-1]
        for axis in reversed(range(len(grid))):
            Z = xp.fft.fft(Z, n=lengths[axis], axis=2 + axis)
        rows = [[(j, parts[k]) for j, parts in enumerate(row) if parts] for row in self.spectra]
        if len(rows) == 1:
            Z *= rows[0][0][1]
        else:
            Z = xp.stack([sum(Z[:, j, ...] * s for j, s in row) for row in rows], axis=1)
        for axis, n in enumerate(grid):
            Z = xp.fft.ifft(Z, axis=2 + axis)[cut(2 + axis, 0, n)]
        # A view would keep the memory of the zeros.
        return xp.asarray(Z, copy=True) if grid else Z

    def rows_out(self, Z: Any) -> Any:
        """Return fields from their transforms along the last axis."""
        xp = self.library.xp
        Z = xp.fft.ifft(Z, axis=-1)[..., : self.grid_shape[-1]]
        if self._w is None:
            return Z
        Z *= xp.conj(self._w)
        return xp.asarray(xp.real(Z), copy=True)


class PlainDiagonalised:
    """Multiplication by a matrix that a transform diagonalises (see `DiagonalisedProduct`)."""

    def __init__(
        self,
        library: Plain,
        spectrum: Any,
        fft_shape: tuple[int, ...],
        grid_shape: tuple[int, ...],
        dtype: DTypeLike,
        transforms: Transforms,
    ) -> None:
        self.points = prod(grid_shape) / 2 ** axes_of(grid_shape)
        self.library, self.grid_shape, self.dtype = library, grid_shape, np.dtype(dtype)
        self.spectrum = _cast(library, spectrum, dtype)
        self.fft_shape, self.transforms = fft_shape, transforms
        self.is_hermitian = library.dtype(spectrum).kind != "c"

    def adjoint(self) -> "PlainDiagonalised":
        """Return the multiplication by the conjugate transpose of a circulant."""
        spectrum = self.library.conj(self.spectrum)
        shapes = self.fft_shape, self.grid_shape
        return PlainDiagonalised(self.library, spectrum, *shapes, self.dtype, self.transforms)

    def __call__(self, X: Any, out: Any = None) -> Any:
        """Multiply the rows of `X`, shape (..., N)."""
        return _multiply_rows(self, X, out)

    def multiply(self, X: Any) -> Any:
        """Multiply the rows of `X`, of shape (rows, N), in the precision of the matrix."""
        xp, axes = self.library.xp, tuple(range(1, 1 + len(self.grid_shape)))
        Z = self.library.pad(xp.reshape(X, (-1, *self.grid_shape)), self.fft_shape)
        Z = self.transforms.forward(Z, axes=axes)
        Z *= self.spectrum
        Z = self.transforms.backward(Z, s=self.fft_shape, axes=axes)
        for axis, n in enumerate(self.grid_shape):
            Z = Z[cut(1 + axis, 0, n)]
        return xp.reshape(Z, X.shape)


class PlainVectors:
    """Operations with vectors, of which each process has a part (see `vectors.Vectors`).

    The squares of the numbers of a vector neither over- nor underflow.
    """

    def __init__(self, library: Plain, gather: Gather | None = None) -> None:
        self.library, xp = library, library.xp
        self.gather = gather or (lambda number: (number,))

        def extreme(of: Any, combine: Any, empty: float) -> Callable[[Any], float]:
            return lambda x: combine(self.gather(float(of(x)) if x.size else empty))

        self.min, self.max = extreme(xp.min, min, inf), extreme(xp.max, max, -inf)
        self.peak = extreme(lambda x: xp.max(library.sizes(x)), max, 0.0)
        self.count = lambda x: int(sum(self.gather(int(xp.count_nonzero(x)))))
        self.sum: Callable[[Any], float] = lambda x: sum(self.gather(library.sum(x)))
        self.dot: Callable[[Any, Any], float] = lambda x, y: self.sum(
            library.real(library.conj(x) * y)
        )
        self.norm: Callable[[Any], float] = lambda x: sqrt(self.dot(x, x))
        # These have memory for the result as their last argument, of which they take the precision.
        self.copy = lambda x, out: xp.astype(x, out.dtype, copy=True)
        self.divide = lambda x, a, out: x / a
        self.subtract = lambda x, y, out: x - y
        self.empty = lambda x, out=None: x
        self.cast = library.cast

    def zeros(self, x: Any, dtype: DTypeLike | None = None) -> Any:
        """Return a vector of zeros as long as another, in its precision or another one."""
        native = x.dtype if dtype is None else self.library.native(dtype)
        return self.library.xp.zeros_like(x, dtype=native)

    def axpy(self, a: float, x: Any, y: Any) -> Any:
        """Return y + a x."""
        y += a * x
        return y

    def aypx(self, a: float, x: Any, y: Any) -> Any:
        """Return a y + x."""
        y *= a
        y += x
        return y


def _multiply_rows(product: Any, X: Any, out: Any) -> Any:
    """Multiply rows, as `products.multiply_rows` does; of `out` but the dtype is of interest."""
    library, xp = product.library, product.library.xp
    given = library.dtype(X)
    dtype = np.result_type(given, product.dtype) if out is None else library.dtype(out)
    if given.kind == "c" != product.dtype.kind:
        real, imag = (_multiply_rows(product, part(X), None) for part in (xp.real, xp.imag))
        return library.cast(real, dtype) + 1j * library.cast(imag, dtype)
    rows = xp.reshape(X, (-1, X.shape[-1]))
    count_work(rows.shape[0], product.points)
    Y = product.multiply(library.cast(rows, product.dtype))
    return library.cast(xp.reshape(Y, X.shape), dtype)


def _parts(lengths: tuple[int, ...]) -> list[slice]:
    """Return the parts of the frequencies of the last axis."""
    count = min(PARTS, lengths[-1], max(1, prod(lengths) // LEAST)) if len(lengths) > 1 else 1
    ends = [lengths[-1] * k // count for k in range(count + 1)]
    return list(map(slice, ends[:-1], ends[1:]))


def _spectrum(library: Plain, a: Any, dtype: np.dtype[Any]) -> list[Any]:
    """Return the eigenvalues of the embedding of some `Coefficients`, in parts."""
    xp, is_complex, last = library.xp, dtype.kind == "c", len(a.grid_shape) - 1
    lengths = embedding_lengths(a.grid_shape, is_complex=is_complex)
    count_transforms(1, *(2 * n for n in a.grid_shape))
    if is_complex:
        column = library.cast(around(library, a.array, last, lengths[-1], a.is_even), np.complex128)
    else:
        # What goes around is imaginary.
        ahead, behind = _halves(xp, a.array, last, a.is_even)
        zeros = library.zeros(behind, last, lengths[-1] - behind.shape[-1])
        column = library.cast(xp.concat([zeros, behind], axis=last), np.complex128)
        column *= 1j
        column += library.cast(library.pad(ahead, lengths[-1:]), np.float64)
        column *= library.phases(lengths[-1], pi / (2 * lengths[-1]), np.complex128)
    column = xp.fft.fft(column, axis=last)
    spectra = []
    for part in _parts(lengths):
        S = column[..., part]
        for axis, length in enumerate(lengths[:-1]):
            S = xp.fft.fft(around(library, S, axis, length, a.is_even), axis=axis)
        spectra.append(_cast(library, xp.real(S) if a.is_hermitian else S, dtype, copy=True))
    return spectra


def around(library: Plain, a: Any, axis: int, length: int, is_even: bool) -> Any:
    """Return the coefficients of the lags from 0 on, zeros, and those of the lags below 0."""
    ahead, behind = _halves(library.xp, a, axis, is_even)
    zeros = library.zeros(a, axis, length - ahead.shape[axis] - behind.shape[axis])
    return library.xp.concat([ahead, zeros, behind], axis=axis)


def _halves(xp: Any, a: Any, axis: int, is_even: bool) -> tuple[Any, Any]:
    if is_even:
        return a, xp.flip(a[cut(axis, 1)], axis=axis)
    n = a.shape[axis] // 2
    return a[cut(axis, n)], a[cut(axis, 0, n)]


def _cast(library: Plain, s: Any, dtype: DTypeLike, copy: bool = False) -> Any:
    """Return real or complex numbers in the precision of a dtype of either kind."""
    char = np.dtype(dtype).char
    native = library.native(char.upper() if library.dtype(s).kind == "c" else char.lower())
    return library.xp.astype(s, native, copy=copy)


def dct(library: Plain, a: Any, axis: int) -> Any:
    """Return an orthonormal DCT-II, by a real transform of the same length (Makhoul)."""
    xp, n = library.xp, a.shape[axis]
    odd = xp.flip(a[cut(axis, 1, None, 2)], axis=axis)
    V = xp.fft.rfft(xp.concat([a[cut(axis, 0, None, 2)], odd], axis=axis), axis=axis)
    V *= _turns(library, n, V.dtype, V.ndim - 1 - axis)
    last = xp.flip(xp.imag(V[cut(axis, 1, (n + 1) // 2)]), axis=axis)
    return xp.concat([xp.real(V), -last], axis=axis)


def idct(library: Plain, f: Any, axis: int) -> Any:
    """Return its inverse."""
    xp, n = library.xp, f.shape[axis]
    last = xp.flip(f[cut(axis, n - n // 2)], axis=axis)
    back = xp.concat([library.zeros(f, axis, 1), last], axis=axis)
    V = xp.astype(back, xp.result_type(f.dtype, xp.complex64))
    V *= -1j
    V += f[cut(axis, 0, n // 2 + 1)]
    V /= _turns(library, n, V.dtype, V.ndim - 1 - axis)
    v = xp.fft.irfft(V, n=n, axis=axis)
    even, odd = v[cut(axis, 0, (n + 1) // 2)], xp.flip(v[cut(axis, (n + 1) // 2)], axis=axis)
    if n % 2:
        odd = xp.concat([odd, library.zeros(f, axis, 1)], axis=axis)
    v = xp.reshape(
        xp.stack([even, odd], axis=axis + 1), (*f.shape[:axis], -1, *f.shape[axis + 1 :])
    )
    return v[cut(axis, 0, n)]


def dst(library: Plain, a: Any, axis: int) -> Any:
    """Return an orthonormal DST-II."""
    return library.xp.flip(dct(library, a * _signs(library, a, axis), axis), axis=axis)


def idst(library: Plain, f: Any, axis: int) -> Any:
    """Return its inverse."""
    return idct(library, library.xp.flip(f, axis=axis), axis) * _signs(library, f, axis)


def _signs(library: Plain, a: Any, axis: int) -> Any:
    """Return (-1)^j along an axis."""
    xp = library.xp
    signs = 1 - 2 * (xp.arange(a.shape[axis], device=library.device) % 2)
    return xp.reshape(xp.astype(signs, a.dtype), (-1, *[1] * (a.ndim - 1 - axis)))


def _turns(library: Plain, n: int, dtype: Any, rest: int) -> Any:
    """Return exp(-iπk/2n) for k = 0 ... n/2, times what makes the transform orthonormal."""
    xp = library.xp
    turns = sqrt(2.0 / n) * library.phases(n // 2 + 1, pi / (2 * n), np.complex128)
    turns = xp.concat([turns[:1] * sqrt(0.5), turns[1:]])
    return xp.reshape(xp.astype(turns, dtype), (-1, *[1] * rest))
