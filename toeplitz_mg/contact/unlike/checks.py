"""Checks of contact with friction of unlike materials: what is given, and what was found."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Element
from toeplitz_mg.contact.gaps import read_surface
from toeplitz_mg.contact.products import Report
from toeplitz_mg.contact.results import ContactError, FrictionalResult, check_converged


def read_gap(
    gap: ArrayLike | None, element: Element | None, heights: Any, unit: str | None
) -> tuple[Array, Any]:
    """Return the gap that was given, and the size of an element, mm: of what does not repeat."""
    z, element, periodic = read_surface(gap, element, heights, unit, None)
    if np.any(periodic):
        raise ValueError(
            "heights is a topography that repeats, but unlike bodies with friction are of surfaces "
            "that end: give its heights as an array, with element and unit"
        )
    return z, element


def check_both(
    result: FrictionalResult, tolerance: float, report: Report, max_products: int
) -> FrictionalResult:
    """Return the result, or raise ContactError where it violates a condition."""
    limit = f"; max_products is {max_products}: allow more" if report.exhausted else ""
    check_converged(result.tangential, tolerance, limit)
    if result.residual <= tolerance:
        return result
    raise ContactError(
        f"after {len(result.residuals)} iterations between pressures and friction the conditions "
        f"of contact are violated by {result.residual:.1e} of the largest interference, but the "
        f"tolerance is {tolerance:g}{limit}",
        result.normal,
    )
