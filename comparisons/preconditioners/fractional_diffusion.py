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
on Riesz derivatives of every order from 1.1 to 1.9 and n = 2^k - 1: it is an error if
one takes more than 9 iterations for a constant load, or more than 10 for a random one. Here it is
SciPy's CG, which stops by the recurrence for the residual: with condition numbers of up to 1e11
there is no x in float64 with a residual of 1e-8.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg
from tqdm import tqdm

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
QUICK_SIZES = {1: (2**6 - 1, 2**10 - 1), 2: (2**5 - 1,)}
LEVELS, QUICK_LEVELS = {1: 20, 2: 10}, {1: 10, 2: 5}  # Largest k of n = 2^k - 1 along an axis.
GROWING = {1: (2**14 - 1, 2**17 - 1, 2**20 - 1), 2: (2**7 - 1, 2**10 - 1)}  # For τ alone.
QUICK_GROWING = {1: (2**6 - 1, 2**8 - 1), 2: (2**3 - 1, 2**4 - 1)}
GROWING_ORDER = 1.5
MANY = 40  # Iterations after which τ is not run at a larger n.
PUBLISHED = "≤ 15"  # Iterations of CG to 1e-8 with eigenvalues in (1/2, 3/2), whatever n.
# Iterations of τ, in one level and in two. A random load, which is rough at the ends too, takes one
# more from 2^19 points on.
MOST = {"constant": 9, "random": 10}

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
    problems: Sequence[str],
    orders: Sequence[float],
    sizes: Mapping[int, Sequence[int]],
    methods: Sequence[str],
) -> Iterator[list[Row]]:
    """Measure every problem; yield the rows so far after each of them."""
    rows: list[Row] = []
    cases = [
        (problem, axes, order, n)
        for axes, lengths in sizes.items()
        for problem in problems
        for order in orders
        for n in lengths
    ]
    for problem, axes, order, n in tqdm(cases, unit="problem"):
        rows += measure(problem, axes, order, n, methods)
        yield rows


def grow(problems: Sequence[str], sizes: Mapping[int, Sequence[int]]) -> Iterator[list[Row]]:
    """Solve every problem with τ, while it takes few iterations; yield the rows so far."""
    rows: list[Row] = []
    cases = [(problem, axes) for axes in sizes for problem in problems]
    for problem, axes in tqdm(cases, unit="problem"):
        for n in sizes[axes]:
            rows += measure(problem, axes, GROWING_ORDER, n, ["tau"])
            yield rows
            if not isinstance(count := rows[-1].get("iterations"), int) or count > MANY:
                break


def check(orders: Sequence[float], levels: Mapping[int, int]) -> Iterator[Row]:
    """Count the iterations of τ on Riesz derivatives, for each n = 2^k - 1."""
    cases = [(axes, order) for axes in levels for order in orders]
    for axes, order in tqdm(cases, unit="order"):
        rows: dict[str, Row] = {load: {"axes": axes, "order": order, "load": load} for load in MOST}
        for k in range(1, levels[axes] + 1):
            A = riesz(axes, 0.0, order, 2**k - 1)
            M = tmg.tau_preconditioner(A)
            n = A.shape[0]
            loads = {"constant": np.ones(n), "random": np.random.default_rng(0).standard_normal(n)}
            for load, b in loads.items():
                options = {"rtol": TOLERANCE, "maxiter": MAXITER, "solver": cg}
                rows[load][f"2^{k} - 1"] = iterate(A, b, M=M, **options)[1]
        yield from rows.values()


def tabulate(rows: Sequence[Row]) -> list[Row]:
    """Return a line for each problem and order: iterations by method, one number for each n."""
    table: list[Row] = []
    for (problem, axes, order), own in report.group(rows, "problem", "axes", "order").items():
        sizes = ", ".join(str(n) for n in report.group(own, "n"))
        line: Row = {"problem": problem, "order": order, "n": sizes + (" squared" * (axes > 1))}
        for method, measured in report.group(own, "method").items():
            line[method] = ", ".join(str(row.get("iterations", "refused")) for row in measured)
        line["τ published"] = next((row["published"] for row in own if row["published"]), "")
        table.append(line)
    return table


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


def main(
    quick_sizes: Mapping[int, Sequence[int]] = QUICK_SIZES,
    quick_growing: Mapping[int, Sequence[int]] = QUICK_GROWING,
    quick_levels: Mapping[int, int] = QUICK_LEVELS,
) -> None:
    """Run the comparison."""
    arguments = report.options(
        "preconditioners.fractional_diffusion",
        f"{TITLE}: iterations of τ and of its rivals.",
        problems=tuple(PROBLEMS[1]),
        orders=CHECKED_ORDERS,
        methods=tuple(METHODS),
    )
    sizes, levels = (quick_sizes, quick_levels) if arguments.quick else (SIZES, LEVELS)
    methods = arguments.methods or tuple(METHODS)
    rows: list[Row] = []
    problems = arguments.problems or tuple(PROBLEMS[1])
    for rows in run(problems, arguments.orders or ORDERS, sizes, methods):
        report.write_csv(arguments.output / "fractional_diffusion.csv", rows)
    report.show("Iterations to a residual of 1e-8", tabulate(rows))
    for rows in grow(problems, quick_growing if arguments.quick else GROWING):
        report.write_csv(arguments.output / "growing.csv", rows)
    report.show("τ as n grows", tabulate(rows))
    checked = list(check(arguments.orders or CHECKED_ORDERS, levels))
    report.write_csv(arguments.output / "tau.csv", checked)
    report.show("Iterations of τ on Riesz derivatives, by the points along an axis", checked)
    for load, most in MOST.items():
        own = [row for row in checked if row["load"] == load]
        count = max(n for row in own for key, n in row.items() if key.startswith("2^"))
        if count > most:
            sys.exit(f"τ takes {count} iterations for a {load} load, but {most} are allowed")
        print(f"τ takes at most {count} iterations for a {load} load; {most} are allowed.")


if __name__ == "__main__":
    main()
