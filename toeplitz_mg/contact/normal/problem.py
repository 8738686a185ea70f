"""Normal contact: pressures and the area of contact of two half-spaces that are pressed together.

The pressures p and the gap w = A p + z - δ (Eq. 6-7) are complementary:

    in contact  w = 0, p ≥ 0;        elsewhere  w ≥ 0, p = 0.

The elements in contact are found by `active_set`, from a first guess on coarser grids.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Element, Progress
from toeplitz_mg.contact import doubts
from toeplitz_mg.contact.checks import check_iteration, check_load
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.normal.active_set import Search, State
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.result import NormalResult, check_converged, touches_edge
from toeplitz_mg.engine.work import count_products
from toeplitz_mg.values import field, in_range


def normal_contact(
    gap: ArrayLike,
    element: Element,
    *,
    material: Any,
    approach: float | None = None,
    force: float | None = None,
    reference: float | None = None,
    periodic: bool | tuple[bool, bool] = False,
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
        constant, that adds to the approach. One axis is line contact. See `surfaces`.
    element : (float, float) or float
        Size (h1, h2) of an element, mm. In line contact the width and the length of the strips,
        or the width alone: plane strain, with forces per mm of length.
    material : Material or (Material, Material)
        Of both bodies, or of the first and the second (see `contact.Material`).
    approach : float
        The approach of the bodies, from where the gap is given, mm.
    force : float
        The force that presses, N; in plane strain N/mm. Either this or the approach is given.
    reference : float, optional
        In plane strain, and on a surface that repeats along one of two axes, the distance at which
        a line load moves nothing, mm: it decides what approach belongs to a force. By default the
        length of the grid across such a load.
    periodic : bool or (bool, bool)
        Whether the surfaces, and the pressures, repeat for ever, with the grid for a period, along
        all axes or along each of them. The force is that of one period. Where they repeat along
        all axes, displacements are those from their mean, so that the mean gap under load is that
        before, less the approach; an approach must leave some.
    tolerance : float
        The error that is allowed, relative to the largest interference: the gap in contact, and
        the depth of penetration elsewhere. Pressures are never negative.
    nested : bool
        Whether the first guess comes from coarser grids.
    max_products : int
        More products with the matrix than that are taken for a failure.
    progress : callable, optional
        Called as ``progress(products, residual)`` before each change of the area.

    Returns
    -------
    NormalResult

    Warns
    -----
    ContactWarning
        Where the answer may not be of the problem that was meant: a contact that reaches the edge
        of the grid or is less than 10 elements across, a mean pressure above E*/2, slopes above 1,
        a gap that varies by more than the length of the grid, or whose sign seems to be reversed.
        `NormalResult.warnings` lists them.

    Raises
    ------
    ValueError, TypeError
        For input that makes no sense, before any work.
    ContactError
        Where the tolerance is not reached: it says what is violated.

    Notes
    -----
    The bodies end where the grid ends. So a punch with sharp edges is a gap that is flat, or
    inclined, along an axis, and touches at both ends of it without a warning. Any other gap, round
    or rough, is taken for a part of a larger surface, and should not touch there.

    Along an axis that repeats the discrete kernel is the continuous symbol 2/(E*|q|) at the
    wavenumbers q of the grid, as `tamaas` and `aspher` have it. Where only one of two axes
    repeats, the images of an element have no finite sum, and `reference` decides on the constant
    (see `halfspace.periodic`).

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
    z = field("gap", gap)
    grid = Grid.of(z.shape, element, material, reference, periodic)
    result = press(grid, z, approach, force, tolerance, nested, max_products, progress)
    doubts.warn(check_converged(result, tolerance).warnings)
    return result


def press(
    grid: Grid,
    z: Array,
    approach: float | None,
    force: float | None,
    tolerance: float,
    nested: bool,
    max_products: int,
    progress: Progress | None,
) -> NormalResult:
    """Return what `normal_contact` finds for the gap `z`, converged or not."""
    with grid.agree() as same:
        force = check_load(grid, z, approach, force)
        check_iteration(tolerance, max_products, progress)
        same["approach"], same["force"], same["nested"] = approach, force, bool(nested)
        same["tolerance"], same["max_products"] = tolerance, max_products
    # A large distance would bury the interference in its rounding.
    distance = grid.vectors.min(z)
    z = z - distance
    if approach is not None:
        approach = float(approach) - distance
        if approach <= 0.0:
            nothing = np.zeros(z.shape)
            return _result(grid, z, State(nothing, nothing, approach), 0, 0.0, distance)
        in_range("the interference", approach)
    with count_products() as work:
        search = Search(grid, z, approach, force, tolerance, progress)
        products = Products(search.matrix, max_products)
        state = search.run(products, nested=nested)
        state = state._replace(p=state.p / search.unit)
    units = work.units(z.size) / search.matrix.work
    return _result(grid, z, state, products.count, units, distance)


def _result(
    grid: Grid, z: Array, state: State, products: int, work: float, distance: float
) -> NormalResult:
    contact = state.p > 0.0
    return NormalResult(
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
        gap=state.u + z - state.approach,
        products=products,
        work=work,
        iterations=state.iterations,
        residual=state.residual,
        warnings=doubts.examine_pressures(grid, z, state.p, state.approach),
    )
