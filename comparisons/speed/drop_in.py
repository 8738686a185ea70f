"""`toeplitz_mg.solve_toeplitz` against `scipy.linalg.solve_toeplitz`: time, residual, crossover.

For n = 1 … 2²⁰, one and 64 right-hand sides at random. Each pair is timed in a fresh process, the
two in turns, one thread; medians. SciPy's is not run where it would take minutes.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from statistics import median

import numpy as np
import scipy.linalg
from matplotlib.figure import Figure
from tqdm import tqdm

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.measuring import time_call
from comparisons.harness.processes import in_a_fresh_process, prepare
from comparisons.harness.report import Row
from comparisons.systems.symbols import column
from toeplitz_mg._typing import Array

SYMBOLS = ("contact", "fGn, H = 0.9", "0.9^k", "exp(-k/1000)", "θ²")
SIZES = (1, 2, 3, 5, *(2**k for k in range(3, 12)), 3000, 4096, 2**13, 10007, 2**15, 2**17, 2**20)
QUICK_SIZES = SIZES[:14]
COLUMNS = (1, 64)
LEVINSON_STEPS = 2**36  # Most steps, n² a column, of SciPy's: some minutes.
ENOUGH = 0.3  # Seconds of one method's runs, after which there are no more turns.
TURNS = 101  # Most turns of the two methods.


@dataclass(frozen=True)
class Pair:
    """What both methods took on one system; None where SciPy's would take too long."""

    seconds: float
    scipy_seconds: float | None
    ratio: float | None
    added_us: float | None
    method: str
    iterations: int
    residual: float
    scipy_residual: float | None


def measure(name: str, n: int, columns: int) -> Pair:
    """Time both in this process, in turns, after a first run of each."""
    c = column(name, n)
    b = np.random.default_rng(0).standard_normal((n, columns) if columns > 1 else n)
    ours = partial(tmg.solve_toeplitz, c, b)
    scipys = partial(scipy.linalg.solve_toeplitz, c, b)
    with_scipy = columns * n**2 <= LEVINSON_STEPS
    (x, info), first = time_call(partial(tmg.solve_toeplitz, c, b, full_output=True))
    x_scipy, first_scipy = time_call(scipys) if with_scipy else (None, 0.0)
    turns = max(1, min(TURNS, round(ENOUGH / max(first, first_scipy))))
    pairs = [
        (time_call(ours)[1], time_call(scipys)[1] if with_scipy and turns > 1 else first_scipy)
        for _ in range(turns)
    ]
    seconds, scipy_seconds = (median(values) for values in zip(*pairs, strict=True))
    return Pair(
        seconds=seconds,
        scipy_seconds=scipy_seconds if with_scipy else None,
        ratio=scipy_seconds / seconds if with_scipy else None,
        added_us=(seconds - scipy_seconds) * 1e6 if with_scipy else None,
        method=info.method,
        iterations=info.iterations,
        residual=residual(c, x, b),
        scipy_residual=None if x_scipy is None else residual(c, x_scipy, b),
    )


def residual(c: Array, x: Array, b: Array) -> float:
    """Return the largest ‖b - A x‖/‖b‖ of all columns."""
    r = b - scipy.linalg.matmul_toeplitz(c, x)
    return float((np.linalg.norm(r, axis=0) / np.linalg.norm(b, axis=0)).max())


def run(sizes: Sequence[int], path: Path) -> list[Row]:
    """Measure all, and keep the table on disk up to date."""
    rows: list[Row] = []
    jobs = [(name, n, k) for name in SYMBOLS for k in COLUMNS for n in sizes if k * n <= 2**22]
    for name, n, columns in tqdm(jobs, unit="pair"):
        # A process of its own for each: what one leaves behind is not the time of the next.
        pair = in_a_fresh_process(partial(measure, name, n, columns))
        rows.append({"symbol": name, "n": n, "columns": columns, **asdict(pair)})
        report.write_csv(path, rows)
    return rows


FORMATS = {
    "seconds": ".2g",
    "scipy_seconds": ".2g",
    "ratio": ".3g",
    "added_us": ".0f",
    "method": "s",
    "iterations": "d",
    "residual": ".0e",
    "scipy_residual": ".0e",
}


def show(rows: Sequence[Row]) -> None:
    """Print a table for each symbol and number of right-hand sides, and the crossovers."""
    crossovers = []
    for (name, columns), own in report.group(rows, "symbol", "columns").items():
        table = [{"n": row["n"]} | report.format_cells(row, FORMATS) for row in own]
        report.show(f"{name}, {columns} right-hand side(s)", table)
        faster = [row["n"] for row in own if row["ratio"] and row["ratio"] > 1.1]
        crossovers.append(
            {"symbol": name, "columns": columns, "faster from n =": min(faster, default="")}
        )
    report.show("Crossover", crossovers)


def show_inverses(n: int) -> None:
    """Print what `toeplitz_inverse` costs and achieves."""
    table = []
    for name in SYMBOLS:
        A = tmg.ToeplitzOperator(column(name, n))
        with tmg.count_products() as setup:
            inverse, seconds = time_call(partial(tmg.toeplitz_inverse, A, rtol=0.1))
        with tmg.count_products() as product:
            _ = inverse @ np.ones(n)
        table.append(
            {
                "symbol": name,
                "set-up, work units": f"{setup.units(n):.1f}",
                "seconds": f"{seconds:.2g}",
                "a column, work units": f"{product.units(n):.1f}",
                "residual": f"{inverse.residual:.1e}",
            }
        )
    report.show(f"toeplitz_inverse, n = {n}", table)


def plot(rows: Sequence[Row], path: Path) -> None:
    """Draw time over n, a panel for each number of right-hand sides."""
    figure = Figure(figsize=(11, 5), layout="constrained")
    panels = zip(
        figure.subplots(1, 2, sharey=True), report.group(rows, "columns").items(), strict=True
    )
    for ax, (columns, of_panel) in panels:
        for k, (name, own) in enumerate(report.group(of_panel, "symbol").items()):
            n = [row["n"] for row in own]
            ax.plot(n, [row["seconds"] for row in own], color=f"C{k}", marker="o", label=name)
            # None is not drawn.
            scipys = [np.nan if (s := row["scipy_seconds"]) is None else s for row in own]
            ax.plot(n, scipys, color=f"C{k}", linestyle="--")
        ax.set(xlabel="n", xscale="log", yscale="log", title=f"{columns} right-hand side(s)")
        ax.grid(alpha=0.3)
        ax.legend()
    figure.suptitle("Seconds: toeplitz_mg.solve_toeplitz, and scipy.linalg.solve_toeplitz (dashed)")
    report.write_figure(path, figure, dpi=130)


def main(quick_sizes: Sequence[int] = QUICK_SIZES) -> None:
    """Run the comparison."""
    prepare("comparisons.speed.drop_in")
    arguments = report.options("speed.drop_in", "Compare solve_toeplitz with SciPy's.")
    rows = run(quick_sizes if arguments.quick else SIZES, arguments.output / "drop_in.csv")
    show(rows)
    show_inverses(2**14 if arguments.quick else 2**20)
    plot(rows, arguments.output / "drop_in.png")


if __name__ == "__main__":
    main()
