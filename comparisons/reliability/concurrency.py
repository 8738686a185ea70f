"""Threads and interrupts: a product is right, whoever else multiplies, whatever went before."""

import signal
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from time import perf_counter
from types import FrameType

import numpy as np
from numpy.random import Generator
from scipy import fft
from scipy.sparse.linalg import LinearOperator

import toeplitz_mg as tmg
from comparisons.reliability.trials import FAILED, REFUSED, RIGHT, Outcome
from comparisons.systems.random_matrices import log_uniform, random_column, random_grid, random_mask

THREADS = 16
VECTORS = 48

BUILDERS: list[Callable[[LinearOperator], LinearOperator]] = [
    lambda A: A,
    tmg.fft_preconditioner,
    tmg.fft_rsm_preconditioner,
    tmg.fft_sd_preconditioner,
    tmg.chan_preconditioner,
    tmg.cosine_preconditioner,
    tmg.sine_preconditioner,
    tmg.default_preconditioner,
    tmg.multigrid,
]


def threads(rng: Generator) -> Outcome:
    """Try an operator in many threads: each product is, to the last bit, that of one thread."""
    axes = int(rng.integers(1, 4))
    shape = random_grid(rng, int(log_uniform(rng, 10, 4e4)), axes)
    name, c = random_column(rng, shape)
    A: LinearOperator = tmg.ToeplitzOperator(c)
    if rng.random() < 0.5:
        A = tmg.MaskedOperator(A, random_mask(rng, shape))
    build = BUILDERS[rng.integers(len(BUILDERS))]
    family = getattr(build, "__name__", "preconditioner").replace("<lambda>", "the matrix")
    try:
        M = build(A)
    except (np.linalg.LinAlgError, ValueError) as error:  # A is indefinite, or has no coarse grid.
        return Outcome(family, REFUSED, str(error))
    X = rng.standard_normal((VECTORS, A.shape[0]))
    expected = [M @ x for x in X]
    with ThreadPoolExecutor(THREADS) as pool:
        found = list(pool.map(M.matvec, X))
    differ = sum(not np.array_equal(a, b) for a, b in zip(expected, found, strict=True))
    note = f"{name} {shape}: {differ} of {VECTORS} products differ"
    return Outcome(family, FAILED if differ else RIGHT, note)


def interrupts(rng: Generator) -> Outcome:
    """Interrupt a product at any moment, and make another one: it is right."""
    shape = ((512, 512), (2**18,), (64, 64, 64))[rng.integers(3)]
    c = np.exp(-np.sqrt(sum(k.astype(float) for k in np.indices(shape))))
    A = tmg.ToeplitzOperator(c)
    M = (lambda A: A, tmg.cosine_preconditioner, tmg.fft_preconditioner)[rng.integers(3)](A)
    family = f"{type(M).__name__} {len(shape)} axes"
    x, y = rng.standard_normal((2, A.shape[0]))
    expected = M @ y
    with fft.set_workers(2):
        expected_by_two = M @ y
        start = perf_counter()
        M @ x
        seconds = perf_counter() - start
        interrupted = _interrupt(lambda: M @ x, rng.uniform(0.0, seconds))
        found = M @ y
    scale = np.abs(expected).max()
    errors = [np.abs(z - expected).max() / scale for z in (expected_by_two, found, M @ y)]
    note = f"{'interrupted' if interrupted else 'not interrupted'}: off by {max(errors):.0e}"
    return Outcome(family, RIGHT if max(errors) < 1e-12 else FAILED, note)


class _Interrupt(BaseException):
    """An interrupt, unlike a KeyboardInterrupt not one that pools of processes catch."""


def _interrupt(work: Callable[[], object], after: float) -> bool:
    """Interrupt some work after so many seconds; return whether that was in time."""
    at_work = True

    def stop(signum: int, frame: FrameType | None) -> None:
        if at_work:
            raise _Interrupt

    before = signal.signal(signal.SIGALRM, stop)
    try:
        try:
            signal.setitimer(signal.ITIMER_REAL, max(after, 1e-6))
            work()
        finally:
            at_work = False  # An interrupt just before this one line is caught below.
    except _Interrupt:
        return True
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    return False
