"""Reused memory, separate for each thread, so that threads may share operators."""

import threading
from collections import defaultdict
from collections.abc import Callable
from math import prod
from typing import Any
from weakref import ref

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array

SMALL = 2**15  # Largest array in bytes that is left to C's allocator, which reuses memory itself.
LARGE_PAGE = 2**21  # Bytes of a large page; with these, strided passes touch few pages.


class _Memory(np.ndarray[Any, Any]):
    """The bytes of a block.

    The base of a NumPy view is the array at the end of its chain of views, unless that belongs to
    another class, such as this one. So an array made from a block lives as long as its views.
    """


class _Block:
    """Memory, and a weak reference to its last array, which lives while any view of it does."""

    def __init__(self, size: int) -> None:
        large = size >= LARGE_PAGE // 2
        # NumPy requests large pages from 4 MB on. Unused pages take no physical memory.
        bytes_in_all = max(size, LARGE_PAGE) + LARGE_PAGE if large else size
        self.memory = _Memory(bytes_in_all, np.uint8)
        self.start = -self.memory.ctypes.data % LARGE_PAGE if large else 0
        self.array: Callable[[], Array | None] = type(None)


class _Blocks(threading.local):
    def __init__(self) -> None:
        self.by_length: defaultdict[int, list[_Block]] = defaultdict(list)


_blocks = _Blocks()


def workspace(shape: tuple[int, ...], dtype: DTypeLike, *, small: int = SMALL) -> Array:
    """Return an uninitialised array, like `np.empty`, in memory that was used before.

    Allocating a new array of a megabyte takes longer than transforming it, because its pages are
    mapped, cleared and released each time. The memory is reused as soon as no reference to the
    array or to a view of it exists, in any function, thread or generator.

    Parameters
    ----------
    shape : tuple of int
    dtype : dtype
    small : int, optional
        Largest size in bytes for which the array comes from C's allocator.
    """
    dtype = np.dtype(dtype)
    size = prod(shape) * dtype.itemsize
    if size <= small:
        return np.empty(shape, dtype)
    length = (size - 1).bit_length()
    for block in _blocks.by_length[length]:
        if block.array() is None:
            break
    else:
        block = _Block(1 << length)
        _blocks.by_length[length].append(block)
    array: Array = np.ndarray(shape, dtype, block.memory, block.start)
    block.array = ref(array)
    return array
