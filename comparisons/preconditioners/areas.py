"""Every preconditioner on contact areas of every kind: what `default_preconditioner` rests on.

The normal problem on an N x N grid of square elements, and on one axis: the paper's kernel on
islands of a line. Left out is what is not symmetric, as SD, and Jacobi, a multiple of the unit
matrix here.
CG from a zero guess to a relative residual of 1e-8. The seconds are of CPU, the median of some
set-ups and solves in a process of its own; what takes minutes is given up. A work unit is the time
of one product with A there, and what a solve takes beyond its work units is what these do not see:
vectors, and memory that sparse products wait for.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from math import isnan, nan
from pathlib import Path
from statistics import median
from time import process_time

import numpy as np
from matplotlib.figure import Figure
from scipy.sparse.linalg import LinearOperator
from tqdm import tqdm

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.measuring import PRECONDITIONERS, TOLERANCE, solve
from comparisons.harness.processes import peak_bytes, prepare, row_or_note
from comparisons.harness.report import Row
from comparisons.systems import masks
from toeplitz_mg import halfspace
from toeplitz_mg.operators.structure import unwrap
from toeplitz_mg.paper.problems import test1

TITLE = "Every preconditioner on areas of every kind"
MAXITER = 150  # Iterations after which a method counts as too slow.
SECONDS = 200.0  # Time after which a method is given up on an area.
REPEATS = 3  # Runs of which the median counts; fewer where they take `ENOUGH` seconds.
ENOUGH = 2.0  # Seconds of runs, after which there are no more.
SIZES = (128, 512, 2048)
LINES = (2**14, 2**17, 2**20)
QUICK_SIZES, QUICK_LINES = (32, 64), (2048,)
TABULATED = ("none", "T. Chan", "cosine", "sine", "M", "FSAI")  # In docs/masks.md.
SHOWN = 128  # Elements across the grid whose pressures are drawn.


def operator(area: str, n: int) -> LinearOperator:
    """Return the matrix of an area, in the plane or on a line."""
    if area in masks.FRAGMENTED:
        mask = masks.FRAGMENTED[area](n)
        element = (2.0 / n, 2.0 / n)
        x, y = halfspace.offsets((n, n), element)
        full = tmg.ToeplitzOperator(halfspace.influence_zz(x, y, element, G=1.0, nu=0.28))
    else:
        mask = masks.ON_A_LINE[area](n)
        full = test1(n).A
    return masks.restrict(full, mask)


def measure(method: str, A: LinearOperator, small: LinearOperator) -> Row:
    """Set up and solve, first a small problem; in a process of its own."""
    solve_by = partial(solve, preconditioner=PRECONDITIONERS[method], maxiter=MAXITER)
    solve_by(small, np.ones(small.shape[0]))
    before = peak_bytes()
    row: Row = {}
    products = _seconds_of_products(A)
    for name, b in (
        ("constant", np.ones(A.shape[0])),
        ("random", np.random.default_rng(0).standard_normal(A.shape[0])),
    ):
        runs = [solve_by(A, b)]
        while len(runs) < REPEATS and sum(run.seconds for run in runs) < ENOUGH:
            runs.append(solve_by(A, b))
        row |= {
            name: runs[0].count,
            f"{name}_units": runs[0].units,
            f"{name}_s": median(run.seconds for run in runs),
            "setup_s": median(run.setup_s for run in runs),
        }
        products += _seconds_of_products(A)  # Again, as the machine may be shared.
    row["product_s"] = median(products)
    return row | {"vectors": (peak_bytes() - before) / (8 * unwrap(A)[0].shape[0]), "note": ""}


def _seconds_of_products(A: LinearOperator) -> list[float]:
    """Return the CPU seconds of some products, without a first one."""
    x = A @ np.ones(A.shape[0])
    seconds: list[float] = []
    while len(seconds) < REPEATS or sum(seconds) < ENOUGH / 20:
        start = process_time()
        A @ x
        seconds.append(process_time() - start)
    return seconds


def run(jobs: Sequence[tuple[str, int]], methods: Sequence[str]) -> Iterator[list[Row]]:
    """Measure preconditioners on areas of some sizes; yield the rows so far after each."""
    rows: list[Row] = []
    with tqdm(total=len(jobs) * len(methods), unit="run") as progress:
        for area, n in jobs:
            # Sent, not built there: what it takes to build it would be the peak of memory.
            A, small = operator(area, n), operator(area, 2048 if area in masks.ON_A_LINE else 64)
            for method in methods:
                progress.set_postfix_str(f"{area}, {n}, {method}")
                row: Row = {"area": area, "n": n, "method": method, "random_s": nan}
                rows.append(row | row_or_note(partial(measure, method, A, small), SECONDS))
                progress.update()
                yield rows


def format_row(row: Row, sine: float) -> Row:
    """Return a row as it is printed; `sine` is the time of CG with the sine transform."""
    formats = {"constant_units": ".1f", "constant_s": ".3g", "random_units": ".1f"}
    formats |= {"random_s": ".3g", "setup_s": ".2g", "vectors": ".0f"}
    cells = report.format_cells(row, formats)
    counts = {k: row.get(k, "") for k in ("constant", "random")}
    seconds = row.get("random_s", nan)
    beyond = seconds - row.get("random_units", nan) * row.get("product_s", nan)
    ratios = {"of sine": seconds / sine, "beyond units": beyond / seconds}
    shares = {k: "" if isnan(share) else f"{share:.2f}" for k, share in ratios.items()}
    return {"method": row["method"], **counts, **cells, **shares, "note": row["note"]}


def tables(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return what was measured as tables of areas by methods, the fastest in bold."""
    found = {
        case: {row["method"]: row for row in own}
        for case, own in report.group(rows, "area", "n").items()
    }
    result: dict[str, list[Row]] = {}
    for b in ("random", "constant"):
        title = f"Iterations to {TOLERANCE:.0e} / CPU seconds with set-up, {b} right-hand side"
        result[title] = [_format_times(area, n, own, b) for (area, n), own in found.items()]
    for title, key, spec in (
        ("CPU seconds of the set-up", "setup_s", ".2g"),
        ("Work units, random right-hand side", "random_units", ".0f"),
        ("Peak memory, vectors of all elements", "vectors", ".0f"),
    ):
        result[title] = [
            {"area": area, "n": n}
            | {m: format(row[key], spec) if key in row else "" for m, row in own.items()}
            for (area, n), own in found.items()
        ]
    return result


