"""Tables I-IX of the paper: ours beside its legible cells, work units counted."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.sparse.linalg import LinearOperator
from tqdm import tqdm

import toeplitz_mg as tmg
from comparisons.harness.measuring import solve
from comparisons.harness.report import Row, group, options, show, write_csv
from toeplitz_mg._typing import Preconditioner
from toeplitz_mg.multigrid_cycle.hierarchy import Level
from toeplitz_mg.multigrid_cycle.transfer import Transfer
from toeplitz_mg.paper import problems, published
from toeplitz_mg.paper.problems import TESTS
from toeplitz_mg.preconditioners.direct import DenseInverse

CYCLES = {"V(1,1)": (1, 1), "V(1,0)": (1, 0), "V(0,1)": (0, 1)}
CELLS = "cells.csv"  # The cells of all tables but the first and the sixth, which follows from them.
# The numbers of the tables in the order of the page, and which smoother they are of.
SMOOTHERS = {4: "RSM", 5: "RSM", 8: "RSM", 7: "RSM", 9: "RSM", 2: "SD", 3: "SD"}

# Tables of cycles by their numbers: title, smoother, what is published, and the test.
CYCLE_TABLES: dict[
    str, tuple[str, Preconditioner, dict[tuple[int, str], published.Column], int]
] = {
    "2": ("Table II. FFT+SD smoother, test 1", tmg.fft_sd_preconditioner, published.DEFLATION, 1),
    "3": ("Table III. FFT+SD smoother, test 2", tmg.fft_sd_preconditioner, published.DEFLATION, 2),
    "4": ("Table IV. FFT+RSM smoother, test 1", tmg.fft_rsm_preconditioner, published.ROW_SUM, 1),
    "5": ("Table V. FFT+RSM smoother, test 2", tmg.fft_rsm_preconditioner, published.ROW_SUM, 2),
    "8": ("Table VIII. FFT+RSM smoother, test 3", tmg.fft_rsm_preconditioner, published.ROW_SUM, 3),
}
# Tables of the smoother as a solver: title and tests.
SOLVER_TABLES: dict[str, tuple[str, tuple[int, ...]]] = {
    "7": ("Table VII. FFT+RSM as a solver", (1, 2)),
    "9": ("Table IX. FFT+RSM as a solver, test 3", (3,)),
}


@dataclass(frozen=True)
class Cell:
    """One cell of a table."""

    test: int
    method: str
    log_n: int
    iterations: int
    factor: float
    work_units: float
    converged: bool
    paper: published.Published | None

    @classmethod
    def read(cls, row: Row) -> "Cell":
        """Return the cell that a row of the CSV file is of."""
        paper = None
        if "paper_iterations" in row:
            paper = published.Published(row["paper_iterations"], row["paper_factor"])
        log_n = row["n"].bit_length() - 1
        own = {key: row[key] for key in ("test", "method", "iterations", "factor")}
        own |= {key: row[key] for key in ("work_units", "converged")}
        return cls(log_n=log_n, paper=paper, **own)

    def row(self) -> Row:
        """Return the cell as a row of the CSV file."""
        return {
            "test": self.test,
            "method": self.method,
            "n": 2**self.log_n,
            "iterations": self.iterations,
            "factor": f"{self.factor:.4f}",
            "work_units": f"{self.work_units:.1f}",
            "converged": self.converged,
            "paper_iterations": self.paper.iterations if self.paper else "",
            "paper_factor": self.paper.factor if self.paper else "",
        }


def papers_cycle(problem: problems.Problem, cycle: str, smoother: Preconditioner) -> LinearOperator:
    """Return the cycle as in the paper: coarse grids discretised anew, down to 2 x 1.

    It is made of its levels, as `multigrid` refuses what diverges, which Table I is about.
    """
    coarsen = tmg.rediscretised(problem.operator_of_grid_shape)
    A: LinearOperator = problem.A
    levels: list[Level] = []
    while A.shape[0] > 2 and (transfer := Transfer.of(A)).has_coarse_grid:
        levels.append(Level(A, smoother(A), transfer))
        A = coarsen(A)
    levels.append(Level(A, DenseInverse(A), None))
    pre, post = CYCLES[cycle]
    return tmg.Multigrid(tuple(levels), pre, post, gamma=1)


def measure(
    test: int,
    method: str,
    log_n: int,
    build: Callable[[problems.Problem], LinearOperator],
    paper: published.Published | None,
) -> Cell:
    """Solve as in §5: random guess, ‖r‖/‖u‖ ≤ 1e-8; factor (‖r_k‖/‖r_0‖)^(1/k)."""
    problem = TESTS[test](2**log_n)
    M = build(problem)
    guess = np.random.default_rng(0).random(len(problem.b))
    first = np.linalg.norm(problem.b - problem.A @ guess) / np.linalg.norm(problem.b)
    run = solve(problem.A, problem.b, lambda _: M, guess, solver=tmg.richardson, maxiter=200)
    factor = float((run.residual / first) ** (1 / run.iterations))
    return Cell(test, method, log_n, run.iterations, factor, run.solve_units, run.info == 0, paper)


def spectral_radii(cycle: str) -> Iterator[tuple[int, float]]:
    """Yield n and ρ(I - B A) of Table I, B the cycle with the plain FFT smoother."""
    for n in published.SPECTRAL_RADII[cycle]:
        problem = problems.test1(n)
        B = papers_cycle(problem, cycle, tmg.fft_preconditioner)
        iteration = np.eye(n) - B @ problem.A.toarray()
        yield n, float(np.abs(np.linalg.eigvals(iteration)).max())


def table_of(runs: list[Cell], smoother: str = "") -> list[Row]:
    """Return two rows a method, ours and the paper's: iterations (convergence factor)."""
    rows = []
    for test, method in dict.fromkeys((run.test, run.method) for run in runs):
        ours: Row = {"": f"{smoother} test {test} {method}, ours".lstrip()}
        theirs: Row = {"": "the paper"}
        for run in runs:
            if (run.test, run.method) == (test, method):
                column = f"2^{run.log_n}"
                ours[column] = (
                    f"{run.iterations} ({run.factor:.4f})" if run.converged else "diverges"
                )
                theirs[column] = (
                    f"{run.paper.iterations} ({run.paper.factor:.4f})" if run.paper else ""
                )
        rows += [ours, theirs]
    return rows


