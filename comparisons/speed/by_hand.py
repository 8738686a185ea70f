"""How fast everything is: products, solves, further right-hand sides, memory, growth with n.

Each contender is set up in a process of its own, and all processes of one size take turns, run by
run, so that what disturbs the machine disturbs them alike; medians of CPU and wall time, on one
thread, and of the large sizes once more on two. The plain contenders are what one writes on
`scipy.fft` by hand. The physical limit of a product is max(10 n log₂(2n)/R, 24 n/B), R the rate of
complex transforms of length 4096, which stay in the cache, and B the bandwidth of a triad, both
measured at the start.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from typing import NamedTuple

import numpy as np
import scipy.fft
from matplotlib.figure import Figure
from tqdm import tqdm

from comparisons.harness import report
from comparisons.harness.processes import peak_bytes, prepare, take_turns
from comparisons.harness.report import Row
from comparisons.speed.by_hand_contenders import (
    ALONG_AXES,
    FURTHER,
    PRODUCTS,
    SOLVES,
    SYSTEMS,
    THREADED,
    SetUp,
)
from toeplitz_mg._typing import Array

SLOW = 4.0  # Seconds of one run, after which larger sizes are left out.


@dataclass(frozen=True)
class Extent:
    """What is timed, and for how long.

    Attributes
    ----------
    products, solves, threaded, further : tuple of int
        The sizes of each part.
    axes : dict
        The sizes of products along several axes, by the names of the systems.
    seconds : float
        Wall seconds of one contender's runs of one size, ten times as many where they are slow.
    least, most : int
        Runs, where they are not slow.
    """

    products: tuple[int, ...] = tuple(2**k for k in range(4, 25, 2))
    solves: tuple[int, ...] = tuple(2**k for k in range(6, 23, 2))
    threaded: tuple[int, ...] = (2**16, 2**18, 2**20, 2**22)
    further: tuple[int, ...] = (2**10, 2**16, 2**20)
    axes: Mapping[str, tuple[int, ...]] = field(
        default_factory=lambda: {
            "two axes": tuple(4**k for k in range(5, 12)),
            "three axes": (8**5, 8**7),
        }
    )
    seconds: float = 1.0
    least: int = 7
    most: int = 200

    def is_enough(self, runs: Sequence["Run"]) -> bool:
        """Tell whether a contender ran often enough, or for long enough."""
        seconds = sum(run.wall for run in runs)
        enough = len(runs) > self.least and seconds > self.seconds
        return len(runs) > 1 and (enough or seconds > 10 * self.seconds or len(runs) > self.most)


FULL = Extent()
QUICK = Extent(
    products=(2**6, 2**10, 2**14),
    solves=(2**6, 2**10),
    threaded=(2**10,),
    further=(2**10,),
    axes={"two axes": (4**5,), "three axes": (8**5,)},
)


class Run(NamedTuple):
    """One run: seconds, and the rise of the process's memory since before the set-up."""

    cpu: float
    wall: float
    peak_vectors: float  # The peak of memory, in vectors of n float64.


def run_again_and_again(set_up: SetUp, c: Array, b: Array, threads: int) -> Iterator[Run]:
    """Set a contender up, then run it for each item."""
    before = peak_bytes()
    with scipy.fft.set_workers(threads):
        action = set_up(c, b)
        action()
        while True:
            wall, cpu = perf_counter(), process_time()
            action()
            cpu, wall = process_time() - cpu, perf_counter() - wall
            yield Run(cpu, wall, (peak_bytes() - before) / (8 * c.size))


def compare(
    contenders: dict[str, SetUp],
    name: str,
    sizes: Sequence[int],
    against: str,
    extent: Extent,
    threads: int = 1,
) -> list[Row]:
    """Time contenders at all sizes, and relate them to one of them."""
    prepare("comparisons.speed.by_hand_contenders", threads=threads)
    # The server that forks has already imported BLAS, with one thread.
    method = "forkserver" if threads == 1 else "spawn"
    rows: list[Row] = []
    left = dict(contenders)
    for n in tqdm(sizes, desc=f"{name}, against {against}", unit="size"):
        # Sent, not built there: the temporary arrays of building them would be the peak.
        c = SYSTEMS[name](n)
        b = np.random.default_rng(0).standard_normal(c.size)
        jobs = {
            key: partial(run_again_and_again, set_up, c, b, threads) for key, set_up in left.items()
        }
        found = take_turns(jobs, extent.is_enough, method)
        times = {key: medians(runs) for key, runs in found.items() if not isinstance(runs, str)}
        base = times.get(against, NOT_RUN)
        for key, runs in found.items():
            t, note = times.get(key, NOT_RUN), runs if isinstance(runs, str) else ""
            row = {"symbol": name, "n": n, "method": key, "cpu_s": t.cpu, "wall_s": t.wall}
            row |= {"ratio": t.cpu / base.cpu, "wall_ratio": t.wall / base.wall}
            rows.append(row | {"vectors": t.peak_vectors, "note": note})
        left = {key: left[key] for key, t in times.items() if t.wall < SLOW}
    return rows


