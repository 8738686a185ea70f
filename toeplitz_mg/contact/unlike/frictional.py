"""Frictional contact and rolling of unlike bodies: pressures and friction solved together."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Element, Numbers, Progress, Unit
from toeplitz_mg.contact import doubts
from toeplitz_mg.contact.checks import (
    bound_of,
    check_force,
    check_friction,
    check_iteration,
    check_load,
    check_previous,
    check_shift,
    has_two_components,
    is_lateral,
    measure_from_contact,
    show,
    widen,
)
from toeplitz_mg.contact.gaps import read_surface
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.products import Report
from toeplitz_mg.contact.results import (
    Before,
    ContactError,
    FrictionalResult,
    TangentialResult,
    check_converged,
)
from toeplitz_mg.contact.results.base import remake
from toeplitz_mg.contact.tangential.friction import add_shifts, as_given, is_field
from toeplitz_mg.contact.tangential.loads import Loads
from toeplitz_mg.contact.tangential.motion import Motion
from toeplitz_mg.contact.tangential.rolling import Rolled, roll
from toeplitz_mg.contact.tangential.solving import SteadyOptions
from toeplitz_mg.contact.unlike.alternation import (
    Coupling,
    Pressing,
    Rolling,
    Shifting,
    alternate,
)
from toeplitz_mg.engine.work import count_products
from toeplitz_mg.halfspace.materials import Bodies
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.values import count, in_unit, refuse_masked

INNER = 0.01  # Tolerance of each problem relative to that of both together.
FARTHEST = 2.0  # Tractions are extrapolated for steps up to this multiple of the last one.
CARRIED = 0.98  # Share of the friction limit to which excessive loads are reduced temporarily.


def frictional_contact(
    gap: ArrayLike | None = None,
    element: Element | None = None,
    *,
    material: Bodies,
    mu: Numbers,
    heights: Any = None,
    unit: Unit | None = None,
    approach: float | None = None,
    force: float | None = None,
    shift: ArrayLike | None = None,
    tangential_force: ArrayLike | None = None,
    previous: FrictionalResult | None = None,
    reference: float | None = None,
    tolerance: float = 1e-6,
    nested: bool = True,
    max_iterations: int = 50,
    max_products: int = 2000,
    progress: Progress | None = None,
) -> FrictionalResult:
    """Press two bodies together with friction, including the coupling of unlike materials.

    If the materials are unlike, pressures displace the bodies along the surface, which friction
    opposes, and the tractions change the gap. So even without a shift there are tangential
    tractions and areas of stick and slip, and the pressures are higher.

    Parameters
    ----------
    gap : array_like of shape (n1, n2) or (n,)
        Gap between the bodies before loading, at the element centres, mm. A constant added to it
        adds to the approach. One axis is line contact. See `surfaces`.
    element : (float, float) or float
        Size (h1, h2) of an element, mm. In line contact, the width and the length of the strips, or
        only the width: then plane strain is assumed, with forces per mm of length.
    material : (Material, Material)
        The first and the second body (see `contact.Material`). The tractions act on the first.
    mu : float, or array_like of shape (n1, n2) or (n,)
        Coefficient of friction, one number or one per element: the traction bound is μ p. Infinite
        where bodies in contact are bonded.
    heights, unit
        Surface heights instead of the gap, and their unit, as in `normal_contact`. Periodic
        surfaces and a hardness are not supported.
    approach : float
        Approach of the bodies, mm, measured from the given gap.
    force : float
        Normal force, N; in plane strain N/mm. Give either this or the approach.
    shift : array_like, optional
        Rigid shift of the bodies since the previous state, mm: (δx, δy), in line contact a number,
        or a field, as in `friction`. By default zero.
    tangential_force : array_like, optional
        Total tangential force (Fx, Fy), N, instead of the shift; in line contact a number, or two
        components as for the shift; in plane strain in N/mm. A force of μ P makes all elements
        slide, as in `friction`.
    previous : FrictionalResult, optional
        The previous state, on the same grid. The slip depends on the load history, so a load is
        best applied in steps.
    reference : float, optional
        In plane strain, the distance at which a line load causes no displacement, mm; by default
        the length of the grid.
    tolerance : float
        Allowed violation of the conditions of normal contact, relative to the largest interference.
        Each of the two problems is solved to a hundredth of it. Pressures are never negative, and
        tractions never exceed μ p.
    nested : bool
        Whether to compute the initial guess on coarser grids.
    max_iterations : int
        Limit of iterations between the two problems; beyond it a `ContactError` is raised.
    max_products : int
        Limit of matrix-vector products in one solution of either problem.
    progress : callable, optional
        Called as ``progress(products, residual)`` after each product, with the products of both
        problems and the violation after the last iteration between them.

    Returns
    -------
    FrictionalResult
        With a `NormalResult` in `normal`, and a `TangentialResult` in `tangential`.

    Warns
    -----
    ContactWarning
        As for `normal_contact`.

    Raises
    ------
    ValueError, TypeError
        If the input is invalid (it is checked before any work), or if the tangential force exceeds
        what friction can carry.
    ContactError
        If the iteration does not converge. The message names the violated condition.

    See Also
    --------
    normal_contact, friction : one after the other, which is exact for like materials.

    Notes
    -----
    The two problems are solved alternately (Panagiotopoulos, 1975), with Anderson acceleration of
    the bound. In the result the bound is exactly μ times the pressures.

    Examples
    --------
    A soft body with ν = 0 on a rigid one: friction makes the contact stiffer and smaller.

    >>> from toeplitz_mg.contact import Material, frictional_contact, normal_contact, surfaces
    >>> bodies = Material(E=1.0, nu=0.0), Material.rigid()
    >>> gap = surfaces.sphere((32, 32), (0.1, 0.1), radius=10.0)
    >>> smooth = normal_contact(gap, (0.1, 0.1), material=bodies, force=0.1)
    >>> rough = frictional_contact(gap, (0.1, 0.1), material=bodies, force=0.1, mu=0.3)
    >>> bool(rough.normal.area < smooth.area)
    True
    >>> f"{rough.normal.max_pressure / smooth.max_pressure:.2f}"
    '1.32'
    """
    z, element = read_gap(gap, element, heights, unit)
    grid = Grid.of(z.shape, element, material, reference)
    earlier = getattr(previous, "tangential", None)
    if is_lateral(earlier) or has_two_components(z.shape, shift, tangential_force):
        grid = replace(grid, directions="xy")
    approach, force = check_load(grid, z, approach, force)
    friction = check_friction(mu, z.shape)
    check_iteration(tolerance, max_products, progress)
    most = count("max_iterations", max_iterations)
    largest = np.inf if force is None else float(friction.max()) * force
    change, total = read_motion(shift, tangential_force, largest, grid)
    before, guess = read_history(previous, grid, z, approach, force)
    inner, report = INNER * tolerance, Report(progress)
    with count_products() as work:
        coupling = Coupling(grid.coupling())
        b, least = place_bodies(change, previous, before, grid, coupling)
        pressing = Pressing(grid, z, coupling, approach, force, inner, max_products, report)
        shifting = Shifting(
            grid=grid,
            coupling=coupling,
            mu=friction,
            b=b,
            total=total,
            least=least,
            tolerance=inner,
            max_products=max_products,
            nested=nested,
            report=report,
            q=guess,
        )
        p = pressing.begin(guess, nested=nested)
        p, q, residuals = alternate(
            pressing, shifting, p, tolerance=tolerance, most=most, report=report
        )
        if total is not None:
            check_carried(tangential_force, float(bound_of(friction, p).sum()) * grid.area, grid)
        normal, tangential = pressing.result(q, p), shifting.result(p)
    normal = remake(normal, work=work.units(z.size))
    moved = tangential.shift
    if tangential_force is None:
        of_elements = shift is not None and is_field(shift, grid.components)
        moved = as_given(change, is_field=of_elements)
    about = doubts.examine_friction(grid, mu)
    total_shift = add_shifts(moved, earlier, grid)
    tangential = remake(tangential, shift=moved, total_shift=total_shift, warnings=about)
    result = FrictionalResult(normal, tangential, residuals, before)
    doubts.warn(check_both(result, tolerance, report, max_products).warnings)
    return result


def frictional_rolling(
    gap: ArrayLike | None = None,
    element: Element | None = None,
    *,
    material: Bodies,
    mu: Numbers,
    heights: Any = None,
    unit: Unit | None = None,
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
    """Press two bodies together and roll them, including the coupling of unlike materials.

    If the materials are unlike, pressures strain the two surfaces differently, so the bodies creep
    and have areas of slip even without a tangential force.

    Parameters
    ----------
    gap, element, material, mu, heights, unit, approach, force
        As for `frictional_contact`; `force` is the normal force.
    longitudinal, lateral, spin, moment, slip, pole
        As for `rolling`.
    tangential_force : (float, float) or float, optional
        Tangential force (Fx, Fy) on the first body instead of creepages, which are then found, as
        `force` in `rolling`; 0 for free rolling.
    tolerance : float
        Allowed violation of the conditions of normal contact, relative to the largest interference.
        Each of the two problems is solved to a hundredth of it.
    nested, max_iterations, max_products, progress
        As for `frictional_contact`.
    options : SteadyOptions, optional
        Limits of the direct search for the steady state, after which it rolls step by step.

    Returns
    -------
    FrictionalResult
        With a `NormalResult` in `normal`, and a `TangentialResult` in `tangential`.

    Warns
    -----
    ContactWarning
        As for `normal_contact`.

    Raises
    ------
    ValueError, TypeError
        If the input is invalid (it is checked before any work), or if loads exceed what friction
        can carry.
    ContactError
        If the iteration does not converge. The message names the violated condition.

    See Also
    --------
    frictional_contact : for bodies that do not roll.
    rolling : with a given bound, which is exact for like materials.

    Notes
    -----
    Without slip, free rollers in plane strain creep by a/(πR) ln((1+β)/(1-β)), where a is the half
    width of the contact and 1/R the sum of both curvatures. β = K/(1-ν) is Dundurs' parameter, with
    the `halfspace.difference_parameter` K and ν of the combined materials (Bufler, 1959). The creep
    increases as friction decreases, up to 0.915 β a/R (Bentall and Johnson, 1967).

    Examples
    --------
    An aluminium roller on a steel roller, without a tangential force.

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
    approach, force = check_load(grid, z, approach, force)
    friction = check_friction(mu, z.shape)
    check_iteration(tolerance, max_products, progress)
    most = count("max_iterations", max_iterations)
    creepages = longitudinal, lateral, spin
    tangential_force = in_unit("tangential_force", tangential_force, grid.force_unit)
    refuse_masked("tangential_force", tangential_force)
    motion = Motion.of(z.shape, creepages, tangential_force, moment, slip, pole)
    grid = replace(grid, directions=motion.directions)
    given = np.zeros((grid.components, *z.shape))
    if motion.slip is not None:
        given = given + motion.slip
    inner, report = INNER * tolerance, Report(progress)
    loads = Loads(motion.units(grid), motion.arms(grid), motion.wanted)

    def solve(g: Array, slip: Array, guess: TangentialResult | None) -> TangentialResult:
        field_of_slip = slip[0] if len(slip) == 1 else slip
        # Friction shifts the pressures, so those before may carry less of the loads.
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
        pressing = Pressing(grid, z, coupling, approach, force, inner, max_products, report)
        rolling = Rolling(grid, coupling, Coupling(grid.coupling(ahead=1)), friction, solve, given)
        p = pressing.begin(None, nested=nested)
        if force is not None:  # Pressures with this sum cannot carry a larger one.
            largest = bound_of(np.max(friction), p)
            replace(motion, loads=(*motion.loads[:2], None)).check_loads(grid, largest)
        p, q, residuals = alternate(
            pressing, rolling, p, tolerance=tolerance, most=most, report=report
        )
        motion.check_loads(grid, bound_of(friction, p))
        loads.check_share(bound_of(friction, p), grid.vectors)
        normal, tangential = pressing.result(q, p), rolling.result(p)
    normal = remake(normal, work=work.units(z.size))
    found = np.ravel(tangential.creepages).tolist()
    about = doubts.examine_friction(grid, mu) + doubts.examine_creepages(found, tangential.area)
    result = FrictionalResult(normal, remake(tangential, warnings=about), residuals)
    doubts.warn(check_both(result, tolerance, report, max_products).warnings)
    return result


