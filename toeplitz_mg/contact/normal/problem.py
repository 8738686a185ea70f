"""Normal contact: pressures and the area of contact of two half-spaces pressed together.

The pressures p and the gap w = A p + z - δ (Eq. 6-7) are complementary:
    in contact  w = 0, p ≥ 0;        elsewhere  w ≥ 0, p = 0.

`search` finds the elements in contact, starting from a guess by `starts`.
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

# For the stiffness, whose error is about the square of the residual. The limit of iterations ends
# the solution once rounding prevents a smaller residual.
ACCURATE: dict[str, Any] = {"rtol": 1e-4, "maxiter": 200}
LEAP = 2.0  # If loads differ by this factor, one's pressures are no initial guess for the other.


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
    """Press two bodies together: find the pressures, contact area, force and approach.

    Parameters
    ----------
    gap : array_like of shape (n1, n2) or (n,)
        Gap between the bodies before loading, at the element centres, mm. A constant added to it
        adds to the approach. It is infinite where there is no material. One axis is line contact.
        See `surfaces`. Arrays of other libraries, for example on a GPU, are accepted too (see
        Notes).
    element : (float, float) or float
        Size (h1, h2) of an element, mm. In line contact, the width and the length of the strips, or
        only the width: then plane strain is assumed, with forces per mm of length.
    material : Material or (Material, Material)
        One material for both bodies, or the first and the second (see `contact.Material`).
    heights : array_like, masked array, or result of `surfaces.read`
        Surface heights, instead of the gap: positive at summits, pressed on a flat, with zero gap
        at the highest point. Missing heights (NaN or masked) are no material. Arrays of other
        libraries are accepted too. A file or a topography of SurfaceTopography also provides the
        element, unit and periodicity. For arrays of xarray (heights or gap), the axes are the
        dimensions named x and y, and the element follows from the coordinates.
    unit : str or (str, str), optional
        Unit of the gap or heights and of the element, or one each, as in ("nm", "um"): "m", "mm",
        "um", "nm", ... By default mm, or the unit that comes with the heights. Loads and results
        are always in N and mm.
    approach : float
        Approach of the bodies, mm, measured from the given gap.
    force : float
        Normal force, N; in plane strain N/mm. Give one of force, approach and pressure. With zero
        force, the bodies just touch.
    pressure : float
        Mean pressure, N/mm²: the force divided by the area of the grid, or of one period.
    previous : NormalResult, optional
        A result for another load or a similar gap on the same grid, used as initial guess. The
        closer it is, the fewer products are needed. The answer does not depend on it: to continue
        from a plastic state (`hardness`), add its `plastic` to the gap. See `load_curve`.
    reference : float, optional
        In plane strain, or on a surface that repeats along one of two axes, the distance at which a
        line load causes no displacement, mm. It determines the approach for a given force. By
        default the length of the grid across the line load.
    periodic : bool or (bool, bool)
        Whether the surfaces and pressures repeat periodically beyond the grid, along all axes or
        along each. The force is that of one period. If they repeat along all axes, displacements
        are relative to their mean, so the mean gap under load is the mean gap before minus the
        approach; an approach must leave it positive. By default False, or as the topography says.
    hardness : float, optional
        The largest pressure that the softer body bears, N/mm². Elements with a higher pressure
        yield by the depth `plastic` of the result. Add it to the gap before applying another load,
        as `load_curve` does. By default no element yields.
    tolerance : float
        Allowed error of the gap in contact, and of the penetration elsewhere, relative to the
        largest interference. Pressures are never negative.
    nested : bool
        Whether to compute the initial guess on coarser grids.
    max_products : int
        Limit of matrix-vector products; beyond it the search fails with a `ContactError`.
    progress : callable, optional
        Called as ``progress(products, residual)`` after each product, with the violation for the
        last area; while the initial guess is computed on coarser grids, with 0 products.

    Returns
    -------
    NormalResult

    Warns
    -----
    ContactWarning
        If the input looks wrong: more than 5 % of the load is at the edge of the grid; the largest
        spot is less than 10 elements across, unless it is one of many; the mean pressure exceeds
        E/10; slopes exceed 1; the gap varies by more than the length of the grid, or its sign seems
        to be reversed. `NormalResult.warnings` lists all warnings.

    Raises
    ------
    ValueError, TypeError
        If the input is invalid. It is checked before any work.
    ContactError
        If the iteration does not converge. The message names the violated condition.

    See Also
    --------
    toeplitz_mg.contact.surfaces.rough : generates a rough surface.
    friction : shifts the bodies tangentially.
    rolling : rolls the bodies on each other.
    subsurface_stresses : the stresses below the surface.
    hertz : the closed-form theory for smooth bodies.

    Notes
    -----
    The bodies end at the edge of the grid. A punch with sharp edges is a gap that is flat or
    inclined along an axis; it may touch both ends without a warning. Any other gap, round or rough,
    is considered part of a larger surface, which should not touch there.

    Along a periodic axis the discrete kernel is the continuous symbol 2/(E*|q|) at the wavenumbers
    q of the grid, as in `tamaas` and `aspher`. If only one of two axes is periodic, the sum over
    the images of an element diverges, and `reference` determines the constant (see
    `halfspace.periodic`).

    If the surface is not periodic, the gap may be an array of CuPy, torch, JAX or another library
    of the array API standard (extra `arrays`). The search then runs on that library's device, and
    only a few numbers per iteration are copied to the host. The fields of the result are NumPy
    arrays.

    Examples
    --------
    Hertz: a steel sphere of radius 10 mm on a steel plate.

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
    """Raise an error for arrays of a library that does not support the search."""
    if any(grid.periodic):
        refuse_masked(name, surface)
    library.require(f"the search with {name}", np.float64)


