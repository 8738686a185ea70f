"""The transforms of Intel's MKL, by its functions in C: complex ones in place, and real ones.

Each has one thread: those of MKL would change the bits, and `threads.share` has others.
"""

import ctypes
import os
import site
import sys
import warnings
from collections.abc import Callable
from ctypes import byref, c_double, c_int, c_long, c_void_p
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.fft import get_workers

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.threads import PIECE, TRANSFORM, share

FILES = "lib/libmkl_rt.so*", "Library/bin/mkl_rt*.dll"  # Where pip and conda put the library.
# What its header mkl_dfti.h calls so, and of the settings of input and output both.
SINGLE, DOUBLE, REAL, COMPLEX, COMPLEX_COMPLEX, NOT_INPLACE = 35, 36, 33, 32, 39, 44
SCALES, TRANSFORMS, STORAGE, PLACEMENT, STRIDES, DISTANCES = (4, 5), 7, 10, 11, (12, 13), (14, 15)
THREAD_LIMIT, THREADING_SEQUENTIAL = 27, 1


class Plan(c_void_p):
    """A descriptor of transforms of MKL, which several threads may use at once.

    Parameters
    ----------
    library : CDLL
    char : str
        That of the dtype: of a real one, real numbers are transformed to half a spectrum, or back.
    length, count : int
        The numbers of a line, and the lines.
    scale : float
        What the results are multiplied by.
    strides, distances : (int, int)
        From number to number, and from line to line, of what is read and of what is written.
    """

    def __init__(
        self,
        library: Any,
        char: str,
        length: int,
        scale: float,
        count: int = 1,
        strides: tuple[int, int] = (1, 1),
        distances: tuple[int, int] = (0, 0),
    ) -> None:
        super().__init__()
        self._free = partial(library.DftiFreeDescriptor, byref(self))
        precision, kind = SINGLE if char in "fF" else DOUBLE, REAL if char in "fd" else COMPLEX
        library.DftiCreateDescriptor(byref(self), precision, kind, c_long(1), c_long(length))
        settings: list[tuple[int, Any]] = [(THREAD_LIMIT, c_long(1)), (TRANSFORMS, c_long(count))]
        settings += [(name, c_double(scale)) for name in SCALES]
        settings += [(name, (c_long * 2)(0, k)) for name, k in zip(STRIDES, strides, strict=True)]
        settings += [(name, c_long(k)) for name, k in zip(DISTANCES, distances, strict=True)]
        if kind == REAL:
            settings += [(STORAGE, c_int(COMPLEX_COMPLEX)), (PLACEMENT, c_int(NOT_INPLACE))]
        for name, value in settings:
            library.DftiSetValue(self, name, value)
        library.DftiCommitDescriptor(self)

    def __del__(self) -> None:
        self._free()


class MKL:
    """The library in a file; an OSError or AttributeError where it is none, or cannot be loaded."""

    def __init__(self, path: str) -> None:
        try:
            library = ctypes.CDLL(path, os.RTLD_NOLOAD)
        except (AttributeError, OSError):
            library = ctypes.CDLL(path)
            # Nothing else in this process has loaded it, which might want its threads.
            library.MKL_Set_Threading_Layer(THREADING_SEQUENTIAL)

        def check(status: int) -> None:
            if status:
                raise RuntimeError(library.DftiErrorMessage(c_long(status)).decode())

        library.DftiErrorMessage.restype = ctypes.c_char_p
        self._compute = library.DftiComputeForward, library.DftiComputeBackward
        for function in (
            library.DftiCreateDescriptor,
            library.DftiSetValue,
            library.DftiCommitDescriptor,
            *self._compute,
        ):
            function.restype = check
        self._plan = lru_cache(maxsize=512)(partial(Plan, library))
        self._layout = lru_cache(maxsize=512)(self._calls)

    def bind(self, Z: Array) -> list[Callable[[], object]]:
        """Return the transform of a complex vector in its own memory, and the inverse one."""
        address, char, n = c_void_p(Z.ctypes.data), Z.dtype.char, len(Z)
        pairs = zip(self._compute, (1.0, 1.0 / n), strict=True)
        return [partial(compute, self._plan(char, n, scale), address) for compute, scale in pairs]

    def transform(self, x: Array, y: Array, axis: int, inverse: bool, scale: float) -> None:
        """Write the transforms of the lines along an axis of `x`, times a factor, to `y`.

        Both are the same complex array, or one is real, and the other has the half of its spectrum
        up to the middle.
        """
        real, at_once = y if x.dtype.kind == "c" else x, get_workers() == 1
        ways = x.strides, y.strides, x.itemsize, y.itemsize
        calls = self._layout(
            real.dtype.char, real.shape[axis], scale, x.shape, axis % x.ndim, *ways, at_once
        )
        a, compute = x.ctypes.data, self._compute[inverse]
        b = a if y is x else y.ctypes.data

        def work(numbers: range) -> None:
            for plan, i, j in calls[numbers.start : numbers.stop]:
                compute(plan, c_void_p(a + i), c_void_p(b + j))

        if at_once:
            work(range(len(calls)))
        else:
            share(work, len(calls), TRANSFORM * x.size)

    def _calls(
        self,
        char: str,
        n: int,
        scale: float,
        shape: tuple[int, ...],
        axis: int,
        ways: tuple[int, ...],
        ways_out: tuple[int, ...],
        size: int,
        size_out: int,
        at_once: bool,
    ) -> list[tuple[Plan, int, int]]:
        """Return the calls by which an array is transformed: plans, and where they begin in it."""
        # Lines that are as far from each other as those of the axis before are of that axis.
        axes: list[tuple[int, int, int]] = []
        for s, t, m, k in sorted(zip(ways, ways_out, shape, range(len(shape)), strict=True))[::-1]:
            if m > 1 and k != axis:
                outer = axes.pop() if axes and axes[-1][:2] == (m * s, m * t) else (0, 0, 1)
                axes.append((s, t, m * outer[2]))
        # One call transforms those that are the nearest.
        s, t, count = axes.pop() if axes else (0, 0, 1)
        starts = [(0, 0)]
        for i, j, m in axes:
            starts = [(a + k * i, b + k * j) for a, b in starts for k in range(m)]
        step = count if at_once else max(1, PIECE // n)
        strides, apart = (
            (ways[axis] // size, ways_out[axis] // size_out),
            (s // size, t // size_out),
        )
        parts = [(k, min(step, count - k)) for k in range(0, count, step)]
        plans = {m: self._plan(char, n, scale, m, strides, apart) for _, m in parts}
        return [(plans[m], a + k * s, b + k * t) for a, b in starts for k, m in parts]


@lru_cache(maxsize=1)
def load() -> MKL | None:
    """Return the library if it is installed; None, with a warning, if it is broken."""
    roots = [Path(root) for root in (sys.prefix, site.getuserbase()) if root]
    paths = [str(path) for root in roots for pattern in FILES for path in root.glob(pattern)]
    if not paths:
        return None
    try:
        library, x = MKL(max(paths)), np.arange(6.0) * (1.0 + 2.0j)
        library.transform(x, x, 0, False, 0.5)
        if not np.allclose(x, 0.5 * np.fft.fft(np.arange(6.0) * (1.0 + 2.0j)), rtol=1e-13):
            raise RuntimeError("its transforms are wrong")
    except (OSError, AttributeError, RuntimeError) as error:
        text = f"MKL ({max(paths)}) cannot be used ({error}): transforms are those of SciPy"
        warnings.warn(text, RuntimeWarning, stacklevel=2)
        return None
    return library
