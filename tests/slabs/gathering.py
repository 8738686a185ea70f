"""No rank is sent, or allocates, what has the size of the whole grid."""

import sys
import tempfile
import tracemalloc
from collections import Counter
from pathlib import Path

import numpy as np

from tests.slabs.counting import MPI
from tests.slabs.ranks import ROOT
from toeplitz_mg import cg, slabs

OWN = 5 * 2**14  # Unknowns of a rank.
LEAST = 2**16  # Bytes of a rise that is looked at.


class Memory:
    """The peak of the memory, and the largest rise by each line of the package, in bytes."""

    def __enter__(self):
        self.peak, self.rises = 0, Counter()
        tracemalloc.start()
        self._frame, self._line, self._before = None, 0, tracemalloc.get_traced_memory()[0]
        self._old = sys.gettrace()
        sys.settrace(self._look)
        return self

    def _look(self, frame, event, _):
        current, peak = tracemalloc.get_traced_memory()
        self.peak = max(self.peak, peak)
        if (rise := peak - self._before) > LEAST:
            place = self._place()
            self.rises[place] = max(self.rises[place], rise)
        self._frame, self._line, self._before = frame, frame.f_lineno, current
        tracemalloc.reset_peak()
        return self._look

    def _place(self):
        frame, line = self._frame, self._line
        while frame and not frame.f_code.co_filename.startswith(str(ROOT)):
            frame, line = frame.f_back, frame.f_back and frame.f_back.f_lineno
        return (frame.f_code.co_filename.removeprefix(str(ROOT)), line) if frame else ("", 0)

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
    x, y = slab.offsets((1.0, 1.0))
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
    file, first = "/tests/slabs/gathering.py", allocate.__code__.co_firstlineno
    rises = [memory.rises[file, first + line] for line in (1, 3)]
    for rise, expected in zip(rises, (8 * OWN, 4 * OWN), strict=True):
        assert expected <= rise < expected + 2**12
    assert 8 * OWN <= memory.peak < 8 * OWN + 2**16


def test_nothing_gathers(comm):
    """With P ranks a grid P times as large takes no more of each than of one rank alone."""
    everything(MPI.COMM_SELF, 16)  # It imports what is imported late.
    alone = memory_of(everything, MPI.COMM_SELF, 320)
    comm.reset()
    together = memory_of(everything, comm, 160)
    # Messages, and what FSAI solves for directly, have a size that does not grow.
    assert together.peak <= 1.15 * alone.peak + 2**23
    # What leaves a rank at a time are complex numbers, as many as it has unknowns.
    assert comm.largest <= 16 * OWN
    if comm.size < 3:
        return  # What is complex takes as much as the whole grid of two ranks.
    for (file, line), rise in together.rises.items():
        # Memory that is kept begins with large pages, of any size.
        if not file.endswith("workspace.py"):
            limit = max(1.15 * alone.rises[file, line] + LEAST, 2.5 * 8 * OWN)
            assert rise <= limit, f"{file}:{line} takes {rise / (8 * OWN)} vectors of a rank"
