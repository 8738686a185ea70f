"""No rank is sent, or allocates, what has the size of the whole grid."""

import sys
import tempfile
import tracemalloc
from collections import Counter
from pathlib import Path

import numpy as np

from tests.slabs.counting import MPI
from toeplitz_mg import cg, slabs

OWN = 2**16  # Unknowns of a rank.
TABLES = 2**19  # Bytes of the tables of FSAI, which do not grow.


class Memory:
    """The peak of the memory, and the largest rise by each line of Python, in bytes."""

    def __enter__(self):
        self.peak, self.rises = 0, Counter()
        tracemalloc.start()
        self._line, self._before = None, tracemalloc.get_traced_memory()[0]
        self._old = sys.gettrace()
        sys.settrace(self._look)
        return self

    def _look(self, frame, event, _):
        current, peak = tracemalloc.get_traced_memory()
        self.peak = max(self.peak, peak)
        self.rises[self._line] = max(self.rises[self._line], peak - self._before)
        self._line, self._before = (frame.f_code.co_filename, frame.f_lineno), current
        tracemalloc.reset_peak()
        return self._look

    def __exit__(self, *error):
        sys.settrace(self._old)
        tracemalloc.stop()


def memory_of(work, *arguments):
    with Memory() as memory:
        work(*arguments)
    return memory


def everything(comm, rows):
    """Multiply, precondition, solve and save, with so many rows for each rank."""
    slab = slabs.Slab(comm, (rows * comm.size, OWN // rows))
    x, y = slab.lags((1.0, 1.0))
    full = slabs.ToeplitzOperator(1.0 / (1.0 + np.hypot(x, y)), slab)
    A = slabs.MaskedOperator(full, np.random.default_rng(0).random(slab.local) < 0.9)
    for make in (
        slabs.fsai_preconditioner,
        slabs.cosine_preconditioner,
        slabs.fft_preconditioner,
        slabs.sine_preconditioner,
    ):
        p, _ = cg(A, np.ones(A.shape[0]), M=make(A), rtol=1e-8, maxiter=2)
    slab.sum(p)
    pressure = np.zeros(slab.local)
    pressure[A.mask] = p
    with tempfile.TemporaryDirectory() as folder:
        slab.save(comm.allgather(str(Path(folder) / "p.npy"))[0], pressure)
        comm.allgather(None)


def allocate(size):
    x = np.empty(size)
    del x
    return np.empty(size // 2)


def test_memory_is_measured(comm):
    memory = memory_of(allocate, OWN)
    first = allocate.__code__.co_firstlineno
    rises = [memory.rises[allocate.__code__.co_filename, first + line] for line in (1, 3)]
    for rise, expected in zip(rises, (8 * OWN, 4 * OWN), strict=True):
        assert expected <= rise < expected + 2**12
    assert 8 * OWN <= memory.peak < 8 * OWN + 2**16


def test_nothing_gathers(comm):
    """With P ranks a grid P times as large takes no more of each than of one rank alone."""
    everything(MPI.COMM_SELF, 16)  # It imports what is imported late.
    alone = memory_of(everything, MPI.COMM_SELF, 256)
    comm.reset()
    together = memory_of(everything, comm, 128)
    assert together.peak <= 1.15 * alone.peak + TABLES
    for line, rise in together.rises.items():
        # Lines that exchange have nothing to do where a rank is alone.
        assert rise <= max(1.15 * alone.rises[line] + TABLES / 16, 10.0 * OWN), line
    # What leaves a rank at a time are complex numbers, as many as it has unknowns.
    assert comm.largest <= 16 * OWN
