"""Every preconditioner on Toeplitz matrices of one axis: iterations, work units, CPU time to 1e-8.

The matrices are in `systems.symbols`: symmetric positive definite ones, on which every
preconditioner is tried, and nonsymmetric, Hermitian and indefinite ones, on which those are that
take them; with a random right-hand side. CG where a matrix is Hermitian, else GMRES. The last
methods are `solve_toeplitz` itself, with ``rtol=1e-8`` and by default, whose work includes the
check of the residual, and SciPy's. The time is from the coefficients to the solution.
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
from comparisons.harness.measuring import PRECONDITIONERS, TOLERANCE, time_call
from comparisons.harness.processes import in_a_fresh_process
from comparisons.harness.report import Row
from comparisons.systems.symbols import COLUMNS, HERMITIAN, INDEFINITE, NONSYMMETRIC, random_pair
from toeplitz_mg._typing import Array
from toeplitz_mg.fractional import riesz_coefficients

Solution = tuple[Array, int | None]  # x, and the iterations where there are any.
Method = Callable[[str, Array, Array, Array], Solution]  # Of the name, first column and row, and b.

DEFINITE = "positive definite"
RIESZ = {f"Riesz, α = {a}": partial(riesz_coefficients, a) for a in (1.2, 1.5, 1.8)}
KINDS: dict[str, Any] = {
    DEFINITE: {name: lambda n, f=f: (f(n),) * 2 for name, f in (COLUMNS | RIESZ).items()},
    "nonsymmetric": {**NONSYMMETRIC, "random entries": random_pair},
    "Hermitian": HERMITIAN,
    "indefinite": INDEFINITE,
}
SIZES = tuple(2**k for k in (10, 12, 14, 17, 20))
TABULATED = 2**12, 2**14  # The sizes in the tables of the page; of the first the larger one.
LEVINSON = 2**14  # Largest n for SciPy's method, and for what has no other.
RESTART = 30  # Iterations of a cycle of GMRES.
MAXITER = 300  # Iterations after which a method is given up.
ENOUGH = 0.1  # CPU seconds of all solves, after which there are no more.
TURNS = 20  # Most solves, of which the fastest counts.
TITLE = """Iterations / work units / CPU seconds, set-up included; (true residual) where it is above
1e-8; > : over 300 iterations; - : refused, or not tried"""


def iterate(preconditioner: Any, name: str, c: Array, r: Array, b: Array) -> Solution:
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


def drop_in(rtol: float | None, name: str, c: Array, r: Array, b: Array) -> Solution:
    """Solve by what `solve_toeplitz` takes."""
    x, info = tmg.solve_toeplitz((c, r), b, rtol=rtol, full_output=True)
    return x, info.iterations


SCIPY, DROP_IN, DEFAULT = "SciPy", "solve_toeplitz", "solve_toeplitz, default"
TRIED = ("none", "Strang", "T. Chan", "M", "cosine", "sine", "tau", "spectral", "FSAI")
TAU = {"tau": tmg.tau_preconditioner}
ANY = ("T. Chan", "spectral", DROP_IN, DEFAULT, SCIPY)  # Those for all kinds of matrices.
METHODS: dict[str, Method] = {
    **{name: partial(iterate, (PRECONDITIONERS | TAU)[name]) for name in TRIED},
    "V(1,1)": partial(iterate, tmg.multigrid),
    DROP_IN: partial(drop_in, TOLERANCE),
    DEFAULT: partial(drop_in, None),
    SCIPY: lambda name, c, r, b: (scipy.linalg.solve_toeplitz((c, r), b), None),
}


def measure(kind: str, name: str, n: int) -> list[Row]:
    """Measure all methods on one system, in this process."""
    c, r = KINDS[kind][name](n)
    rng = np.random.default_rng(0)
    b = rng.standard_normal(n)
    if c.dtype.kind == "c":
        b = b + 1j * rng.standard_normal(n)
    rows: list[Row] = []
    for method in METHODS if kind == DEFINITE else ANY:
        row: Row = {"kind": kind, "symbol": name, "n": n, "method": method, "note": ""}
        rows.append(row)
        if n > LEVINSON and (method == SCIPY or name == "random entries"):
            row["note"] = "takes n² operations, or does not converge"
            continue
        job: Callable[[], Solution] = partial(METHODS[method], name, c, r, b)
        try:
            with tmg.count_products() as work:
                (x, row["iterations"]), first = time_call(job, process_time)
        except np.linalg.LinAlgError as error:
            row["note"] = str(error)
            continue
        turns = range(min(TURNS, int(ENOUGH / max(first, 1e-9))))
        row["seconds"] = min([time_call(job, process_time)[1] for _ in turns], default=first)
        rest = b - scipy.linalg.matmul_toeplitz((c, r), x)
        row |= {"units": work.units(n), "residual": np.linalg.norm(rest) / np.linalg.norm(b)}
    return rows


def run(folder: Path, sizes: Sequence[int] = SIZES, symbols: Sequence[str] | None = None) -> None:
    """Measure all methods on every system, and print a row for each."""
    table = report.Table(TITLE, room={"symbol": 30} | dict.fromkeys(METHODS, 18))
    rows: list[Row] = []
    systems = [(kind, name, n) for kind in KINDS for name in KINDS[kind] for n in sizes]
    for kind, name, n in systems:
        if symbols is None or name in symbols:
            # A process of its own for each: what one leaves behind is not the time of the next.
            own = in_a_fresh_process(partial(measure, kind, name, n))
            rows += own
            report.write_csv(folder / "symbols.csv", rows)
            table.add({"symbol": name, "n": n} | {row["method"]: cell(row) for row in own})


def cell(row: Row, is_timed: bool = True) -> str:
    """Return iterations, work units and seconds, or why there are none."""
    if row.get("seconds") is None:
        return "–"
    if (row.get("iterations") or 0) >= MAXITER:
        return ">"
    rounding = f" ({row['residual']:.0e})" if row["residual"] > 1.01 * TOLERANCE else ""
    seconds = f" / {row['seconds']:.2g}" if is_timed else ""
    return f"{row.get('iterations', 'direct')} / {row['units']:.0f}{seconds}{rounding}"


def arrange(rows: Sequence[Row], n: int = TABULATED[-1]) -> list[Row]:
    """Return the table of iterations and work units of positive definite matrices."""
    table = []
    of_page = [row for row in rows if row["n"] == n and row["kind"] == DEFINITE]
    for name, own in report.group(of_page, "symbol").items():
        line: Row = {"symbol, or coefficients": name.replace("|", r"\|")}
        shown = [r for r in own if r["method"] not in ("none", "Strang", DEFAULT, SCIPY)]
        line |= {row["method"]: cell(row, is_timed=False) for row in shown}
        # The last is one of the others, with a check.
        done = [row for row in shown[:-1] if row.get("residual", 1.0) <= 1.01 * TOLERANCE]
        best = min(done, key=lambda row: float(row["units"]), default={"method": ""})
        table.append(line | {"least work": best["method"]})
    return table


def arrange_general(rows: Sequence[Row]) -> list[Row]:
    """Return the table of other matrices: speed-up over SciPy's, iterations and true residual."""
    others = [row for row in rows if row["kind"] != DEFINITE and row["n"] in TABULATED]
    theirs = {(row["symbol"], row["n"]): row["seconds"] for row in others if row["method"] == SCIPY}

    def shown(row: Row) -> tuple[str, str]:
        ratio = theirs[row["symbol"], row["n"]] / row["seconds"] if "seconds" in row else 0.0
        if row["method"] in (DROP_IN, DEFAULT):
            heading = f"{row['method']}, 2^{row['n'].bit_length() - 1}"
            return heading, f"{row['iterations']} / {ratio:.3g} x / {row['residual']:.0e}"
        return row["method"], cell(row).partition(" ")[0]

    own = (row for row in others if row["method"] != SCIPY)
    return report.pivot(own, lambda row: {"matrix": row["symbol"].replace("|", r"\|")}, shown)
