"""Every method on the same systems: time, iterations, work, peak memory and true residual.

The systems are tests 1 to 3 of the paper and test 1 with a random right-hand side, each to a
relative residual of 1e-8 from a zero guess; the `methods` are pyamg's, a dense factorisation,
SciPy's recursion, CG with circulants and those of this package, of which the default is
`solve_toeplitz`, and `cg` on a mask. A method that needs more than 30 s at some n is not run at a
larger one. ``--quick`` solves test 1 for three small n; ``--picture`` runs only the methods that
are drawn, up to 0.7 s each, in minutes.

`harness.measuring` says how a run is measured. Multigrid solves up to 256 elements directly.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from comparisons.baselines.methods import METHODS
from comparisons.harness import report
from comparisons.harness.measuring import Contender, Measurement, measure
from comparisons.harness.processes import prepare
from comparisons.harness.report import Row
from toeplitz_mg.paper.problems import Problem, test1, test2, test3

LONGEST = 30.0  # Seconds of one run, above which a method is not run at a larger n.
DRAWN_LONGEST = 0.7  # The same where only the picture is wanted,
QUICK_LONGEST = 0.1  # and with --quick.
SIZES, QUICK_SIZES = tuple(4**k for k in range(3, 11)), (256, 1024, 4096)
# The methods that are drawn, in colours of Okabe and Ito that are told apart: the table has all.
DRAWN = {
    "dense Cholesky": "#000000",
    "SciPy's solve_toeplitz": "#56B4E9",
    "CG": "#009E73",
    "CG + pyamg RS, banded": "#CC79A7",
    "CG + M": "#D55E00",
    "V(0,1)": "#0072B2",
}
FORMATS = {
    "setup_s": ".2g",
    "solve_s": ".2g",
    "iterations": "d",
    "setup_units": ".1f",
    "solve_units": ".1f",
    "peak_mb": ".1f",
    "peak_vectors": ".1f",
    "residual": ".1e",
}


def test1_random(n: int) -> Problem:
    """Return test 1 with a right-hand side of all frequencies."""
    rhs = np.random.default_rng(0).standard_normal(n)
    return replace(test1(n), name="random", b=rhs)


SYSTEMS = (test1, test2, test3, test1_random)


def run(
    system: Callable[[int], Problem],
    methods: Sequence[Contender],
    sizes: Sequence[int],
    longest: float,
) -> Iterator[Row]:
    """Yield what is measured of methods, each up to the size where it takes more than `longest`."""
    too_slow: dict[str, str] = {}
    for n in sizes:
        problem = system(n)
        for method in methods:
            name = method.name
            if name in too_slow:
                measurement = Measurement(note=too_slow[name])
            else:
                measurement = measure(method, problem)
                if (measurement.total_s or 0.0) > longest:
                    too_slow[name] = f"not run: over {longest:g} s at n = {n}"
            yield {"system": problem.name, "n": n, "method": name, **asdict(measurement)}


def form(row: Row) -> Row:
    """Return the cells of a row that are printed, empty where nothing was measured."""
    names = {key: row[key] for key in ("system", "n", "method")}
    return names | report.format_cells(row, FORMATS) | {"note": row["note"]}


def arrange(rows: Sequence[Row]) -> list[Row]:
    """Return the table of docs/benchmarks.md: test 1 at the largest n."""
    largest = max(row["n"] for row in rows)
    table = []
    for row in rows:
        if row["system"] == "test 1" and row["n"] == largest and "setup_s" in row:
            cells = report.format_cells(row, FORMATS)
            line = {"method": row["method"], "set-up (s)": cells["setup_s"]}
            line |= {"solve (s)": cells["solve_s"] if row["converged"] else "diverges"}
            line |= {"iterations": cells["iterations"], "work units": cells["solve_units"]}
            line |= {"vectors": cells["peak_vectors"], "true residual": cells["residual"]}
            table.append(line)
    return table


def plot(rows: Sequence[Row], path: Path) -> None:
    """Draw set-up and solve time over n, a panel for each system, of the methods in `DRAWN`."""
    ours = {method.name for method in METHODS if method.ours}
    # A figure made without pyplot is drawn by Agg: it needs no screen.
    figure = Figure(figsize=(12, 9), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    for ax, (system, own) in zip(axes.flat, report.group(rows, "system").items(), strict=False):
        ax.set(title=system, xlabel="n", ylabel="set-up + solve, s", yscale="log")
        ax.set_xscale("log", base=2)
        ax.grid(alpha=0.3)
        for name, colour in DRAWN.items():
            runs = [row for row in own if row["method"] == name and row["converged"]]
            style = "o-" if name in ours else "o--"
            n, seconds = [row["n"] for row in runs], [row["total_s"] for row in runs]
            ax.plot(n, seconds, style, color=colour, markersize=4.0, label=name)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    figure.suptitle("Time to a true residual of 1e-8 (solid: this package; converged runs only)")
    report.write_figure(path, figure, dpi=130)


@report.interruptible
def main(argv: Sequence[str] | None = None, sizes: Sequence[int] | None = None) -> None:
    """Run the comparison, for the sizes of the options unless others are given."""
    # What every measured process imports, imported once.
    prepare("comparisons.baselines.methods", "comparisons.harness.report")
    arguments = report.options(
        "baselines",
        "Compare every method on the same systems.",
        flags={"picture": f"only the methods that are drawn, up to {DRAWN_LONGEST:g} s each"},
        argv=argv,
    )
    systems = SYSTEMS[:1] if arguments.quick else SYSTEMS
    longest, name = QUICK_LONGEST if arguments.quick else LONGEST, "baselines.csv"
    methods = [method for method in METHODS if method.name in DRAWN or not arguments.picture]
    if arguments.picture:  # Its table is not to be taken for that of all.
        longest, name = DRAWN_LONGEST, "drawn.csv"
    sizes = sizes or (QUICK_SIZES if arguments.quick else SIZES)
    room = {"n": 7, "method": 22, "setup_s": 8, "solve_s": 8, "residual": 8}
    title = "Each method to a true residual of 1e-8"
    table = report.Table(title, arguments.output / name, form, room)
    for system in systems:
        table.extend(run(system, methods, sizes, longest))
        plot(table.rows, arguments.output / "baselines.png")
