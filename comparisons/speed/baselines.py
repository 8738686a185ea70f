"""Every method on the same systems: time, iterations, work, peak memory and true residual.

The systems are tests 1 to 3 of the paper and test 1 with a random right-hand side, each to a
relative residual of 1e-8 from a zero guess. A method that needs more than 30 s at some n is not
run at a larger one. The methods are in `contenders`; how a run is measured is in `measuring`.
Grids of up to 256 elements multigrid solves directly.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from tqdm import tqdm

from comparisons.harness import report
from comparisons.harness.measuring import Contender, Measurement, measure
from comparisons.harness.processes import prepare
from comparisons.harness.report import Row
from comparisons.speed.contenders import CONTENDERS
from toeplitz_mg.paper.problems import Problem, test1, test2, test3

LARGEST_TIME = 30.0  # Seconds of one run, above which a method is not run at a larger n.
SIZES = tuple(4**k for k in range(3, 11))
QUICK_SIZES = SIZES[:3]
SHOWN_SIZES = (2**10, 2**14, 2**20)


def test1_random(n: int) -> Problem:
    """Return test 1 with a right-hand side of all frequencies."""
    rhs = np.random.default_rng(0).standard_normal(n)
    return replace(test1(n), name="random", b=rhs)


SYSTEMS = (test1, test2, test3, test1_random)


def run(sizes: Sequence[int], path: Path) -> list[Row]:
    """Measure every contender on every system, and keep the table on disk up to date."""
    rows: list[Row] = []
    jobs = len(SYSTEMS) * len(sizes) * len(CONTENDERS)
    with tqdm(total=jobs, unit="run") as progress:
        for system in SYSTEMS:
            rows += run_system(system, sizes, progress)
            report.write_csv(path, rows)
    return rows


def run_system(
    system: Callable[[int], Problem], sizes: Sequence[int], progress: "tqdm[None]"
) -> list[Row]:
    """Measure every contender on one system, each up to the size where it is too slow."""
    rows: list[Row] = []
    too_slow: dict[str, str] = {}
    for n in sizes:
        problem = system(n)
        for contender in CONTENDERS:
            name = contender.name
            progress.set_postfix_str(f"{problem.name}, n = {n}, {name}")
            if name in too_slow:
                measurement = Measurement(note=too_slow[name])
            else:
                measurement = measure(contender, problem)
                if (measurement.total_s or 0.0) > LARGEST_TIME:
                    too_slow[name] = f"not run: over {LARGEST_TIME:.0f} s at n = {n}"
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


def plot(rows: Sequence[Row], path: Path) -> None:
    """Draw set-up and solve time over n, one panel a system; runs that converged only."""
    # A figure made without pyplot is drawn by Agg: it needs no screen.
    figure = Figure(figsize=(13, 11), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    for ax, (system, own) in zip(axes.flat, report.group(rows, "system").items(), strict=True):
        for contender, style in zip(CONTENDERS, styles(CONTENDERS), strict=True):
            runs = [row for row in own if row["method"] == contender.name and row["converged"]]
            n, seconds = [row["n"] for row in runs], [row["total_s"] for row in runs]
            if n:
                ax.plot(n, seconds, label=contender.name, **style)
        ax.set(title=system, xlabel="n", ylabel="set-up + solve, s", yscale="log")
        ax.set_xscale("log", base=2)
        ax.grid(alpha=0.3)
    figure.suptitle("Time to a true residual of 1e-8 (solid: this package; converged runs only)")
    lines = {line.get_label(): line for ax in axes.flat for line in ax.get_lines()}
    figure.legend(handles=lines.values(), loc="outside lower center", ncols=5)
    report.write_figure(path, figure, dpi=130)


def styles(contenders: Sequence[Contender]) -> list[Row]:
    """Return a line style for each contender: ours solid and bright, the others dashed."""
    bright = iter(colormaps["tab10"](np.arange(10)))
    # The dark ones of each of its five hues are legible.
    muted = iter(colormaps["tab20b"]([0, 1, 4, 5, 8, 9, 12, 13, 16, 17, 18]))
    full, thin = iter("osD^vP*Xp"), iter("x+1234|<>_.")
    return [
        {"color": next(bright), "marker": next(full), "linestyle": "-", "linewidth": 2.0}
        if contender.ours
        else {"color": next(muted), "marker": next(thin), "linestyle": "--", "linewidth": 1.2}
        for contender in contenders
    ]


def main(quick_sizes: Sequence[int] = QUICK_SIZES) -> None:
    """Run the comparison."""
    # What every measured process imports, imported once; this module is run anew in each.
    prepare("comparisons.speed.contenders", "comparisons.harness.report", "matplotlib.figure")
    arguments = report.options("speed.baselines", "Compare every method on the same systems.")
    sizes = quick_sizes if arguments.quick else SIZES
    rows = run(sizes, arguments.output / "baselines.csv")
    show(rows, sizes[-1:] if arguments.quick else SHOWN_SIZES)
    plot(rows, arguments.output / "baselines.png")


if __name__ == "__main__":
    main()