@dataclass(frozen=True)
class Pressed:
    """The checked arguments of `normal_contact`."""

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
        """Return the checked arguments for the gap `z`, or raise an error.

        The load consists of approach, force and mean pressure, two of which are None.
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
    """Return the result of `normal_contact` for the gap `z`, converged or not.

    The search uses arrays of the given library, everything else NumPy arrays.
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
    """Return the result for the gap `z`, from a search in which the gap was less by `distance`."""
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
    """Return dF/dδ for the elements C in contact, N/mm; in plane strain N/mm².

    While C is constant, a change dδ of the approach changes the pressures by x dδ, where A x = 1 on
    C; changes of C affect the force to second order only. The function 2 Σx - x·Ax has its maximum
    Σx at A x = 1, so its error is of second order and single precision is sufficient for x.
    """
    vectors = grid.vectors
    touching = vectors.count(C)
    if not touching:
        return 0.0
    if grid.has_free_mean and touching == prod(grid.shape):
        return np.inf  # Under a mean pressure the approach is constant.
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
    """Press two bodies together under a sequence of loads.

    Each result is the initial guess for the next load; the edge of the contact is extrapolated from
    the last two. For rough surfaces and loads in order, this takes about half the products of
    separate calls of `normal_contact`, with the same results. If coarser grids give a better guess,
    as for smooth bodies, they are used for the next load.

    With a hardness, plastic deformation remains: each load is applied to the gap that the previous
    loads have left, and `NormalResult.plastic` is the total depth.

    Parameters
    ----------
    gap, element, material, heights, unit
        The surface and the bodies, as for `normal_contact`.
    forces : array_like of shape (k,)
        Normal forces, N; in plane strain N/mm. Zero means no contact. They may decrease again.
    approaches : array_like of shape (k,)
        The approaches, mm. Give either these or the forces.
    reference, periodic, hardness, tolerance, nested, max_products, progress
        As for `normal_contact`, for each load.
    keep : bool
        Whether the curve keeps its results. Otherwise it keeps only their numbers, so the memory
        does not grow with the number of loads.

    Returns
    -------
    LoadCurve
        An iterator that computes the result for each load on request, with the methods `plot`,
        `to_dataframe`, `to_xarray` and `save`. `NormalResult.stiffness` is the slope of the curve.

    Warns
    -----
    ContactWarning
        As for `normal_contact`, for each result.

    Raises
    ------
    ValueError, TypeError
        If the input is invalid. It is checked before any work.
    ContactError
        If the iteration does not converge for a load. The previous results have been returned by
        then.

    See Also
    --------
    normal_contact : for a single load.

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
        # Products for the last load that started from previous results, and for one that did not.
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
            if result.products:  # Zero for an unloaded body.
                if len(known) != 1:  # A start from one result says nothing about a start from two.
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
