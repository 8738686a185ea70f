"""Tables I-IX of the paper: ours beside its legible cells, work units counted."""

import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from scipy.sparse.linalg import LinearOperator

import toeplitz_mg as tmg
from comparisons.harness.measuring import solve
from comparisons.harness.report import Row, Table, format_cells, group
from toeplitz_mg._typing import Preconditioner
from toeplitz_mg.paper import algorithm, problems, published
from toeplitz_mg.paper.problems import TESTS

CYCLES = {"V(1,1)": (1, 1), "V(1,0)": (1, 0), "V(0,1)": (0, 1)}
CELLS = "cells.csv"  # The cells of all tables but the first and the sixth, which follows from them.
MAXITER = 200
# The numbers of the tables in the order of the page, and which smoother they are of.
SMOOTHERS = {"4": "RSM", "5": "RSM", "8": "RSM", "7": "RSM", "9": "RSM", "2": "SD", "3": "SD"}
# Tables of cycles by their numbers: the smoother, what is published, and the test.
CYCLE_TABLES: dict[str, tuple[Preconditioner, dict[tuple[int, str], published.Column], int]] = {
    "2": (tmg.fft_sd_preconditioner, published.DEFLATION, 1),
    "3": (tmg.fft_sd_preconditioner, published.DEFLATION, 2),
    "4": (tmg.fft_rsm_preconditioner, published.ROW_SUM, 1),
    "5": (tmg.fft_rsm_preconditioner, published.ROW_SUM, 2),
    "8": (tmg.fft_rsm_preconditioner, published.ROW_SUM, 3),
}
SOLVER_TABLES = {"7": (1, 2), "9": (3,)}  # Of the smoother as a solver: tests.


def papers_cycle(problem: problems.Problem, cycle: str, smoother: Preconditioner) -> LinearOperator:
    """Return the cycle as in the paper: coarse grids discretised anew, down to 2 x 1.

    Table I is about the plain FFT smoother, which diverges, as `multigrid` warns.
    """
    pre, post = CYCLES[cycle]
    coarsen = tmg.rediscretised(problem.operator_of_grid_shape)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "the smoother .* diverges")
        return tmg.multigrid(
            problem.A, smoother=smoother, pre=pre, post=post, coarsest=2, coarsen=coarsen
        )


def measure(
    test: int,
    method: str,
    log_n: int,
    build: Callable[[problems.Problem], LinearOperator],
    paper: published.Published | None,
) -> Row:
    """Solve as in §5: random guess, ‖r‖/‖u‖ ≤ 1e-8; factor (‖r_k‖/‖r_0‖)^(1/k)."""
    problem = TESTS[test](2**log_n)
    M = build(problem)
    guess = np.random.default_rng(0).random(len(problem.b))
    first = np.linalg.norm(problem.b - problem.A @ guess) / np.linalg.norm(problem.b)
    run = solve(problem.A, problem.b, lambda _: M, guess, solver=tmg.richardson, maxiter=MAXITER)
    row: Row = {"test": test, "method": method, "n": 2**log_n, "iterations": run.iterations}
    row["factor"] = float((run.residual / first) ** (1 / run.iterations))
    row |= {"work_units": run.solve_units, "converged": run.info == 0}
    row["paper_iterations"] = paper.iterations if paper else None
    return row | {"paper_factor": paper.factor if paper else None}


def spectral_radii(cycle: str) -> Iterator[tuple[int, float]]:
    """Yield n and ρ(I - B A) of Table I, B the cycle with the plain FFT smoother.

    By `algorithm`, as `multigrid` keeps a smoother that diverges off the small grids.
    """
    for n in published.SPECTRAL_RADII[cycle]:
        levels, one = algorithm.grids(1, n, algorithm.fft_smoother), np.eye(n)
        A, _ = levels[0]
        iteration = one - algorithm.cycle(levels, A @ one, *CYCLES[cycle])
        yield n, float(np.abs(np.linalg.eigvals(iteration)).max())


