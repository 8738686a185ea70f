"""Every method on the same systems: time, iterations, work, peak memory and true residual.

The systems are tests 1 to 3 of the paper and test 1 with a random right-hand side, each to a
relative residual of 1e-8 from a zero guess. A method that needs more than 30 s at some n is not
run at a larger one; with ``--picture`` only the methods that are drawn are run, up to 0.7 s each,
which takes minutes in the place of half an hour. The methods are in `contenders`; how a run is
measured is in `measuring`. Grids of up to 256 elements multigrid solves directly.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from tqdm import tqdm

from comparisons.harness import report
from comparisons.harness.measuring import Contender, Measurement, measure
from comparisons.harness.processes import prepare
from comparisons.harness.report import Row
from comparisons.speed.contenders import CONTENDERS
from toeplitz_mg.paper.problems import Problem, test1, test2, test3

LARGEST_TIME = 30.0  # Seconds of one run, above which a method is not run at a larger n.
DRAWN_TIME = 0.7  # The same where only the picture is wanted.
SIZES = tuple(4**k for k in range(3, 11))
QUICK_SIZES = SIZES[:3]
SHOWN_SIZES = (2**10, 2**14, 2**20)
# The methods that are drawn, in colours of Okabe and Ito that are told apart: the table has all.
DRAWN = {
    "dense Cholesky": "#000000",
    "SciPy's solve_toeplitz": "#56B4E9",
    "CG": "#009E73",
    "CG + pyamg RS, banded": "#CC79A7",
    "CG + M": "#D55E00",
    "V(0,1)": "#0072B2",
}
OURS = {contender.name for contender in CONTENDERS if contender.ours}
ROOM = 2.0**3  # Factor of the largest n up to which the axis goes on, for the names of lines.
APART = 1.9  # Ratio of two times whose names, one above the other, do not overlap.
LETTER = 2.0**0.42  # Factor of n that a letter of a name is wide.


def test1_random(n: int) -> Problem:
    """Return test 1 with a right-hand side of all frequencies."""
    rhs = np.random.default_rng(0).standard_normal(n)
    return replace(test1(n), name="random", b=rhs)


SYSTEMS = (test1, test2, test3, test1_random)


def run(
    contenders: Sequence[Contender], sizes: Sequence[int], longest: float, path: Path
) -> list[Row]:
    """Measure contenders on every system, and keep the table on disk up to date."""
    rows: list[Row] = []
    jobs = len(SYSTEMS) * len(sizes) * len(contenders)
    with tqdm(total=jobs, unit="run") as progress:
        for system in SYSTEMS:
            rows += run_system(system, contenders, sizes, longest, progress)
            report.write_csv(path, rows)
    return rows


def run_system(
    system: Callable[[int], Problem],
    contenders: Sequence[Contender],
    sizes: Sequence[int],
    longest: float,
    progress: "tqdm[None]",
) -> list[Row]:
    """Measure contenders on one system, each up to the size where it takes more than `longest`."""
    rows: list[Row] = []
    too_slow: dict[str, str] = {}
    for n in sizes:
        problem = system(n)
        for contender in contenders:
            name = contender.name
            progress.set_postfix_str(f"{problem.name}, n = {n}, {name}")
            if name in too_slow:
                measurement = Measurement(note=too_slow[name])
            else:
                measurement = measure(contender, problem)
                if (measurement.total_s or 0.0) > longest:
                    too_slow[name] = f"not run: over {longest:g} s at n = {n}"
            rows.append({"system": problem.name, "n": n, "method": name, **asdict(measurement)})
            progress.update()
    return rows


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


def format_row(row: Row) -> Row:
    """Return a row as it is printed, with nothing where nothing was measured."""
    return {"method": row["method"], **report.format_cells(row, FORMATS), "note": row["note"]}


def show(rows: Sequence[Row], sizes: Sequence[int]) -> None:
    """Print a table for each system and some sizes."""
    shown = [row for row in rows if row["n"] in sizes]
    for (system, n), own in report.group(shown, "system", "n").items():
        report.show(f"{system}, n = {n}", [format_row(row) for row in own])


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
    """Draw set-up and solve time over n, one panel a system, of the methods in `DRAWN`."""
    # A figure made without pyplot is drawn by Agg: it needs no screen.
    figure = Figure(figsize=(12, 9), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    largest = max(row["n"] for row in rows)
    for ax, (system, own) in zip(axes.flat, report.group(rows, "system").items(), strict=True):
        ax.set(title=system, xlabel="n", ylabel="set-up + solve, s", yscale="log")
        ax.set_xscale("log", base=2)
        ax.grid(alpha=0.3)
        ends: list[tuple[str, str, float, float]] = []
        for name, colour in DRAWN.items():
            runs = [row for row in own if row["method"] == name and row["converged"]]
            if runs:
                n, seconds = [row["n"] for row in runs], [row["total_s"] for row in runs]
                style = "o-" if name in OURS else "o--"
                ax.plot(n, seconds, style, color=colour, markersize=4.0)
                ends.append((name, colour, n[-1], seconds[-1]))
        write_names(ax, ends)
    axes[0, 0].set_xlim(right=largest * ROOM)
    axes[0, 0].set_ylim(top=APART**3 * LARGEST_TIME)
    figure.suptitle("Time to a true residual of 1e-8 (solid: this package; converged runs only)")
    report.write_figure(path, figure, dpi=130)


def write_names(ax: Any, ends: Sequence[tuple[str, str, float, float]]) -> None:
    """Write names where lines end, on their right at the largest n and else on their left.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Of logarithmic scales.
    ends : sequence of (name, colour, x, y)
    """
    largest = max(x for _, _, x, _ in ends)
    taken: list[tuple[float, float, float]] = []  # Where names begin and end, and their heights.
    for name, colour, x, height in sorted(ends, key=lambda end: end[3]):
        align, offset = ("left", 7.0) if x == largest else ("right", -7.0)
        width = LETTER ** len(name)
        first, last = (x, x * width) if x == largest else (x / width, x)
        for begin, end, other in taken:  # The lowest of them comes first.
            if first < end and begin < last and other / APART < height < other * APART:
                height = other * APART
        taken.append((first, last, height))
        ax.annotate(
            name, (x, height), (offset, 0.0), textcoords="offset points", color=colour,
            ha=align, va="center", fontsize="small",
        )  # fmt: skip


def main(quick_sizes: Sequence[int] = QUICK_SIZES) -> None:
    """Run the comparison."""
    # What every measured process imports, imported once; this module is run anew in each.
    prepare("comparisons.speed.contenders", "comparisons.harness.report", "matplotlib.figure")
    arguments = report.options(
        "speed.baselines",
        "Compare every method on the same systems.",
        flags={"picture": f"only the methods that are drawn, up to {DRAWN_TIME:g} s each"},
    )
    sizes = quick_sizes if arguments.quick else SIZES
    contenders: Sequence[Contender] = CONTENDERS
    longest, name = LARGEST_TIME, "baselines.csv"
    if arguments.picture:  # Its table is not to be taken for that of all.
        contenders = tuple(contender for contender in CONTENDERS if contender.name in DRAWN)
        longest, name = DRAWN_TIME, "drawn.csv"
    rows = run(contenders, sizes, longest, arguments.output / name)
    show(rows, sizes[-1:] if arguments.quick else SHOWN_SIZES)
    plot(rows, arguments.output / "baselines.png")


if __name__ == "__main__":
    main()