def arrange(rows: Sequence[Row]) -> list[Row]:
    """Return the table of docs/masks.md: areas of 512² elements and two lines, some methods."""
    table = []
    for (area, n), own in report.group(rows, "area", "n").items():
        if n == 512 or (n == 2**17 and area in ("100 islands", "n/100 islands")):
            some = {row["method"]: row for row in own if row["method"] in TABULATED}
            cells = _format_times(area, n, some, "random")
            table.append({key: cells[key] for key in ("area", "n", *TABULATED) if key in cells})
    return table


def _format_times(area: str, n: int, own: dict[str, Row], b: str) -> Row:
    """Return a row of iterations and seconds; where there is none, why."""
    solved = {m: row[f"{b}_s"] for m, row in own.items() if isinstance(row.get(b), int)}
    best = min(solved.values(), default=nan)
    cells: Row = {"area": area, "n": n}
    for method, row in own.items():
        if b not in row:
            cells[method] = "too long" if row.get("note", "").startswith("over") else "refused"
        else:
            seconds = f"{row[f'{b}_s']:.2g}"
            cells[method] = (
                f"{row[b]} / {f'**{seconds}**' if solved.get(method) == best else seconds}"
            )
    return cells


def draw(areas: Sequence[str], n: int, path: Path) -> None:
    """Draw the pressures under a rigid displacement of each area."""
    figure = Figure(figsize=(17, 9), layout="constrained")
    axes = figure.subplots(3, 5).ravel()
    for ax, area in zip(axes, areas, strict=False):
        A = operator(area, n)
        p, info = tmg.cg(A, np.ones(A.shape[0]), M=tmg.default_preconditioner(A), rtol=1e-6)
        if info:
            raise ArithmeticError("not converged")
        field = np.full((n, n), np.nan)
        field[masks.FRAGMENTED[area](n)] = p
        image = ax.imshow(
            field.T, origin="lower", extent=(-1, 1, -1, 1), cmap="YlOrRd",
            vmin=0.0, vmax=float(np.quantile(p, 0.95)), interpolation="none",
        )  # fmt: skip
        bar = ax.inset_axes((1.04, 0.0, 0.05, 1.0))
        figure.colorbar(image, cax=bar, extend="max")
        ax.set(title=area, xlabel="x", ylabel="y", xticks=[-1, 0, 1], yticks=[-1, 0, 1])
    figure.suptitle(f"Pressures over G under a unit displacement, of {n}² elements")
    for ax in axes[len(areas) :]:
        ax.set_axis_off()
    report.write_figure(path, figure, dpi=130)


def main(
    quick_sizes: Sequence[int] = QUICK_SIZES, quick_lines: Sequence[int] = QUICK_LINES
) -> None:
    """Run the comparison."""
    prepare("comparisons.systems.masks", "comparisons.harness.measuring", "matplotlib.figure")
    arguments = report.options(
        "preconditioners.areas",
        f"{TITLE}.",
        sizes=QUICK_SIZES + SIZES + QUICK_LINES + LINES,
        areas=(*masks.FRAGMENTED, *masks.ON_A_LINE),
        methods=tuple(PRECONDITIONERS),
    )
    quick = arguments.quick
    in_the_plane, on_a_line = (quick_sizes, quick_lines) if quick else (SIZES, LINES)
    jobs = [
        (area, n)
        for area in arguments.areas or (*masks.FRAGMENTED, *masks.ON_A_LINE)
        for n in (on_a_line if area in masks.ON_A_LINE else in_the_plane)
        if n in (arguments.sizes or (n,))
    ]
    rows: list[Row] = []
    for rows in run(jobs, arguments.methods or tuple(PRECONDITIONERS)):
        report.write_csv(arguments.output / "areas.csv", rows)
    module = "comparisons.preconditioners.areas"
    report.write_markdown(arguments.output / "areas.md", TITLE, module, tables(rows))
    for (area, n), measured in report.group(rows, "area", "n").items():
        sine = {row["method"]: row["random_s"] for row in measured}.get("sine", nan)
        report.show(f"{area}, n = {n}", [format_row(row, sine) for row in measured])
    drawn = [area for area in masks.FRAGMENTED if area in dict(jobs)]
    draw(drawn, quick_sizes[-1] if quick else SHOWN, arguments.output / "areas.png")


if __name__ == "__main__":
    main()
