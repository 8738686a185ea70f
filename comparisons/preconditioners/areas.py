"""Every preconditioner on contact areas of every kind: what `default_preconditioner` rests on.

The normal problem on an N x N grid of square elements, the two tangential components together
("coupled") on some of the areas, and on one axis the paper's kernel on islands of a line. Left out
is what is not symmetric, as SD, and Jacobi, a multiple of the unit matrix here.
CG from zero to a relative residual of 1e-8; the seconds are of CPU, with set-up, the median of some
set-ups and solves in a process of its own; what takes minutes is given up.
"""

from collections.abc import Sequence
from functools import partial
from math import nan
from pathlib import Path
from statistics import median

import numpy as np
from matplotlib.figure import Figure
from scipy.sparse.linalg import LinearOperator

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.measuring import PRECONDITIONERS, solve
from comparisons.harness.processes import row_or_note
from comparisons.harness.report import Row
from comparisons.systems import masks
from comparisons.systems.punch import influence
from toeplitz_mg.paper.problems import test1

TITLE = "Every preconditioner on areas of every kind"
MAXITER = 150  # Iterations after which a method counts as too slow.
SECONDS = 200.0  # Time after which a method is given up on an area.
REPEATS = 3  # Runs of which the median counts; fewer where they take `ENOUGH` seconds.
ENOUGH = 2.0  # Seconds of runs, after which there are no more.
SIZES = (128, 512, 2048)
LINES = (2**14, 2**17, 2**20)
AREAS = (*masks.FRAGMENTED, *masks.ON_A_LINE)
COUPLED = ("full", "circle", "rough, 30 %")  # Areas of the coupled problem.
TABULATED = ("none", "T. Chan", "cosine", "sine", "M", "FSAI")  # In appendix/preconditioners.md.
FORMATS = {"area": "", "problem": "", "n": "", "method": "", "random": "", "random_s": ".3g"}
FORMATS |= {"random_units": ".1f", "constant": "", "constant_s": ".3g", "setup_s": ".2g"}
FORMATS["note"] = ""
SHOWN = 128  # Elements across the grid whose pressures are drawn.
TABULATED_SIZE, TABULATED_LINE = 512, 2**17


def operator(area: str, n: int, problem: str = "normal") -> LinearOperator:
    """Return the matrix of an area, in the plane or on a line."""
    if area in masks.FRAGMENTED:
        return influence(problem, masks.FRAGMENTED[area](n), (2.0 / n, 2.0 / n))
    return masks.restrict(test1(n).A, masks.ON_A_LINE[area](n))


def measure(method: str, A: LinearOperator, small: LinearOperator) -> Row:
    """Set up and solve, first a small problem; in a process of its own."""
    solve_by = partial(solve, preconditioner=PRECONDITIONERS[method], maxiter=MAXITER)
    solve_by(small, np.ones(small.shape[0]))
    row: Row = {}
    for name, b in (
        ("constant", np.ones(A.shape[0])),
        ("random", np.random.default_rng(0).standard_normal(A.shape[0])),
    ):
        runs = [solve_by(A, b)]
        while len(runs) < REPEATS and sum(run.seconds for run in runs) < ENOUGH:
            runs.append(solve_by(A, b))
        row |= {name: runs[0].count, f"{name}_units": runs[0].units}
        row[f"{name}_s"] = median(run.seconds for run in runs)
        row["setup_s"] = median(run.setup_s for run in runs)
    return row | {"note": ""}


def run(
    folder: Path,
    sizes: Sequence[int] = SIZES,
    lines: Sequence[int] = LINES,
    areas: Sequence[str] = AREAS,
    methods: Sequence[str] = tuple(PRECONDITIONERS),
) -> None:
    """Measure preconditioners on areas of some sizes."""
    table = report.Table(TITLE, folder / "areas.csv", FORMATS, {"area": 17, "method": 10})
    for area in areas:
        for n in lines if area in masks.ON_A_LINE else sizes:
            for problem in ("normal", "coupled") if area in COUPLED else ("normal",):
                # Sent, not built there: what it takes to build it would be the peak of memory.
                A = operator(area, n, problem)
                small = operator(area, 2048 if area in masks.ON_A_LINE else 64, problem)
                for method in methods:
                    row: Row = {"area": area, "problem": problem, "n": n, "method": method}
                    job = partial(measure, method, A, small)
                    table.add(row | {"random_s": nan} | row_or_note(job, SECONDS))


