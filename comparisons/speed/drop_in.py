"""`toeplitz_mg.solve_toeplitz` against the faster of two rivals, at every size.

The rivals: `scipy.linalg.solve_toeplitz`, and what one writes by hand on `scipy.fft`, CG with
T. Chan's circulant. CPU time on one thread, set-ups and the check of our residual included; the
contenders in turns, whose order is drawn, in one process, a fresh one for each symbol and decade;
low quantiles, of fewer turns for one that takes long. ``--symbols``, ``--sizes``, ``--columns`` and
``--digits``, of the residual, choose others.

What `solve_toeplitz` chooses by a ratio of two times is shown as it is, and as it would be where
Levinson's recursion costs half or twice as much beside all else: the ratio is then fixed by the
environment variable, and to the times of those who call the recursion so much of it is added.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import partial
from itertools import groupby
from pathlib import Path
from random import Random
from time import process_time
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
import scipy.linalg
from matplotlib.figure import Figure
from tqdm import tqdm

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.measuring import time_call
from comparisons.harness.processes import in_a_fresh_process, prepare
from comparisons.harness.report import Row
from comparisons.speed.by_hand_contenders import chan_column, plain_cg
from comparisons.systems import symbols
from toeplitz_mg._typing import Array
from toeplitz_mg.solvers.levinson import levinson
from toeplitz_mg.solvers.machine import VARIABLE, cosine_over_levinson

SYMBOLS = ("contact", "fGn, H = 0.9", "0.9^k", "exp(-k/1000)", "θ²")
A_DECADE = 24  # Sizes in each decade beyond the first 40.
SIZES = (*range(1, 41), *(round(10 ** (k / A_DECADE)) for k in range(39, 6 * A_DECADE + 1)))
TABULATED = (32, 100, 316, 1000, 3162, 10_000, 100_000, 1_000_000)  # In docs/benchmarks.md.
QUICK_SIZES = (*range(1, 41, 3), *SIZES[40:80:4])
COLUMNS = (1, 64)
DIGITS = 8  # Those of the relative residual that is asked for, unless told otherwise.
FACTORS = (1.0, 0.5, 2.0)  # How much more Levinson's recursion costs: 1 is as it is.
LEVINSON_STEPS = 2**28  # Most steps, n² a column, of SciPy's, and so n = 16,384.
BY_HAND = range(100, 2**17)  # Sizes for the rival by hand, which is far behind at the others.
ENOUGH = 0.1  # CPU seconds of the runs of one contender, after which it has no more turns.
TURNS = 40  # Most turns.
SHORTEST = 0.001  # CPU seconds of the runs of one turn, so that the clock resolves them.
QUANTILE = 0.2  # Share of the turns that are faster: the others were disturbed.
RECURSIVE = "scipy.linalg.solve_toeplitz"  # The method that is Levinson's recursion.


class Contender(NamedTuple):
    """What is timed, and the ratio of two times that is fixed for it."""

    run: Callable[[], object]
    ratio: str = "1"


@dataclass(frozen=True)
class Pair:
    """What `solve_toeplitz` and its rivals took on one system; None where one was not run."""

    seconds: float
    scipy_seconds: float | None
    by_hand_seconds: float | None
    ratio: float | None  # To the faster rival.
    ratio_half: float | None  # The same where Levinson's recursion costs half as much.
    ratio_twice: float | None
    method: str
    iterations: int
    residual: float


def measure(name: str, sizes: Sequence[int], columns: int, rtol: float) -> list[Pair]:
    """Time all contenders in this process."""
    ratio = cosine_over_levinson()
    return [measure_one(name, n, columns, rtol, ratio) for n in sizes]


def measure_one(name: str, n: int, columns: int, rtol: float, ratio: float) -> Pair:
    """Time all contenders on one system, in turns, after a first run of each."""
    c = symbols.column(name, n)
    b = np.random.default_rng(0).standard_normal((n, columns) if columns > 1 else n)
    lags, rows = np.concatenate([c[:0:-1], c]), np.ascontiguousarray(b.T)
    infos: dict[float, tmg.SolveInfo] = {}
    contenders: dict[str, Contender] = {}
    reached = 0.0
    for factor in FACTORS:
        fixed = str(ratio / factor)
        with patch.dict(os.environ, {VARIABLE: fixed}):
            x, info = tmg.solve_toeplitz(c, b, rtol=rtol, full_output=True)
        contenders.setdefault(
            info.method, Contender(partial(tmg.solve_toeplitz, c, b, rtol=rtol), fixed)
        )
        infos[factor] = info
        reached = max(reached, residual(c, x, b))
    if columns * n**2 <= LEVINSON_STEPS:
        contenders["scipy"] = Contender(partial(scipy.linalg.solve_toeplitz, c, b))
        contenders["recursion"] = Contender(partial(levinson, lags, rows))
    if columns == 1 and n in BY_HAND:
        with suppress(ArithmeticError):  # It may not converge.
            (by_hand := plain_cg(chan_column, c, b, rtol))()
            contenders["by hand"] = Contender(by_hand)
    seconds = time_in_turns(contenders)

    def compare(factor: float) -> float | None:
        more = (factor - 1.0) * seconds.get("recursion", 0.0)
        method = infos[factor].method
        rivals = [seconds[key] for key in ("by hand",) if key in seconds]
        rivals += [seconds[key] + more for key in ("scipy",) if key in seconds]
        ours = seconds[method] + (more if method == RECURSIVE else 0.0)
        return ours / min(rivals) if rivals else None

    return Pair(
        seconds=seconds[infos[1.0].method],
        scipy_seconds=seconds.get("scipy"),
        by_hand_seconds=seconds.get("by hand"),
        ratio=compare(1.0),
        ratio_half=compare(0.5),
        ratio_twice=compare(2.0),
        method=infos[1.0].method,
        iterations=infos[1.0].iterations,
        residual=reached,
    )


def time_in_turns(contenders: Mapping[str, Contender]) -> dict[str, float]:
    """Return the CPU seconds of each; one that takes long has fewer turns than the others."""
    repeats = {
        key: max(1, round(SHORTEST / max(time_call(run, process_time)[1], 1e-6)))
        for key, (run, _) in contenders.items()
    }
    times: dict[str, list[float]] = {key: [] for key in contenders}
    order, chance = list(contenders.items()), Random(0)
    for _ in range(TURNS):
        chance.shuffle(order)  # A run is slower after one that has emptied the caches.
        for key, (run, ratio) in order:
            if sum(times[key]) * repeats[key] > ENOUGH:
                continue
            with patch.dict(os.environ, {VARIABLE: ratio}):
                start = process_time()
                for _ in range(repeats[key]):
                    run()
                times[key].append((process_time() - start) / repeats[key])
    return {key: float(np.quantile(t, QUANTILE, method="lower")) for key, t in times.items()}


def residual(c: Array, x: Array, b: Array) -> float:
    """Return the largest ‖b - A x‖/‖b‖ of all columns."""
    r = b - scipy.linalg.matmul_toeplitz(c, x)
    return float((np.linalg.norm(r, axis=0) / np.linalg.norm(b, axis=0)).max())


def run(
    sizes: Sequence[int], path: Path, names: Sequence[str], columns: Sequence[int], rtol: float
) -> list[Row]:
    """Measure all, and keep the table on disk up to date."""
    rows: list[Row] = []
    jobs = []
    for name in names:
        for k in columns:
            some = [n for n in sizes if k * n <= 2**22]
            jobs += [(name, k, list(own)) for _, own in groupby(some, lambda n: len(str(n)))]
    for name, k, own in tqdm(jobs, unit="decade"):
        # A process of its own for each: what one leaves behind is not the time of the next.
        pairs = in_a_fresh_process(partial(measure, name, own, k, rtol))
        for n, pair in zip(own, pairs, strict=True):
            rows.append({"symbol": name, "n": n, "columns": k, **asdict(pair)})
        report.write_csv(path, rows)
    return rows


FORMATS = {
    "seconds": ".2g",
    "scipy_seconds": ".2g",
    "by_hand_seconds": ".2g",
    "ratio": ".2f",
    "ratio_half": ".2f",
    "ratio_twice": ".2f",
    "method": "s",
    "iterations": "d",
    "residual": ".0e",
}


def show(rows: Sequence[Row]) -> None:
    """Print a table for each symbol and number of right-hand sides, and the largest ratios."""
    worst = []
    for (name, columns), own in report.group(rows, "symbol", "columns").items():
        table = [{"n": row["n"]} | report.format_cells(row, FORMATS) for row in own]
        report.show(f"{name}, {columns} right-hand side(s)", table)
        line: Row = {"symbol": name, "columns": columns}
        for key in ("ratio", "ratio_half", "ratio_twice"):
            ratios = [(row[key], row["n"]) for row in own if row[key] is not None]
            line[key] = "{:.2f} at {}".format(*max(ratios)) if ratios else "no rival"
        worst.append(line)
    report.show("The largest ratios to the faster rival, and where", worst)


def arrange(rows: Sequence[Row]) -> list[Row]:
    """Return the table of docs/benchmarks.md: some sizes across, the contact kernel in full."""
    found = {(row["symbol"], row["columns"], row["n"]): row for row in rows}
    lines = [
        (f"contact kernel, {columns} right-hand side{'s' * (columns > 1)}: {title}", key, columns)
        for columns in COLUMNS
        for title, key in (
            ("SciPy", "scipy_seconds"),
            ("CG with T. Chan's circulant by hand", "by_hand_seconds"),
            ("this package", "seconds"),
            ("its time over that of the faster rival", "ratio"),
        )
        if columns == 1 or key != "by_hand_seconds"
    ]
    table = [_arrange_line(title, found, "contact", columns, key) for title, key, columns in lines]
    table += [
        _arrange_line(f"{name}, {columns}: the same ratio", found, name, columns, "ratio")
        for columns in COLUMNS
        for name in SYMBOLS[1:]
    ]
    return [cells for cells in table if any(list(cells.values())[1:])]


def _arrange_line(title: str, found: Mapping[Any, Row], name: str, columns: int, key: str) -> Row:
    cells: Row = {"n": title}
    for n in TABULATED:
        value = found.get((name, columns, n), {}).get(key)
        shown = "" if value is None else f"{value:.2f}"
        cells[f"{n:,}"] = report.format_seconds(value) if key.endswith("seconds") else shown
    return cells


def show_inverses(n: int) -> None:
    """Print what `toeplitz_inverse` costs and achieves."""
    table = []
    for name in SYMBOLS:
        A = tmg.ToeplitzOperator(symbols.column(name, n))
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
    groups = report.group(rows, "columns")
    axes = figure.subplots(1, len(groups), sharey=True, squeeze=False)[0]
    for ax, (columns, of_panel) in zip(axes, groups.items(), strict=True):
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
    arguments = report.options(
        "speed.drop_in",
        "Compare solve_toeplitz with SciPy's.",
        symbols=tuple(symbols.COLUMNS),
        sizes=[],
        columns=list(COLUMNS),
        digits=DIGITS,
    )
    sizes = arguments.sizes or (quick_sizes if arguments.quick else SIZES)
    path, rtol = arguments.output / "drop_in.csv", 10.0**-arguments.digits
    rows = run(sizes, path, arguments.symbols or SYMBOLS, arguments.columns, rtol)
    show(rows)
    if not arguments.sizes:
        show_inverses(2**14 if arguments.quick else 2**20)
    plot(rows, arguments.output / "drop_in.png")


if __name__ == "__main__":
    main()
