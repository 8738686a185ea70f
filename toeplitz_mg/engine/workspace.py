"""Memory that is used again: each thread has its own, so that operators may be shared."""

import threading
from collections import defaultdict
from collections.abc import Callable
from math import prod
from typing import Any
from weakref import ref

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array

SMALL = 2**15  # Bytes up to which the allocator of C itself keeps memory and gives it out again.
LARGE_PAGE = 2**21  # Bytes of a large page, of which a strided pass needs few.


class _Memory(np.ndarray[Any, Any]):
    """The bytes of a block.

    NumPy lets a view refer to the array at the end of a chain of views, unless that is of another
    class, as this one is. So the array that is made first from a block lives as long as any view
    of it.
    """


class _Block:
    """Memory, and the array that was last made from it, as long as it or a view of it lives."""

    def __init__(self, size: int) -> None:
        large = size >= LARGE_PAGE // 2
        # NumPy asks for large pages from 4 MB on. What is not used is not mapped.
        bytes_in_all = max(size, LARGE_PAGE) + LARGE_PAGE if large else size
        self.memory = _Memory(bytes_in_all, np.uint8)
        self.start = -self.memory.ctypes.data % LARGE_PAGE if large else 0
        self.array: Callable[[], Array | None] = type(None)


class _Blocks(threading.local):
    def __init__(self) -> None:
        self.by_length: defaultdict[int, list[_Block]] = defaultdict(list)


_blocks = _Blocks()


def workspace(shape: tuple[int, ...], dtype: DTypeLike, *, small: int = SMALL) -> Array:
    """Return an array of any content, as `np.empty` does, from memory that was used before.

    A fresh array of a megabyte costs more than a transform of it: its pages are mapped, cleared
    and given back each time. The memory is given out again when nobody has the array any more, nor
    a view of it: not a caller further up, not another thread, not a generator that waits.

    Parameters
    ----------
    shape : tuple of int
    dtype : dtype
    small : int, optional
        Bytes up to which the memory is not kept, as the allocator of C does that itself.
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
