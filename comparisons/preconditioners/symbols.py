"""Every preconditioner of CG on many symbols: iterations, work units and time to 1e-8.

The matrices are in `symbols`, with a constant and a random right-hand side. The last method is
`solve_toeplitz` itself, with ``rtol=1e-8``: the preconditioner that it picks, or another method;
its work includes the check of the residual. A method that did not converge in 200 iterations is
not run at a larger n. How a run is measured is in `measuring`.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from operator import itemgetter
from pathlib import Path

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg
from tqdm import tqdm

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.measuring import (
    PRECONDITIONERS,
    TOLERANCE,
    Contender,
    Measurement,
    Solve,
    System,
    by_iteration,
    measure,
)
from comparisons.harness.processes import prepare
from comparisons.harness.report import Row
from comparisons.systems.symbols import COLUMNS, column
from toeplitz_mg._typing import Array

SIZES = tuple(2**k for k in (8, 11, 14, 17, 20))
QUICK_SIZES = SIZES[:2]
MAXITER = 200  # Iterations after which a method is not run at a larger n.
TABULATED = 2**14  # The size in the table of the page.
LEFT_OUT = ("none", "Strang")  # Of that table.
OVERHEAD = 1.5  # Work units of `solve_toeplitz` for the transform of A and the check of x.
# Interpolation for the zero of a symbol; a positive one can do with copies.
INTERPOLATIONS = {
    "|θ|": tmg.linear_interpolation,
    "|θ|^1.5": tmg.linear_interpolation,
    "θ²": tmg.linear_interpolation,
    "2 - 2 cos θ": tmg.linear_interpolation,
    "2 + 2 cos θ": tmg.modulated_interpolation,
    "|θ|³": tmg.Interpolation((0.125, 0.5, 0.75, 0.5, 0.125)),
    "θ⁴": tmg.Interpolation((0.125, 0.5, 0.75, 0.5, 0.125)),
}


@dataclass(frozen=True)
class Sample:
    """A system to be measured."""

    name: str
    A: LinearOperator
    b: Array


def samples(name: str, n: int) -> dict[str, Sample]:
    """Return a symbol's systems, by the name of the right-hand side."""
    A = tmg.ToeplitzOperator(column(name, n))
    rhs = {"constant": np.ones(n), "random": np.random.default_rng(0).standard_normal(n)}
    return {kind: Sample(name, A, b) for kind, b in rhs.items()}


def v11(system: System) -> Solve:
    """Precondition by V(1,1): with M̄ where that exists, else with damped Jacobi."""
    interpolation = INTERPOLATIONS.get(system.name, tmg.piecewise_constant)
    cycle = partial(tmg.multigrid, pre=1, post=1, interpolation=interpolation)
    try:
        return by_iteration(cg, cycle, system, MAXITER)
    except np.linalg.LinAlgError:
        cycle = partial(cycle, smoother=tmg.jacobi_preconditioner)
        return by_iteration(cg, cycle, system, MAXITER)


def drop_in(system: System) -> Solve:
    """Solve by what `solve_toeplitz` takes; it has no set-up of its own."""

    def solve() -> tuple[Array, int]:
        x, info = tmg.solve_toeplitz(system.A.c, system.b, rtol=TOLERANCE, full_output=True)
        return x, info.iterations

    return solve


def by_cg(name: str) -> Contender:
    """Return CG with a preconditioner."""
    method = partial(by_iteration, cg, PRECONDITIONERS[name], maxiter=MAXITER)
    return Contender(name, method, ours=name not in ("none", "Strang", "T. Chan"))


CONTENDERS = (
    *map(by_cg, ("none", "Strang", "T. Chan", "M", "cosine", "sine", "spectral", "FSAI")),
    Contender("V(1,1)", v11, ours=True),
    Contender("solve_toeplitz", drop_in, ours=True),
)


def run(symbols: Sequence[str], sizes: Sequence[int], path: Path) -> list[Row]:
    """Measure every method on every system, and keep the table on disk up to date."""
    rows: list[Row] = []
    with tqdm(total=len(symbols) * len(sizes) * 2 * len(CONTENDERS), unit="run") as progress:
        for name in symbols:
            too_many: set[tuple[str, str]] = set()
            for n in sizes:
                for kind, system in samples(name, n).items():
                    for contender in CONTENDERS:
                        progress.set_postfix_str(f"{name}, n = {n}, {contender.name}")
                        key = kind, contender.name
                        if key in too_many:
                            measurement = Measurement(note=f"over {MAXITER} iterations before")
                        else:
                            measurement = measure(contender, system)
                            if measurement.iterations == MAXITER:
                                too_many.add(key)
                        measured = {"symbol": name, "n": n, "rhs": kind, "method": contender.name}
                        rows.append({**measured, **asdict(measurement)})
                        progress.update()
            report.write_csv(path, rows)
    return rows


