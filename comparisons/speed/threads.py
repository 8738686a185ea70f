"""What threads gain: products, approximate inverses, solves, contact, by `scipy.fft.set_workers`.

Wall time on one thread over that on k, beside what the machine allows: bare transforms of SciPy's
of as many numbers on k threads, in the same run, and for what iterates, solves and contact, three
triads with each pair of them, as many as an iteration updates vectors. All take turns, thread
counts innermost, so that what disturbs the machine disturbs all alike; low quantiles. What takes
long has fewer turns. A product's own transforms are four times as large, and leave the cache: bare,
they are shown beside it, and gain less.

The serial share is measured on one thread, by its CPU time: what is neither in a loop that
`toeplitz_mg.engine.threads` shares, nor in a transform of many lines, which SciPy shares. What it
means for more cores is Amdahl's law, 1/(s + (1 - s)/k): memory allows less where it is slow.
"""

import os
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from functools import cache, partial
from time import process_time
from typing import Any
from unittest.mock import patch

import numpy as np
import scipy.fft
from tqdm import tqdm

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.measuring import time_call
from comparisons.harness.report import Row
from toeplitz_mg import halfspace
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import Material, normal_contact, surfaces
from toeplitz_mg.engine import threads

STEEL = Material(E=210000.0, nu=0.28)
QUANTILE = 0.1  # Share of the turns that are faster: the others were disturbed.
CORES = 16, 64  # Of machines for which the serial share says what is to be expected.
LEAST_TURNS = 3  # Turns that are timed of what takes longest.
UPDATES = 3  # Triads with each pair of transforms: an iteration updates so many vectors.
ITERATES = "cg", "normal contact"  # Beginnings of the names of what iterates.
BARE = "bare transforms", "bare triads", "bare transforms of a product"


@dataclass(frozen=True)
class Extent:
    """What is timed: sides of the grids, most turns, and seconds after which a task has none."""

    sides: tuple[int, ...] = (512, 1024, 2048)
    turns: int = 15
    seconds: float = 10.0


FULL, QUICK = Extent(), Extent((512,), turns=2)


def tasks(side: int) -> Iterator[tuple[str, Callable[[], object]]]:
    """Yield what is timed on `side`² unknowns, bare ones first."""
    n, rng = side**2, np.random.default_rng(0)
    b = rng.standard_normal(n)
    Z = rng.standard_normal((side, side)) + 0j
    yield BARE[0], lambda: scipy.fft.ifftn(scipy.fft.fftn(Z, overwrite_x=True), overwrite_x=True)
    yield BARE[1], partial(add_vectors, *np.ones((3, n)))
    yield BARE[2], partial(transform_extended, b.reshape(side, side))
    element = (1.0, 1.0)
    x, y = halfspace.offsets((side, side), element)
    evaluate = partial(halfspace.influence_zz, x, y, element, G=1.0, nu=0.28)
    c = evaluate()
    yield "coefficients", evaluate
    yield "set-up of A", partial(tmg.ToeplitzOperator, c)
    line = tmg.ToeplitzOperator(1.0 / (1.0 + np.arange(n)))
    for axes, A in ((2, tmg.ToeplitzOperator(c)), (1, line)):
        yield f"product, axes: {axes}", partial(A.apply, b)
        yield (
            f"product in float32, axes: {axes}",
            partial(A.astype(np.float32).apply, b.astype("f")),
        )
        M, P = tmg.default_preconditioner(A), tmg.fsai_preconditioner(A)
        yield f"default M, axes: {axes}", partial(M.apply, b)
        yield f"FSAI, axes: {axes}", partial(P.apply, b)
        yield f"set-up of FSAI, axes: {axes}", partial(tmg.fsai_preconditioner, A)
        yield f"cg with the default M, axes: {axes}", partial(tmg.cg, A, b, M=M, rtol=1e-8)
    # Round in the large, so that the contact keeps away from the edge.
    gap = surfaces.rough((side, side), element, rms=0.01, seed=1)
    gap += surfaces.sphere((side, side), element, radius=1.25 * side**2)
    approach = float(np.quantile(gap, 0.1))
    yield (
        "normal contact, rough",
        partial(normal_contact, gap, element, material=STEEL, approach=approach),
    )


def transform_extended(x: Array) -> Array:
    """Transform a field as a product does, extended by zeros to twice its sides, there and back."""
    n = len(x)
    columns = scipy.fft.fft(scipy.fft.rfft(x, 2 * n), 2 * n, axis=0)
    return scipy.fft.irfft(scipy.fft.ifft(columns, axis=0, overwrite_x=True)[:n], 2 * n)


