"""The transforms of Intel's MKL, called through its C functions: complex in place, and real.

Each call runs on one thread. MKL's threads would change the last bits, `threads.share` does not.
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
# Constants of the header mkl_dfti.h; pairs are the settings for input and output.
SINGLE, DOUBLE, REAL, COMPLEX, COMPLEX_COMPLEX, NOT_INPLACE = 35, 36, 33, 32, 39, 44
SCALES, TRANSFORMS, STORAGE, PLACEMENT, STRIDES, DISTANCES = (4, 5), 7, 10, 11, (12, 13), (14, 15)
THREAD_LIMIT, THREADING_SEQUENTIAL = 27, 1


class Plan(c_void_p):
    """A descriptor of MKL transforms, which several threads may use at once.

    Parameters
    ----------
    library : CDLL
    char : str
        Character of the dtype. If it is real, real numbers are transformed to half a spectrum, or
        back.
    length : int
    scale : float
        Factor of the results.
    lines : (int, (int, int), (int, int))
        Count, strides between numbers, and distances between lines, each for input and output.
    """

    def __init__(
        self, library: Any, char: str, length: int, scale: float, lines: Any = (1, (1, 1), (0, 0))
    ) -> None:
        super().__init__()
        self._free, (count, strides, distances) = library.DftiFreeDescriptor, lines
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
        self._free(byref(self))


class MKL:
    """MKL, loaded from a file; OSError or AttributeError if that fails or the file is not MKL."""

    def __init__(self, path: str) -> None:
        try:
            library = ctypes.CDLL(path, os.RTLD_NOLOAD)
        except (AttributeError, OSError):
            library = ctypes.CDLL(path)
            # Nothing else in this process has loaded MKL, so nobody else relies on its threads.
            library.MKL_Set_Threading_Layer(THREADING_SEQUENTIAL)

        def check(status: int) -> None:
            if status:
                raise RuntimeError(library.DftiErrorMessage(c_long(status)).decode())

        library.DftiErrorMessage.restype = ctypes.c_char_p
        names = "CreateDescriptor", "SetValue", "CommitDescriptor", "ComputeForward"
        *_, forward = made = [getattr(library, f"Dfti{name}") for name in names]
        self._compute = forward, library.DftiComputeBackward
        for function in (*made, self._compute[1]):
            function.restype = check
        self._plan = lru_cache(maxsize=512)(partial(Plan, library))
        self._layout = lru_cache(maxsize=512)(self._calls)

    def bind(self, Z: Array) -> list[Callable[[], object]]:
        """Return the in-place transform of a complex vector, and its inverse, as callables."""
        address, char, n = c_void_p(Z.ctypes.data), Z.dtype.char, len(Z)
        pairs = zip(self._compute, (1.0, 1.0 / n), strict=True)
        return [partial(compute, self._plan(char, n, scale), address) for compute, scale in pairs]

    def transform(self, x: Array, y: Array, axis: int, inverse: bool, scale: float) -> None:
        """Write the transforms of the lines along an axis of `x`, times `scale`, to `y`.

        Either `x` and `y` are the same complex array, or one is real and the other is the
        non-negative half of its spectrum.
        """
        real, at_once = y if x.dtype.kind == "c" else x, get_workers() == 1
        plan, sizes = (real.dtype.char, real.shape[axis], scale), (x.itemsize, y.itemsize)
        calls = self._layout(plan, x.shape, axis % x.ndim, x.strides, y.strides, sizes, at_once)
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
        self, plan: Any, shape: Any, axis: int, ways: Any, ways_out: Any, sizes: Any, at_once: bool
    ) -> list[tuple[Plan, int, int]]:
        """Return the calls that transform an array: plans, and byte offsets of input and output."""
        # Merge axes whose lines are equally spaced in memory.
        axes: list[tuple[int, int, int]] = []
        for s, t, n, k in sorted(zip(ways, ways_out, shape, range(len(shape)), strict=True))[::-1]:
            if n > 1 and k != axis:
                outer = axes.pop() if axes and axes[-1][:2] == (n * s, n * t) else (0, 0, 1)
                axes.append((s, t, n * outer[2]))
        # One call transforms the lines with the smallest spacing.
        s, t, count = axes.pop() if axes else (0, 0, 1)
        starts = [(0, 0)]
        for i, j, n in axes:
            starts = [(a + k * i, b + k * j) for a, b in starts for k in range(n)]
        step = count if at_once else max(1, PIECE // shape[axis])
        pairs = (ways[axis], ways_out[axis]), (s, t)
        strides, apart = ((i // sizes[0], j // sizes[1]) for i, j in pairs)
        parts = [(k, min(step, count - k)) for k in range(0, count, step)]
        plans = {n: self._plan(*plan, (n, strides, apart)) for _, n in parts}
        return [(plans[n], a + k * s, b + k * t) for a, b in starts for k, n in parts]


@lru_cache(maxsize=1)
def load() -> MKL | None:
    """Return MKL if it is installed and works, else None; warn if it is broken."""
    roots = [Path(root) for root in (sys.prefix, site.getuserbase()) if root]
    paths = [str(path) for root in roots for pattern in FILES for path in root.glob(pattern)]
    if not paths:
        return None
    try:
        library, x = MKL(max(paths)), np.array([1.0, 1.0j, 0.0])
        library.transform(x, x, 0, False, 0.5)
        if not np.allclose(x, 0.5 + 0.5j * np.exp(-2j * np.pi / 3.0 * np.arange(3)), rtol=1e-13):
            raise RuntimeError("its transforms are wrong")
    except (OSError, AttributeError, RuntimeError) as error:
        text = f"MKL ({max(paths)}) cannot be used ({error}): SciPy's transforms are used"
        warnings.warn(text, RuntimeWarning, stacklevel=2)
        return None
    return library
