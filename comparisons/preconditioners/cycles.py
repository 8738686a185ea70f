"""Multigrid with its default smoother on any kernel: iterations of CG to 1e-8, set-up in cycles."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import toeplitz_mg as tmg
from comparisons.harness.measuring import solve
from comparisons.harness.report import Row, Table
from comparisons.systems.masks import FRAGMENTED
from comparisons.systems.punch import influence
from comparisons.systems.symbols import COLUMNS, Column
from toeplitz_mg.fractional import riesz_coefficients

# Of a condition number with which a residual of 1e-8 is near rounding, or beyond it.
HARD = "θ⁴", "|θ|³", "(2 - 2 cos θ)²", "wide Gaussian"
KERNELS: dict[str, Column] = {
    **{name: COLUMNS[name] for name in COLUMNS if name not in HARD},
    **{f"Riesz, α = {a}": partial(riesz_coefficients, a) for a in (1.2, 1.5, 1.8)},
    "exp(-k/20)": lambda n: np.exp(-np.arange(n) / 20.0),
    "Gaussian, nugget 0.01": lambda n: COLUMNS["Gaussian"](n) + 0.01 * np.eye(1, n)[0],
    "0.9^k cos k, nugget": lambda n: np.exp((1j - 0.1) * np.arange(n)).real + np.eye(1, n)[0] / 5,
    "log": lambda n: np.log(1e7 / np.maximum(np.arange(n), 0.2)),
    "contact, rounded": lambda n: COLUMNS["contact"](n) * (1 + 6e-9 * np.sin(np.arange(n) ** 2)),
}


def measure(name: str, A: Any) -> Row:
    """Make a cycle, and solve for a random right-hand side."""
    M, b = tmg.multigrid(A), np.random.default_rng(1).standard_normal(A.shape[0])
    run = solve(A, b, tmg.multigrid, maxiter=100)
    setup = f"{run.setup_units / M.work:.1f}" if M.work else "direct"
    row = {"system": name, "n": A.shape[0], "iterations": run.iterations}
    return row | {"set-up, cycles": setup, "cycle": repr(M)}


def run(
    folder: Path, lines: Sequence[int] = (2**10, 2**16, 2**20), squares: Sequence[int] = (128, 512)
) -> None:
    """Print a row for each kernel of a line, and for the half-space on each area."""
    table = Table(str(__doc__), folder / "cycles.csv", room={"system": 24, "n": 7})
    for name, f in KERNELS.items():
        table.extend(measure(name, tmg.ToeplitzOperator(f(n))) for n in lines)
    for area, mask in FRAGMENTED.items():
        for n in squares:
            table.add(measure(area, influence("normal", mask(n), (2.0 / n, 2.0 / n))))
