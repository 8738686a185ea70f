"""The forces on flat punches for N to infinity, with one half-space of G = 1 and ν = 0.28.

On rectangles the error of F at N elements is a sum of powers of 1/N: 1 by the edges, 1.593 by the
corners, where displacements rise as r^0.2966 (Morrison and Lewis, SIAM J. Appl. Math. 31, 1976) and
the error as twice that and one more, and 2. The elements of a circle are a staircase, whose area is
not that of the circle, to one side or the other as N has it. So F is divided by the radius of the
circle that has their area; what remains is 1/N, and on an annulus the error of the inner radius.

The coefficients are fitted by least squares over many N, the error is the standard error of that.
The rough patch has no limit here: it has finer detail at every N.
"""

from collections.abc import Sequence

import numpy as np
from tqdm import tqdm

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.report import Row
from comparisons.systems import masks
from comparisons.systems.punch import KINDS, NU, Punch
from toeplitz_mg._typing import Array

TOLERANCE = 1e-9
CORNER = 1.0 + 2.0 * 0.2966  # Power of 1/N of the error that the corners of rectangles make.
RECTANGLES = ("square", "2:1", "4:1")
ROUND = ("circle", "annulus")
SIZES = (32, 48, 64, 96, 128, 192, 256, 384)  # Elements across rectangles.
# Elements across round areas, from 64 to 512.
ROUND_SIZES = tuple(4 * round(16 * 2 ** (k / 5)) for k in range(16))
QUICK = 160  # Largest number of elements of a quick run.

# F/(E* b δ), or F/(G b δ) where tangential, b the shorter half side or the radius. Those of the
# circle are exact, with A_xz dropped; of rectangles and the annulus our own.
REFERENCES: dict[tuple[str, str], float] = {
    ("normal", "square"): 2.30460,
    ("normal", "2:1"): 3.34214,
    ("normal", "4:1"): 5.08516,
    ("normal", "circle"): 2.0,
    ("normal", "annulus"): 1.9621,
    ("tangential", "square"): 5.36112,
    ("tangential", "2:1"): 7.59716,
    ("tangential", "circle"): 8.0 / (2.0 - NU),
    ("tangential", "annulus"): 4.5641,
    ("coupled", "square"): 5.36516,
    ("coupled", "2:1"): 7.60197,
    ("coupled", "circle"): 8.0 / (2.0 - NU),
    ("coupled", "annulus"): 4.5652,
}


def forces(area: str, kind: str, sizes: Sequence[int], nu: float = NU) -> Array:
    """Return the force at every size."""
    values: list[float] = []
    for N in sizes:
        punch = Punch(area, kind, N, nu)
        A = punch.operator()
        x, info = tmg.cg(A, punch.displacement(), M=tmg.default_preconditioner(A), rtol=TOLERANCE)
        if info:
            raise ArithmeticError(f"not converged for {kind}, {area}, N = {N}")
        values.append(punch.force(x))
    return np.array(values)


def limit(area: str, sizes: Sequence[int], forces: Array) -> tuple[float, float]:
    """Return the force for N to infinity, and its standard error.

    Examples
    --------
    >>> import numpy as np
    >>> from comparisons.contact.punch_limits import limit
    >>> N = np.array([32, 48, 64, 96, 128])
    >>> value, error = limit("square", N, 2.0 - 0.7 / N)
    >>> print(f"{value:.6f}")
    2.000000
    """
    N = np.asarray(sizes, dtype=np.float64)
    if area in RECTANGLES:
        terms = [N**0, 1.0 / N, N**-CORNER, N**-2]
    else:
        outer = np.array([np.sqrt(masks.circle(n).mean() * 4.0 / np.pi) for n in sizes])
        forces, terms = forces / outer, [N**0, 1.0 / N]
        if area == "annulus":
            ring = np.array([masks.annulus(n).mean() * 4.0 / np.pi for n in sizes])
            terms.append(np.sqrt(1.0 - ring / outer**2) - 0.5)
    if len(sizes) <= len(terms):
        raise ValueError(f"{len(sizes)} sizes are no more than the {len(terms)} terms of the fit")
    X = np.stack(terms, axis=1)
    coefficients, *_ = np.linalg.lstsq(X, forces)
    r = forces - X @ coefficients
    variance = r @ r / (len(N) - len(terms)) * np.linalg.inv(X.T @ X)[0, 0]
    return float(coefficients[0]), float(np.sqrt(variance))


def main() -> None:
    """Run the comparison."""
    arguments = report.options(
        "contact.punch_limits",
        "The forces on flat punches for N to infinity.",
        areas=RECTANGLES + ROUND,
        problems=KINDS,
    )
    punches = [
        (kind, area)
        for kind in arguments.problems or KINDS
        for area in arguments.areas or RECTANGLES + ROUND
    ]
    rows: list[Row] = []
    for kind, area in tqdm(punches, unit="punch"):
        sizes = SIZES if area in RECTANGLES else ROUND_SIZES
        sizes = tuple(N for N in sizes if N <= QUICK) if arguments.quick else sizes
        found = forces(area, kind, sizes)
        value, error = limit(area, sizes, found)
        row: Row = {"problem": kind, "area": area, "N": sizes[-1], "force": found[-1]}
        row |= {"limit": value, "error": error, "reference": REFERENCES.get((kind, area), "")}
        rows.append(row)
        report.write_csv(arguments.output / "punch_limits.csv", rows)
    table = [row | {k: f"{row[k]:.6f}" for k in ("force", "limit")} for row in rows]
    for row in table:
        row["error"] = f"{row['error']:.0e}"
        row["reference"] = f"{row['reference']:.6g}" if row["reference"] else ""
    report.show("Forces for N to infinity", table)


if __name__ == "__main__":
    main()
