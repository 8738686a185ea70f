"""Small cases of steady rolling, which tables are made of: how long a case takes.

Ellipses of any shape and with any friction roll by random creepages on 11² and 25² elements, from
sticking to sliding. The matrices are kept, so that each case is run before it is measured. The
violation of Coulomb's law is recomputed with the matrices of the whole grid.
"""

from collections.abc import Sequence
from time import process_time
from typing import Any

import numpy as np
from numpy.random import Generator

from comparisons.contact.growth import violation
from comparisons.harness import report
from comparisons.harness.report import Row
from toeplitz_mg._typing import Array
from toeplitz_mg.contact import Material, rolling, surfaces
from toeplitz_mg.contact.tangential.motion import CREEPAGES

SIZES = 11, 25
CASES, QUICK_CASES = 30, 3
REPEATED = 5  # The least of so many times counts.
PRESSURE = 0.01  # The largest, over the shear modulus.


def random_case(rng: Generator, n: int) -> tuple[Array, dict[str, Any], tuple[float, ...]]:
    """Return a traction bound on n x n elements, the arguments of `rolling`, and the creepages."""
    ratio = np.exp(rng.uniform(-1.0, 1.0))
    a, b, mu = ratio**0.5, ratio**-0.5, np.exp(rng.uniform(np.log(0.1), np.log(0.6)))
    element = 2.0 * a / n, 2.0 * b / n
    x, y = surfaces.centres((n, n), element)
    g = mu * PRESSURE * np.sqrt(np.maximum(0.0, 1.0 - (x / a) ** 2 - (y / b) ** 2))
    size = mu * PRESSURE * np.exp(rng.uniform(np.log(0.1), np.log(4.0)))
    creepages = tuple((size * rng.standard_normal(3)).tolist())
    material = Material.from_shear(1.0, float(rng.uniform(0.0, 0.5)))
    return g, {"element": element, "material": material}, creepages


def main() -> None:
    """Run the comparison."""
    arguments = report.options("contact.small", "Small cases of steady rolling.")
    rows: list[Row] = []
    for n in SIZES:
        rng = np.random.default_rng(n)
        for _ in range(QUICK_CASES if arguments.quick else CASES):
            g, case, creepages = random_case(rng, n)
            case |= dict(zip(CREEPAGES, creepages, strict=True))
            seconds = []
            for _ in range(1 + REPEATED):
                start = process_time()
                result = rolling(g, **case)
                seconds.append(process_time() - start)
            rows.append(
                {
                    "N": n,
                    "stick": f"{result.stick_area / result.area:.2f}",
                    "products": result.products,
                    "violation": f"{violation(result, creepages):.1e}",
                    "cpu_ms": f"{1e3 * min(seconds[1:]):.2f}",
                }
            )
    report.write_csv(arguments.output / "small.csv", rows)
    report.show("Small cases of steady rolling", arrange(rows))


def arrange(rows: Sequence[Row]) -> list[Row]:
    """Return the table of the cases of each size."""
    return [_summarise(rows, n) for n in SIZES]


def _summarise(rows: Sequence[Row], n: int) -> Row:
    of_size = [row for row in rows if row["N"] == n]
    milliseconds = np.array([float(row["cpu_ms"]) for row in of_size])
    return {
        "elements": f"{n}²",
        "cases": len(of_size),
        "products, median": float(np.median([row["products"] for row in of_size])),
        "violation, at most": f"{max(float(row['violation']) for row in of_size):.1e}",
        "CPU, median": f"{np.median(milliseconds):.2f} ms",
        "CPU, at most": f"{milliseconds.max():.2f} ms",
    }


if __name__ == "__main__":
    main()