def tabulate_radii() -> Iterator[Row]:
    """Yield Table I: two rows a cycle, ours and the paper's."""
    for cycle, paper in published.SPECTRAL_RADII.items():
        radii = dict(spectral_radii(cycle))
        yield {"": f"{cycle}, ours"} | {f"n = {n}": f"{r:.3g}" for n, r in radii.items()}
        yield {"": "the paper"} | {f"n = {n}": f"{r:.3g}" for n, r in paper.items()}


def measure_table(number: str, sizes: Sequence[int]) -> Iterator[Row]:
    """Yield the cells of a table, of cycles or of the FFT+RSM smoother as a solver."""
    if number in SOLVER_TABLES:
        for test in SOLVER_TABLES[number]:
            for k in sizes:
                paper = published.SOLVER[test].get(k)
                row = measure(test, "solver", k, lambda p: tmg.fft_rsm_preconditioner(p.A), paper)
                yield {"table": number} | row
        return
    smoother, columns, test = CYCLE_TABLES[number]
    for cycle in CYCLES:
        build = partial(papers_cycle, cycle=cycle, smoother=smoother)
        for k in sizes:
            paper = columns.get((test, cycle), {}).get(k)
            yield {"table": number} | measure(test, cycle, k, build, paper)


def arrange(rows: Sequence[Row]) -> list[Row]:
    """Return two rows a method, ours and the paper's, with the work units of the largest n."""
    lines: list[Row] = []
    tables = group(rows, "table")
    for number, smoother in SMOOTHERS.items():
        for (test, method), own in group(tables[int(number)], "test", "method").items():
            ours: Row = {"": f"{smoother} test {test} {method}, ours"}
            theirs: Row = {"": "*the paper*"}
            for row in own:
                column = f"2^{row['n'].bit_length() - 1}"
                done = f"{row['iterations']} ({row['factor']:.4f})"
                ours[column] = done if row["converged"] else "diverges"
                if "paper_iterations" in row:
                    paper = f"{row['paper_iterations']} ({row['paper_factor']:.4f})"
                    theirs[column] = f"*{paper}*"
            last = own[-1]
            units = f"work units, {column}"
            ours[units] = f"{last['work_units']:.0f}" if last["converged"] else ""
            lines.append(ours)
            if len(theirs) > 1:
                if smoother == "RSM" and last["n"] == 2**20:
                    theirs[units] = f"*{published.WORK_UNITS[test, method]}*"
                lines.append(theirs)
    return lines


def form(row: Row) -> Row:
    """Return a cell as it is printed."""
    formats = {"table": "", "test": "", "method": "", "n": "", "iterations": "", "factor": ".4f"}
    formats |= {"work_units": ".1f", "paper_iterations": "", "paper_factor": ".4f"}
    if not row["converged"]:
        row = row | {"iterations": "diverges", "factor": None, "work_units": None}
    units = published.WORK_UNITS.get((row["test"], row["method"]))
    is_known = row["n"] == 2**20 and SMOOTHERS[row["table"]] == "RSM"
    return format_cells(row, formats) | {"paper_units": str(units) if is_known else ""}


def run(folder: Path, sizes: Sequence[int]) -> None:
    """Run all tables; Table VI, of work units, is in the cells of the others."""
    title = "Table I. Spectral radii with the FFT smoother"
    Table(title, folder / "table_1.csv", room={"": 13}).extend(tabulate_radii())
    title = """Tables II and III, FFT+SD smoother; IV, V and VIII, FFT+RSM; VII and IX, FFT+RSM as a
solver; VI, work units: iterations to 1e-8, and the convergence factor"""
    table = Table(title, folder / CELLS, form, {"n": 7, "iterations": 8})
    for number in sorted(SMOOTHERS):
        table.extend(measure_table(number, sizes))
