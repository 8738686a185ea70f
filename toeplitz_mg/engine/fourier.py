"""Fourier, cosine and sine transforms from SciPy, or from MKL if it is installed.

`fft`, `rfftn`, `dctn` and the others have the names and arguments of `scipy.fft`, and call it if
MKL lacks the transform. A backend set by ``scipy.fft.set_backend`` takes precedence. The libraries
agree up to rounding, so that one can invert what another has transformed.
"""

import warnings
from collections.abc import Callable
from contextlib import ExitStack
from functools import lru_cache, partial
from math import prod
from typing import Any

import numpy as np
from scipy import fft as of_scipy
from scipy import fftpack

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.engine.mkl import MKL, load
from toeplitz_mg.engine.threads import is_backend_set, keep_bits
from toeplitz_mg.engine.workspace import workspace

NAMES = "mkl", "scipy"
# Shortest transform for which MKL is used. Below it, calls and memory cost more than MKL saves,
# except for complex transforms in place.
SMALL = 2**13
_chosen: str | None = None  # Set by `use_transforms`; None stands for MKL if it is installed.


def use_transforms(name: str | None = None) -> Any:
    """Choose the library of transforms for all products in all threads, or return its name.

    Parameters
    ----------
    name : {"mkl", "scipy"}, optional
        By default, Intel's MKL is used if it is installed, for example by
        ``pip install 'toeplitz-mg[fast]'``. The first transform loads it.

    Returns
    -------
    str or context manager
        The name of the library in use, if no name is given. Otherwise a context manager that
        restores the previous choice at the end of a ``with`` block; without a block this one stays.

    Raises
    ------
    ValueError
        If `name` is anything else.

    Warns
    -----
    UserWarning
        If MKL is requested but not installed; SciPy is used instead.
    RuntimeWarning
        If MKL is installed but broken; SciPy is used instead.

    See Also
    --------
    scipy.fft.set_backend : chooses any other library, which then takes precedence.

    Examples
    --------
    >>> import toeplitz_mg as tmg
    >>> with tmg.use_transforms("scipy"):
    ...     tmg.use_transforms()
    'scipy'
    """
    if name is None:
        return "mkl" if isinstance(library(), MKL) else "scipy"
    if name not in NAMES:
        raise ValueError(f"name is {name!r}, but must be one of {NAMES}")
    if name == "mkl" and not load():
        warnings.warn(
            "MKL is not installed, or broken, so SciPy's transforms are used: install it "
            "with pip install 'toeplitz-mg[fast]'",
            stacklevel=2,
        )
    before = ExitStack()
    before.callback(_choose, _chosen)
    _choose(name)
    return before


def _choose(name: str | None) -> None:
    global _chosen
    _chosen = name


def library() -> Any:
    """Return the library whose transforms are used in this thread.

    It is an `MKL`, or SciPy's module `fftpack`, whose calls have the least overhead, or `scipy.fft`
    if a backend is set.
    """
    if is_backend_set():
        return of_scipy
    return (_chosen != "scipy" and load()) or fftpack


# Complex transforms in place ----------------------------------------------------------------


def forward(Z: Array, axis: int = -1) -> None:
    """Transform complex numbers along an axis, in place."""
    _in_place(Z, axis, "fft", "backward")


def backward(Z: Array, axis: int = -1, norm: str = "forward") -> None:
    """Transform back in place, with the factor 1/L only if the norm is "backward"."""
    _in_place(Z, axis, "ifft", norm)


