"""One method on one system: times, work, peak memory, iterations and true residual."""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from statistics import median
from time import perf_counter, process_time
from typing import Any

import numpy as np
from scipy.linalg import matmul_toeplitz
from scipy.sparse.linalg import LinearOperator

import toeplitz_mg as tmg
from comparisons.harness.processes import in_a_fresh_process, peak_bytes
from toeplitz_mg._typing import Array
from toeplitz_mg.paper.problems import test1

System = Any  # A system A x = b, of a Toeplitz matrix or a part of one, with its name.
Solve = Callable[[], tuple[Array, int | None]]  # Returns x and the iterations, or None if direct.
Method = Callable[[Any], Solve]  # Sets a `System` up.
Choice = Callable[[Any], LinearOperator | None]  # Returns a preconditioner of A, or none.

TOLERANCE = 1e-8
MAXITER = 3000  # Iterations after which a method has not converged, unless told otherwise.
KILL_AFTER = 60.0  # Seconds after which a method is given up.
CONVERGED = 1.01 * TOLERANCE  # Largest true residual: the recurrence for it may drift a little.
WARM_UP_SIZE = 64  # Elements of a first problem, solved before anything is measured.


def nothing(A: LinearOperator) -> None:
    """Return no preconditioner: plain CG."""


PRECONDITIONERS: dict[str, Choice] = {
    "none": nothing,
    "Strang": tmg.strang_preconditioner,
    "T. Chan": tmg.chan_preconditioner,
    "cosine": tmg.cosine_preconditioner,
    "sine": tmg.sine_preconditioner,
    "spectral": tmg.spectral_preconditioner,
    "M": tmg.fft_preconditioner,
    "M̄": tmg.fft_rsm_preconditioner,
    "V(1,1)": tmg.componentwise(tmg.multigrid),
    "FSAI": tmg.fsai_preconditioner,
    "default": tmg.default_preconditioner,
}


@dataclass(frozen=True)
class Contender:
    """A method with its name in tables."""

    name: str
    method: Method  # From a problem to its solve; the call is the set-up.
    ours: bool = False  # Whether it is of this package, other than as a baseline.
    counted: bool = True  # Whether the products that are counted are all of its work.


@dataclass(frozen=True)
class Run:
    """One set-up of a preconditioner, and one iteration with it."""

    x: Array
    iterations: int
    info: int  # 0 where it has converged, as by SciPy.
    setup_s: float  # CPU seconds.
    solve_s: float
    setup_units: float  # Products counted, in products on the whole grid: the paper's work units.
    solve_units: float
    residual: float  # ‖b - A x‖ / ‖b‖.

    @property
    def seconds(self) -> float:
        """CPU seconds of set-up and iteration."""
        return self.setup_s + self.solve_s

    @property
    def units(self) -> float:
        """Work units of set-up and iteration."""
        return self.setup_units + self.solve_units

    @property
    def count(self) -> int | str:
        """The iterations as they are printed, marked where they were not enough."""
        return self.iterations if self.residual <= 1.1 * TOLERANCE else f"> {self.iterations}"


def iterate(
    A: LinearOperator, b: Array, *arguments: Any, solver: Any = tmg.cg, **options: Any
) -> tuple[Array, int, int]:
    """Iterate, by CG unless another solver is given; return x, the iterations and `info`."""
    steps: list[None] = []
    x, info = solver(A, b, *arguments, callback=lambda _: steps.append(None), **options)
    return x, len(steps), info


def solve(
    A: LinearOperator, b: Array, preconditioner: Choice, *arguments: Any, **options: Any
) -> Run:
    """Set a preconditioner up and iterate to `TOLERANCE`, both timed and their work counted."""
    n = full_of(A).shape[0]
    with tmg.count_products() as setup_work:
        M, setup_s = time_call(lambda: preconditioner(A), process_time)
    with tmg.count_products() as work:
        (x, iterations, info), solve_s = time_call(
            lambda: iterate(A, b, *arguments, M=M, rtol=TOLERANCE, **options), process_time
        )
    residual = float(np.linalg.norm(b - A @ x)) / float(np.linalg.norm(b))
    units = setup_work.units(n), work.units(n)
    return Run(x, iterations, info, setup_s, solve_s, *units, residual)


