"""Fractional diffusion: iterations of τ and of its rivals on the standard problems.

Steady and one step in time, derivatives of Riesz and two-sided ones of Riemann and Liouville,
constant and variable coefficients, on one axis and on two (`comparisons.systems.fractional`). CG
for symmetric matrices, GMRES for others, from a zero guess to a true residual of
1e-8, for a random right-hand side. Of a matrix that is not symmetric all but T. Chan's circulant
are those of the symmetric part.

Beside them stand the iterations of τ as published: the eigenvalues of the preconditioned matrix lie
between 1/2 and 3/2 for constant coefficients of Riesz (Huang, Lin, Ng, Sun 2022), so that CG takes
at most 15 iterations to 1e-8.

Then τ alone on all of them as n grows, up to 2^20 unknowns, as long as it takes few iterations, and
on Riesz derivatives of every order from 1.1 to 1.9 and n = 2^k - 1. There it is SciPy's CG, which
stops by the recurrence for the residual: with condition numbers of up to 1e11 there is no x in
float64 with a residual of 1e-8.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.measuring import PRECONDITIONERS, TOLERANCE, Choice, Run, iterate, solve
from comparisons.harness.report import Row
from comparisons.systems.fractional import PROBLEMS, riesz

TITLE = "Fractional diffusion"
MAXITER = 100  # Iterations after which a method has not converged.
ORDERS = (1.2, 1.5, 1.8)
CHECKED_ORDERS = tuple(k / 10 for k in range(11, 20))
SIZES = {1: (2**8 - 1, 2**11 - 1, 2**14 - 1), 2: (2**4 - 1, 2**5 - 1, 2**7 - 1)}
LEVELS = {1: 20, 2: 10}  # Largest k of n = 2^k - 1 along an axis.
GROWING = {1: (2**14 - 1, 2**17 - 1, 2**20 - 1), 2: (2**7 - 1, 2**10 - 1)}  # For τ alone.
GROWING_ORDER = 1.5
MANY = 40  # Iterations after which τ is not run at a larger n.
PUBLISHED = "≤ 15"  # Iterations of CG to 1e-8 with eigenvalues in (1/2, 3/2), whatever n.

METHODS: dict[str, Choice] = {
    "tau": tmg.tau_preconditioner,
    "sine": PRECONDITIONERS["sine"],
    "cosine": PRECONDITIONERS["cosine"],
    "T. Chan": PRECONDITIONERS["T. Chan"],
    "default": PRECONDITIONERS["default"],
}


def run_one(S: LinearOperator, preconditioner: Choice) -> Run:
    """Set up and solve, by CG where the matrix is symmetric, else by GMRES."""
    b = np.random.default_rng(0).standard_normal(S.shape[0])
    if S.H is S:
        return solve(S, b, preconditioner, maxiter=MAXITER)
    # The second cycle is for what the recurrence for the residual has missed by.
    cycles = {"restart": MAXITER, "maxiter": 2, "callback_type": "pr_norm"}
    return solve(S, b, _of_part(preconditioner), solver=tmg.gmres, **cycles)


def _of_part(preconditioner: Choice) -> Choice:
    """Return a preconditioner that takes the symmetric part where it needs one."""

    def of_part(S: LinearOperator) -> LinearOperator | None:
        try:
            return preconditioner(S)
        except ValueError:
            return preconditioner((S + S.T) / 2)

    return of_part


def measure(problem: str, axes: int, order: float, n: int, methods: Sequence[str]) -> Iterator[Row]:
    """Solve a problem with each of the methods."""
    S = PROBLEMS[axes][problem](order, n)
    for method in methods:
        row: Row = {"problem": problem, "axes": axes, "order": order, "n": n, "method": method}
        published = PUBLISHED if method == "tau" and problem.startswith("Riesz,") else ""
        try:
            solved = run_one(S, METHODS[method])
        except np.linalg.LinAlgError as error:
            yield row | {"published": published, "note": str(error)[:60]}
        else:
            measured = {"iterations": solved.count, "units": solved.units, "cpu_s": solved.seconds}
            measured |= {"residual": solved.residual, "published": published, "note": ""}
            yield row | measured


def run(
    folder: Path,
    sizes: Mapping[int, Sequence[int]] = SIZES,
    growing: Mapping[int, Sequence[int]] = GROWING,
    levels: Mapping[int, int] = LEVELS,
    problems: Sequence[str] = tuple(PROBLEMS[1]),
    orders: Sequence[float] = ORDERS,
) -> None:
    """Measure every problem by all methods, τ as n grows, and τ on Riesz derivatives."""
    room = {"problem": 33, "method": 8}
    table = report.Table("Iterations to a residual of 1e-8", folder / "fractional.csv", form, room)
    for axes, lengths in sizes.items():
        for problem in problems:
            for order in orders:
                for n in lengths:
                    table.extend(measure(problem, axes, order, n, tuple(METHODS)))
    table = report.Table("τ as n grows", folder / "growing.csv", form, room)
    for axes, lengths in growing.items():
        for problem in problems:
            for n in lengths:
                table.extend(measure(problem, axes, GROWING_ORDER, n, ["tau"]))
                if not isinstance(k := table.rows[-1].get("iterations"), int) or k > MANY:
                    break
    table = report.Table("Iterations of τ on Riesz derivatives, n = 2^k - 1", folder / "tau.csv")
    table.extend(count_on_riesz(CHECKED_ORDERS, levels))


def form(row: Row) -> Row:
    """Return a row as it is printed."""
    formats = {"iterations": "", "published": "", "units": ".1f", "cpu_s": ".3g", "note": ""}
    names = {key: row[key] for key in ("problem", "axes", "order", "n", "method")}
    return names | report.format_cells(row, formats)


def count_on_riesz(orders: Sequence[float], levels: Mapping[int, int]) -> Iterator[Row]:
    """Count the iterations of τ on Riesz derivatives, for a constant and a random load."""
    for axes, most in levels.items():
        for order in orders:
            counts: dict[str, list[int]] = {"constant": [], "random": []}
            for k in range(1, most + 1):
                A = riesz(axes, 0.0, order, 2**k - 1)
                M, n = tmg.tau_preconditioner(A), A.shape[0]
                random = np.random.default_rng(0).standard_normal(n)
                for load, b in (("constant", np.ones(n)), ("random", random)):
                    options = {"rtol": TOLERANCE, "maxiter": MAXITER, "solver": cg}
                    counts[load].append(iterate(A, b, M=M, **options)[1])
            for load, own in counts.items():
                row: Row = {"axes": axes, "order": order, "load": load, "most": max(own)}
                yield row | {"k = 1, 2, …": " ".join(map(str, own))}


def arrange(rows: Sequence[Row]) -> list[Row]:
    """Return the table of docs/which_method.md: a line for each problem, of its largest matrices.

    The iterations are those of each order, one after the other.
    """
    table: list[Row] = []
    for (axes, problem), own in report.group(rows, "axes", "problem").items():
        n = max(row["n"] for row in own)
        line: Row = {"problem": problem, "n": f"{n}" + " squared" * (axes > 1)}
        largest = [row for row in own if row["n"] == n]
        for method, measured in report.group(largest, "method").items():
            counts = [row.get("iterations") for row in measured]
            line[method] = ", ".join("refused" if k is None else str(k) for k in counts)
        line["τ published"] = largest[0].get("published") or ""
        table.append(line)
    return table


def arrange_growing(rows: Sequence[Row]) -> list[Row]:
    """Return the table of docs/which_method.md of τ alone: a line for each problem, n across."""
    table: list[Row] = []
    for problem, own in report.group(rows, "problem").items():
        line: Row = {"problem": problem}
        found = {(row["axes"], row["n"]): row for row in own if row.get("iterations")}
        for axes, lengths in GROWING.items():
            for n in lengths:
                row = found.get((axes, n))
                cell = f"{row['iterations']} / {row['cpu_s']:.2g} s" if row else "-"
                line[f"n = {n}" + " squared" * (axes > 1)] = cell
        table.append(line)
    return table
