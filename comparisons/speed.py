"""How fast everything is: products, solves, further right-hand sides, memory, growth with n.

Each contender is set up in a process of its own, and all processes of one size take turns, run by
run, so that what disturbs the machine disturbs them alike; medians of CPU and wall time, on one
thread, and of the large sizes once more on two. The plain contenders are what one writes on
`scipy.fft` by hand. The physical limit of a product is max(10 n log₂(2n)/R, 24 n/B), R the rate of
complex transforms of length 4096, which stay in the cache, and B the bandwidth of a triad, both
measured at the start.
"""

import math
from collections.abc import Sequence
from multiprocessing import set_forkserver_preload
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np
import scipy.fft
from matplotlib.figure import Figure
from tqdm import tqdm

from comparisons import report
from comparisons.report import Row
from comparisons.speed_contenders import FURTHER, LEVELS, PRODUCTS, SOLVES, THREADED, Contender
from comparisons.turns import Times, take_turns

PRODUCT_SIZES = tuple(2**k for k in range(4, 25, 2))
SOLVE_SIZES = tuple(2**k for k in range(6, 23, 2))
LEVEL_SIZES = {"two levels": tuple(4**k for k in range(5, 12)), "three levels": (8**5, 8**7)}
THREADED_SIZES = (2**16, 2**18, 2**20, 2**22)
QUICK_PRODUCTS, QUICK_SOLVES, QUICK_THREADED = (2**6, 2**10, 2**14), (2**6, 2**10), (2**10,)
SLOW = 4.0  # seconds of one run, after which larger sizes are left out


def compare(
    contenders: dict[str, Contender],
    name: str,
    sizes: Sequence[int],
    against: str,
    threads: int = 1,
) -> list[Row]:
    """Time contenders at all sizes, and relate them to one of them."""
    rows: list[Row] = []
    left = dict(contenders)
    for n in tqdm(sizes, desc=f"{name}, against {against}", unit="size"):
        times = take_turns(left, name, n, threads)
        base = times[against] if against in times else Times(math.nan, math.nan, math.nan)
        for key, t in times.items():
            row = {"symbol": name, "n": n, "method": key, "cpu_s": t.cpu, "wall_s": t.wall}
            row |= {"ratio": t.cpu / base.cpu, "wall_ratio": t.wall / base.wall}
            rows.append(row | {"vectors": t.peak_vectors, "note": t.note})
        left = {k: c for k, c in left.items() if k not in times or times[k].wall < SLOW}
    return rows


def machine() -> tuple[float, float]:
    """Return R, flops a second of transforms in the cache, and B, bytes a second of a triad."""
    z = np.ones(4096, np.complex128)
    a, b, c = (np.ones(2**24) for _ in range(3))

    def triad() -> None:
        np.multiply(b, 3.0, out=a)
        np.add(a, c, out=a)

    def transform() -> None:
        for _ in range(100):
            scipy.fft.fft(z, overwrite_x=True)
            z[:] = 1.0

    seconds = {}
    for action in (transform, triad):
        runs = []
        for _ in range(9):
            start = perf_counter()
            action()
            runs.append(perf_counter() - start)
        seconds[action] = median(runs)
    # The triad in NumPy is two passes: 16 + 24 bytes a number.
    return 100 * 5 * 4096 * 12 / seconds[transform], 40.0 * 2**24 / seconds[triad]


def show(title: str, rows: Sequence[Row], key: str, spec: str) -> None:
    """Print a table, methods across."""
    table: dict[int, Row] = {}
    for row in rows:
        value = row[key]
        shown = "" if math.isnan(value) else format(value, spec)
        table.setdefault(row["n"], {"n": row["n"]})[row["method"]] = shown
    report.show(title, list(table.values()))


def show_growth(rows: Sequence[Row]) -> None:
    """Print the exponent of time over n."""
    table = []
    for method in dict.fromkeys(row["method"] for row in rows):
        own = {row["n"]: row["cpu_s"] for row in rows if row["method"] == method}
        ends = [n for n in own if n >= 2**16 and not math.isnan(own[n])]
        if len(ends) > 1:
            first, last = min(ends), max(ends)
            exponent = math.log(own[last] / own[first]) / math.log(last / first)
            table.append(
                {"method": method, "n": f"{first} … {last}", "exponent": f"{exponent:.3f}"}
            )
    report.show("Growth of time with n", table)


