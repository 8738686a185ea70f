"""Stretched elements, grids and contact areas, in three dimensions: iterations and CPU time.

Conjugate gradients from a zero guess to a relative residual of 1e-8, for a displacement that is
constant (along x) and for a random one. The grids are N x N or N/4 x 16 N; stretched elements are
longer along y, and a circle on the grid is then an ellipse. The seconds are of CPU, with set-up,
for the random displacement: medians of turns that the methods take in one process.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from math import nan
from statistics import median

import numpy as np
from scipy.sparse.linalg import LinearOperator
from tqdm import tqdm

from comparisons.harness import report
from comparisons.harness.measuring import PRECONDITIONERS, solve
from comparisons.harness.processes import in_a_fresh_process, prepare
from comparisons.harness.report import Row
from comparisons.systems import masks
from comparisons.systems.punch import KINDS, influence
from toeplitz_mg._typing import Array

MAXITER = 200  # Iterations after which a method has not converged.
SECONDS = 300.0  # Time after which a case is given up.
TURNS = 3  # Solves of which the median time counts.
SIZES = (64, 128, 256, 512, 1024)
DEFAULT_SIZES, QUICK_SIZES = (256,), (32,)


def long_grid(N: int) -> Array:
    """Return the mask of N/4 x 16 N elements, 64 x 4096 for N = 256."""
    return np.ones((N // 4, 16 * N), dtype=bool)


rough = partial(masks.rough, 0.3)
CASES: dict[str, tuple[Callable[[int], Array], float]] = {
    "square": (masks.square, 1.0),
    "square, elements 1:20": (masks.square, 20.0),
    "grid 1:64": (long_grid, 1.0),
    "grid 1:64, elements 1:20": (long_grid, 20.0),
    "circle": (masks.circle, 1.0),
    "circle, elements 1:20": (masks.circle, 20.0),
    "circle, elements 1:100": (masks.circle, 100.0),
    "rough, 30 %": (rough, 1.0),
    "rough, 30 %, elements 1:20": (rough, 20.0),
}

METHODS = ("cosine", "sine", "M", "M̄", "FSAI", "V(1,1)", "default")


def operator(case: str, kind: str, N: int) -> LinearOperator:
    """Return the matrix of a case."""
    area, stretch = CASES[case]
    return influence(kind, area(N), (2.0 / N, stretch * 2.0 / N))


def measure(case: str, kind: str, N: int, methods: Sequence[str]) -> list[Row]:
    """Measure every method in turn on one case; in a process of its own."""
    A = operator(case, kind, N)
    n = A.shape[0]
    constant = np.ones(n)
    if kind == "coupled":
        constant[n // 2 :] = 0.0
    random = np.random.default_rng(0).standard_normal(n)
    solve_by = partial(solve, maxiter=MAXITER)
    rows: dict[str, Row] = {}
    for method in methods:
        row = rows[method] = {"case": case, "problem": kind, "N": N, "method": method, "note": ""}
        try:
            for name, b in (("constant", constant), ("random", random)):
                row[name] = solve_by(A, b, PRECONDITIONERS[method]).count
        except (np.linalg.LinAlgError, ValueError, TypeError) as error:
            row["note"] = str(error)[:60]
    able = [method for method in methods if "random" in rows[method]]
    times: dict[str, list[float]] = {method: [] for method in able}
    for _ in range(TURNS):
        for method in able:
            times[method].append(solve_by(A, random, PRECONDITIONERS[method]).seconds)
    for method in able:
        rows[method]["random_s"] = median(times[method])
    return list(rows.values())


def run(
    sizes: Sequence[int], cases: Sequence[str], kinds: Sequence[str], methods: Sequence[str]
) -> Iterator[list[Row]]:
    """Measure every case; yield the rows so far after each of them."""
    rows: list[Row] = []
    for case, kind, N in tqdm(
        [(c, k, N) for c in cases for k in kinds for N in sizes], unit="case"
    ):
        try:
            rows += in_a_fresh_process(partial(measure, case, kind, N, methods), SECONDS)
        except (TimeoutError, ArithmeticError) as error:
            note = str(error)[:60] or f"over {SECONDS:.0f} s"
            rows.append({"case": case, "problem": kind, "N": N, "random_s": nan, "note": note})
        yield rows


def tabulate_by_case(rows: Sequence[Row]) -> list[Row]:
    """Return a table: a line for each case, iterations (constant, random) and time by method."""
    table: list[Row] = []
    for (case, problem, N), own in report.group(rows, "case", "problem", "N").items():
        line: Row = {"case": case, "problem": problem, "N": N}
        for row in own:
            if "random" in row:
                counts = f"{row['constant']}, {row['random']}"
                line[row["method"]] = f"{counts} / {row['random_s']:.2g}"
        table.append(line)
    return table


def main() -> None:
    """Run the comparison."""
    prepare("comparisons.preconditioners.stretched")
    arguments = report.options(
        "preconditioners.stretched",
        "Stretched elements, grids and areas: iterations and CPU time.",
        sizes=QUICK_SIZES + SIZES,
        cases=tuple(CASES),
        problems=KINDS,
        methods=METHODS,
    )
    rows: list[Row] = []
    for rows in run(
        arguments.sizes or (QUICK_SIZES if arguments.quick else DEFAULT_SIZES),
        arguments.cases or tuple(CASES),
        arguments.problems or KINDS,
        arguments.methods or METHODS,
    ):
        report.write_csv(arguments.output / "stretched.csv", rows)
    report.show("Iterations (constant, random) / CPU seconds (random)", tabulate_by_case(rows))


if __name__ == "__main__":
    main()