def add_vectors(x: Array, y: Array, z: Array) -> None:
    """Compute z = 3 x + y, by as many threads as SciPy takes, in pieces that stay in the cache."""
    k, size = scipy.fft.get_workers(), threads.PIECE

    def work(part: range) -> None:
        for i in part:
            piece = slice(i * size, (i + 1) * size)
            z[piece] = 3.0 * x[piece] + y[piece]

    cuts = np.linspace(0, -(-len(x) // size), k + 1).astype(int).tolist()
    if k == 1:
        work(range(cuts[-1]))
    else:
        wait([pool(k).submit(work, range(*cuts[i : i + 2])) for i in range(k)])


@cache
def pool(k: int) -> ThreadPoolExecutor:
    """Return the threads of the triads, the same ones each time."""
    return ThreadPoolExecutor(k)


class Meter:
    """The CPU time of what threads can share, while all of it is done by one."""

    __ua_domain__ = "numpy.scipy.fft"

    def __init__(self) -> None:
        self.seconds, self._is_within = 0.0, False

    @contextmanager
    def shared(self) -> Iterator[None]:
        """Take the time of a block, but of one within another."""
        if self._is_within:
            yield
            return
        self._is_within, start = True, process_time()
        try:
            yield
        finally:
            self._is_within, self.seconds = False, self.seconds + process_time() - start

    def share(self, work: threads.Work, count: int, points: int) -> None:
        """Do all parts, as `threads.share` does, in this thread."""
        is_shared = count > 1 and points >= threads.WORTH_THREADS
        with self.shared() if is_shared else nullcontext(), scipy.fft.set_workers(1):
            work(range(count))

    def __ua_function__(self, method: Any, args: Any, kwargs: Any) -> Any:
        """Transform, as `scipy.fft` does: many lines are shared."""
        points = threads.TRANSFORM * args[0].size
        lines = args[0].ndim > 1 and points >= threads.WORTH_THREADS
        with (
            scipy.fft.skip_backend(self),
            scipy.fft.set_workers(1),
            self.shared() if lines else nullcontext(),
        ):
            return method(*args, **kwargs)


def serial_share(action: Callable[[], object]) -> float:
    """Return the share of the CPU time of an action that threads do not share."""
    meter, share = Meter(), threads.share
    with ExitStack() as stack:
        for module in list(sys.modules.values()):
            if getattr(module, "share", None) is share:
                stack.enter_context(patch.object(module, "share", meter.share))
        stack.enter_context(scipy.fft.set_backend(meter))
        stack.enter_context(scipy.fft.set_workers(2))  # For one thread some loops are none.
        _, seconds = time_call(action, process_time)
    return max(0.0, 1.0 - meter.seconds / seconds)


def measure(side: int, extent: Extent, workers: Sequence[int]) -> list[Row]:
    """Time all tasks of one size, in turns."""
    actions = dict(tasks(side))
    wall: dict[tuple[str, int], list[float]] = defaultdict(list)
    cpu: dict[tuple[str, int], list[float]] = defaultdict(list)
    spent: dict[str, float] = defaultdict(float)
    for turn in tqdm(range(extent.turns + 1), desc=f"{side} x {side}", unit="turn"):
        for name, action in actions.items():
            if turn > LEAST_TURNS and spent[name] > extent.seconds:
                continue
            for k in workers:
                with scipy.fft.set_workers(k):
                    begin = process_time()
                    _, seconds = time_call(action)
                    used = process_time() - begin
                spent[name] += seconds
                if turn:  # The first one maps memory, and starts threads.
                    wall[name, k].append(seconds)
                    cpu[name, k].append(used)
    times = {key: float(np.quantile(seconds, QUANTILE)) for key, seconds in wall.items()}
    cpu_times = {key: float(np.quantile(seconds, QUANTILE)) for key, seconds in cpu.items()}
    rows: list[Row] = []
    for name, action in actions.items():
        share = 0.0 if name in BARE else serial_share(action)
        triads = UPDATES * name.startswith(ITERATES)
        for k in workers:
            alone, together = (times[BARE[0], j] + triads * times[BARE[1], j] for j in (1, k))
            allowed = alone / together
            row: Row = {"n": side**2, "task": name, "workers": k, "wall_s": times[name, k]}
            row |= {"speed_up": times[name, 1] / times[name, k], "allowed": allowed}
            row |= {"of_allowed": row["speed_up"] / allowed, "serial_share": share}
            row["cpu_ratio"] = cpu_times[name, k] / cpu_times[name, 1]
            row |= {f"on_{cores}": 1.0 / (share + (1.0 - share) / cores) for cores in CORES}
            rows.append(row)
    return rows


FORMATS = {"task": "", "workers": "d", "wall_s": ".4f", "speed_up": ".2f", "allowed": ".2f"}
FORMATS |= {"of_allowed": ".2f", "cpu_ratio": ".2f", "serial_share": ".1%"}
FORMATS |= {f"on_{cores}": ".1f" for cores in CORES}


def main(quick: Extent = QUICK) -> None:
    """Run the comparison."""
    arguments = report.options("speed.threads", "Time threads.", cores=2)
    extent = quick if arguments.quick else FULL
    workers = sorted({2**k for k in range(11) if 2**k <= arguments.cores} | {1, arguments.cores})
    if fixed := os.environ.get("OMP_NUM_THREADS"):
        print(f"OMP_NUM_THREADS is {fixed}, and so are threads of bare transforms: better unset it")
    print("Load of the machine before: " + ", ".join(f"{load:.1f}" for load in os.getloadavg()))
    rows: list[Row] = []
    for side in extent.sides:
        rows += measure(side, extent, workers)
        report.write_csv(arguments.output / "threads.csv", rows)
    print("Load of the machine after: " + ", ".join(f"{load:.1f}" for load in os.getloadavg()))
    tables = {
        f"{n} unknowns": [report.format_cells(row, FORMATS) for row in own]
        for n, own in report.group(rows, "n").items()
    }
    for title, table in tables.items():
        report.show(title, table)
    module = "comparisons.speed.threads"
    report.write_markdown(arguments.output / "threads.md", "What threads gain", module, tables)


if __name__ == "__main__":
    main()
