"""What threads gain: products, approximate inverses, solves, contact, by `scipy.fft.set_workers`.

Wall time on one thread over that on k, beside what bare transforms of SciPy's of as many numbers
gain on the same machine. All take turns, thread counts innermost, so that what disturbs the machine
disturbs all alike; low quantiles. What takes long has fewer turns. What iterates updates vectors
too, which is bound by memory, as a bare triad is.
"""

import os
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from time import process_time

import numpy as np
import scipy.fft

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.measuring import time_call
from comparisons.harness.report import Row
from toeplitz_mg import halfspace
from toeplitz_mg.contact import Material, normal_contact, surfaces

STEEL = Material(E=210000.0, nu=0.28)
SIDES = 512, 1024, 2048
TURNS, SECONDS = 15, 10.0  # Most turns, and seconds after which a task has no more,
LEAST_TURNS = 3  # but for so many.
QUANTILE = 0.1  # Share of the turns that are faster: the others were disturbed.
BARE = "bare transforms"
FORMATS = {"n": "d", "task": "", "workers": "d", "wall_s": ".4f", "speed_up": ".2f"}
FORMATS |= {"of_bare": ".2f", "cpu_ratio": ".2f"}


def tasks(side: int) -> Iterator[tuple[str, Callable[[], object]]]:
    """Yield what is timed on `side`² unknowns, the bare transforms first."""
    n, rng = side**2, np.random.default_rng(0)
    b = rng.standard_normal(n)
    Z = rng.standard_normal((side, side)) + 0j
    yield BARE, lambda: scipy.fft.ifftn(scipy.fft.fftn(Z, overwrite_x=True), overwrite_x=True)
    element = (1.0, 1.0)
    x, y = halfspace.offsets((side, side), element)
    evaluate = partial(halfspace.influence_zz, x, y, element, G=1.0, nu=0.28)
    c = evaluate()
    yield "coefficients", evaluate
    yield "set-up of A", partial(tmg.ToeplitzOperator, c)
    line = tmg.ToeplitzOperator(1.0 / (1.0 + np.arange(n)))
    for axes, A in ((2, tmg.ToeplitzOperator(c)), (1, line)):
        yield f"product, axes: {axes}", partial(A.matvec, b)
        single = A.astype(np.float32)
        yield f"product in float32, axes: {axes}", partial(single.matvec, b.astype(np.float32))
        M, P = tmg.default_preconditioner(A), tmg.fsai_preconditioner(A)
        yield f"default M, axes: {axes}", partial(M.matvec, b)
        yield f"FSAI, axes: {axes}", partial(P.matvec, b)
        yield f"set-up of FSAI, axes: {axes}", partial(tmg.fsai_preconditioner, A)
        yield f"cg with the default M, axes: {axes}", partial(tmg.cg, A, b, M=M, rtol=1e-8)
    # Round in the large, so that the contact keeps away from the edge.
    gap = surfaces.rough((side, side), element, rms=0.01, seed=1)
    gap += surfaces.sphere((side, side), element, radius=1.25 * side**2)
    press = partial(normal_contact, gap, element, material=STEEL)
    yield "normal contact, rough", partial(press, approach=float(np.quantile(gap, 0.1)))


def measure(side: int, turns: int, workers: Sequence[int]) -> Iterator[Row]:
    """Time all tasks of one size, in turns."""
    actions = dict(tasks(side))
    wall: dict[tuple[str, int], list[float]] = defaultdict(list)
    cpu: dict[tuple[str, int], list[float]] = defaultdict(list)
    spent: dict[str, float] = defaultdict(float)
    for turn in range(turns + 1):
        for name, action in actions.items():
            if turn > LEAST_TURNS and spent[name] > SECONDS:
                continue
            for k in workers:
                start = process_time()
                with scipy.fft.set_workers(k):
                    _, seconds = time_call(action)
                spent[name] += seconds
                if turn:  # The first one maps memory, and starts threads.
                    wall[name, k].append(seconds)
                    cpu[name, k].append(process_time() - start)
    low = {key: float(np.quantile(seconds, QUANTILE)) for key, seconds in wall.items()}
    for name, k in wall:
        row: Row = {"n": side**2, "task": name, "workers": k, "wall_s": low[name, k]}
        row["speed_up"] = low[name, 1] / low[name, k]
        row["of_bare"] = row["speed_up"] * low[BARE, k] / low[BARE, 1]
        yield row | {"cpu_ratio": np.median(cpu[name, k]) / np.median(cpu[name, 1])}


def run(folder: Path, *, cores: int, sides: Sequence[int] = SIDES, turns: int = TURNS) -> None:
    """Time everything on up to so many threads, a size at a time."""
    workers = sorted({2**k for k in range(11) if 2**k <= cores} | {1, cores})
    if fixed := os.environ.get("OMP_NUM_THREADS"):
        print(f"OMP_NUM_THREADS is {fixed}, and so are threads of bare transforms: better unset it")
    print("Load of the machine: " + ", ".join(f"{load:.1f}" for load in os.getloadavg()))
    room = {"task": 30, "n": 8}
    table = report.Table("What threads gain", folder / "threads.csv", FORMATS, room)
    for side in sides:
        table.extend(measure(side, turns, workers))
