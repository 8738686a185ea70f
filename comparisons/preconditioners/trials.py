"""Matrices whose coefficients do not tell the preconditioner: what `default_preconditioner` takes.

Beside it is what takes part in its trial, each alone. Work units to 1e-8 of CG with a random
right-hand side, the set-up left out but for that of the default, which has the trial.
"""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.measuring import PRECONDITIONERS, solve
from comparisons.harness.report import Row
from comparisons.systems import masks
from toeplitz_mg._typing import Array

TITLE = "Work units of CG where a trial chooses; empty: refused; inf: over 300 iterations"
SIZES = (64, 256)
METHODS = ("none", "FSAI", "cosine", "sine", "T. Chan")
FORMATS = dict.fromkeys(("kernel", "area", "n"), "")
FORMATS |= dict.fromkeys(("trial", "default", *METHODS), ".1f")
MAXITER = 300  # Iterations after which a method is given up.
AREAS: dict[str, Callable[[int], Array]] = {
    "full": masks.FRAGMENTED["full"],
    "circle": masks.circle,
    "random, 60 %": partial(masks.random, 0.6),
}


def waves(i: Array, j: Array) -> Array:
    """Return plane waves in noise."""
    plane = 10.0 * np.cos(0.3 * i) * np.cos(0.1 * j) + 5.0 * np.cos(i) * np.cos(0.7 * j)
    return plane + ((i == 0) & (j == 0))


def lags(i: Array, j: Array) -> Array:
    """Return coefficients at two lags, one of them far."""
    far = (i == i.max() - 1) & (j == j.max())
    return 8.8 * ((i == 0) & (j == 0)) - 1.0 * far - 1.0 * ((i == 3) & (j == 0))


KERNELS: dict[str, Callable[[Array, Array], Array]] = {
    "damped cosines": lambda i, j: np.exp(-(i + j) / 5.0) * np.cos(i) * np.cos(j),
    "cos r/(1 + r) + noise": lambda i, j: np.cos(r := np.hypot(i, j)) / (1.0 + r) + 3.0 * (r == 0),
    "Laplacian": lambda i, j: 4.0 * (i + j == 0) - (i + j == 1),
    "plane waves": waves,
    "isolated lags": lags,
    "a Gaussian as wide as its grid": lambda i, j: (
        np.exp(-((np.hypot(i, j) / i.max()) ** 2)) + 0.01 * (i + j == 0)
    ),
}


def run(folder: Path, sizes: Sequence[int] = SIZES) -> None:
    """Measure all of them on every system, and print a row for each."""
    table = report.Table(TITLE, folder / "trials.csv", FORMATS, {"kernel": 32, "area": 14})
    for n in sizes:
        for kernel, f in KERNELS.items():
            full = tmg.ToeplitzOperator(f(*np.indices((n, n)).astype(float)))
            for area, mask in AREAS.items():
                A = masks.restrict(full, mask(n))
                b = np.random.default_rng(0).standard_normal(A.shape[0])
                row: Row = {"kernel": kernel, "area": area, "n": n}
                for method in ("default", *METHODS):
                    try:
                        run = solve(A, b, PRECONDITIONERS[method], maxiter=MAXITER)
                    except np.linalg.LinAlgError:
                        continue
                    row[method] = run.solve_units if run.info == 0 else np.inf
                    if method == "default":
                        row["trial"] = run.setup_units
                table.add(row)
