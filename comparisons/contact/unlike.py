"""Unlike materials: a sphere pressed in steps, a bonded punch, and rollers that creep alone.

The sphere is that of Spence and of Kalker (Three-Dimensional Elastic Bodies in Rolling Contact,
1990, Figure 5.25): soft, without a Poisson's ratio, pressed on a rigid plane in 35 steps. It is
solved with the coupling, with the alternation not accelerated, and without the coupling. Its
conditions are recomputed with the matrix of all three directions.

The bonded punch is stiffer than a smooth one by ln(3 - 4ν)(1 - ν)/(1 - 2ν) (Mossakovskii and
Spence): the error over the number N of elements across the grid.

The rollers are of aluminium and steel, free of a tangential force or not, as Bentall and Johnson
(1967) have them: their creepage beside that which another program prints for the same elements.
Their curve is the creepage over β a/R by β/μ: 2/π without slip, where β is small, and 0.915 where
all slides. Without slip it is known for any β (Bufler, 1959); the error is over N.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from time import process_time
from unittest.mock import patch

import numpy as np

from comparisons.harness import report
from comparisons.harness.report import Row
from toeplitz_mg import halfspace
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import (
    FrictionalResult,
    Material,
    NormalResult,
    acceleration,
    frictional_contact,
    frictional_rolling,
    normal_contact,
    surfaces,
)
from toeplitz_mg.contact.tangential.coulomb import clip

SIZES, QUICK_SIZES = (64, 128, 256), (32, 64)
STEPS, QUICK_STEPS = 35, 6
MU = 0.2986  # Coefficient of friction of the sphere.
SOFT, HARD = Material.from_shear(0.5, 0.0), Material.from_shear(1e5, 0.0)  # N/mm²
ROLLERS = Material.from_shear(23000.0, 0.31), Material.from_shear(82000.0, 0.28)  # N/mm²
RADIUS, LOAD = 25.0, 16.2019  # mm, of both curvatures; N/mm
# μ, the force over μ times the load, and the creepage that is printed for it.
CREEPAGES = (
    (10.0, 0.0, 3.591e-4),
    (0.05, 0.0, 4.294e-4),
    (0.05, 0.75, 5.392e-4),
    (0.05, -0.75, 2.108e-4),
)
RATIOS = (0.1, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0)  # β/μ of the curve.
LINES, QUICK_LINES = (64, 128, 256, 512, 1024), (64, 128)
PUBLISHED: Row = {
    "case": "published",
    "contact": 921,
    "stick": 225,
    "slip": 696,
    "peak": 0.02392,
    "approach": 0.09874,
}


@contextmanager
def accelerated(depth: int) -> Iterator[None]:
    """Let what is repeated combine so many differences of pairs."""
    with patch.object(acceleration, "DEPTH", depth):
        yield


def sphere() -> tuple[Array, tuple[float, float]]:
    """Return the gap of the sphere, and the size of an element, mm."""
    x = -4.3999 + 0.2 * np.arange(45)
    return 0.004116 * (x[:, None] ** 2 + x**2), (0.2, 0.2)


def press_in_steps(steps: int, tolerance: float) -> list[FrictionalResult]:
    """Press the sphere with (k/45)³ N in step k."""
    gap, element = sphere()
    results: list[FrictionalResult] = []
    for k in range(1, steps + 1):
        before = results[-1] if results else None
        results.append(
            frictional_contact(
                gap,
                element,
                material=(SOFT, HARD),
                mu=MU,
                force=(k / 45) ** 3,
                previous=before,
                tolerance=tolerance,
            )
        )
    return results


def violation(now: FrictionalResult, before: FrictionalResult) -> float:
    """Return the error of all conditions, over the interference, with all displacements."""
    gap, element = sphere()
    A = halfspace.influence_matrix("xyz", gap.shape, element, (SOFT, HARD))
    t, last = (np.stack([*r.tangential.traction, r.normal.pressure]) for r in (now, before))
    u, u_last = ((A @ x.ravel()).reshape(x.shape) for x in (t, last))
    p, q, a0 = t[2], t[:2], float(A.diagonal()[0])
    w = gap + u[2] - now.normal.approach
    slip = u[:2] - u_last[:2]
    errors = (
        np.abs(np.minimum(w, a0 * p)).max(),
        a0 * np.abs(q - clip(q - slip / a0, MU * p)).max(),
    )
    return max(errors) / (now.normal.approach - float(gap.min()))


def spheres(quick: bool) -> list[Row]:
    """Press the sphere with the coupling, accelerated and not, and without it."""
    steps = QUICK_STEPS if quick else STEPS
    rows: list[Row] = [] if quick else [PUBLISHED]
    for case, depth, tolerance in (
        ("coupled", acceleration.DEPTH, 1e-6),
        ("coupled", acceleration.DEPTH, 1e-7),
        ("not accelerated", 0, 1e-6),
        ("not accelerated", 0, 1e-7),
    ):
        start = process_time()
        with accelerated(depth):
            results = press_in_steps(steps, tolerance)
        seconds = process_time() - start
        *_, before, last = results
        rows.append(
            describe(f"{case}, {tolerance:g}", last.normal)
            | {
                "stick": int(last.tangential.stick.sum()),
                "slip": int(last.tangential.sliding.sum()),
                "most iterations": max(len(r.residuals) for r in results),
                "products": sum(r.normal.products + r.tangential.products for r in results),
                "violation": f"{violation(last, before):.1e}",
                "cpu_s": f"{seconds:.1f}",
            }
        )
    gap, element = sphere()
    smooth = normal_contact(gap, element, material=(SOFT, HARD), force=(steps / 45) ** 3)
    rows.append(describe("uncoupled", smooth))
    return rows


def describe(case: str, pressed: NormalResult) -> Row:
    """Return what is known of the pressures."""
    return {
        "case": case,
        "contact": int(pressed.contact.sum()),
        "peak": float(f"{pressed.max_pressure:.5f}"),
        "approach": float(f"{pressed.approach:.5f}"),
    }


def punches(sizes: tuple[int, ...]) -> list[Row]:
    """Press a bonded circular punch and a smooth one."""
    rows: list[Row] = []
    for nu in (0.0, 0.3):
        exact = np.log(3.0 - 4.0 * nu) * (1.0 - nu) / (1.0 - 2.0 * nu)
        bodies = Material.from_shear(1.0, nu), Material.rigid()
        for N in sizes:
            h = 2.0 / N
            r = np.hypot(*surfaces.centres((N, N), (h, h)))
            gap = np.where(r < 0.8, 0.0, 1.0)
            smooth = normal_contact(gap, (h, h), material=bodies, approach=1e-3)
            start = process_time()
            bonded = frictional_contact(gap, (h, h), material=bodies, approach=1e-3, mu=np.inf)
            factor = bonded.normal.force / smooth.force
            rows.append(
                {
                    "ν": nu,
                    "N": N,
                    "factor": f"{factor:.5f}",
                    "theory": f"{exact:.5f}",
                    "error": f"{factor / exact - 1.0:.1e}",
                    "iterations": len(bonded.residuals),
                    "products": f"{bonded.normal.products} + {bonded.tangential.products}",
                    "cpu_s": f"{process_time() - start:.2f}",
                }
            )
    return rows


def roll(N: int, mu: float, traction: float = 0.0) -> FrictionalResult:
    """Roll the rollers with N strips on 0.216 mm, with a part of the force that μ carries."""
    h = 0.216 / N
    gap = surfaces.cylinder(N, h, radius=RADIUS)
    force = traction * mu * LOAD if traction else 0.0
    return frictional_rolling(gap, h, material=ROLLERS, mu=mu, force=LOAD, tangential_force=force)


def rollers(sizes: tuple[int, ...]) -> list[Row]:
    """Roll with the forces that are published, and without slip on finer and finer strips."""
    rows: list[Row] = []
    cases = [(216, *case) for case in CREEPAGES]
    cases += [(N, np.inf, 0.0, bufler()) for N in sizes]
    for N, mu, traction, known in cases:
        start = process_time()
        result = roll(N, mu, traction)
        creepage = -float(result.tangential.creepages)
        rows.append(
            {
                "N": N,
                "μ": mu,
                "F/μP": traction,
                "creepage": f"{creepage:.4g}",
                "known": f"{known:.4g}",
                "error": f"{creepage / known - 1.0:.1e}",
                "contact": int(result.normal.contact.sum()),
                "stick": int(result.tangential.stick.sum()),
                "iterations": len(result.residuals),
                "products": result.normal.products + result.tangential.products,
                "cpu_s": f"{process_time() - start:.2f}",
            }
        )
    return rows


def curve(N: int) -> list[Row]:
    """Roll freely with less and less friction."""
    beta = dundurs()
    rows: list[Row] = []
    for ratio in RATIOS:
        result = roll(N, beta / ratio)
        a = result.normal.area / 2.0
        scaled = -float(result.tangential.creepages) * RADIUS / (beta * a)
        stick = result.tangential.stick.sum() / result.normal.contact.sum()
        rows.append({"β/μ": ratio, "creepage R/(β a)": f"{scaled:.4f}", "stick": f"{stick:.2f}"})
    return rows


def dundurs() -> float:
    """Return Dundurs' parameter of the rollers."""
    both = halfspace.combined_material(*ROLLERS)
    return both.difference / (1.0 - both.nu)


def bufler() -> float:
    """Return the creepage of rollers that do not slip."""
    beta = dundurs()
    gamma = np.log((1.0 + beta) / (1.0 - beta)) / (2.0 * np.pi)
    k = halfspace.combined_material(*ROLLERS).E_star / (2.0 * RADIUS)
    a = np.sqrt(2.0 * LOAD / (np.pi * k * (1.0 + 4.0 * gamma**2)))
    return float(2.0 * gamma * a / RADIUS)


def main() -> None:
    """Run the comparison."""
    arguments = report.options("contact.unlike", "Unlike materials: pressed, and rolling.")
    tables = {
        "A soft sphere on a rigid plane": spheres(arguments.quick),
        "A bonded punch": punches(QUICK_SIZES if arguments.quick else SIZES),
        "Aluminium and steel rollers": rollers(QUICK_LINES if arguments.quick else LINES),
        "Free rollers by friction: the curve": curve(128 if arguments.quick else 1024),
    }
    for title, rows in tables.items():
        report.write_csv(arguments.output / f"{title.split()[-1]}.csv", rows)
        report.show(title, rows)


if __name__ == "__main__":
    main()
