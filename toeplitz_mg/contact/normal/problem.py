"""Normal contact: pressures and the area of contact of two half-spaces that are pressed together.

The pressures p and the gap w = A p + z - δ (Eq. 6-7) are complementary:

    in contact  w = 0, p ≥ 0;        elsewhere  w ≥ 0, p = 0.

The elements in contact are found by `search`, from a first guess that `starts` has.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from functools import partial
from math import prod
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Element, Progress, Unit
from toeplitz_mg.contact import doubts
from toeplitz_mg.contact.checks import (
    check_hardness,
    check_iteration,
    check_load,
    check_same_grid,
    measure_from_contact,
)
from toeplitz_mg.contact.curves import LoadCurve
from toeplitz_mg.contact.gaps import read_surface
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.inverse import invert_on
from toeplitz_mg.contact.normal.search import Search
from toeplitz_mg.contact.normal.starts import Known, State, predict, solve
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.results import NormalResult, check_converged
from toeplitz_mg.contact.results.base import make, remake, touches_edge
from toeplitz_mg.engine.arrays.library import NUMPY, Library, library_of
from toeplitz_mg.engine.work import count_products
from toeplitz_mg.halfspace.materials import Bodies
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.solvers.cg import cg
from toeplitz_mg.values import field, refuse_masked

# Of the stiffness, whose error is about the square of the residual; most iterations, after which
# rounding keeps them from the rest.
ACCURATE: dict[str, Any] = {"rtol": 1e-4, "maxiter": 200}
LEAP = 2.0  # Factor between two loads from which the pressures of one are no guess of the other.


def normal_contact(
    gap: ArrayLike | None = None,
    element: Element | None = None,
    *,
    material: Bodies,
    heights: Any = None,
    unit: Unit | None = None,
    approach: float | None = None,
    force: float | None = None,
    pressure: float | None = None,
    previous: NormalResult | None = None,
    reference: float | None = None,
    periodic: bool | tuple[bool, bool] | None = None,
    hardness: float | None = None,
    tolerance: float = 1e-8,
    nested: bool = True,
    max_products: int = 2000,
    progress: Progress | None = None,
) -> NormalResult:
    """Press two bodies together: pressures, area of contact, force and approach.

    Parameters
    ----------
    gap : array_like of shape (n1, n2) or (n,)
        Between the bodies before they touch, at the centres of the elements, mm; up to a
        constant, that adds to the approach. It is infinite where there is no material. One axis is
        line contact. See `surfaces`. It may be an array of another library, as on a GPU (see the
        notes).
    element : (float, float) or float
        Size (h1, h2) of an element, mm. In line contact the width and the length of the strips,
        or the width alone: plane strain, with forces per mm of length.
    material : Material or (Material, Material)
        Of both bodies, or of the first and the second (see `contact.Material`).
    heights : array_like, masked array, or what `surfaces.read` returns
        In the place of the gap: the heights of a surface on a flat, positive at summits, whose gap
        is zero at the highest one. Those that are missing, NaN or masked, are no material. They may
        be of another library, too. Those of a file, and a topography of SurfaceTopography, also say
        element, unit and periodicity. Of an array of xarray, as of the gap, axes are those that are
        named x and y, and the element is what the coordinates say.
    unit : str or (str, str), optional
        The unit of gap or heights, and element, or one of each, as ("nm", "um"): "m", "mm", "um",
        "nm", ... Loads and results are in N and mm. By default mm, or what the heights say.
    approach : float
        The approach of the bodies, from where the gap is given, mm.
    force : float
        The force that presses, N; in plane strain N/mm. One of force, approach and pressure is
        given. No force leaves the bodies where they first touch.
    pressure : float
        The mean pressure on the grid, N/mm²: the force over its area, that of one period.
    previous : NormalResult, optional
        A result under another load, or of a gap that is alike, on the same grid: what it is near
        to takes fewer products. It is a guess, no history: what has yielded (`hardness`) is taken
        over by a gap to which its `plastic` is added. See `load_curve`.
    reference : float, optional
        In plane strain, and on a surface that repeats along one of two axes, the distance at which
        a line load moves nothing, mm: it decides what approach belongs to a force. By default the
        length of the grid across such a load.
    periodic : bool or (bool, bool)
        Whether the surfaces, and the pressures, repeat for ever, with the grid for a period, along
        all axes or along each of them. The force is that of one period. Where they repeat along
        all axes, displacements are those from their mean, so that the mean gap under load is that
        before, less the approach; an approach must leave some. By default False, or what a
        topography says.
    hardness : float, optional
        The largest pressure that the softer body bears, N/mm²: an element yields where it would
        be higher, and is pressed in by the depth `plastic` of the result, which is to be added to
        the gap before another load (`load_curve` does). By default none does.
    tolerance : float
        The error that is allowed, relative to the largest interference: the gap in contact, and
        the depth of penetration elsewhere. Pressures are never negative.
    nested : bool
        Whether the first guess comes from coarser grids.
    max_products : int
        More products with the matrix than that are taken for a failure.
    progress : callable, optional
        Called as ``progress(products, residual)`` after each product, with the violation of the
        last area; on coarser grids, where the first guess comes from, with 0 products.

    Returns
    -------
    NormalResult

    Warns
    -----
    ContactWarning
        Where the answer may not be of the problem that was meant: a contact of which more than 5 %
        of the load is at the edge of the grid, or whose largest spot is less than 10 elements
        across, unless it is one of many, a mean pressure above E/10, slopes above 1,
        a gap that varies by more than the length of the grid, or whose sign seems to be reversed.
        `NormalResult.warnings` lists them.

    Raises
    ------
    ValueError, TypeError
        For input that makes no sense, before any work.
    ContactError
        Where the tolerance is not reached: it says what is violated.

    See Also
    --------
    toeplitz_mg.contact.surfaces.rough : a gap to press.
    friction : shifts the bodies then.
    rolling : rolls them.
    subsurface_stresses : the stresses below.
    hertz : theory, for smooth bodies.

    Notes
    -----
    The bodies end where the grid ends. So a punch with sharp edges is a gap that is flat, or
    inclined, along an axis, and touches at both ends of it without a warning. Any other gap, round
    or rough, is taken for a part of a larger surface, and should not touch there.

    Along an axis that repeats the discrete kernel is the continuous symbol 2/(E*|q|) at the
    wavenumbers q of the grid, as `tamaas` and `aspher` have it. Where only one of two axes
    repeats, the images of an element have no finite sum, and `reference` decides on the constant
    (see `halfspace.periodic`).

    The search is made on the arrays of the gap: those of CuPy, torch, JAX, or another library of
    the array API standard, too, by the extra `arrays`, if the surface does not repeat. The fields
    of the result are NumPy's in any case. In an iteration a few numbers go to the memory of the
    processor, and no field.

    Examples
    --------
    Hertz: a steel sphere of 10 mm on a steel plate.

    >>> from toeplitz_mg.contact import Material, normal_contact, surfaces
    >>> steel = Material(E=210000.0, nu=0.28)  # N/mm²
    >>> gap = surfaces.sphere((64, 64), (0.01, 0.01), radius=10.0)
    >>> contact = normal_contact(gap, (0.01, 0.01), material=steel, force=100.0)
    >>> E_star = steel.E_star / 2.0  # Of two bodies of steel.
    >>> a = (3 * 100.0 * 10.0 / (4 * E_star)) ** (1 / 3)
    >>> f"{contact.approach:.5f} mm, {a**2 / 10.0:.5f} by Hertz"
    '0.00351 mm, 0.00351 by Hertz'
    """
    name, surface = ("gap", gap) if heights is None else ("heights", heights)
    library = library_of(surface)
    gap, heights = (x if x is None else library.to_numpy(x) for x in (gap, heights))
    z, element, periodic = read_surface(gap, element, heights, unit, periodic)
    grid = Grid.of(z.shape, element, material, reference, periodic)
    if library is not NUMPY:
        _check_library(library, name, surface, grid)
    before = () if previous is None else (previous,)
    search = tolerance, nested, max_products, progress
    asked = grid.agree(Pressed.of, grid, z, (approach, force, pressure), *search, before, hardness)
    result = press(grid, z, asked, progress, library)
    doubts.warn(check_converged(result, tolerance).warnings, within=grid.callers)
    return result


def _check_library(library: Library, name: str, surface: Any, grid: Grid) -> None:
    """Refuse arrays of a library on which the search cannot be made."""
    if any(grid.periodic):
        refuse_masked(name, surface)
    library.require(f"the search with {name}", np.float64)


@dataclass(frozen=True)
class Pressed:
    """Arguments of `normal_contact`, checked; see there."""

    approach: float | None
    force: float | None
    hardness: float | None
    tolerance: float
    nested: bool
    max_products: int
    previous: Sequence[NormalResult] = dataclass_field(compare=False)

    @classmethod
    def of(
        cls,
        grid: Grid,
        z: Array,
        load: tuple[Any, Any, Any],
        tolerance: float,
        nested: bool,
        max_products: int,
        progress: Progress | None,
        previous: Sequence[NormalResult] = (),
        hardness: float | None = None,
    ) -> Self:
        """Return the arguments for the gap `z`, or say what is wrong with them.

        The load are an approach, a force and a mean pressure, of which one is given.
        """
        approach, force = check_load(grid, z, *load)
        if hardness is not None:
            hardness = check_hardness(grid, hardness, force, pressure=load[2])
        check_iteration(tolerance, max_products, progress)
        for result in previous:
            check_same_grid(result, grid)
        return cls(approach, force, hardness, tolerance, bool(nested), max_products, previous)


def press(
    grid: Grid, z: Array, asked: Pressed, progress: Progress | None, library: Library = NUMPY
) -> NormalResult:
    """Return what `normal_contact` finds for the gap `z`, converged or not.

    The search is made on arrays of a library, and all else on NumPy's.
    """
    force, load = asked.force, asked.approach if asked.force is None else asked.force
    assert load is not None
    z, distance, approach = measure_from_contact(z, asked.approach, grid.vectors)
    most = check_hardness(grid, asked.hardness, force, grid.vectors.count(z < np.inf))
    if force == 0.0 or (approach is not None and approach <= 0.0):
        nothing = State(np.zeros(z.shape), np.zeros(z.shape), approach or 0.0)
        return make_result(grid, z, nothing, 0, 0.0, distance, most)
    with count_products() as work:
        there = grid if library is NUMPY else replace(grid, library=library)
        search = Search(
            there, library.from_numpy(z), approach, force, asked.tolerance, progress, most
        )
        if grid.vectors.count(np.isinf(z)):
            search = replace(search, z=search.put_out_of_reach())
        products = Products(search.matrix, asked.max_products)
        known = [
            Known(r.approach if force is None else r.force, r.pressure * search.unit, r.gap)
            for r in asked.previous
        ]
        guess = predict(known, load, grid.vectors) if known else None
        if guess is not None:
            guess = library.from_numpy(guess)
        state = solve(search, products, nested=asked.nested, guess=guess)
        p, u = library.to_numpy(state.p), library.to_numpy(state.u)
        state = state._replace(p=np.where(p < search.most, p / search.unit, most), u=u)
    units = products.units(work) / search.matrix.work
    return make_result(grid, z, state, products.count, units, distance, most)


def make_result(
    grid: Grid,
    z: Array,
    state: State,
    products: int,
    work: float,
    distance: float,
    hardness: float = np.inf,
) -> NormalResult:
    """Return what was found for the gap `z`, which was less by a distance."""
    farthest = grid.vectors.max(np.where(z < np.inf, z, 0.0))
    contact = state.p > 0.0
    gap, plastic = state.u + z - state.approach, None
    if hardness < np.inf:
        plastic = np.where(state.p >= hardness, np.maximum(-gap, 0.0), 0.0)
        gap += plastic
    return make(
        NormalResult,
        material=grid.material,
        shape=grid.shape,
        element=grid.element,
        centres=grid.centres(),
        pressure=state.p,
        displacement=state.u,
        contact=contact,
        area=grid.vectors.count(contact) * grid.area,
        force=grid.vectors.sum(state.p) * grid.area,
        approach=state.approach + distance,
        max_pressure=grid.vectors.max(state.p),
        energy=0.5 * grid.area * grid.vectors.dot(state.p, state.u),
        touches_edge=touches_edge(grid, contact),
        periodic=grid.periodic,
        gap=gap,
        plastic=plastic,
        products=products,
        work=work,
        iterations=state.iterations,
        residual=abs(state.residual),  # Not -0.0.
        stiffness=partial(find_stiffness, grid, contact & (state.p < hardness)),
        warnings=doubts.examine_pressures(grid, np.minimum(z, farthest), state.p, state.approach),
    )


def find_stiffness(grid: Grid, C: Array) -> float:
    """Return dF/dδ of the elements C in contact, N/mm; in plane strain N/mm².

    While these are the same, a change dδ of the approach changes the pressures by x dδ, A x = 1 on
    them; and which they are changes the force to second order only. The function 2 Σx - x·Ax is
    largest, and the sum of x, where A x = 1: near there its error is of second order, so that x in
    single precision is good enough.
    """
    vectors = grid.vectors
    touching = vectors.count(C)
    if not touching:
        return 0.0
    if grid.has_free_mean and touching == prod(grid.shape):
        return np.inf  # A mean pressure moves nothing.
    A, unit = grid.scaled_normal()
    ones = np.ones(np.count_nonzero(C), np.float32)
    M = invert_on(grid, A, C)
    x, _ = cg(grid.restrict(A, C).astype(M.dtype), ones.astype(M.dtype), M=M, **ACCURATE)
    y = np.zeros(C.shape)
    y[C] = x
    u = apply_to_rows(A, y.reshape(-1)).reshape(y.shape)
    return (2.0 * vectors.sum(y) - vectors.dot(y, u)) * grid.area / unit


def load_curve(
    gap: ArrayLike | None = None,
    element: Element | None = None,
    *,
    material: Bodies,
    heights: Any = None,
    unit: Unit | None = None,
    forces: ArrayLike | None = None,
    approaches: ArrayLike | None = None,
    reference: float | None = None,
    periodic: bool | tuple[bool, bool] | None = None,
    hardness: float | None = None,
    tolerance: float = 1e-8,
    nested: bool = True,
    max_products: int = 2000,
    progress: Progress | None = None,
    keep: bool = True,
) -> LoadCurve:
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
    keep : bool
        Whether the curve keeps its results. Otherwise it keeps their numbers, and the memory is
        that of a few fields for any number of loads.

    Returns
    -------
    LoadCurve
        An iterator that computes the result for each load when it is asked for, with `plot`,
        `to_dataframe`, `to_xarray` and `save`. `NormalResult.stiffness` is the slope of the curve.

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
    is_force, loads = _check_loads(forces, approaches, grid)
    for load in loads.tolist():
        _, force = check_load(grid, z, None if is_force else load, load if is_force else None)
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
            asked = Pressed.of(grid, gap, (approach, force, None), *search, begins, hardness)
            result = press(grid, gap, asked, progress)
            if result.plastic is not None:
                dents = dents + result.plastic
                result = remake(result, plastic=dents)
            yield check_converged(result, tolerance)
            if result.products:  # Without a load there was nothing to find.
                if len(known) != 1:  # A beginning with one result says nothing of one with two.
                    after, alone = (result.products, alone) if begins else (after, result.products)
                known, known_load = (*known, result)[-2:], load

    return LoadCurve(solve(), len(loads), bool(keep))


def _check_loads(
    forces: ArrayLike | None, approaches: ArrayLike | None, grid: Grid
) -> tuple[bool, Array]:
    """Return whether forces are given, and the loads."""
    if (forces is None) == (approaches is None):
        raise ValueError(
            f"forces is {forces!r} and approaches is {approaches!r}, but just one of the two must "
            "be given"
        )
    name, given = ("forces", forces) if approaches is None else ("approaches", approaches)
    assert given is not None
    loads = field(name, given, "mm" if forces is None else grid.force_unit)
    if loads.ndim != 1:
        raise ValueError(f"{name} has shape {loads.shape}, but must be a list of numbers")
    return forces is not None, np.asarray(loads)
