"""Load curves from warm starts, and hardness against an independent solution.

Twenty loads on a rough surface and on a sphere, in equal ratios, in equal steps, and falling: the
products and the CPU time of `load_curve` beside those of each load from scratch, with the largest
difference of the pressures, and the violation of the conditions, recomputed.

Spheres that are harder than 0.6, 0.8 and 1 of the largest pressure by Hertz: the difference from
SciPy's `lsq_linear` on a dense factor, which knows of the two bounds alone, over the number N of
elements across the grid, and the products.
"""

import warnings
from time import process_time

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import lsq_linear
from tqdm import tqdm

from comparisons.contact.methods import Problem
from comparisons.harness import report
from comparisons.harness.report import Row
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import (
    ContactWarning,
    Material,
    NormalResult,
    load_curve,
    normal_contact,
    surfaces,
)

LOADS = 20
LEAST, MOST = 0.006, 0.3  # Of the forces on the rough surface: 1 to 40 % in contact.
SIZES, QUICK_SIZES = (64, 256), (32,)
HARD_SIZES, QUICK_HARD_SIZES = (8, 16, 24), (8,)
HARDNESSES = (0.6, 0.8, 1.0)  # Over the largest pressure by Hertz.
TOLERANCE = 1e-10  # Of the contacts that are compared with the independent solution.


def orders(least: float, most: float) -> dict[str, Array]:
    """Return forces by the name of their order."""
    steps = np.linspace(least, most, LOADS)
    return {"ratios": np.geomspace(least, most, LOADS), "steps": steps, "falling": steps[::-1]}


def curves(N: int) -> list[Row]:
    """Compare curves with their loads, each from scratch."""
    rows: list[Row] = []
    for problem, scale in ((Problem("rough", N, is_rough=True), 1.0), (Problem("sphere", N), 0.6)):
        element, material = (problem.h, problem.h), problem.material
        for order, forces in orders(scale * LEAST, scale * MOST).items():
            start = process_time()
            alone = [
                normal_contact(problem.gap, element, material=material, force=force)
                for force in forces
            ]
            middle = process_time()
            curve = list(load_curve(problem.gap, element, material=material, forces=forces))
            end = process_time()
            row: Row = {"surface": problem.name, "N": N, "forces": order}
            row |= {"products, each alone": products(alone), "as a curve": products(curve)}
            row["CPU over that"] = f"{(end - middle) / (middle - start):.2f}"
            row["difference"] = f"{max(map(difference, curve, alone)):.1e}"
            violation = max(problem.violation(result.pressure, None) for result in curve)
            rows.append(row | {"violation": f"{violation:.1e}"})
    return rows


def products(results: list[NormalResult]) -> int:
    """Return the products of all of them."""
    return sum(result.products for result in results)


def difference(first: NormalResult, second: NormalResult) -> float:
    """Return the largest difference of the pressures over the largest of these."""
    return float(np.abs(first.pressure - second.pressure).max() / second.max_pressure)


def hard_spheres(N: int) -> list[Row]:
    """Compare spheres of several hardnesses with what the bounds alone give."""
    h, material = 2.0 / N, Material.from_shear(1.0, 0.0)  # E* = 1.
    gap = surfaces.sphere((N, N), (h, h), radius=1.0)
    approach = 0.25
    largest = 2.0 * np.sqrt(approach) / np.pi  # By Hertz.
    problem = Problem("sphere", N)
    # The energy is ½|Rp - y|², with RᵀR = A.
    R = cholesky(problem.matrix.toarray())
    y = solve_triangular(R, (approach - gap).ravel(), trans="T")
    rows: list[Row] = []
    for share in HARDNESSES:
        result = normal_contact(
            gap,
            (h, h),
            material=material,
            approach=approach,
            hardness=share * largest,
            tolerance=TOLERANCE,
        )
        found = lsq_linear(R, y, (0.0, share * largest), method="bvls", tol=1e-15).x
        away = np.abs(result.pressure.ravel() - found).max() / largest
        yielding = np.count_nonzero(result.pressure >= share * largest)
        row: Row = {"N": N, "hardness / p0": share, "yielding": yielding}
        rows.append(row | {"difference": f"{away:.1e}", "products": result.products})
    return rows


def main() -> None:
    """Run the comparison."""
    arguments = report.options("contact.loads", "Load curves, and hardness.")
    warnings.simplefilter("ignore", ContactWarning)  # Small contacts are coarse, large ones wide.
    sizes = QUICK_SIZES if arguments.quick else SIZES
    rows = [row for N in tqdm(sizes, unit="size") for row in curves(N)]
    report.show(f"{LOADS} loads, each from scratch, and as a curve", rows)
    report.write_csv(arguments.output / "curves.csv", rows)
    hard = QUICK_HARD_SIZES if arguments.quick else HARD_SIZES
    rows = [row for N in tqdm(hard, unit="size") for row in hard_spheres(N)]
    report.show("Hardness, beside SciPy's lsq_linear", rows)
    report.write_csv(arguments.output / "hardness.csv", rows)


if __name__ == "__main__":
    main()
