"""Every method that is at hand for a Toeplitz system: iterations, time, memory and true residual.

The system is test 1 of the paper with a random right-hand side, which has all frequencies, solved
to a relative residual of 1e-8 from zero, for n = 4^4 … 4^10; methods of n² steps stop before that.
Each runs in a process of its own, on one thread. Set-up and solve are CPU time, medians of runs
of a tenth of a second in all; the memory is the rise of the peak.

pyamg's hierarchies are of the dense matrix in sparse format: as they come, and as its users would
set them up for this matrix, by pairs of elements, R A P and symmetric Gauss-Seidel. That is the
multigrid which the authors of the paper had before it. The product of CG is the fast one for all.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import numpy as np
import pyamg
import scipy.linalg
from matplotlib.figure import Figure
from pyamg.relaxation.smoothing import change_smoothers
from scipy.sparse import csr_matrix, eye_array, kron
from scipy.sparse.linalg import LinearOperator, cg

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.measuring import TOLERANCE, Choice, iterate, nothing, time_call
from comparisons.harness.processes import peak_bytes, prepare, row_or_note
from comparisons.harness.report import Row
from toeplitz_mg._typing import Array
from toeplitz_mg.paper.problems import test1

Solve = Callable[[], tuple[Array, int | None]]  # Returns x and the iterations, or None if direct.
SIZES, QUICK_SIZES = [4**k for k in range(4, 11)], [256, 1024]
TABULATED = (256, 1024, 4096, 2**20)  # In docs/benchmarks.md.
FEWEST = 8  # Unknowns up to which the hierarchy by pairs goes.
ENOUGH = 0.1  # Seconds of the runs of a method, after which it is not repeated.
KILL_AFTER = 60.0  # Seconds after which a method is given up.
FORMATS = {"n": "d", "method": "", "iterations": "d", "setup_s": ".2g", "solve_s": ".2g"}
FORMATS |= {"peak_mb": ".1f", "residual": ".1e", "note": ""}


@dataclass(frozen=True)
class Method:
    """A method: from A and b to its solve; the call is the set-up."""

    name: str
    set_up: Callable[[Any, Array], Solve]
    largest: int = 2**20  # Unknowns up to which it is run.
    colour: str = ""  # That of its curve, if it is drawn.
    style: str = "o--"


def cholesky(A: Any, b: Array) -> Solve:
    """Factorise the dense matrix."""
    # The transpose is in Fortran order, in which LAPACK overwrites it instead of a copy.
    dense = scipy.linalg.toeplitz(A.c).T
    factor = scipy.linalg.cho_factor(dense, overwrite_a=True, check_finite=False)
    return lambda: (scipy.linalg.cho_solve(factor, b, check_finite=False), None)


def levinson(A: Any, b: Array) -> Solve:
    """Solve by SciPy's Levinson recursion, which has nothing to set up."""
    return lambda: (scipy.linalg.solve_toeplitz(A.c, b, check_finite=False), None)


def by_solve_toeplitz(A: Any, b: Array) -> Solve:
    """Solve by the method that `solve_toeplitz` chooses; its set-up is in the solve."""

    def solve() -> tuple[Array, int]:
        x, info = tmg.solve_toeplitz(A.c, b, rtol=TOLERANCE, full_output=True)
        return x, info.iterations

    return solve


def iteration(solver: Any, preconditioner: Choice, A: Any, b: Array) -> Solve:
    """Iterate on the fast product, with a preconditioner of A."""
    M = preconditioner(A)
    tolerance = {"tol" if solver.__module__.startswith("pyamg") else "rtol": TOLERANCE}

    def solve() -> tuple[Array, int]:
        x, iterations, _ = iterate(A, b, solver=solver, M=M, maxiter=1000, **tolerance)
        return x, iterations

    return solve


def as_it_comes(build: Any, A: Any) -> LinearOperator:
    """Return a cycle of one of pyamg's hierarchies for the stored matrix."""
    return build(csr_matrix(scipy.linalg.toeplitz(A.c))).aspreconditioner()