def cell(row: Row) -> str:
    """Return iterations, work units and seconds, or why there are none."""
    if row["iterations"] is None:
        return ">" if "iterations" in row["note"] else "-"
    if row["iterations"] == MAXITER:
        return ">"
    iterations = "direct" if row["solve_units"] == 0.0 else str(row["iterations"])
    units = row["setup_units"] + row["solve_units"]
    rounding = "" if row["converged"] else f" ({row['residual']:.0e})"
    return f"{iterations} / {units:.0f} / {row['total_s']:.2g}{rounding}"


def show(rows: Sequence[Row]) -> None:
    """Print a table for each size and right-hand side, methods across."""
    for n, of_size in report.group(rows, "n").items():
        for kind, own in report.group(of_size, "rhs").items():
            table: dict[str, Row] = {}
            for row in own:
                table.setdefault(row["symbol"], {"symbol": row["symbol"]})
                table[row["symbol"]][row["method"]] = cell(row)
            report.show(f"n = {n}, {kind} right-hand side", list(table.values()))
    print(
        "\nIterations / work units / seconds, set-up included; (true residual) where rounding ends"
        f" above {TOLERANCE:g};\n> : over {MAXITER} iterations; - : refused, no positive "
        "eigenvalues; direct: Levinson's recursion."
    )


def arrange(rows: Sequence[Row]) -> list[Row]:
    """Return the table of iterations and work units for a random right-hand side."""
    table = []
    of_page = [row for row in rows if row["n"] == TABULATED and row["rhs"] == "random"]
    for name, own in report.group(of_page, "symbol").items():
        line: Row = {"symbol, or coefficients": name.replace("|", r"\|")}
        units: dict[str, float] = {}
        for row in own:
            if row["method"] in LEFT_OUT:
                continue
            if row.get("iterations") is None:
                line[row["method"]] = ">" if "iterations" in row["note"] else "–"
                continue
            work = row["setup_units"] + row["solve_units"]
            line[row["method"]] = f"{row['iterations']} / {work:.0f}"
            if row["iterations"] == MAXITER:
                line[row["method"]] = ">"
            elif not row["converged"]:
                line[row["method"]] += f" ({row['residual']:.0e})"
            else:
                units[row["method"]] = work
        units.pop("solve_toeplitz", None)  # It is one of the others, with a check.
        best = min(units, key=lambda key: units[key], default="")
        table.append(line | {"least work": best})
    return table


def show_the_choice(rows: Sequence[Row]) -> None:
    """Print how the preconditioner of `solve_toeplitz` compares to the best of the others.

    The transform of A and the product that checks the result are not counted as its work.
    """
    table = []
    for name, own in report.group(filter(itemgetter("solve_units"), rows), "symbol").items():
        ratios = []
        for pick in (row for row in own if row["method"] == "solve_toeplitz"):
            others = [
                row["setup_units"] + row["solve_units"]
                for row in own
                if (row["n"], row["rhs"]) == (pick["n"], pick["rhs"])
                and row["method"] != "solve_toeplitz"
                and row["residual"] <= 2 * max(pick["residual"], TOLERANCE)
            ]
            if others:
                ratios.append((pick["solve_units"] - OVERHEAD) / min(others))
        iterations = [row["iterations"] for row in own if row["method"] == "solve_toeplitz"]
        if ratios:
            table.append(
                {
                    "symbol": name,
                    "most iterations": max(iterations),
                    "work / best, most": f"{max(ratios):.2f}",
                    "least": f"{min(ratios):.2f}",
                }
            )
    report.show("The choice of solve_toeplitz, over all n and both right-hand sides", table)


def main(quick_sizes: Sequence[int] = QUICK_SIZES) -> None:
    """Run the comparison."""
    prepare("comparisons.preconditioners.symbols")
    arguments = report.options(
        "preconditioners.symbols", "Every preconditioner on many symbols.", symbols=tuple(COLUMNS)
    )
    rows = run(
        arguments.symbols or tuple(COLUMNS),
        quick_sizes if arguments.quick else SIZES,
        arguments.output / "symbols.csv",
    )
    show(rows)
    show_the_choice(rows)


if __name__ == "__main__":
    main()
