"""One method on one system in a fresh process: times, work, peak memory and true residual."""

import math
import resource
import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from statistics import median
from time import perf_counter
from typing import Any, TypeVar

import numpy as np
from scipy.linalg import matmul_toeplitz

import toeplitz_mg as tmg
from comparisons import contenders
from comparisons.contenders import Contender, System, column_and_mask
from toeplitz_mg._typing import Array
from toeplitz_mg.paper.problems import test1

T = TypeVar("T")

KILL_AFTER = 60.0  # seconds
MEMORY_LIMIT = 8 << 30  # bytes of address space: beyond it a method meets a MemoryError
CONVERGED = 1.01 * contenders.TOLERANCE  # a recurrence for the residual may drift a little
WARM_UP_SIZE = 64
RUSAGE_BYTES = 1 if sys.platform == "darwin" else 1024  # the unit of ru_maxrss


@dataclass(frozen=True)
class Measurement:
    """What was measured, None where it was not.

    Attributes
    ----------
    setup_s, solve_s, total_s : float
        Seconds; `total_s` is infinite where the process was killed.
    iterations : int
    setup_units, solve_units : float
        Products counted, in products on the whole grid (the paper's work units).
    peak_mb, peak_vectors : float
        The rise of the process's peak memory above the problem and the libraries, in MB and in
        vectors of n float64.
    residual : float
        ‖b - A x‖ / ‖b‖ by `true_residual`.
    converged : bool
    note : str
        Why something is missing, or the method did not converge.
    """

    setup_s: float | None = None
    solve_s: float | None = None
    total_s: float | None = None
    iterations: int | None = None
    setup_units: float | None = None
    solve_units: float | None = None
    peak_mb: float | None = None
    peak_vectors: float | None = None
    residual: float | None = None
    converged: bool | None = None
    note: str = ""


def measure(contender: Contender, problem: System) -> Measurement:
    """Run a contender in a process of its own, and kill it where it takes too long."""
    # The problem is sent, not built there: the temporary arrays of building it would be the peak.
    try:
        return in_a_fresh_process(partial(_measure_here, contender, problem), KILL_AFTER)
    except TimeoutError:
        return Measurement(total_s=math.inf, note=f"over {KILL_AFTER:.0f} s")
    except ArithmeticError as error:
        return Measurement(note=str(error))


def in_a_fresh_process(job: Callable[[], T], seconds: float) -> T:
    """Return what a function returns in a process of its own.

    Raises
    ------
    TimeoutError
        Where it takes longer than that; it is killed.
    ArithmeticError
        Where it raises an error, which is the message, or the process dies.
    """
    context = get_context("forkserver")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_send, args=(job, sender), daemon=True)
    process.start()
    sender.close()
    try:
        if not receiver.poll(seconds):
            raise TimeoutError
        succeeded, result = receiver.recv()
    except EOFError:
        raise ArithmeticError("the process died, as it does where memory ends") from None
    finally:
        process.kill()
        process.join()
    if not succeeded:
        raise ArithmeticError(result)
    answer: T = result
    return answer


def true_residual(problem: System, x: Array) -> float:
    """Return ‖b - A x‖ / ‖b‖, by a product that is not the one under test."""
    column, mask = column_and_mask(problem.A)
    extended = np.zeros(len(column))
    extended[mask] = x
    with np.errstate(all="ignore"):  # of a solution that diverged
        r = problem.b - matmul_toeplitz(column, extended, check_finite=False)[mask]
        return float(np.linalg.norm(r) / np.linalg.norm(problem.b))


def _send(job: Callable[[], Any], sender: Connection) -> None:
    """Send what a function returns, or the error it met."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, resource.RLIM_INFINITY))
    warnings.simplefilter("ignore")  # what matters of them is seen in the residual
    try:
        sender.send((True, job()))
    except Exception as error:
        reason = str(error).partition("\n")[0]
        sender.send((False, f"{type(error).__name__}: {reason}"))


def _measure_here(contender: Contender, problem: System) -> Measurement:
    """Measure in this process, which is to be a fresh one."""
    # The first call loads code, a few MB of it, which is neither its time nor its memory.
    with suppress(Exception):
        contender.method(test1(WARM_UP_SIZE))()
    n = problem.A.grid_shape[0]
    before = peak_bytes()
    with tmg.count_products() as setup_work:
        solve, setup_s = timed(lambda: contender.method(problem))
    with tmg.count_products() as solve_work:
        (x, iterations), solve_s = timed(solve)
    peak = peak_bytes() - before
    residual = true_residual(problem, x)
    converged = residual <= CONVERGED
    setup_s, solve_s = _repeated(contender, problem, setup_s, solve_s)
    measurement = Measurement(
        setup_s=setup_s,
        solve_s=solve_s,
        total_s=setup_s + solve_s,
        iterations=iterations,
        peak_mb=peak / 1e6,
        peak_vectors=peak / (8 * n),
        residual=residual,
        converged=converged,
        note="" if converged else f"not converged; {contender.explain(problem)}".rstrip("; "),
    )
    if not contender.counted:
        return measurement
    return replace(measurement, setup_units=setup_work.units(n), solve_units=solve_work.units(n))


def _repeated(
    contender: Contender, problem: System, setup_s: float, solve_s: float
) -> tuple[float, float]:
    """Return the medians with a few more runs, where they are short and easily disturbed."""
    setups, solves = [setup_s], [solve_s]
    while len(setups) < 5 and sum(setups) + sum(solves) < 0.5:
        solve, seconds = timed(lambda: contender.method(problem))
        setups.append(seconds)
        solves.append(timed(solve)[1])
    return median(setups), median(solves)


def timed(function: Callable[[], Any]) -> tuple[Any, float]:
    """Return what a function returns and the seconds it took."""
    start = perf_counter()
    result = function()
    return result, perf_counter() - start


def peak_bytes() -> int:
    """Return the largest resident memory that this process had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * RUSAGE_BYTES
