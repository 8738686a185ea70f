"""What `updated` costs where an area changes: the CPU time of an update over that of a set-up.

FSAI on the areas of `areas`, of the normal problem and of the tangential one, whose components are
coupled (ν = 1/2). Of the elements in contact 1 % change: in one place, along the edges of the area,
or scattered, and 1 % more, scattered, after four such updates. A set-up and the updates take turns
in one process on one thread; medians. Beside each ratio the iterations of CG to 1e-8, random
right-hand side, with what is updated and with a new one, and the time of an application over that
of a new one.
"""

from collections.abc import Callable, Mapping
from functools import partial
from itertools import product
from statistics import median
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from comparisons.harness import report
from comparisons.harness.measuring import TOLERANCE, iterate
from comparisons.harness.processes import in_a_fresh_process, prepare
from comparisons.harness.report import Row
from comparisons.systems import masks
from toeplitz_mg import (
    CoupledOperator,
    MaskedOperator,
    ToeplitzOperator,
    fsai_preconditioner,
    halfspace,
)

Array = NDArray[np.bool_]

PART = 0.01  # Share of the elements in contact that change.
TURNS = 9  # Set-ups and updates of which the median time counts.
SECONDS = 600.0  # Time after which an area is given up.
SIZES, QUICK_SIZES = (512, 1024), (48,)


def in_one_place(mask: Array, count: int) -> Array:
    """Change the elements nearest to one that is in contact, and has most contact about it."""
    i, j = np.nonzero(mask)
    middle = np.argmin(np.hypot(i - i.mean(), j - j.mean()))
    x, y = np.indices(mask.shape)
    distance = np.hypot(x - i[middle], y - j[middle]).ravel()
    changed = np.zeros(mask.size, dtype=bool)
    changed[np.argsort(distance, kind="stable")[:count]] = True
    return mask ^ changed.reshape(mask.shape)


def along_edges(mask: Array, count: int) -> Array:
    """Add elements beside the area, and take away as many at its edge."""
    outside = binary_dilation(mask) & ~mask
    inside = binary_dilation(~mask) & mask
    return mask ^ _some(outside, count // 2) ^ _some(inside, count - count // 2)


def scattered(mask: Array, count: int, seed: int = 0) -> Array:
    """Change elements anywhere."""
    return mask ^ _some(np.ones_like(mask), count, seed)


def _some(where: Array, count: int, seed: int = 0) -> Array:
    places = np.flatnonzero(where)
    chosen = np.zeros(where.size, dtype=bool)
    some = np.random.default_rng(seed).choice(places, min(count, len(places)), replace=False)
    chosen[some] = True
    return chosen.reshape(where.shape)


CHANGES: dict[str, Callable[[Array, int], Array]] = {
    "in one place": in_one_place,
    "along edges": along_edges,
    "scattered": scattered,
}
FIFTH = "the fifth, scattered"


def normal(N: int) -> ToeplitzOperator:
    """Return the matrix of normal tractions."""
    element = (2.0 / N, 2.0 / N)
    x, y = halfspace.offsets((N, N), element)
    return ToeplitzOperator(halfspace.influence_zz(x, y, element, G=1.0, nu=0.28))


def tangential(N: int, ratio: float = 1.0) -> CoupledOperator:
    """Return that of tangential ones, elements being stretched by this ratio."""
    element = (2.0 / N, ratio * 2.0 / N)
    x, y = halfspace.all_offsets((N, N), element)
    xx, xy, yy = (
        ToeplitzOperator.from_lags(influence(x, y, element, G=1.0, nu=0.5))
        for influence in (halfspace.influence_xx, halfspace.influence_xy, halfspace.influence_yy)
    )
    return CoupledOperator([[xx, xy], [xy, yy]])


PROBLEMS: dict[str, Callable[[int], Any]] = {"normal": normal, "tangential": tangential}


def measure(problem: str, area: str, N: int, turns: int) -> Row:
    """Time a set-up, and the updates over it; in a process of its own."""
    mask = masks.FRAGMENTED[area](N)
    on = partial(MaskedOperator, PROBLEMS[problem](N))
    A = on(mask)
    P: Any = fsai_preconditioner(A)
    count = max(1, round(PART * np.count_nonzero(mask)))
    setup = partial(fsai_preconditioner, A)
    new = {name: (P, f(mask, count)) for name, f in CHANGES.items()}
    fourth, then = P, mask
    for seed in range(1, 5):
        then = scattered(then, count, seed)
        fourth = fourth.updated(then)
    new[FIFTH] = fourth, scattered(then, count, 5)
    changes = {name: (Q, on(other)) for name, (Q, other) in new.items() if (other ^ mask).any()}
    actions = {name: partial(Q.updated, B.mask) for name, (Q, B) in changes.items()}
    seconds = _medians({"set-up": setup} | actions, turns)
    row: Row = {
        "problem": problem,
        "area": area,
        "n": N,
        "unknowns": A.shape[0],
        "setup_s": seconds["set-up"],
    }
    for name, (Q, B) in changes.items():
        updated, fresh = Q.updated(B.mask), fsai_preconditioner(B)
        b = np.random.default_rng(1).standard_normal(B.shape[0])
        taken = [iterate(B, b, M=R, rtol=TOLERANCE)[1] for R in (updated, fresh)]
        applications = {"updated": partial(updated.matvec, b), "new": partial(fresh.matvec, b)}
        applied = _medians(applications, turns)
        row[name] = seconds[name] / seconds["set-up"]
        row[f"{name}: iterations"], row[f"{name}: new"] = taken
        row[f"{name}: application"] = applied["updated"] / applied["new"]
    return row


def _medians(actions: Mapping[str, Callable[[], object]], turns: int) -> dict[str, float]:
    seconds: dict[str, list[float]] = {name: [] for name in actions}
    for _ in range(turns):
        for name, action in actions.items():
            start = process_time()
            action()
            seconds[name].append(process_time() - start)
    return {name: median(times) for name, times in seconds.items()}


def _shown(row: Row, change: str) -> str:
    if change not in row:
        return "none"
    taken = f"{row[f'{change}: iterations']}/{row[f'{change}: new']}"
    return f"{row[change]:.2f} ({taken}, {row[f'{change}: application']:.2f})"


def main(turns: int = TURNS) -> None:
    """Run the comparison."""
    prepare("comparisons.systems.masks", "comparisons.harness.report", "scipy.ndimage")
    arguments = report.options("preconditioners.updates", "The cost of an update of FSAI.")
    rows: list[Row] = []
    for problem, N in product(PROBLEMS, QUICK_SIZES if arguments.quick else SIZES):
        own = [
            in_a_fresh_process(partial(measure, problem, area, N, turns), SECONDS)
            for area in masks.FRAGMENTED
            if area != "one line"
        ]
        rows += own
        shown = [
            {k: r[k] for k in ("area", "unknowns")}
            | {"set-up, s": f"{r['setup_s']:.3f}"}
            | {name: _shown(r, name) for name in (*CHANGES, FIFTH)}
            for r in own
        ]
        report.show(
            "An update over a set-up (iterations/of a new one, application over a new one's), "
            f"{problem}, 1 % of the elements changed, {N}²",
            shown,
        )
        report.write_csv(arguments.output / "updates.csv", rows)


if __name__ == "__main__":
    main()
