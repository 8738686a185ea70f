"""Unlike bodies that are pressed together and roll: pressures and the steady state at once."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Element, Progress
from toeplitz_mg.contact import doubts
from toeplitz_mg.contact.checks import check_friction, check_iteration, check_load
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.products import Report
from toeplitz_mg.contact.results import FrictionalResult, TangentialResult
from toeplitz_mg.contact.tangential.given_loads import Loads
from toeplitz_mg.contact.tangential.motion import Motion
from toeplitz_mg.contact.tangential.rolling import Rolled, roll
from toeplitz_mg.contact.tangential.steady import SteadyOptions
from toeplitz_mg.contact.unlike.alternation import alternate
from toeplitz_mg.contact.unlike.checks import check_both, read_gap
from toeplitz_mg.contact.unlike.coupling import Coupling, bound_of
from toeplitz_mg.contact.unlike.normal_side import Pressing
from toeplitz_mg.contact.unlike.pressing import INNER
from toeplitz_mg.contact.unlike.tangential_sides import Rolling
from toeplitz_mg.engine.work import count_products
from toeplitz_mg.values import count, refuse_masked

CARRIED = 0.98  # Part of what pressures carry to which loads beyond it are reduced for the moment.


def frictional_rolling(
    gap: ArrayLike | None = None,
    element: Element | None = None,
    *,
    material: Any,
    mu: ArrayLike,
    heights: Any = None,
    unit: str | None = None,
    approach: float | None = None,
    force: float | None = None,
    longitudinal: float = 0.0,
    lateral: float = 0.0,
    spin: float = 0.0,
    tangential_force: Any = None,
    moment: float | None = None,
    slip: ArrayLike | None = None,
    pole: tuple[float, float] = (0.0, 0.0),
    tolerance: float = 1e-6,
    nested: bool = True,
    max_iterations: int = 50,
    max_products: int = 2000,
    progress: Progress | None = None,
    options: SteadyOptions | None = None,
) -> FrictionalResult:
    """Press two bodies together and roll them, each problem with the displacements of the other.

    Where the materials are unlike, pressures strain the two surfaces unlike: so they creep, and
    have areas of slip, without a tangential force.

    Parameters
    ----------
    gap, element, material, mu, heights, unit, approach, force
        The arguments of `frictional_contact`; `force` is the one that presses.
    longitudinal, lateral, spin, moment, slip, pole
        The arguments of `rolling`.
    tangential_force : (float, float) or float, optional
        The tangential force (Fx, Fy) on the first body in the place of creepages, which are then
        found, as `force` in `rolling`; 0 for free rolling.
    tolerance : float
        The violation of the conditions of normal contact that is allowed, over the largest
        interference; each problem by itself is solved to a hundredth of it.
    nested, max_iterations, max_products, progress
        The arguments of `frictional_contact`.
    options : SteadyOptions, optional
        How long the search for the steady state goes on before it rolls step by step.

    Returns
    -------
    FrictionalResult
        It has a `NormalResult` in `normal`, and a `TangentialResult` in `tangential`.

    Warns
    -----
    ContactWarning
        The warnings of `normal_contact`.

    Raises
    ------
    ValueError, TypeError
        For input that makes no sense, before any work; also for loads that the bound does not
        carry.
    ContactError
        Where the tolerance is not reached: it says what is violated.

    See Also
    --------
    frictional_contact : of bodies that do not roll.
    rolling : with a bound that is given, which is exact where the materials are alike.

    Notes
    -----
    Without slip, free rollers in plane strain creep by a/(πR) ln((1+β)/(1-β)), a being half the
    width of contact, 1/R the sum of both curvatures, and β = K/(1-ν) Dundurs' parameter, with the
    `halfspace.difference_parameter` K and ν of the combined materials (Bufler, 1959). The less
    friction there is, the more they creep, up to 0.915 β a/R (Bentall and Johnson, 1967).

    Examples
    --------
    An aluminium roller on a steel roller, free of a tangential force.

    >>> from toeplitz_mg.contact import Material, frictional_rolling, surfaces
    >>> rollers = Material.from_shear(23000.0, 0.31), Material.from_shear(82000.0, 0.28)
    >>> gap = surfaces.cylinder(128, 0.002, radius=25.0)
    >>> pressed = dict(material=rollers, force=16.2, tangential_force=0.0)
    >>> for mu in (0.02, 0.05, 0.2):
    ...     rolled = frictional_rolling(gap, 0.002, mu=mu, **pressed)
    ...     f"{rolled.tangential.creepages:.2e}"
    '-4.80e-04'
    '-4.29e-04'
    '-3.69e-04'
    """
    z, element = read_gap(gap, element, heights, unit)
    grid = Grid.of(z.shape, element, material, None)
    force = check_load(grid, z, approach, force)
    friction = check_friction(mu, z.shape)
    check_iteration(tolerance, max_products, progress)
    most = count("max_iterations", max_iterations)
    refuse_masked("tangential_force", tangential_force)
    creepages = longitudinal, lateral, spin
    motion = Motion.of(z.shape, creepages, tangential_force, moment, slip, pole)
    grid = replace(grid, directions=motion.directions)
    given = np.zeros((grid.components, *z.shape))
    if motion.slip is not None:
        given = given + motion.slip
    inner, report = INNER * tolerance, Report(progress)
    loads = Loads(motion.units(grid), motion.arms(grid), motion.wanted)

    def solve(g: Array, slip: Array, guess: TangentialResult | None) -> TangentialResult:
        field_of_slip = slip[0] if len(slip) == 1 else slip
        # Friction moves pressures to where it is high: those before may carry less of the loads.
        share = loads.share(g, grid.vectors)
        part = 1.0 if share < 1.0 else CARRIED / share
        x, y, about = (None if load is None else part * load for load in motion.loads)
        asked = creepages, (x, y), about, field_of_slip, pole
        search = inner, nested, max_products, report, options, guess
        found = roll(grid, g, Rolled.of(g.shape, asked, *search), report, guess)
        report.add(found.products, max_products)
        return found

    with count_products() as work:
        coupling = Coupling(grid.coupling())
        pressing = Pressing.of(grid, z, coupling, approach, force, inner, max_products, report)
        rolling = Rolling(grid, coupling, Coupling(grid.coupling(ahead=1)), friction, solve, given)
        p = pressing.begin(None, nested=nested)
        if force is not None:  # No pressures of that sum carry a larger one.
            largest = bound_of(np.max(friction), p)
            replace(motion, loads=(*motion.loads[:2], None)).check_loads(grid, largest)
        p, q, residuals = alternate(
            pressing, rolling, p, tolerance=tolerance, most=most, report=report
        )
        motion.check_loads(grid, bound_of(friction, p))
        loads.check_share(bound_of(friction, p), grid.vectors)
        normal, tangential = pressing.result(q, p), rolling.result(p)
    normal = replace(normal, work=work.units(z.size))
    result = FrictionalResult(normal, tangential, residuals)
    doubts.warn(check_both(result, tolerance, report, max_products).warnings)
    return result
