"""Nonsymmetric, Hermitian and indefinite matrices: iterations, time beside SciPy's, true residual.

GMRES, or CG where the matrix is Hermitian, to 1e-8 with each preconditioner that takes it, the
inverse, `solve_toeplitz` with ``rtol=1e-8`` and without, and Levinson's recursion as SciPy has it.
The time is that of the processor, from the coefficients to the solution, all methods in turns in
one process.
The symbols are in `systems.symbols`.
"""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import scipy.linalg

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.measuring import TOLERANCE, time_call
from comparisons.harness.processes import in_a_fresh_process
from comparisons.harness.report import Row
from comparisons.systems.symbols import HERMITIAN, INDEFINITE, NONSYMMETRIC, random_pair
from toeplitz_mg._typing import Array

KINDS = {
    "nonsymmetric": {**NONSYMMETRIC, "random entries": random_pair},
    "Hermitian": HERMITIAN,
    "indefinite": INDEFINITE,
}
SIZES = tuple(2**k for k in (10, 12, 14, 17, 20))
TABULATED = SIZES[1:3]  # Those of the table in docs.
LEVINSON = 2**14  # Largest n for SciPy's method, and for what has no other.
RESTART = 30  # Iterations of a cycle of GMRES.
MAXITER = 300  # Iterations after which a method is given up.
ENOUGH = 0.5  # CPU seconds of all turns, after which there are no more.
TURNS = 51  # Most turns.
TITLE = """Nonsymmetric, Hermitian and indefinite: iterations / CPU time of SciPy's over that of the
method, set-up included, or seconds where SciPy's takes too long / true residual; - : refused"""
EARLY = 0.2  # The quantile of all turns that is shown: others may use the machine.

Solution = tuple[Array, int | None]  # x, and the iterations where there are any.
Method = Callable[[Array, Array, Array], Solution]  # From the first column and row, and b.


def iterate(preconditioner: Any, c: Array, r: Array, b: Array) -> Solution:
    """Solve by CG or GMRES."""
    A = tmg.ToeplitzOperator(c, r)
    M = preconditioner(A)
    residuals: list[float] = []
    options = {"M": M, "rtol": TOLERANCE, "residuals": residuals}
    if A.is_hermitian:
        x, _ = tmg.cg(A, b, maxiter=MAXITER, **options)
    else:
        x, _ = tmg.gmres(A, b, restart=RESTART, maxiter=MAXITER // RESTART, **options)
    return x, len(residuals) - 1


def invert(c: Array, r: Array, b: Array) -> Solution:
    """Solve by the inverse."""
    return tmg.toeplitz_inverse(tmg.ToeplitzOperator(c, r), rtol=TOLERANCE) @ b, None


def drop_in(rtol: float | None, c: Array, r: Array, b: Array) -> Solution:
    """Solve by what `solve_toeplitz` takes."""
    x, info = tmg.solve_toeplitz((c, r), b, rtol=rtol, full_output=True)
    return x, info.iterations


def levinson(c: Array, r: Array, b: Array) -> Solution:
    """Solve by SciPy's method."""
    return scipy.linalg.solve_toeplitz((c, r), b), None


SCIPY, DROP_IN = "SciPy", "solve_toeplitz"
METHODS: dict[str, Method] = {
    "T. Chan": partial(iterate, tmg.chan_preconditioner),
    "spectral": partial(iterate, tmg.spectral_preconditioner),
    "inverse": invert,
    DROP_IN: partial(drop_in, TOLERANCE),
    f"{DROP_IN}, default": partial(drop_in, None),
    SCIPY: levinson,
}


def measure(kind: str, name: str, n: int) -> list[Row]:
    """Measure all methods on one system, in turns, in this process."""
    c, r = KINDS[kind][name](n)
    rng = np.random.default_rng(0)
    b = rng.standard_normal(n)
    if c.dtype.kind == "c":
        b = b + 1j * rng.standard_normal(n)
    rows: list[Row] = []
    jobs: list[tuple[Row, Callable[[], Solution]]] = []
    first: dict[str, float] = {}
    for method, solve in METHODS.items():
        row: Row = {"kind": kind, "symbol": name, "n": n, "method": method, "note": ""}
        rows.append(row)
        if n > LEVINSON and (method == SCIPY or name == "random entries"):
            row["note"] = "takes n² operations, or does not converge"
            continue
        job: Callable[[], Solution] = partial(solve, c, r, b)
        try:
            (x, row["iterations"]), first[method] = time_call(job, process_time)
        except np.linalg.LinAlgError as error:
            row["note"] = str(error)
            continue
        rest = b - scipy.linalg.matmul_toeplitz((c, r), x)
        row["residual"] = float(np.linalg.norm(rest) / np.linalg.norm(b))
        jobs.append((row, job))
    if not jobs:
        return rows
    # A first run counts where it takes so long that there are no turns.
    spent: dict[str, list[float]] = {row["method"]: [] for row, _ in jobs}
    turn = sum(first.values())
    for _ in range(min(TURNS, int(ENOUGH / turn))):
        for row, job in jobs:
            spent[row["method"]].append(time_call(job, process_time)[1])
    spent = {method: times or [first[method]] for method, times in spent.items()}
    seconds = {method: float(np.quantile(times, EARLY)) for method, times in spent.items()}
    for row, _ in jobs:
        row["seconds"] = seconds[row["method"]]
        if SCIPY in seconds:
            row["speed-up"] = seconds[SCIPY] / row["seconds"]
    return rows


def run(folder: Path, sizes: Sequence[int] = SIZES) -> None:
    """Measure all, and print a row for each system."""
    table = report.Table(TITLE, room={"matrix": 30} | dict.fromkeys(METHODS, 22))
    rows: list[Row] = []
    systems = [(kind, name, n) for kind in KINDS for name in KINDS[kind] for n in sizes]
    for kind, name, n in systems:
        # A process of its own for each: what one leaves behind is not the time of the next.
        own = in_a_fresh_process(partial(measure, kind, name, n))
        rows += own
        report.write_csv(folder / "general.csv", rows)
        table.add({"matrix": name, "n": n} | {row["method"]: cell(row) for row in own})


def count_iterations(row: Row) -> str:
    """Return the iterations, or what there is in their place."""
    iterations = row.get("iterations")
    if iterations is None:
        return "direct" if row.get("seconds") else "-"
    return str(iterations) if iterations < MAXITER else f"> {MAXITER}"


def cell(row: Row) -> str:
    """Return the iterations, the time and the residual, or what there is of them."""
    if row.get("seconds") is None:
        return "-"
    ratio, seconds = row.get("speed-up"), row["seconds"]
    time = f"{seconds:.2g} s" if ratio is None or row["method"] == SCIPY else f"{ratio:.3g} x"
    return f"{count_iterations(row)} / {time} / {row['residual']:.0e}"


def arrange(rows: Sequence[Row]) -> list[Row]:
    """Return the table of docs/which_method.md: a line for each matrix, some sizes across."""
    table: list[Row] = []
    for (_, symbol), own in report.group(rows, "kind", "symbol").items():
        found = {(row["method"], row["n"]): row for row in own}
        line: Row = {"matrix": symbol.replace("|", "\\|")}  # Else it would end the cell.
        for n in TABULATED:
            for method in (DROP_IN, f"{DROP_IN}, default"):
                row = found.get((method, n), {})
                line[f"{method}, 2^{n.bit_length() - 1}"] = cell(row) if row else ""
        for method in ("T. Chan", "spectral"):
            line[method] = count_iterations(found.get((method, TABULATED[-1]), {}))
        table.append(line)
    return table
