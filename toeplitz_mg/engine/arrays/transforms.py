"""Cosine and sine transforms for arrays of any library, via its Fourier transforms.

References
----------
J. Makhoul, A fast cosine transform in one and two dimensions, IEEE Trans. Acoust. Speech Signal
Process. 28 (1980).
"""

from math import pi, prod, sqrt
from typing import Any

import numpy as np

from toeplitz_mg.engine.embedding import LEAST, cut, phases, zeros
from toeplitz_mg.engine.work import count_transforms


def cosine_sums(library: Any, column: Any) -> Any:
    """Return f_k = Σ a_j cos(πjk/n) over all lags (see `engine.transforms`)."""
    count_transforms(1, *(m - 1 for m in column.shape))
    return along(_sum_cosines, library, column, range(column.ndim))


def _sum_cosines(library: Any, column: Any, axis: int) -> Any:
    """Return the sums of `cosine_sums` along an axis."""
    xp = library.xp
    inside = xp.flip(column[cut(axis, 1, column.shape[axis] - 1)], axis=axis)
    return xp.real(xp.fft.rfft(xp.concat([column, inside], axis=axis), axis=axis))


def along(transform: Any, library: Any, a: Any, axes: Any, s: Any = None) -> Any:
    """Return a transform of an array along some axes, in two halves if the array is large.

    Halves save memory: a transform needs several times as much as its result.
    """
    xp, given, last = library.xp, a, a.ndim - 1
    for axis in axes:
        other = last if axis != last else last - 1
        if not last or prod(a.shape) < LEAST:
            a = transform(library, a, axis)
            continue
        a, middle = xp.asarray(a, copy=True) if a is given else a, a.shape[other] // 2
        for own in (cut(other, 0, middle), cut(other, middle)):
            a = library.replace_part(a, own, transform(library, a[own], axis))
    return a


def dct(library: Any, a: Any, axis: int) -> Any:
    """Return an orthonormal DCT-II, via a real Fourier transform of the same length."""
    xp, n = library.xp, a.shape[axis]
    odd = xp.flip(a[cut(axis, 1, None, 2)], axis=axis)
    V = xp.fft.rfft(xp.concat([a[cut(axis, 0, None, 2)], odd], axis=axis), axis=axis)
    V *= _turns(library, n, V.dtype, V.ndim - 1 - axis)
    last = xp.flip(xp.imag(V[cut(axis, 1, (n + 1) // 2)]), axis=axis)
    return xp.concat([xp.real(V), -last], axis=axis)


def idct(library: Any, f: Any, axis: int) -> Any:
    """Return the inverse of `dct`."""
    xp, n = library.xp, f.shape[axis]
    last = xp.flip(f[cut(axis, n - n // 2)], axis=axis)
    back = xp.concat([zeros(library, f, axis, 1), last], axis=axis)
    V = xp.astype(back, xp.result_type(f.dtype, xp.complex64))
    V *= -1j
    V += f[cut(axis, 0, n // 2 + 1)]
    V /= _turns(library, n, V.dtype, V.ndim - 1 - axis)
    v = xp.fft.irfft(V, n=n, axis=axis)
    even, odd = v[cut(axis, 0, (n + 1) // 2)], xp.flip(v[cut(axis, (n + 1) // 2)], axis=axis)
    if n % 2:
        odd = xp.concat([odd, zeros(library, f, axis, 1)], axis=axis)
    both = xp.stack([even, odd], axis=axis + 1)
    # The length is explicit: if there are no lines, -1 would be ambiguous.
    v = xp.reshape(both, (*f.shape[:axis], 2 * even.shape[axis], *f.shape[axis + 1 :]))
    return v[cut(axis, 0, n)]


def dst(library: Any, a: Any, axis: int) -> Any:
    """Return an orthonormal DST-II."""
    return library.xp.flip(dct(library, a * _signs(library, a, axis), axis), axis=axis)


def idst(library: Any, f: Any, axis: int) -> Any:
    """Return the inverse of `dst`."""
    return idct(library, library.xp.flip(f, axis=axis), axis) * _signs(library, f, axis)


def _signs(library: Any, a: Any, axis: int) -> Any:
    """Return (-1)^j along an axis."""
    xp = library.xp
    signs = 1 - 2 * (xp.arange(a.shape[axis], device=library.device) % 2)
    return xp.reshape(xp.astype(signs, a.dtype), (-1, *[1] * (a.ndim - 1 - axis)))


def _turns(library: Any, n: int, dtype: Any, rest: int) -> Any:
    """Return exp(-iπk/2n) for k = 0 ... n/2, scaled so that the transform is orthonormal."""
    xp = library.xp
    turns = sqrt(2.0 / n) * phases(library, n // 2 + 1, pi / (2 * n), np.complex128)
    turns = xp.concat([turns[:1] * sqrt(0.5), turns[1:]])
    return xp.reshape(xp.astype(turns, dtype), (-1, *[1] * rest))


class PlainTransforms:
    """A Fourier transform and its inverse, which also takes real arrays (see `Transforms`)."""

    def __init__(self, library: Any, forward: Any, inverse: Any) -> None:
        self.library, self.forward, self._inverse = library, forward, inverse

    def __reduce__(self) -> Any:
        # Functions of some libraries cannot be pickled: take them from the unpickled library.
        name = "fourier" if self.library.fourier is self else "complex_fourier"
        return getattr, (self.library, name)

    def backward(self, a: Any, **options: Any) -> Any:
        """Return the inverse transform."""
        xp = self.library.xp
        dtype = xp.result_type(a.dtype, xp.complex64)
        return self._inverse(xp.astype(a, dtype, copy=False), **options)