NOT_RUN = Run(math.nan, math.nan, math.nan)


def medians(runs: Sequence[Run]) -> Run:
    """Return the medians of the seconds, and the peak."""
    cpu, wall, peak = zip(*runs, strict=True)
    return Run(median(cpu), median(wall), max(peak))


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
    for method, runs in report.group(rows, "method").items():
        own = {row["n"]: row["cpu_s"] for row in runs}
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
    for k, (method, own) in enumerate(report.group(rows, "method").items()):
        style = "--" if "plain" in method or method[0] in "LdmfSb" else "-"
        n, seconds = [row["n"] for row in own], [row["cpu_s"] for row in own]
        ax.plot(n, seconds, style, marker=".", color=f"C{k}" if k < 10 else "k", label=method)
    ax.set(xlabel="n", ylabel="CPU time, s", xscale="log", yscale="log", title=title)
    ax.set_xscale("log", base=2)
    ax.grid(alpha=0.3)
    ax.legend(ncols=2, fontsize=8)
    report.write_figure(path, figure, dpi=130)


def main(quick: Extent = QUICK) -> None:
    """Run the comparison."""
    arguments = report.options("speed.by_hand", "Time products and solves.")
    folder, extent = arguments.output, quick if arguments.quick else FULL
    R, B = machine()
    print(f"Transforms in the cache: {R / 1e9:.1f} Gflop/s; triad: {B / 1e9:.1f} GB/s")

    products = compare(PRODUCTS, "contact", extent.products, "plain", extent)
    for row in products:
        n = row["n"]
        row["limit"] = max(10 * n * math.log2(2 * n) / R, 24 * n / B) / row["cpu_s"]
    report.write_csv(folder / "products.csv", products)
    show("One product: CPU time against the plain one", products, "ratio", ".2f")
    show("One product: CPU time, µs", [r | {"us": r["cpu_s"] * 1e6} for r in products], "us", ".4g")
    show("One product: fraction of the physical limit", products, "limit", ".2f")
    plot(products, "One product", folder / "products.png")

    several: list[Row] = []
    for name, sizes in extent.axes.items():
        rows = compare(ALONG_AXES, name, sizes, "plain", extent)
        several += rows
        show(f"One product in {name}: CPU time against the plain one", rows, "ratio", ".2f")
    report.write_csv(folder / "axes.csv", several)

    solves: list[Row] = []
    for name in ("contact", "fGn, H = 0.9"):
        rows = compare(SOLVES, name, extent.solves, "plain CG + T. Chan", extent)
        solves += rows
        report.write_csv(folder / "solves.csv", solves)
        show(f"{name}, to 1e-8: CPU time against plain CG + T. Chan", rows, "ratio", ".2f")
        show(f"{name}, to 1e-8: CPU time, s", rows, "cpu_s", ".2g")
        show(f"{name}: peak memory, vectors of n", rows, "vectors", ".1f")
        plot(rows, f"{name}: a solve to 1e-8", folder / f"solves_{name[:3]}.png")

    threaded: list[Row] = []
    for contenders, against in ((PRODUCTS, "plain"), (SOLVES, "plain CG + T. Chan")):
        few = {key: contenders[key] for key in THREADED if key in contenders}
        rows = compare(few, "contact", extent.threaded, against, extent, threads=2)
        threaded += rows
        show(f"On two threads: wall time against {against} on two", rows, "wall_ratio", ".2f")
        show("On two threads: wall time, s", rows, "wall_s", ".2g")
    report.write_csv(folder / "two_threads.csv", threaded)

    further = compare(FURTHER, "contact", extent.further, "plain product", extent)
    report.write_csv(folder / "further.csv", further)
    show("Further right-hand sides: CPU time against one plain product", further, "ratio", ".2f")
    show_growth(products + [row for row in solves if row["symbol"] == "contact"])


if __name__ == "__main__":
    main()
