"""A workspace is memory that nobody has any more: no caller, no view, no other thread."""

import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import count

import numpy as np
import pytest

from toeplitz_mg.engine.workspace import LARGE_PAGE, SMALL, workspace

SHAPE = (4, SMALL)  # of bytes: enough to be given out again

VIEWS = [
    lambda a: a,
    lambda a: a[1:],
    lambda a: a.T,
    lambda a: a.reshape(-1)[3:4],
    lambda a: a.view(np.complex128).real[:, 1:],
    lambda a: np.broadcast_to(a[0], a.shape),
    lambda a: np.lib.stride_tricks.as_strided(a, (2,), (1,)),
    memoryview,
    iter,
    lambda a: (x for x in a),
]


@pytest.mark.parametrize("size", [SMALL + 1, 2**20, 2**22 + 5])
def test_what_nobody_has_any_more_is_used_again(size):
    first = workspace((size,), np.uint8)
    where = first.ctypes.data
    assert first.size == size
    assert size < 2**20 or where % LARGE_PAGE == 0
    del first
    assert workspace((-(-size // 4),), np.float32).ctypes.data == where


@pytest.mark.parametrize("view", VIEWS)
def test_what_somebody_has_is_not_given_out(view):
    array = workspace(SHAPE, np.uint8)
    where = array.ctypes.data
    kept = view(array)
    del array
    assert workspace(SHAPE, np.uint8).ctypes.data != where
    assert kept is not None
    del kept
    assert where in [a.ctypes.data for a in [workspace(SHAPE, np.uint8) for _ in range(2)]]


def test_what_another_thread_or_a_waiting_generator_has_is_not_given_out():
    def waiting():
        memory = workspace(SHAPE, np.uint8)
        yield memory.ctypes.data
        yield memory

    generator = waiting()
    where = next(generator)
    assert workspace(SHAPE, np.uint8).ctypes.data != where
    with ThreadPoolExecutor(1) as pool:
        array = pool.submit(workspace, SHAPE, np.uint8).result()
        again = pool.submit(workspace, SHAPE, np.uint8).result()
    assert not np.shares_memory(array, again)


def test_an_interrupt_within_does_no_harm():
    """In each line of it: what it gives out afterwards nobody else has."""
    held, interrupted = [workspace(SHAPE, np.uint8)], 0
    before = sys.gettrace()
    for k in range(12):
        lines = count()

        def interrupt(frame, event, _, k=k, lines=lines):
            if frame.f_code is not workspace.__code__:
                return None
            if event == "line" and next(lines) == k:
                raise KeyboardInterrupt
            return interrupt

        for _ in range(2):  # where it takes new memory, and where it finds some
            sys.settrace(interrupt)
            try:
                held.append(workspace(SHAPE, np.uint8))
            except KeyboardInterrupt:
                interrupted += 1
            finally:
                sys.settrace(before)
        held.append(workspace(SHAPE, np.uint8))
        held.pop(0)
    assert interrupted > 8
    assert len({a.ctypes.data for a in held}) == len(held)
