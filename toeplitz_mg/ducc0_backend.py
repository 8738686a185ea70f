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
from functools import partial
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
    if result is NotImplemented:
        # A global backend has no other behind it that would be asked next.
        with set_backend("scipy", only=True):
            return method(*args, **kwargs)
    return result


def _transform(
    kernel: Any,
    inverse: bool,
    overwrites: str | None,
    x: Any,
    s: Sequence[int] | None = None,
    axes: Sequence[int] | None = None,
    norm: str | None = None,
    overwrite_x: bool = False,
    workers: int | None = None,
    *,
    plan: None = None,
    **fixed: Any,
) -> Array:
    """Call a function of ducc0, with the arguments that those of `scipy.fft` have.

    Parameters
    ----------
    kernel : callable
    inverse : bool
        Whether the normalisation is that of an inverse transform.
    overwrites : str or None
        The kind of dtype whose arrays can take the result too.
    """
    x = _floating(x)
    axes = _axes(x, s, axes)
    x = _resize(x, s, axes)
    if overwrite_x and x.dtype.kind == overwrites and x.flags.writeable:
        fixed["out"] = x
    threads = workers or get_workers()
    return kernel(x, axes=axes, inorm=_NORMS[norm][inverse], nthreads=threads, **fixed)


def _irfftn(
    x: Any, s: Sequence[int] | None = None, axes: Sequence[int] | None = None, *args: Any, **kw: Any
) -> Array:
    x = _floating(x)
    x = x.astype(np.result_type(x, np.complex64), copy=False)
    axes = _axes(x, s, axes)
    last = 2 * (x.shape[axes[-1]] - 1) if s is None else s[-1]
    s = None if s is None else (*s[:-1], last // 2 + 1)
    kw |= {"forward": False, "lastsize": last}
    return _transform(ducc0.fft.c2r, True, None, x, s, axes, *args, **kw)


def _trigonometric(
    kernel: Any,
    inverse: bool,
    x: Any,
    type: int = 2,
    s: Sequence[int] | None = None,
    axes: Sequence[int] | None = None,
    norm: str | None = None,
    *args: Any,
    orthogonalize: bool | None = None,
    **kw: Any,
) -> Any:
    x = _floating(x)
    if x.dtype.kind == "c" or orthogonalize not in (None, norm == "ortho"):
        return NotImplemented
    # The inverse of type 2 is type 3; the other types are their own.
    kw["type"] = {2: 3, 3: 2}.get(type, type) if inverse else type
    return _transform(kernel, inverse, "f", x, s, axes, norm, *args, **kw)


def _on_one_axis(
    transform: Any, x: Any, n: int | None = None, axis: int = -1, *args: Any, **kw: Any
) -> Array:
    return transform(x, None if n is None else (n,), (axis,), *args, **kw)


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


_fft = partial(_transform, ducc0.fft.c2c, False, "c", forward=True)
_ifft = partial(_transform, ducc0.fft.c2c, True, "c", forward=False)
_rfftn = partial(_transform, ducc0.fft.r2c, False, None, forward=True)

_FUNCTIONS: dict[str, Any] = {
    "fft": partial(_on_one_axis, _fft),
    "ifft": partial(_on_one_axis, _ifft),
    "rfft": partial(_on_one_axis, _rfftn),
    "irfft": partial(_on_one_axis, _irfftn),
    "rfftn": _rfftn,
    "irfftn": _irfftn,
    "dctn": partial(_trigonometric, ducc0.fft.dct, False),
    "idctn": partial(_trigonometric, ducc0.fft.dct, True),
    "dstn": partial(_trigonometric, ducc0.fft.dst, False),
    "idstn": partial(_trigonometric, ducc0.fft.dst, True),
}
