"""The transforms of the package ducc0, as a backend of `scipy.fft`: faster than SciPy's own.

``pip install 'toeplitz-mg[ducc0]'``, and then, for all products of this package and all else that
calls `scipy.fft` in this thread:

>>> import numpy as np
>>> import scipy.fft
>>> import toeplitz_mg as tmg
>>> from toeplitz_mg import ducc0_backend
>>> A = tmg.ToeplitzOperator(1.0 / (1.0 + np.arange(1000)))
>>> with scipy.fft.set_backend(ducc0_backend):
...     y = A @ np.ones(1000)
>>> bool(np.allclose(y, A @ np.ones(1000), rtol=1e-13))
True

``scipy.fft.set_global_backend(ducc0_backend)`` chooses it for the whole process. What is not here,
SciPy does.
"""

from collections.abc import Sequence
from typing import Any

import ducc0.fft
import numpy as np
from scipy.fft import get_workers, set_backend

from toeplitz_mg._typing import Array

__ua_domain__ = "numpy.scipy.fft"

# The normalisation of ducc0, forward and backward: 0 for none, 1 for 1/√N, 2 for 1/N.
_NORMS = {
    None: (0, 2),
    "backward": (0, 2),
    "ortho": (1, 1),
    "forward": (2, 0),
}


def __ua_function__(method: Any, args: Any, kwargs: Any) -> Any:
    """Call the function of this module that has the name of one of `scipy.fft`."""
    function = _FUNCTIONS.get(method.__name__)
    result = NotImplemented if function is None else function(*args, **kwargs)
    if result is NotImplemented:  # A global backend has no other behind it.
        with set_backend("scipy", only=True):
            return method(*args, **kwargs)
    return result


def _complex(forward: bool) -> Any:
    def transform(
        x: Any,
        n: int | None = None,
        axis: int = -1,
        norm: str | None = None,
        overwrite_x: bool = False,
        workers: int | None = None,
        *,
        plan: None = None,
    ) -> Array:
        x = _floating(x)
        if n is not None:
            x = _resize(x, (n,), (axis,))
        in_place = overwrite_x and x.dtype.kind == "c" and x.flags.writeable
        return ducc0.fft.c2c(
            x,
            axes=(axis % x.ndim,),
            forward=forward,
            inorm=_NORMS[norm][not forward],
            out=x if in_place else None,
            nthreads=workers or get_workers(),
        )

    return transform


def _rfftn(
    x: Any,
    s: Sequence[int] | None = None,
    axes: Sequence[int] | None = None,
    norm: str | None = None,
    overwrite_x: bool = False,
    workers: int | None = None,
    *,
    plan: None = None,
) -> Array:
    x = _floating(x)
    axes = _axes(x, s, axes)
    x = _resize(x, s, axes)
    return ducc0.fft.r2c(
        x, axes=axes, forward=True, inorm=_NORMS[norm][0], nthreads=workers or get_workers()
    )


def _irfftn(
    x: Any,
    s: Sequence[int] | None = None,
    axes: Sequence[int] | None = None,
    norm: str | None = None,
    overwrite_x: bool = False,
    workers: int | None = None,
    *,
    plan: None = None,
) -> Array:
    x = _floating(x)
    x = x.astype(np.result_type(x, np.complex64), copy=False)
    axes = _axes(x, s, axes)
    last = 2 * (x.shape[axes[-1]] - 1) if s is None else s[-1]
    if s is not None:
        x = _resize(x, (*s[:-1], s[-1] // 2 + 1), axes)
    return ducc0.fft.c2r(
        x,
        axes=axes,
        lastsize=last,
        forward=False,
        inorm=_NORMS[norm][1],
        nthreads=workers or get_workers(),
    )


def _rfft(x: Any, n: int | None = None, axis: int = -1, *args: Any, **kwargs: Any) -> Array:
    return _rfftn(x, None if n is None else (n,), (axis,), *args, **kwargs)


def _irfft(x: Any, n: int | None = None, axis: int = -1, *args: Any, **kwargs: Any) -> Array:
    return _irfftn(x, None if n is None else (n,), (axis,), *args, **kwargs)


def _trigonometric(name: str, inverse: bool) -> Any:
    kernel = getattr(ducc0.fft, name)

    def transform(
        x: Any,
        type: int = 2,
        s: Sequence[int] | None = None,
        axes: Sequence[int] | None = None,
        norm: str | None = None,
        overwrite_x: bool = False,
        workers: int | None = None,
        *,
        orthogonalize: bool | None = None,
    ) -> Any:
        x = _floating(x)
        if x.dtype.kind == "c" or orthogonalize not in (None, norm == "ortho"):
            return NotImplemented
        axes = _axes(x, s, axes)
        x = _resize(x, s, axes)
        # The inverse of type 2 is type 3, that of the others themselves.
        kind = {2: 3, 3: 2}.get(type, type) if inverse else type
        in_place = overwrite_x and x.flags.writeable
        return kernel(
            x,
            kind,
            axes=axes,
            inorm=_NORMS[norm][inverse],
            out=x if in_place else None,
            nthreads=workers or get_workers(),
        )

    return transform


def _floating(x: Any) -> Array:
    x = np.asarray(x)
    return np.asarray(x, None if x.dtype.char in "fdFD" else np.result_type(x, np.float64))


def _axes(x: Array, s: Sequence[int] | None, axes: Sequence[int] | None) -> tuple[int, ...]:
    if axes is None:
        axes = range(x.ndim) if s is None else range(x.ndim - len(s), x.ndim)
    return tuple(axis % x.ndim for axis in np.atleast_1d(axes).tolist())


def _resize(x: Array, s: Sequence[int] | None, axes: Sequence[int]) -> Array:
    """Cut the axes, or extend them by zeros, to the lengths `s`."""
    if s is None or all(x.shape[axis] == n for axis, n in zip(axes, s, strict=True)):
        return x
    shape = list(x.shape)
    part = [slice(None)] * x.ndim
    for axis, n in zip(axes, s, strict=True):
        part[axis] = slice(min(n, shape[axis]))
        shape[axis] = n
    result = np.zeros(shape, x.dtype)
    result[tuple(part)] = x[tuple(part)]
    return result


_FUNCTIONS = {
    "fft": _complex(True),
    "ifft": _complex(False),
    "rfft": _rfft,
    "irfft": _irfft,
    "rfftn": _rfftn,
    "irfftn": _irfftn,
    "dctn": _trigonometric("dct", False),
    "idctn": _trigonometric("dct", True),
    "dstn": _trigonometric("dst", False),
    "idstn": _trigonometric("dst", True),
}
