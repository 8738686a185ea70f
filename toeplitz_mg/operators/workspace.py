"""Memory that is used again: each thread has its own, so that operators may be shared."""

import threading
from math import prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

Array = NDArray[Any]

LARGE_PAGE = 2**21  # bytes: of pages of that size a strided pass needs few


class _Buffers(threading.local):
    def __init__(self) -> None:
        self.by_purpose: dict[str, Array] = {}


_buffers = _Buffers()


def workspace(purpose: str, shape: tuple[int, ...], dtype: DTypeLike) -> Array:
    """Return an array of any content, the same memory at every call for this purpose.

    A fresh array of a megabyte costs more than a transform of it: its pages are mapped, cleared
    and given back each time. What one call has written is lost with the next for the same purpose
    in the same thread.
    """
    size = prod(shape) * np.dtype(dtype).itemsize
    buffer = _buffers.by_purpose.get(purpose)
    if buffer is None or buffer.nbytes < size:
        buffer = _buffers.by_purpose[purpose] = _memory(size)
    return buffer[:size].view(dtype).reshape(shape)


def _memory(size: int) -> Array:
    """Return memory of so many bytes; from a megabyte on it begins on a large page."""
    if size < LARGE_PAGE // 2:
        return np.empty(size, np.uint8)
    # NumPy asks for large pages from 4 MB on. What is not used is not mapped.
    memory = np.empty(max(size, LARGE_PAGE) + LARGE_PAGE, np.uint8)
    start = -memory.ctypes.data % LARGE_PAGE
    return memory[start : start + size]
