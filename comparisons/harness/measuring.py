"""A preconditioner in an iteration: CPU time, work, iterations and true residual."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from random import Random
from time import perf_counter, process_time
from typing import Any

import numpy as np
from scipy.sparse.linalg import LinearOperator

import toeplitz_mg as tmg
from toeplitz_mg._typing import Array

Choice = Callable[[Any], LinearOperator | None]  # Returns a preconditioner of A, or none.

TOLERANCE = 1e-8
ENOUGH = 0.1  # CPU seconds of the runs of one contender, after which it has no more turns.
TURNS = 40  # Most turns.
SHORTEST = 0.001  # CPU seconds of the runs of one turn, so that the clock resolves them.
QUANTILE = 0.2  # Share of the turns that are faster: the others were disturbed.


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


def full_of(A: LinearOperator) -> Any:
    """Return the matrix on the whole grid, of which A may be the part on a mask."""
    return A.full if isinstance(A, tmg.MaskedOperator) else A


def time_call(
    function: Callable[[], Any], clock: Callable[[], float] = perf_counter
) -> tuple[Any, float]:
    """Return what a function returns and the seconds it took, of wall time unless told."""
    start = clock()
    result = function()
    return result, clock() - start


def time_in_turns(contenders: Mapping[str, Callable[[], object]]) -> dict[str, float]:
    """Return the CPU seconds of each; one that takes long has fewer turns than the others."""
    first = {key: time_call(run, process_time)[1] for key, run in contenders.items()}
    repeats = {key: max(1, round(SHORTEST / max(t, 1e-6))) for key, t in first.items()}
    # What takes seconds is not repeated.
    times = {key: [t] if t > 10.0 * ENOUGH else [] for key, t in first.items()}
    order, chance = list(contenders.items()), Random(0)
    for _ in range(TURNS):
        chance.shuffle(order)  # A run is slower after one that has emptied the caches.
        for key, run in order:
            if sum(times[key]) * repeats[key] > ENOUGH:
                continue
            start = process_time()
            for _ in range(repeats[key]):
                run()
            times[key].append((process_time() - start) / repeats[key])
    return {key: float(np.quantile(t, QUANTILE, method="lower")) for key, t in times.items()}