def arrange_all(rows: Sequence[Row]) -> list[Row]:
    """Return the table of appendix/areas.md: all areas and sizes by methods, the fastest bold."""
    normal = [row for row in rows if row["problem"] == "normal"]
    return [
        {"area": area, "n": n} | format_times({row["method"]: row for row in own})
        for (area, n), own in report.group(normal, "area", "n").items()
    ]


def arrange(rows: Sequence[Row]) -> list[Row]:
    """Return a table of appendix/preconditioners.md: areas of one size, two lines, some methods."""
    table = []
    for (area, n, problem), own in report.group(rows, "area", "n", "problem").items():
        is_line = n == TABULATED_LINE and area in ("100 islands", "n/100 islands")
        if (n == TABULATED_SIZE and problem == "normal") or is_line:
            some = {row["method"]: row for row in own if row["method"] in TABULATED}
            table.append({"area": area, "n": n} | format_times(some))
    return table


def arrange_coupled(rows: Sequence[Row]) -> list[Row]:
    """Return a table of appendix/preconditioners.md: a row a method, normal and coupled."""

    def cell(row: Row) -> tuple[str, str]:
        return f"{row['problem']}, {row['area']}", format_times({"": row})[""].replace("**", "")

    own = (row for row in rows if row["n"] == TABULATED_SIZE and row["area"] in COUPLED)
    return report.pivot(own, lambda row: {"method": row["method"]}, cell)


def format_times(own: dict[str, Row]) -> Row:
    """Return cells of iterations and seconds by method, random load; where there are none, why."""
    solved = {m: row["random_s"] for m, row in own.items() if isinstance(row.get("random"), int)}
    best = min(solved.values(), default=nan)
    cells: Row = {}
    for method, row in own.items():
        if "random" not in row:
            cells[method] = "too long" if row.get("note", "").startswith("over") else "refused"
        else:
            seconds = f"{row['random_s']:.2g}"
            shown = f"**{seconds}**" if solved.get(method) == best else seconds
            cells[method] = f"{row['random']} / {shown}"
    return cells


def draw(folder: Path, n: int = SHOWN) -> None:
    """Draw the pressures under a rigid displacement of each area."""
    figure = Figure(figsize=(17, 9), layout="constrained")
    axes = figure.subplots(3, 5).ravel()
    for ax, (area, mask) in zip(axes, masks.FRAGMENTED.items(), strict=False):
        A = operator(area, n)
        p, info = tmg.cg(A, np.ones(A.shape[0]), M=tmg.default_preconditioner(A), rtol=1e-6)
        if info:
            raise ArithmeticError("not converged")
        field = np.full((n, n), np.nan)
        field[mask(n)] = p
        image = ax.imshow(
            field.T, origin="lower", extent=(-1, 1, -1, 1), cmap="YlOrRd",
            vmin=0.0, vmax=float(np.quantile(p, 0.95)), interpolation="none",
        )  # fmt: skip
        bar = ax.inset_axes((1.04, 0.0, 0.05, 1.0))
        figure.colorbar(image, cax=bar, extend="max")
        ax.set(title=area, xlabel="x", ylabel="y", xticks=[-1, 0, 1], yticks=[-1, 0, 1])
    figure.suptitle(f"Pressures over G under a unit displacement, of {n}² elements")
    for ax in axes[len(masks.FRAGMENTED) :]:
        ax.set_axis_off()
    report.write_figure(folder / "areas.png", figure, dpi=130)
