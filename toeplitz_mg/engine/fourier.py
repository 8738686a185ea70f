"""Transforms of rows by public functions, whichever of NumPy's and SciPy's take the least time.

This is the one file that says whose they are, for transforms along one axis that are so short that
the calls count. All are of double precision.

Those of `scipy.fftpack` work in the memory of their argument, and their calls take less time than
those of `scipy.fft`. A real transform of FFTPACK is as many real numbers: that of the frequency 0,
then the real and the imaginary part of each other one.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy import fftpack

from toeplitz_mg._typing import Array, Rows

fft, ifft = fftpack.fft, fftpack.ifft
packed_rfft, packed_irfft = fftpack.rfft, fftpack.irfft


def bind(Z: Array) -> tuple[Callable[[], object], Callable[[], object]]:
    """Return the transform of a complex vector in its own memory, and the inverse one."""

    def in_place(transform: Callable[..., Array]) -> Callable[[], object]:
        if np.may_share_memory(transform(Z, overwrite_x=True), Z):
            return partial(transform, Z, overwrite_x=True)
        return lambda: np.copyto(Z, transform(Z))

    return in_place(fft), in_place(ifft)


def dct(X: Rows, kind: int) -> Rows:
    """Return the orthonormal cosine transforms of rows, which are lost: they give their memory.

    Those of type 2 and 3 are inverse to each other.
    """
    return fftpack.dct(X, kind, norm="ortho", overwrite_x=True)


def dst(X: Rows, kind: int) -> Rows:
    """Return the orthonormal sine transforms of rows, as `dct` does."""
    return fftpack.dst(X, kind, norm="ortho", overwrite_x=True)


def rfft(X: Rows) -> Array:
    """Return the discrete Fourier transforms of real rows, up to the middle."""
    return np.fft.rfft(X)


def irfft(Y: Array, length: int) -> Rows:
    """Return the real rows of this length that have these discrete Fourier transforms."""
    return np.fft.irfft(Y, length)