def read_gap(
    gap: ArrayLike | None, element: Element | None, heights: Any, unit: Unit | None
) -> tuple[Array, Any]:
    """Return the given gap and the element size, mm; periodic surfaces are refused."""
    z, element, periodic = read_surface(gap, element, heights, unit, None)
    if np.any(periodic):
        raise ValueError(
            "heights has periodic=True, but this function takes no periodic surfaces: give its "
            "heights as an array, with element= and unit="
        )
    return z, element


def check_both(
    result: FrictionalResult, tolerance: float, report: Report, max_products: int
) -> FrictionalResult:
    """Return the result, or raise ContactError if it violates a condition."""
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


def read_motion(
    shift: ArrayLike | None, tangential_force: Any, largest: float, grid: Grid
) -> tuple[Array, Array | None]:
    """Return the rigid shift (by default zero), and the sum of the tractions or None.

    The tangential force may be at most `largest`.
    """
    if shift is not None and tangential_force is not None:
        raise ValueError(
            f"shift is {show(shift)} and tangential_force is {show(tangential_force)}, but at most "
            "one of the two may be given"
        )
    still = np.zeros((grid.components, *(1,) * len(grid.shape)))
    if tangential_force is not None:
        return still, check_carried(tangential_force, largest, grid)
    return still if shift is None else check_shift(shift, (grid.components, *grid.shape)), None