def by_iteration(
    solver: Any, preconditioner: Choice, problem: System, maxiter: int = MAXITER
) -> Solve:
    """Iterate by `cg` or `richardson` on the fast product, with a preconditioner of A."""
    M = preconditioner(problem.A)

    def solve() -> tuple[Array, int]:
        options = {"M": M, "rtol": TOLERANCE, "maxiter": maxiter}
        x, iterations, _ = iterate(problem.A, problem.b, solver=solver, **options)
        return x, iterations

    return solve


@dataclass(frozen=True)
class Measurement:
    """What was measured, None where it was not."""

    setup_s: float | None = None
    solve_s: float | None = None
    total_s: float | None = None  # Infinite where the process was killed.
    iterations: int | None = None
    setup_units: float | None = None
    solve_units: float | None = None
    peak_mb: float | None = None  # The rise of the process's peak memory, in MB
    peak_vectors: float | None = None  # and in vectors of n float64.
    residual: float | None = None  # By `true_residual`.
    converged: bool | None = None
    note: str = ""  # Why something is missing, or the method did not converge.


def measure(contender: Contender, problem: System) -> Measurement:
    """Run a contender in a process of its own, and kill it where it takes too long."""
    # The problem is sent, not built there: the temporary arrays of building it would be the peak.
    try:
        return in_a_fresh_process(partial(_measure_here, contender, problem), KILL_AFTER)
    except TimeoutError:
        return Measurement(total_s=math.inf, note=f"over {KILL_AFTER:.0f} s")
    except ArithmeticError as error:
        return Measurement(note=str(error))


def true_residual(problem: System, x: Array) -> float:
    """Return ‖b - A x‖ / ‖b‖, by a product that is not the one under test."""
    column, mask = column_and_mask(problem.A)
    extended = np.zeros(len(column))
    extended[mask] = x
    with np.errstate(all="ignore"):  # A solution may have diverged.
        r = problem.b - matmul_toeplitz(column, extended, check_finite=False)[mask]
        return float(np.linalg.norm(r) / np.linalg.norm(problem.b))


def column_and_mask(A: LinearOperator) -> tuple[Array, Array]:
    """Return the first column of the Toeplitz matrix and the mask of the unknowns."""
    is_masked = isinstance(A, tmg.MaskedOperator)
    return full_of(A).c, A.mask if is_masked else np.ones(A.shape[0], dtype=bool)


def full_of(A: LinearOperator) -> Any:
    """Return the matrix on the whole grid, of which A may be the part on a mask."""
    return A.full if isinstance(A, tmg.MaskedOperator) else A


def _measure_here(contender: Contender, problem: System) -> Measurement:
    """Measure in this process, which is to be a fresh one."""
    # The first call loads code, a few MB of it, which is neither its time nor its memory.
    with suppress(Exception):
        contender.method(test1(WARM_UP_SIZE))()
    n = problem.A.grid_shape[0]
    before = peak_bytes()
    with tmg.count_products() as setup_work:
        solve, setup_s = time_call(lambda: contender.method(problem))
    with tmg.count_products() as solve_work:
        (x, iterations), solve_s = time_call(solve)
    peak = peak_bytes() - before
    residual = true_residual(problem, x)
    converged = residual <= CONVERGED
    setup_s, solve_s = _repeat(contender, problem, setup_s, solve_s)
    measurement = Measurement(
        setup_s=setup_s,
        solve_s=solve_s,
        total_s=setup_s + solve_s,
        iterations=iterations,
        peak_mb=peak / 1e6,
        peak_vectors=peak / (8 * n),
        residual=residual,
        converged=converged,
        note="" if converged else "not converged",
    )
    if not contender.counted:
        return measurement
    return replace(measurement, setup_units=setup_work.units(n), solve_units=solve_work.units(n))


def _repeat(
    contender: Contender, problem: System, setup_s: float, solve_s: float
) -> tuple[float, float]:
    """Return the medians with a few more runs, where they are short and easily disturbed."""
    setups, solves = [setup_s], [solve_s]
    while len(setups) < 5 and sum(setups) + sum(solves) < 0.5:
        solve, seconds = time_call(lambda: contender.method(problem))
        setups.append(seconds)
        solves.append(time_call(solve)[1])
    return median(setups), median(solves)


def time_call(
    function: Callable[[], Any], clock: Callable[[], float] = perf_counter
) -> tuple[Any, float]:
    """Return what a function returns and the seconds it took, of wall time unless told."""
    start = clock()
    result = function()
    return result, clock() - start