def arrange(rows: Sequence[Row]) -> list[Row]:
    """Return the table of all cells, with the work units of the largest problem."""
    lines: list[Row] = []
    tables = group(rows, "table")
    for number, smoother in SMOOTHERS.items():
        for own in group(tables[number], "test", "method").values():
            runs = [Cell.read(row) for row in own]
            ours, theirs = table_of(runs, smoother)
            last = runs[-1]
            units = f"work units, 2^{last.log_n}"
            ours[units] = f"{last.work_units:.0f}" if last.converged else ""
            if smoother == "RSM" and last.log_n == 20:
                theirs[units] = published.WORK_UNITS[last.test, last.method]
            lines.append(ours)
            if any(run.paper for run in runs):
                lines.append({key: f"*{text}*" if text else "" for key, text in theirs.items()})
    return lines


def work_table(runs: list[Cell]) -> list[Row]:
    """Return Table VI and the work of the solver: ours counted, the paper's for n = 2^20."""
    rows: list[Row] = []
    for run in runs:
        rows.append(
            {
                "test": run.test,
                "method": run.method,
                "n": f"2^{run.log_n}",
                "iterations": run.iterations,
                "work units, counted": f"{run.work_units:.1f}",
                "the paper": published.WORK_UNITS[run.test, run.method] if run.log_n == 20 else "",
            }
        )
    return rows


def tabulate_radii() -> list[Row]:
    """Return Table I: two rows a cycle, ours and the paper's."""
    rows: list[Row] = []
    for cycle, paper in published.SPECTRAL_RADII.items():
        radii = dict(spectral_radii(cycle))
        rows.append({"": f"{cycle}, ours"} | {f"n = {n}": f"{r:.3g}" for n, r in radii.items()})
        rows.append({"": "the paper"} | {f"n = {n}": f"{r:.3g}" for n, r in paper.items()})
    return rows


def measure_cycles(number: str, sizes: Sequence[int]) -> Iterator[Cell]:
    """Yield the cells of a table of cycles."""
    _, smoother, columns, test = CYCLE_TABLES[number]
    for cycle in CYCLES:
        build = partial(papers_cycle, cycle=cycle, smoother=smoother)
        for log_n in sizes:
            yield measure(test, cycle, log_n, build, columns.get((test, cycle), {}).get(log_n))


def measure_solvers(number: str, sizes: Sequence[int]) -> Iterator[Cell]:
    """Yield the cells of a table of the FFT+RSM smoother as a solver."""
    _, tests = SOLVER_TABLES[number]
    for test in tests:
        for log_n in sizes:
            paper = published.SOLVER[test].get(log_n)
            yield measure(test, "solver", log_n, lambda p: tmg.fft_rsm_preconditioner(p.A), paper)


def main() -> None:
    """Run all tables."""
    arguments = options("paper.tables", __doc__ or "")
    sizes = range(10, 14) if arguments.quick else range(15, 21)
    rows = tabulate_radii()
    show("Table I. Spectral radii with the FFT smoother", rows)
    write_csv(arguments.output / "table_1.csv", rows)
    titles = {number: title for number, (title, *_) in (CYCLE_TABLES | SOLVER_TABLES).items()}
    tables: dict[str, list[Cell]] = {}
    with tqdm(total=(len(CYCLE_TABLES) * len(CYCLES) + len(TESTS)) * len(sizes), unit="run") as bar:
        for number in titles:
            run = measure_cycles if number in CYCLE_TABLES else measure_solvers
            tables[number] = []
            for cell in run(number, sizes):
                tables[number].append(cell)
                bar.update()
    cells: list[Row] = []
    for number, runs in sorted(tables.items()):
        show(f"{titles[number]}: iterations (convergence factor)", table_of(runs))
        cells += [{"table": number} | run.row() for run in runs]
    write_csv(arguments.output / CELLS, cells)
    of_rsm = [run for number in ("4", "5", "8", "7", "9") for run in tables[number]]
    work = work_table([run for run in of_rsm if run.log_n == sizes[-1]])
    show("Table VI, and the work of §5.3 and §5.4. Work units", work)
    write_csv(arguments.output / "table_6.csv", work)


if __name__ == "__main__":
    main()
