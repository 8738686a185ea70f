"""Transforms of rows, real, cosine and sine, with little of Python around them."""

from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from scipy import fftpack

from toeplitz_mg._typing import Array, Rows

# Where SciPy has compiled them: since 1.17, and before.
MODULES = ("scipy.fft._duccfft.pyduccfft", "scipy.fft._pocketfft.pypocketfft")
AXES, ONE_THREAD = (-1,), 1
NOT_SCALED, ORTHONORMAL, BY_LENGTH = 0, 1, 2  # Their scales of a transform.


class Transforms(NamedTuple):
    """Transforms of rows, of float64.

    Attributes
    ----------
    dct, dst : callable
        ``dct(X, out, kind)`` writes those of type 2 or 3, which are inverse to each other, or of
        type 4, inverse to itself, to `out`, which may be X itself.
    rfft : callable
        ``rfft(X)`` returns the discrete Fourier transforms up to the middle.
    irfft : callable
        ``irfft(Y, m)`` returns the rows of m numbers that have these.
    """

    dct: Callable[[Rows, Rows, int], Any]
    dst: Callable[[Rows, Rows, int], Any]
    rfft: Callable[[Rows], Array]
    irfft: Callable[[Array, int], Rows]


@cache
def transforms() -> Transforms:
    """Return the transforms that SciPy has compiled, if they still are what they were.

    Its public functions look at their arguments for half of the time that 1024 numbers take. The
    private ones may change or vanish with any release, and then the public ones are taken.
    """
    for name in MODULES:
        try:
            found = _compiled(import_module(name))
            if _are_right(found):
                return found
        except Exception:  # Whatever the reason is, the public functions are what they were.
            continue
    return PUBLIC


def _compiled(module: Any) -> Transforms:
    c2r, r2c = module.c2r, module.r2c
    return Transforms(
        dct=_of_rows(module.dct),
        dst=_of_rows(module.dst),
        rfft=lambda X: r2c(X, AXES, True, NOT_SCALED, None, ONE_THREAD),
        irfft=lambda Y, m: c2r(Y, AXES, m, False, BY_LENGTH, None, ONE_THREAD),
    )


def _of_rows(transform: Any) -> Callable[[Rows, Rows, int], Any]:
    return lambda X, out, kind: transform(X, kind, AXES, ORTHONORMAL, out, ONE_THREAD, True)


def _public_of_rows(transform: Any) -> Callable[[Rows, Rows, int], Any]:
    def write(X: Rows, out: Rows, kind: int) -> None:
        out[...] = transform(X, kind, norm="ortho")

    return write


PUBLIC = Transforms(
    _public_of_rows(fftpack.dct), _public_of_rows(fftpack.dst), np.fft.rfft, np.fft.irfft
)


def _are_right(found: Transforms) -> bool:
    """Whether these do what the public functions do, odd lengths and even ones."""
    for m in (7, 8):
        X = np.cos(np.arange(2.0 * m) ** 2).reshape(2, m)
        results: list[Array] = []
        for dct, dst, rfft, irfft in (found, PUBLIC):
            Y = rfft(X)
            result = [Y.real, Y.imag, irfft(Y, m)]
            for transform in (dct, dst):
                for kind in (2, 3, 4):
                    Z = X.copy()
                    transform(Z, Z, kind)
                    result.append(Z)
            results.append(np.hstack(result))
        if not np.allclose(results[0], results[1], rtol=1e-13, atol=1e-13):
            return False
    return True
