"""Rolling as it is asked for: by force, from rest, along a curve of creepages, as falling friction.

A circle by forces and moment beside the creepages that have these: products, and what they cost
more. Carter's cylinder from rest, by a force, in 56 steps from Cattaneo's tractions to Carter's.
Curves of the force over the creepage against Carter's, with the order of their error, and Kalker's
coefficients against his tables (1990), of three digits. Friction that falls with the slip, more and
more steeply, beside the stiffness of an element, above which there is more than one answer.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import product
from time import process_time
from typing import Any

import numpy as np
from tqdm import tqdm

from comparisons.contact import violation
from comparisons.contact.cases import order
from comparisons.contact.rolling_theory import PART, carter_bound
from comparisons.contact.theory import MU, UNIT, A, semi_ellipse
from comparisons.contact.unlike import accelerated
from comparisons.harness import report
from comparisons.harness.processes import in_a_fresh_process, prepare
from comparisons.harness.report import Row
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import (
    ContactError,
    ContactWarning,
    Material,
    TangentialResult,
    acceleration,
    creep_curve,
    friction,
    kalker_coefficients,
    rolling,
    rolling_steps,
    surfaces,
)
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.tangential.motion import CREEPAGES as CREEPAGE_NAMES
from toeplitz_mg.contact.tangential.rolling import stiffness_of_element

SURFACES, LINES = (11, 32, 64, 128, 256), (64, 256, 1024, 4096)
QUICK = (11, 32), (64, 256), 32  # Sizes of surfaces, of lines, and of falling friction.
# Longitudinal and lateral creepage and spin, from nearly without slip to where all slides.
CREEPAGES = (
    (0.01, 0.0, 0.0),
    (0.1, 0.0, 0.0),
    (0.0, 0.1, 0.0),
    (0.0, 0.0, 0.3),
    (0.02, 0.04, -0.1),
    (0.2, 0.1, 0.1),
    (1.0, 0.5, 0.3),
    (0.2, 0.1, 2.0),
)
STRIPS, STEPS = 28, 56  # Of the cylinder that starts to roll: across the contact, and in time.
SHOWN = (1, 2, 4, 8, 14, 28, 42, 56)  # Steps that are shown.
CURVE = 10  # Points of a curve, up to where all slides.
STEEPNESSES = (0.1, 0.3, 0.6, 1.0, 2.0, 5.0, 20.0)  # Of falling friction, over the stiffness.
# C11, C22, C23 and C33 by the ratio a/b and Poisson's ratio, of Kalker (1990).
KALKER = {
    (0.1, 0.0): (2.51, 2.51, 0.334, 6.42),
    (0.1, 0.25): (3.31, 2.52, 0.473, 8.28),
    (0.1, 0.5): (4.85, 2.53, 0.731, 11.7),
    (0.5, 0.0): (2.88, 2.88, 0.827, 1.74),
    (0.5, 0.25): (3.62, 3.01, 0.929, 1.93),
    (0.5, 0.5): (4.83, 3.14, 1.07, 2.22),
    (1.0, 0.0): (3.40, 3.40, 1.33, 1.21),
    (1.0, 0.25): (4.12, 3.67, 1.47, 1.19),
    (1.0, 0.5): (5.20, 3.98, 1.63, 1.16),
    (2.0, 0.0): (4.37, 4.37, 2.35, 0.958),
    (2.0, 0.25): (5.10, 4.90, 2.62, 0.819),
    (2.0, 0.5): (6.11, 5.56, 2.96, 0.650),
    (10.0, 0.0): (10.7, 10.7, 12.2, 0.795),
    (10.0, 0.25): (11.7, 12.8, 14.6, 0.526),
    (10.0, 0.5): (12.9, 16.0, 18.0, 0.228),
}


def circle(N: int) -> tuple[Array, dict[str, Any]]:
    """Return the bound of a circle, and the elements and the material."""
    h = 2.0 / N
    r = np.hypot(*surfaces.centres((N, N), (h, h)))
    return 0.3 * semi_ellipse(r, A), {"element": (h, h), "material": Material.from_shear(1.0, 0.25)}


def by_force(sizes: Sequence[int]) -> list[Row]:
    """Roll a circle by creepages, and by the loads that belong to them."""
    rows: list[Row] = []
    for N, creepages in product(sizes, CREEPAGES):
        g, case = circle(N)
        xi, eta, phi = creepages
        known, products, seconds = roll(g, case | _named(creepages))
        for name, loads in {
            "Fx": {"force": (known.force[0], None), "lateral": eta, "spin": phi},
            "Fx, Fy": {"force": known.force, "spin": phi},
            "Fx, Fy, M": {"force": known.force, "moment": known.moment},
            "M": {"moment": known.moment, "longitudinal": xi, "lateral": eta},
        }.items():
            found, more, longer = roll(g, case | loads)
            away = np.abs(found.creepages - creepages).max() / max(map(abs, creepages))
            rows.append(
                {
                    "N": N,
                    "ξ, η, φ": ", ".join(f"{c:g}" for c in creepages),
                    "sticks": f"{known.stick_area / known.area:.0%}",
                    "given": name,
                    "products by creepage": products,
                    "by loads": more,
                    "ratio": f"{more / products:.2f}",
                    "CPU ratio": f"{longer / seconds:.2f}",
                    "creepages off by": f"{away:.1e}",
                    "violation": f"{violation.measure([found], None, g):.1e}",
                }
            )
    return rows


def roll(g: Array, arguments: dict[str, Any]) -> tuple[TangentialResult, int, float]:
    """Return the result, the products, and the CPU time of the faster of two calls."""
    seconds = []
    for _ in range(2):
        start = process_time()
        result = rolling(g, **arguments)
        seconds.append(process_time() - start)
    return result, result.products, min(seconds)


def _named(creepages: Sequence[float]) -> dict[str, float]:
    return dict(zip(CREEPAGE_NAMES, creepages, strict=True))


def from_rest() -> list[Row]:
    """Let a cylinder that is held by a force begin to roll."""
    h = 2.0 * A / STRIPS
    (x,) = surfaces.centres(STRIPS, h)
    g = MU * A / 2.0 * semi_ellipse(x, A)
    force = (1.0 - PART**2) * MU * np.pi * A**2 / 4.0
    case: dict[str, Any] = {"element": h, "material": UNIT, "force": force}
    at_rest, steady = friction(g, **case), rolling(g, **case)
    exact = -MU * A * (1.0 - PART)
    rows: list[Row] = []
    for k, step in enumerate(rolling_steps(g, steps=STEPS, previous=at_rest, **case), 1):
        if k in SHOWN:
            away = np.abs(step.traction - steady.traction).max() / g.max()
            rows.append(
                {
                    "step": k,
                    "rolled over a": f"{k * h / A:.2f}",
                    "ξ over Carter's": f"{step.creepages / exact:.4f}",
                    "over that of rolling": f"{step.creepages / steady.creepages:.5f}",
                    "sticks": f"{step.stick_area / step.area:.2f}",
                    "force off by": f"{abs(step.force / force - 1.0):.0e}",
                    "tractions off those of rolling": f"{away:.0e}",
                    "products": step.products,
                }
            )
    return rows


def curves(sizes: Sequence[int]) -> list[Row]:
    """Compare a curve with Carter's, each point from the one before and by itself."""
    share = np.arange(1.0, CURVE + 1) / CURVE  # Creepages over that at which all slides.
    rows: list[Row] = []
    errors: list[float] = []
    for N in sizes:
        _, g, h = carter_bound(N)
        case: dict[str, Any] = {"element": h, "material": UNIT}
        creepages = -MU * A * share
        start = process_time()
        curve = creep_curve(g, longitudinal=creepages, **case)
        middle = process_time()
        alone = [rolling(g, longitudinal=c, **case) for c in creepages.tolist()]
        end = process_time()
        carried = MU * np.pi * A**2 / 4.0
        errors.append(float(np.abs(curve.force / carried - 1.0 + (1.0 - share) ** 2).max()))
        rows.append(
            {
                "N": N,
                "error of F/μP": f"{errors[-1]:.1e}",
                "products, as a curve": int(curve.products.sum()),
                "each alone": sum(r.products for r in alone),
                "CPU of a point": f"{(middle - start) / CURVE * 1e3:.1f} ms",
                "over that alone": f"{(middle - start) / (end - middle):.2f}",
                "violation": f"{violation.measure(alone, None, g):.1e}",
            }
        )
    return [*rows, {"N": "order", "error of F/μP": f"{order(errors, sizes):.2f}"}]


