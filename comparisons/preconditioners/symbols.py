"""Every preconditioner of CG on many symbols: iterations, work units and time to 1e-8.

The matrices are in `systems.symbols`, with a constant and a random right-hand side. The last method
is `solve_toeplitz` itself, with ``rtol=1e-8``: the preconditioner that it picks, or another method;
its work includes the check of the residual. A method that did not converge in 200 iterations is
not run at a larger n. How a run is measured is in `measuring`.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg

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
from comparisons.harness.report import Row
from comparisons.systems.symbols import COLUMNS, column
from toeplitz_mg._typing import Array

SIZES = tuple(2**k for k in (8, 11, 14, 17, 20))
MAXITER = 200  # Iterations after which a method is not run at a larger n.
TABULATED = 2**14  # The size in the table of the page.
LEFT_OUT = ("none", "Strang")  # Of that table.
TITLE = """Iterations / work units / seconds, set-up included; (true residual) where rounding ends
above 1e-8; > : over 200 iterations; - : refused; direct: Levinson's recursion"""
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


def run(
    folder: Path, sizes: Sequence[int] = SIZES, symbols: Sequence[str] = tuple(COLUMNS)
) -> None:
    """Measure every method on every system: a row for each, printed where all are there."""
    table = report.Table(TITLE, room={"symbol": 15} | {c.name: 16 for c in CONTENDERS})
    rows: list[Row] = []
    for name in symbols:
        too_many: set[tuple[str, str]] = set()
        for n in sizes:
            for kind, system in samples(name, n).items():
                line: Row = {"symbol": name, "n": n, "rhs": kind}
                for contender in CONTENDERS:
                    key = kind, contender.name
                    if key in too_many:
                        measurement = Measurement(note=f"over {MAXITER} iterations before")
                    else:
                        measurement = measure(contender, system)
                        if measurement.iterations == MAXITER:
                            too_many.add(key)
                    row = {"symbol": name, "n": n, "rhs": kind, "method": contender.name}
                    rows.append(row | asdict(measurement))
                    line[contender.name] = cell(rows[-1])
                report.write_csv(folder / "symbols.csv", rows)
                table.add(line)


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


def arrange(rows: Sequence[Row], n: int = TABULATED) -> list[Row]:
    """Return the table of iterations and work units for a random right-hand side."""
    table = []
    of_page = [row for row in rows if row["n"] == n and row["rhs"] == "random"]
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
