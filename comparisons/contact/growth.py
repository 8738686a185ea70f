"""Steady rolling on finer and finer grids: how many products it takes.

A sphere of radius 1 and ν = 1/4, with a contact of half width 0.6 on [-1, 1]², rolls by six
creepages with partial slip. The work is all that is done, on coarser grids and in preconditioners
too, in products on the rectangle around the contact. The violation of Coulomb's law is recomputed
with the matrices of the whole grid, over the largest rigid slip.
"""

from collections.abc import Sequence
from time import process_time

import numpy as np

from comparisons.contact.theory import MU, A, semi_ellipse
from comparisons.harness import report
from comparisons.harness.report import Row
from toeplitz_mg import halfspace
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import Material, TangentialResult, rolling, surfaces
from toeplitz_mg.contact.tangential.coulomb import clip

SIZES, QUICK_SIZES = (64, 128, 256, 512, 1024), (32, 64)
BODY = Material.from_shear(1.0, 0.25)
# Longitudinal and lateral creepage, and spin.
MOTIONS = {
    "longitudinal": (0.1, 0.0, 0.0),
    "lateral": (0.0, 0.1, 0.0),
    "spin": (0.0, 0.0, 0.3),
    "all": (0.06, 0.04, 0.2),
    "small": (0.02, 0.04, -0.1),
    "nearly none": (0.002, 0.0, 0.0),
}


def roll(N: int, creepages: tuple[float, float, float]) -> TangentialResult:
    """Roll on N x N elements."""
    h = 2.0 / N
    r = np.hypot(*surfaces.centres((N, N), (h, h)))
    g = MU * 2.0 * A / np.pi * semi_ellipse(r, A)
    longitudinal, lateral, spin = creepages
    return rolling(g, (h, h), material=BODY, longitudinal=longitudinal, lateral=lateral, spin=spin)


def violation(result: TangentialResult, creepages: tuple[float, ...]) -> float:
    """Return how far the tractions are from obeying Coulomb's law, as a part of the rigid slip."""
    shape, element, q = result.shape, result.element, result.traction
    h, material = element[0], result.material
    here, ahead = (
        halfspace.influence_matrix("xy", shape, element, material, ahead=k) for k in (0, 1)
    )
    x, y = surfaces.centres(shape, (h, element[1]))
    longitudinal, lateral, spin = creepages
    w: Array = h * np.stack(np.broadcast_arrays(longitudinal - spin * y, lateral + spin * x))
    slip = (here @ q.ravel() - ahead @ q.ravel()).reshape(q.shape) + w
    k0 = float(here.diagonal()[0] - ahead.diagonal()[0])
    error = k0 * np.abs(q - clip(q - slip / k0, result.bound)).max()
    return float(error / np.abs(w * result.contact).max())


def arrange(rows: Sequence[Row]) -> list[Row]:
    """Return the table of products, and of all work in products, a row for each grid."""
    table: dict[int, Row] = {}
    for row in rows:
        line = table.setdefault(row["N"], {"products (all work)": f"{row['N']}²"})
        line[row["motion"]] = f"{row['products']} ({row['work']})"
    return list(table.values())


def main() -> None:
    """Run the comparison."""
    arguments = report.options("contact.growth", "Steady rolling on finer and finer grids.")
    rows: list[Row] = []
    for motion, creepages in MOTIONS.items():
        for N in QUICK_SIZES if arguments.quick else SIZES:
            start = process_time()
            result = roll(N, creepages)
            seconds = process_time() - start
            rows.append(
                {
                    "motion": motion,
                    "N": N,
                    "products": result.products,
                    "work": f"{result.work:.0f}",
                    "iterations": " ".join(map(str, result.iterations)),
                    "violation": f"{violation(result, creepages):.1e}",
                    "cpu_s": f"{seconds:.2f}",
                }
            )
    report.write_csv(arguments.output / "growth.csv", rows)
    report.show("Steady rolling with partial slip", rows)


if __name__ == "__main__":
    main()