def by_pairs(A: Any) -> LinearOperator:
    """Return a cycle of pyamg's that is set up for this matrix."""
    matrix, levels = csr_matrix(scipy.linalg.toeplitz(A.c)), []
    while True:
        level = pyamg.multilevel.MultilevelSolver.Level()
        level.A = matrix
        levels.append(level)
        if matrix.shape[0] <= FEWEST:
            break
        level.P = csr_matrix(kron(eye_array(matrix.shape[0] // 2), np.ones((2, 1))))
        level.R = csr_matrix(level.P.T)
        matrix = csr_matrix(level.R @ matrix @ level.P)
    hierarchy = pyamg.multilevel.MultilevelSolver(levels, coarse_solver="pinv")
    smoother = ("gauss_seidel", {"sweep": "symmetric"})
    change_smoothers(hierarchy, smoother, smoother)
    return hierarchy.aspreconditioner()


def cg_with(name: str, choice: Choice, **options: Any) -> Method:
    """Return CG with a preconditioner."""
    return Method(f"CG + {name}", partial(iteration, cg, choice), **options)


aggregation, classical = pyamg.smoothed_aggregation_solver, pyamg.ruge_stuben_solver
v01, v11 = partial(tmg.multigrid, pre=0), tmg.multigrid
# The colours are of Okabe and Ito, which are told apart.
METHODS = (
    Method("dense Cholesky", cholesky, 2**12, "#000000"),
    Method("SciPy's solve_toeplitz", levinson, 2**14, "#56B4E9"),
    Method("CG", partial(iteration, cg, nothing), 2**16, "#009E73"),
    cg_with("T. Chan", tmg.chan_preconditioner, colour="#E69F00"),
    cg_with("pyamg SA", partial(as_it_comes, aggregation), largest=2**12),
    cg_with("pyamg RS", partial(as_it_comes, classical), largest=2**10),
    cg_with("pyamg by pairs", by_pairs, largest=2**12, colour="#CC79A7"),
    Method("pyamg's CG + cosine", partial(iteration, pyamg.krylov.cg, tmg.cosine_preconditioner)),
    Method("pyamg's BiCGStab + V(0,1)", partial(iteration, pyamg.krylov.bicgstab, v01)),
    cg_with("M", tmg.fft_preconditioner, colour="#999999", style="o-"),
    cg_with("cosine", tmg.cosine_preconditioner),
    cg_with("V(1,1)", v11),
    Method("V(0,1)", partial(iteration, tmg.richardson, v01), colour="#0072B2", style="o-"),
    Method("solve_toeplitz", by_solve_toeplitz, colour="#D55E00", style="o-"),
)


def measure(method: Method, n: int) -> Row:
    """Measure a method in this process, which is to be a fresh one."""
    A, b = test1(n).A, np.random.default_rng(0).standard_normal(n)
    method.set_up(test1(64).A, b[:64])()  # A first call loads code: neither its time nor memory.
    before = peak_bytes()
    setups: list[float] = []
    solves: list[float] = []
    while len(setups) < 5 and sum(setups) + sum(solves) < ENOUGH:
        solve, seconds = time_call(lambda: method.set_up(A, b), process_time)
        setups.append(seconds)
        (x, iterations), seconds = time_call(solve, process_time)
        solves.append(seconds)
    peak = peak_bytes() - before
    # By a product that is not the one under test.
    r = b - scipy.linalg.matmul_toeplitz(A.c, x, check_finite=False)
    residual = float(np.linalg.norm(r) / np.linalg.norm(b))
    row: Row = {"iterations": iterations, "setup_s": median(setups), "solve_s": median(solves)}
    row |= {"peak_mb": peak / 1e6, "residual": residual}
    return row | ({} if residual <= 1.01 * TOLERANCE else {"note": "not converged"})


def run(methods: Sequence[Method], sizes: Sequence[int]) -> Iterator[Row]:
    """Yield what is measured."""
    for n in sizes:
        for method in methods:
            if n <= method.largest:
                found = row_or_note(partial(measure, method, n), KILL_AFTER)
                yield {"n": n, "method": method.name} | found


def arrange(rows: Sequence[Row]) -> list[Row]:
    """Return the table of docs/benchmarks.md, a line for each method."""

    def cell(row: Row) -> str:
        if "note" in row:
            return row["note"]
        setup, solve = (report.format_seconds(row[key]) for key in ("setup_s", "solve_s"))
        return f"{row.get('iterations', '–')}: {setup} + {solve}"

    table = []
    for method, own in report.group(rows, "method").items():
        of_n = {row["n"]: row for row in own}
        line: Row = {"method": method}
        line |= {f"n = {n:,}": cell(of_n[n]) if n in of_n else "" for n in TABULATED}
        for n in TABULATED[-2:]:
            peak = of_n.get(n, {}).get("peak_mb")
            line[f"MB, {n:,}"] = "" if peak is None else f"{peak:.1f}" if peak >= 0.1 else "< 0.1"
        table.append(line)
    return table


def plot(rows: Sequence[Row], path: Path) -> None:
    """Draw set-up and solve over n."""
    # A figure made without pyplot is drawn by Agg: it needs no screen.
    figure = Figure(figsize=(8, 5), layout="constrained")
    axes = figure.subplots()
    axes.set(xlabel="n", ylabel="set-up + solve, CPU seconds", yscale="log")
    axes.set_xscale("log", base=2)
    axes.grid(alpha=0.3)
    for method in METHODS:
        own = [row for row in rows if row["method"] == method.name and "note" not in row]
        if method.colour and own:
            seconds = [row["setup_s"] + row["solve_s"] for row in own]
            style: dict[str, Any] = {"color": method.colour, "markersize": 4.0}
            axes.plot([row["n"] for row in own], seconds, method.style, label=method.name, **style)
    axes.legend()
    axes.set_title("Time to a true residual of 1e-8 (solid: this package)")
    report.write_figure(path, figure, dpi=130)


@report.interruptible
def main(argv: Sequence[str] | None = None) -> None:
    """Run the comparison."""
    prepare("comparisons.baselines")  # What every measured process imports, imported once.
    arguments = report.options(
        "baselines", "Compare every method on one system.", argv=argv, sizes=[]
    )
    sizes = arguments.sizes or (QUICK_SIZES if arguments.quick else SIZES)
    room = {"n": 7, "method": 25, "setup_s": 8, "solve_s": 8, "peak_mb": 7, "residual": 8}
    title = "Each method to a true residual of 1e-8: CPU seconds, and MB of memory"
    table = report.Table(title, arguments.output / "baselines.csv", FORMATS, room)
    table.extend(run(METHODS, sizes))
    plot(table.rows, arguments.output / "baselines.png")


if __name__ == "__main__":
    main()
