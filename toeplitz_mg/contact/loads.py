"""Normal contact under one load after the other, each the first guess of the next."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Element, Progress
from toeplitz_mg.contact import doubts
from toeplitz_mg.contact.checks import check_hardness, check_iteration, check_load
from toeplitz_mg.contact.gaps import read_surface
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.normal.problem import Pressed, press
from toeplitz_mg.contact.results import NormalResult, check_converged
from toeplitz_mg.values import field

LEAP = 2.0  # Factor between two loads from which the pressures of one are no guess of the other.


def load_curve(
    gap: ArrayLike | None = None,
    element: Element | None = None,
    *,
    material: Any,
    heights: Any = None,
    unit: str | None = None,
    forces: ArrayLike | None = None,
    approaches: ArrayLike | None = None,
    reference: float | None = None,
    periodic: bool | tuple[bool, bool] | None = None,
    hardness: float | None = None,
    tolerance: float = 1e-8,
    nested: bool = True,
    max_products: int = 2000,
    progress: Progress | None = None,
) -> Iterator[NormalResult]:
    """Press two bodies together under several loads, one after the other.

    Each result is the first guess of the next one: from the last two the edge of the contact is
    extrapolated. So loads of a rough surface in order take about half of the products of as many
    calls of `normal_contact`, and the same answers come out. Where coarser grids were a better
    guess, as of smooth bodies, the next load begins with those.

    With a hardness, what has yielded stays pressed in: each load meets the gap that the loads
    before have left, and `NormalResult.plastic` is the depth by all of them.

    Parameters
    ----------
    gap, element, material, heights, unit
        The surface and the bodies, as `normal_contact` takes them.
    forces : array_like of shape (k,)
        The forces that press, N; in plane strain N/mm. Zero is no contact. They may fall again.
    approaches : array_like of shape (k,)
        The approaches, mm. Either these or the forces are given.
    reference, periodic, hardness, tolerance, nested, max_products, progress
        As `normal_contact` takes them, for each load.

    Returns
    -------
    iterator of NormalResult
        One for each load, when it is asked for: a list of them keeps the fields of all.
        `NormalResult.stiffness` is the slope of the curve.

    Warns
    -----
    ContactWarning
        As `normal_contact`, for each result.

    Raises
    ------
    ValueError, TypeError
        For input that makes no sense, before any work.
    ContactError
        Where the tolerance is not reached under a load: the results before have been returned.

    See Also
    --------
    normal_contact : under one load.

    Examples
    --------
    A steel sphere on a steel plate; by Hertz's theory dF/dδ = 2 E* a = 1.5 F/δ.

    >>> from toeplitz_mg import contact
    >>> steel, element = contact.Material(E=210000.0, nu=0.28), (0.01, 0.01)
    >>> gap = contact.surfaces.sphere((64, 64), element, radius=10.0)
    >>> for r in contact.load_curve(gap, element, material=steel, forces=[0.0, 50.0, 100.0]):
    ...     print(f"{r.force:5.0f} N  {1e3 * r.approach:.2f} µm  {r.stiffness:5.0f} N/mm")
        0 N  0.00 µm      0 N/mm
       50 N  2.21 µm  33946 N/mm
      100 N  3.51 µm  42831 N/mm
    """
    z, element, periodic = read_surface(gap, element, heights, unit, periodic)
    grid = Grid.of(z.shape, element, material, reference, periodic)
    check_iteration(tolerance, max_products, progress)
    is_force, loads = _check_loads(forces, approaches)
    for load in loads.tolist():
        force = check_load(grid, z, None if is_force else load, load if is_force else None)
        check_hardness(grid, hardness, force)

    def solve() -> Iterator[NormalResult]:
        known: tuple[NormalResult, ...] = ()
        known_load = 0.0
        # Products of the last load that began with the results before it, and of one without.
        after, alone = 0, 0
        dents: Array = np.zeros(z.shape)
        for load in loads.tolist():
            approach, force = (None, load) if is_force else (load, None)
            begins = known if after <= alone else ()
            if len(known) == 1 and not known_load / LEAP < load < known_load * LEAP:
                begins = ()
            search, gap = (tolerance, nested, max_products, progress), z + dents
            asked = Pressed.of(grid, gap, approach, force, *search, begins, hardness)
            result = press(grid, gap, asked, progress)
            if result.plastic is not None:
                dents = dents + result.plastic
                result = replace(result, plastic=dents)
            doubts.warn(check_converged(result, tolerance).warnings)
            yield result
            if result.products:  # Without a load there was nothing to find.
                if len(known) != 1:  # A beginning with one result says nothing of one with two.
                    after, alone = (result.products, alone) if begins else (after, result.products)
                known, known_load = (*known, result)[-2:], load

    return solve()


def _check_loads(forces: ArrayLike | None, approaches: ArrayLike | None) -> tuple[bool, Array]:
    """Return whether forces are given, and the loads."""
    if (forces is None) == (approaches is None):
        raise ValueError(
            f"forces is {forces!r} and approaches is {approaches!r}, but one of the two must be "
            "given"
        )
    name, given = ("forces", forces) if approaches is None else ("approaches", approaches)
    assert given is not None
    loads = field(name, given)
    if loads.ndim != 1:
        raise ValueError(f"{name} has shape {loads.shape}, but must be a list of numbers")
    return forces is not None, np.asarray(loads)