def plot(rows: Sequence[Row], title: str, path: Path) -> None:
    """Draw time over n."""
    figure = Figure(figsize=(9, 6), layout="constrained")
    ax = figure.subplots()
    for k, method in enumerate(dict.fromkeys(row["method"] for row in rows)):
        own = [row for row in rows if row["method"] == method]
        style = "--" if "plain" in method or method[0] in "LdmfSb" else "-"
        n, seconds = [row["n"] for row in own], [row["cpu_s"] for row in own]
        ax.plot(n, seconds, style, marker=".", color=f"C{k}" if k < 10 else "k", label=method)
    ax.set(xlabel="n", ylabel="CPU time, s", xscale="log", yscale="log", title=title)
    ax.set_xscale("log", base=2)
    ax.grid(alpha=0.3)
    ax.legend(ncols=2, fontsize=8)
    report.write_figure(path, figure, dpi=130)


def main() -> None:
    """Run the comparison."""
    set_forkserver_preload(["comparisons.turns"])
    arguments = report.options("speed", "Time products and solves.")
    folder, quick = arguments.output, arguments.quick
    R, B = machine()
    print(f"Transforms in the cache: {R / 1e9:.1f} Gflop/s; triad: {B / 1e9:.1f} GB/s")

    products = compare(PRODUCTS, "contact", QUICK_PRODUCTS if quick else PRODUCT_SIZES, "plain")
    for row in products:
        n = row["n"]
        row["limit"] = max(10 * n * math.log2(2 * n) / R, 24 * n / B) / row["cpu_s"]
    report.write_csv(folder / "products.csv", products)
    show("One product: CPU time against the plain one", products, "ratio", ".2f")
    show("One product: CPU time, µs", [r | {"us": r["cpu_s"] * 1e6} for r in products], "us", ".4g")
    show("One product: fraction of the physical limit", products, "limit", ".2f")
    plot(products, "One product", folder / "products.png")

    levels: list[Row] = []
    for name, sizes in LEVEL_SIZES.items():
        rows = compare(LEVELS, name, sizes[:1] if quick else sizes, "plain")
        levels += rows
        show(f"One product in {name}: CPU time against the plain one", rows, "ratio", ".2f")
    report.write_csv(folder / "levels.csv", levels)

    solves: list[Row] = []
    for name in ("contact", "fGn, H = 0.9"):
        rows = compare(SOLVES, name, QUICK_SOLVES if quick else SOLVE_SIZES, "plain CG + T. Chan")
        solves += rows
        report.write_csv(folder / "solves.csv", solves)
        show(f"{name}, to 1e-8: CPU time against plain CG + T. Chan", rows, "ratio", ".2f")
        show(f"{name}, to 1e-8: CPU time, s", rows, "cpu_s", ".2g")
        show(f"{name}: peak memory, vectors of n", rows, "vectors", ".1f")
        plot(rows, f"{name}: a solve to 1e-8", folder / f"solves_{name[:3]}.png")

    threaded: list[Row] = []
    for contenders, against in ((PRODUCTS, "plain"), (SOLVES, "plain CG + T. Chan")):
        few = {key: contenders[key] for key in THREADED if key in contenders}
        sizes = QUICK_THREADED if quick else THREADED_SIZES
        rows = compare(few, "contact", sizes, against, threads=2)
        threaded += rows
        show(f"On two threads: wall time against {against} on two", rows, "wall_ratio", ".2f")
        show("On two threads: wall time, s", rows, "wall_s", ".2g")
    report.write_csv(folder / "two_threads.csv", threaded)

    further = compare(
        FURTHER, "contact", (2**10,) if quick else (2**10, 2**16, 2**20), "plain product"
    )
    report.write_csv(folder / "further.csv", further)
    show("Further right-hand sides: CPU time against one plain product", further, "ratio", ".2f")
    show_growth(products + [row for row in solves if row["symbol"] == "contact"])


if __name__ == "__main__":
    main()