def read_history(
    previous: FrictionalResult | None,
    grid: Grid,
    z: Array,
    approach: float | None,
    force: float | None,
) -> tuple[Before, Array | None]:
    """Return the state before this step, and an initial guess of the tractions, or None."""
    shape = (grid.components, *grid.shape)
    if previous is None:
        _, distance, _ = measure_from_contact(z, None, grid.vectors)
        return Before(np.zeros(shape), 0.0, distance), None
    if not isinstance(previous, FrictionalResult):
        kind = type(previous).__name__
        raise TypeError(f"previous is of type {kind}, but must be a FrictionalResult")
    traction = check_previous(previous.tangential, grid, shape)
    before = Before(traction, previous.normal.force, previous.normal.approach)
    return before, extrapolate(previous, before, approach, force).reshape(shape)


def place_bodies(
    change: Array,
    previous: FrictionalResult | None,
    before: Before,
    grid: Grid,
    coupling: Coupling,
) -> tuple[Array, float]:
    """Return the displacements along the surface without slip and pressures.

    The second value is the largest displacement of the previous state.
    """
    b = np.zeros((grid.components, *grid.shape)) + change
    if previous is None:
        return b, 0.0
    u = apply_to_rows(grid.tangential(), before.traction.ravel()).reshape(b.shape)
    u += coupling.along(previous.normal.pressure)
    return b + u, float(np.abs(u).max())


def check_carried(force: Any, most: float, grid: Grid) -> Array:
    """Return the sum of the tractions for a tangential force, of at most `most`."""
    return check_force(force, most / grid.area, grid, name="tangential_force")[0]


def extrapolate(
    previous: FrictionalResult, now: Before, approach: float | None, force: float | None
) -> Array:
    """Return tractions extrapolated with the load, from the step before."""
    earlier = previous.before
    if earlier is None:
        return now.traction
    if force is None:
        assert approach is not None
        change, last = approach - now.approach, now.approach - earlier.approach
    else:
        change, last = force - now.force, now.force - earlier.force
    step = change / last if 0.0 < abs(change) <= FARTHEST * abs(last) else 0.0
    return now.traction + step * (now.traction - widen(earlier.traction, len(now.traction)))
