"""What one rank of a job measures: times, bytes and memory of a disc on a square grid, on slabs.

Run by `comparisons.machines.ranks`, as ``mpiexec -n 4 python -m mpi4py -c "..." n what file``; rank
0 writes what all have measured to the file.
"""

import json
import sys
from collections.abc import Callable
from functools import partial
from math import inf
from operator import matmul
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from typing import Any

import numpy as np
import scipy.fft
from mpi4py import MPI

import toeplitz_mg as tmg
from comparisons.harness.counting import CountingCommunicator
from comparisons.harness.processes import peak_bytes
from toeplitz_mg import halfspace, slabs
from toeplitz_mg._typing import Array

ROWS = 64  # Rows of coefficients that are evaluated at a time, so that they take no memory.
RUNS = 7  # Runs of which the median is taken.
ELEMENT, RTOL = (1.0, 1.0), 1e-8


def main() -> None:
    """Measure what the arguments say: n, "times" or what to solve with, and a file."""
    n, what, path = int(sys.argv[1]), sys.argv[2], Path(sys.argv[3])
    comm = CountingCommunicator(MPI.COMM_WORLD)
    row = measure_times(comm, n) if what == "times" else measure_memory(comm, n, what)
    if comm.rank == 0:
        path.write_text(json.dumps(row))


def measure_times(comm: CountingCommunicator, n: int) -> dict[str, Any]:
    """Return medians of wall and CPU seconds, and bytes, of everything on slabs.

    On one rank also those of the serial package, run by run in turns.
    """
    slab = balanced_slab(comm, n)
    c, mask = coefficients(n, slab.rows), disc(n, slab.rows)
    full = slabs.ToeplitzOperator(c, slab)
    A = slabs.MaskedOperator(full, mask)
    x, b = np.ones(full.shape[0]), np.ones(A.shape[0])
    inverses = {"FSAI": slabs.fsai_preconditioner(A), "cosine": slabs.cosine_preconditioner(A)}
    jobs: dict[str, Callable[[], Any]] = {"product": partial(matmul, full, x)}
    jobs |= {name: partial(matmul, M, b) for name, M in inverses.items()}
    if comm.size == 1:
        serial = tmg.ToeplitzOperator(c)
        P = tmg.fsai_preconditioner(tmg.MaskedOperator(serial, mask))
        jobs |= {"serial product": partial(matmul, serial, x), "serial FSAI": partial(matmul, P, b)}
    runs: dict[str, list[tuple[float, float]]] = {name: [] for name in jobs}
    row: dict[str, Any] = {"ranks": comm.size, "n": n, **rates(comm)}
    for _ in range(RUNS + 1):  # The first loads code, and fills caches.
        for name, job in jobs.items():
            comm.reset()
            runs[name].append(timed(comm, job)[1])
            row[f"{name} bytes"] = sum(comm.allgather(comm.sent)) / n**2
    for name, measured in runs.items():
        for k, clock in enumerate(("s", "CPU s")):
            row[f"{name} {clock}"] = median(run[k] for run in measured[1:])
    for name, M in inverses.items():
        residuals: list[float] = []
        solve = partial(tmg.cg, A, b, M=M, rtol=RTOL, residuals=residuals)
        (_, row[f"{name} info"]), (row[f"{name} solve s"], _) = timed(comm, solve)
        row[f"{name} iterations"] = len(residuals) - 1
    return row


def measure_memory(comm: CountingCommunicator, n: int, what: str) -> dict[str, Any]:
    """Return by how much the memory of a rank rises for set-up and some iterations, in MB.

    The coefficients are there before. What begins with "serial" is the package without slabs.
    """
    serial, name = what.startswith("serial"), what.removeprefix("serial ")
    slab = balanced_slab(comm, n)
    c, mask = coefficients(n, slab.rows), disc(n, slab.rows)
    comm.allgather(None)
    before = peak_bytes()
    package: Any = tmg if serial else slabs
    full = tmg.ToeplitzOperator(c) if serial else slabs.ToeplitzOperator(c, slab)
    A = package.MaskedOperator(full, mask)
    M = getattr(package, f"{name.lower()}_preconditioner")(A)
    tmg.cg(A, np.ones(A.shape[0]), M=M, rtol=RTOL, maxiter=3)
    rises = comm.allgather(peak_bytes() - before)
    return {"ranks": comm.size, "n": n, "what": what, "MB": max(rises) / 1e6}


def balanced_slab(comm: CountingCommunicator, n: int) -> slabs.Slab:
    """Return the slab of a square grid whose ranks have about as much of the disc each."""
    slab = slabs.Slab(comm, (n, n))
    return slab.balanced(disc(n, slab.rows))


def coefficients(n: int, rows: slice) -> Array:
    """Return some rows of the coefficients of a half-space, evaluated by blocks."""
    c = np.empty((rows.stop - rows.start, n))
    for start in range(rows.start, rows.stop, ROWS):
        stop = min(start + ROWS, rows.stop)
        x, y = ELEMENT[0] * np.arange(start, stop)[:, None], ELEMENT[1] * np.arange(n)
        c[start - rows.start : stop - rows.start] = halfspace.influence_zz(
            x, y, ELEMENT, G=1.0, nu=0.28
        )
    return c


def disc(n: int, rows: slice) -> Array:
    """Return some rows of a disc that nearly touches the edges of the grid."""
    lag = (np.arange(n) - (n - 1) / 2.0) ** 2
    return np.add.outer(lag[rows], lag) < (0.49 * n) ** 2


def timed(comm: CountingCommunicator, job: Callable[[], Any]) -> tuple[Any, tuple[float, float]]:
    """Return what a job returns, the longest wall time of a rank, and the CPU time of all."""
    comm.allgather(None)  # All begin at once.
    wall, cpu = perf_counter(), process_time()
    result = job()
    told = comm.allgather((perf_counter() - wall, process_time() - cpu))
    return result, (max(told)[0], sum(cpu for _, cpu in told))


def rates(comm: CountingCommunicator) -> dict[str, float]:
    """Return what all ranks do at once: a rank's flop/s, and bytes/s of its memory and network."""
    Z = np.ones((64, 4096), complex)
    x, y = np.ones(2**22), np.ones(2**22)
    counts = np.full(comm.size, 2**20 // comm.size)
    got = np.empty(int(counts.sum()))
    best = dict.fromkeys(("flop/s", "memory B/s", "network B/s"), 0.0)
    jobs: dict[str, tuple[float, Callable[[], Any]]] = {
        "flop/s": (Z.size * 5 * 12.0, partial(scipy.fft.fft, Z)),
        "memory B/s": (3.0 * x.nbytes, partial(np.add, x, y, x)),
        "network B/s": (
            8.0 * counts[1:].sum(),
            lambda: comm.Alltoallv([got, counts], [got.copy(), counts]),
        ),
    }
    for _ in range(RUNS):
        for name, (amount, job) in jobs.items():
            best[name] = max(best[name], amount / timed(comm, job)[1][0])
    best["network B/s"] = best["network B/s"] or inf  # A rank alone sends nothing.
    return best
