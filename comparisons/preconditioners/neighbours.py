"""How many iterations FSAI takes with 12, 24 and 40 neighbours, and what its trial problem says.

Kernels of half-spaces, stretched or not, and covariances: Matérn's of half-integer smoothness, of
one axis and of two, and of smoothness, length and nugget drawn by chance. For each the iterations
of CG to 1e-8, random right-hand side, at most over the areas of `areas`, beside those of the trial
by which `fsai_preconditioner` chooses the number of neighbours, and the number that it chooses.
"""

from collections.abc import Callable, Iterator

import numpy as np
from scipy.special import gamma, kv

from comparisons.harness import report
from comparisons.harness.report import Row
from comparisons.systems import masks
from toeplitz_mg import MaskedOperator, ToeplitzOperator, cg, fsai_preconditioner, halfspace
from toeplitz_mg._typing import Array, Mask
from toeplitz_mg.preconditioners.fsai.neighbours import (
    NUMBERS,
    count_iterations,
    select_stencil,
)
from toeplitz_mg.preconditioners.fsai.stencil import Stencil

SIZE, QUICK_SIZE = 128, 32  # Cells along each side of a grid; a line has their square.
CHANCE, QUICK_CHANCE = 20, 1  # Number of covariances that are drawn by chance.
MOST = 60  # Iterations after which a case is given up.


def matern(r: Array, nu: float, length: float, nugget: float = 0.0) -> Array:
    """Return Matérn's covariance at the distances r, the first of them zero."""
    s = np.sqrt(2.0 * nu) * np.where(r == 0.0, 1.0, r) / length
    c = np.where(r == 0.0, 1.0 + nugget, 2.0 ** (1.0 - nu) / gamma(nu) * s**nu * kv(nu, s))
    return c


def kernels(n: int, chance: int) -> Iterator[tuple[str, Array]]:
    """Yield names and coefficients."""
    influences: dict[str, Callable[..., Array]] = {
        "normal": halfspace.influence_zz,
        "tangential xx": halfspace.influence_xx,
        "tangential yy": halfspace.influence_yy,
    }
    for name, influence in influences.items():
        for ratio in (1.0, 20.0, 50.0, 100.0, 150.0, 1000.0):
            element = (1.0, ratio)
            at = halfspace.offsets((n, n), element)
            yield f"{name}, 1:{ratio:g}", influence(*at, element, G=1.0, nu=0.5)
    plane, line = np.hypot(*np.ogrid[:n, :n]), np.arange(float(n * n))[np.newaxis]
    for nu, lengths in ((0.5, (1, 3, 5, 8)), (1.5, (2, 3, 4)), (2.5, (1.5, 2, 3))):
        for length in lengths:
            yield f"Matérn {nu}, {length}", matern(plane, nu, length)
            yield f"Matérn {nu}, {4 * length} on a line", matern(line, nu, 4 * length)
    rng = np.random.default_rng(0)
    for _ in range(chance):
        nu, length = rng.uniform(0.3, 3.0), rng.uniform(0.5, 7.0)
        nugget = float(rng.choice([0.0, 0.01, 0.1, 1.0]))
        name = f"Matérn {nu:.2f}, {length:.1f}, nugget {nugget:g}"
        yield name, matern(plane, nu, length, nugget)


def areas(shape: tuple[int, ...]) -> Iterator[Mask]:
    """Yield masks of a grid, or of a line."""
    rng = np.random.default_rng(1)
    for density in (0.05, 0.1, 0.2, 0.5):
        yield rng.random(shape) < density
    if shape[0] > 1:
        for mask in masks.FRAGMENTED.values():
            yield mask(shape[0])


def iterations(c: Array, neighbours: int, mask: Mask) -> int:
    """Count the iterations of CG; -1 where it fails."""
    count = 0

    def step(_: object) -> None:
        nonlocal count
        count += 1

    A = MaskedOperator(ToeplitzOperator(c), mask)
    b = np.random.default_rng(0).standard_normal(A.shape[0])
    try:
        P = fsai_preconditioner(A, neighbours=neighbours)
        _, info = cg(A, b, M=P, rtol=1e-8, maxiter=MOST, callback=step)
    except np.linalg.LinAlgError:
        return -1
    return count if info == 0 else -1


def measure(name: str, c: Array) -> Row:
    """Compare the trials of a kernel with what larger grids take."""
    row: Row = {"kernel": name}
    for number in NUMBERS:
        try:
            row[f"{number}: trial"] = count_iterations(Stencil.of_one(c, number))
        except np.linalg.LinAlgError:
            row[f"{number}: trial"] = float("inf")
        counts = [iterations(c, number, mask) for mask in areas(c.shape)]
        row[f"{number}: most"] = -1 if -1 in counts else max(counts)
    try:
        row["chosen"] = select_stencil(c).neighbours
    except np.linalg.LinAlgError:
        row["chosen"] = "refused"
    return row


def main() -> None:
    """Run the comparison."""
    arguments = report.options(
        "preconditioners.neighbours", "Iterations of FSAI by its number of neighbours."
    )
    n, chance = (QUICK_SIZE, QUICK_CHANCE) if arguments.quick else (SIZE, CHANCE)
    rows = [measure(name, c) for name, c in kernels(n, chance)]
    shown = [
        {"kernel": r["kernel"]}
        | {str(k): f"{r[f'{k}: most']} ({r[f'{k}: trial']:.1f})" for k in NUMBERS}
        | {"chosen": r["chosen"]}
        for r in rows
    ]
    report.show(f"Iterations, at most (of the trial), by neighbours, {n}²", shown)
    report.write_csv(arguments.output / "neighbours.csv", rows)


if __name__ == "__main__":
    main()