def _in_place(Z: Array, axis: int, name: str, norm: str) -> None:
    of, inverse = library(), name == "ifft"
    if isinstance(of, MKL) and Z.size:
        of.transform(Z, Z, axis, inverse, _scale(norm, inverse, Z.shape[axis]))
        return
    with keep_bits(Z.dtype, Z.size // Z.shape[axis]):
        if norm == "backward" and of is fftpack:
            Y = getattr(of, name)(Z, axis=axis, overwrite_x=True)
        else:
            Y = getattr(of_scipy, name)(Z, axis=axis, norm=norm, overwrite_x=True)
    if not np.may_share_memory(Y, Z):
        Z[...] = Y


def bind(Z: Array, of: Any) -> Any:
    """Return the in-place transform of a vector and its inverse, from the given `library`."""
    if isinstance(of, MKL):
        return of.bind(Z)

    def in_place(transform: Callable[..., Array]) -> Callable[[], object]:
        if of is fftpack and np.may_share_memory(transform(Z, overwrite_x=True), Z):
            return partial(transform, Z, overwrite_x=True)
        return lambda: np.copyto(Z, transform(Z))

    return in_place(of.fft), in_place(of.ifft)


# Transforms with the interface of `scipy.fft` ------------------------------------------------


def _scale(norm: str | None, inverse: bool, n: int) -> float:
    if norm == "ortho":
        return float(n) ** -0.5
    return 1.0 / n if (norm == "forward") != inverse else 1.0


def _fit(x: Array, axes: Any, lengths: Any, dtype: str, own: bool | None) -> Array:
    """Return a contiguous array, cropped or zero-padded to `lengths`; a copy if `own` is true.

    If `own` is None, the array is new and its contents are undefined.
    """
    shape = list(x.shape)
    for axis, n in zip(axes, lengths, strict=True):
        shape[axis] = n
    if own is None:
        return np.empty(shape, dtype)
    if tuple(shape) == x.shape:
        return np.array(x, dtype, order="C", copy=own or None)
    y = np.zeros(shape, dtype)
    cut = tuple(map(slice, map(min, shape, x.shape)))
    y[cut] = x[cut]
    return y


def _make(name: str) -> Any:
    """Return the function of `scipy.fft` with this name, using MKL if that is faster."""
    theirs: Any = getattr(of_scipy, name)
    inverse, is_real, has_axis = name[0] == "i", "r" in name, name[-1] != "n"
    chars = "fd" if is_real and not inverse else "fdFD"

    def transform(
        x: Array,
        s: Any = None,
        axes: Any = -1 if has_axis else None,
        norm: str | None = None,
        overwrite_x: bool = False,
        *,
        axis: int | None = None,
    ) -> Array:
        axes = axes if axis is None else axis
        on = (axes,) if has_axis else tuple(range(x.ndim) if axes is None else axes)
        lengths = [x.shape[k] for k in on] if s is None else [s] if has_axis else list(s)
        if inverse and is_real and s is None:
            lengths[-1] = 2 * lengths[-1] - 2
        size = prod(lengths)
        mkl = library() if size >= SMALL and x.dtype.char in chars else None
        if not isinstance(mkl, MKL):
            if name in ("fft", "ifft") and x.ndim == 1 and not norm and not is_backend_set():
                return getattr(fftpack, name)(x, s, overwrite_x=overwrite_x)
            with keep_bits(x.dtype):
                return theirs(x, s, axes, norm, overwrite_x)
        real, pairs, scale = x.dtype.char.lower(), x.dtype.char.upper(), _scale(norm, inverse, size)
        *others, last = on
        half = [*lengths[:-1], lengths[-1] // 2 + 1]
        if is_real and not inverse:
            x = _fit(x, on, lengths, real, False)
            Z = _fit(x, [last], half[-1:], pairs, None)
            mkl.transform(x, Z, last, False, scale)
        else:
            Z = _fit(x, on, half if is_real else lengths, pairs, not overwrite_x)
        for k in others:
            mkl.transform(Z, Z, k, inverse, 1.0)
        if is_real and not inverse:
            return Z
        y = _fit(Z, [last], lengths[-1:], real, None) if is_real else Z
        mkl.transform(Z, y, last, inverse, scale)
        return y

    transform.__name__ = transform.__qualname__ = name  # Unpickling finds it by this name.
    return transform


fft, ifft, rfft, irfft = map(_make, ("fft", "ifft", "rfft", "irfft"))
fftn, ifftn, rfftn, irfftn = map(_make, ("fftn", "ifftn", "rfftn", "irfftn"))
# Always SciPy's: MKL's interface for transforms has no cosine or sine transforms.
dctn, idctn, dstn, idstn = of_scipy.dctn, of_scipy.idctn, of_scipy.dstn, of_scipy.idstn


# Transforms of rows in double precision with little overhead --------------------------------


def dct(X: Rows, kind: int) -> Rows:
    """Return the orthonormal cosine transforms of rows, which may be overwritten.

    Types 2 and 3 are inverse to each other.
    """
    return _cosines(X, kind, fftpack.dct, 1.0)


def dst(X: Rows, kind: int) -> Rows:
    """Return the orthonormal sine transforms of rows, as `dct` does."""
    return _cosines(X, kind, fftpack.dst, -1.0)


def _cosines(X: Rows, kind: int, of_scipy: Any, sign: float) -> Rows:
    """Return cosine transforms or, if `sign` is -1, sine transforms, via the reversed cosine ones.

    Long ones use real transforms of MKL (J. Makhoul, A fast cosine transform in one and two
    dimensions, IEEE Trans. Acoust. Speech Signal Process. 28, 1980).
    """
    n = X.shape[-1]
    if n < SMALL or not isinstance(mkl := library(), MKL):
        return of_scipy(X, kind, norm="ortho", overwrite_x=True)
    turns, turns_back, even, half = *_turns(n), -(-n // 2), n // 2 + 1
    y, Z = np.empty_like(X), workspace((*X.shape[:-1], half), np.complex128)
    if kind == 2:
        y[..., :even] = X[..., ::2]
        np.multiply(X[..., 1::2][..., ::-1], sign, out=y[..., even:])
        mkl.transform(y, Z, -1, False, 1.0)
        Z *= turns
        back = y[..., :: int(sign)]
        back[..., :half] = Z.real
        np.negative(Z.imag[..., even - 1 : 0 : -1], out=back[..., half:])
        return y
    f = X[..., :: int(sign)]
    Z.real = f[..., :half]
    Z.imag[..., 0] = 0.0
    np.negative(f[..., : n - half : -1], out=Z.imag[..., 1:])
    Z *= turns_back
    mkl.transform(Z, y, -1, True, 1.0)
    X[..., ::2] = y[..., :even]
    np.multiply(y[..., even:][..., ::-1], sign, out=X[..., 1::2])
    return X


@lru_cache(maxsize=4)
def _turns(n: int) -> tuple[Array, Array]:
    """Return exp(-iπk/2n), k = 0 ... n/2, with orthonormal scaling, and the inverse's factors."""
    turns = np.sqrt(2.0 / n) * np.exp(-0.5j * np.pi / n * np.arange(n // 2 + 1))
    turns[0] *= np.sqrt(0.5)
    return turns, 1.0 / (n * turns)


def packed_rfft(X: Rows, overwrite_x: bool = False) -> Rows:
    """Return the transforms of real rows of length n as n real numbers each.

    These are frequency 0, then the real and the imaginary part of each further frequency.
    """
    if X.shape[-1] < SMALL or not isinstance(library(), MKL):
        return fftpack.rfft(X, overwrite_x=overwrite_x)
    pairs = rfft(X).view(X.dtype)
    pairs[..., 1] = pairs[..., 0]
    return pairs[..., 1 : X.shape[-1] + 1]


def packed_irfft(Y: Rows, overwrite_x: bool = False) -> Rows:
    """Return the real rows from the transforms that `packed_rfft` returns."""
    n = Y.shape[-1]
    if n < SMALL or not isinstance(library(), MKL):
        return fftpack.irfft(Y, overwrite_x=overwrite_x)
    pairs = np.zeros((*Y.shape[:-1], 2 * (n // 2) + 2), Y.dtype)
    pairs[..., 1 : n + 1] = Y
    pairs[..., 0], pairs[..., 1] = Y[..., 0], 0.0
    return irfft(pairs.view(Y.dtype.char.upper()), n, overwrite_x=True)