def coefficients(tables: Mapping[tuple[float, float], tuple[float, ...]]) -> list[Row]:
    """Compare with Kalker's tables."""
    rows: list[Row] = []
    for (ratio, nu), table in tables.items():
        start = process_time()
        found = kalker_coefficients(ratio, nu)
        seconds = process_time() - start
        row: Row = {"a/b": ratio, "ν": nu}
        for name, own, printed in zip(found._fields, found, table, strict=True):
            row[name] = f"{own:.3g} ({own / printed - 1.0:+.1%})"
        rows.append(row | {"cpu_s": f"{seconds:.2f}"})
    return rows


def falling(N: int) -> list[Row]:
    """Roll a circle with friction that falls from 1 to ½, more and more steeply."""
    g, case = circle(N)
    case |= {"longitudinal": 0.1, "spin": 0.1}
    grid = Grid.of(g.shape, case["element"], case["material"], None)
    stiffness, constant = stiffness_of_element(grid), rolling(g, **case)
    carried = float(g.sum() * np.prod(case["element"]))
    rows: list[Row] = []
    for steepness in STEEPNESSES:
        scale = 0.5 * float(g.max()) / (steepness * stiffness)

        def factor(slip: Array, scale: float = scale) -> Array:
            return 0.5 + 0.5 / (1.0 + slip / scale)

        row: Row = {"fall over stiffness": steepness}
        for name, depth in (("accelerated", acceleration.DEPTH), ("not accelerated", 0)):
            with accelerated(depth), warnings.catch_warnings(record=True) as told:
                warnings.simplefilter("always")
                try:
                    found = rolling(g, falling=factor, **case)
                except ContactError as error:
                    row[f"products, {name}"] = f"off by {error.result.residual:.0e}"
                    continue
            row[f"products, {name}"] = found.products
            if depth:
                bound = g * factor(np.hypot(*found.slip))
                row["violation"] = f"{violation.measure([found], None, bound):.1e}"
                row["|F|/μP"] = f"{np.linalg.norm(found.force) / carried:.4f}"
                row["doubted"] = "yes" if told else ""
        rows.append(row)
    last: Row = {"products, accelerated": constant.products}
    last |= {"|F|/μP": f"{np.linalg.norm(constant.force) / carried:.4f}"}
    return [{"fall over stiffness": 0.0} | last, *rows]


def main() -> None:
    """Run the comparison."""
    prepare("comparisons.contact.unlike")
    arguments = report.options("contact.rolling", "Rolling by force, from rest, curves, tables.")
    surfaces, lines, N = (SURFACES, LINES, 64) if not arguments.quick else QUICK
    tables: dict[str, tuple[str, Callable[[], list[Row]]]] = {
        "loads": ("By the loads of creepages, beside these", partial(by_force, surfaces)),
        "from_rest": (f"From rest, in {STEPS} steps", from_rest),
        "curves": ("Curves, against Carter's", partial(curves, lines)),
        "coefficients": ("Coefficients, and how far from Kalker's", partial(coefficients, KALKER)),
        "falling": ("Friction that falls", partial(falling, N)),
    }
    for name, (title, compute) in tqdm(tables.items(), unit="table"):
        rows = in_a_fresh_process(partial(quietly, compute))
        report.write_csv(arguments.output / f"{name}.csv", rows)
        report.show(title, rows)


def quietly(compute: Callable[[], list[Row]]) -> list[Row]:
    """Compute a table; the smallest contacts are coarse, which is no concern of it."""
    warnings.simplefilter("ignore", ContactWarning)
    return compute()


if __name__ == "__main__":
    main()
