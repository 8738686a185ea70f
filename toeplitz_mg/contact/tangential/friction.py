"""Friction: tangential tractions of two half-spaces in contact that are shifted (Eq. 1-3)."""

from dataclasses import dataclass, field, replace
from math import prod
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Element, Numbers, Progress
from toeplitz_mg.contact import doubts
from toeplitz_mg.contact.checks import (
    check_force,
    check_iteration,
    check_pressed,
    check_previous,
    check_shift,
    has_two_components,
    is_lateral,
    show,
)
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.results import NormalResult, TangentialResult, check_converged
from toeplitz_mg.contact.results.base import make, remake, touches_edge
from toeplitz_mg.contact.tangential.law import (
    Areas,
    Problem,
    State,
    admit,
    along,
    clip,
    direction,
    drop_rounding,
    scale_to_bound,
    sum_components,
)
from toeplitz_mg.contact.tangential.loads import Loads
from toeplitz_mg.contact.tangential.solving import solve_shifted
from toeplitz_mg.contact.window import MARGIN
from toeplitz_mg.engine.work import count_products
from toeplitz_mg.halfspace.materials import Bodies
from toeplitz_mg.values import in_unit, refuse_masked


def friction(
    pressed: NormalResult | None = None,
    element: Element | None = None,
    *,
    mu: Numbers | None = None,
    bound: Numbers | None = None,
    material: Bodies | None = None,
    shift: ArrayLike | None = None,
    force: ArrayLike | None = None,
    previous: TangentialResult | None = None,
    reference: float | None = None,
    periodic: bool | tuple[bool, bool] | None = None,
    tolerance: float = 1e-8,
    nested: bool = True,
    max_products: int = 2000,
    progress: Progress | None = None,
) -> TangentialResult:
    """Shift two bodies in contact: find tractions, slip and the areas of stick and slip.

    Parameters
    ----------
    pressed : NormalResult
        A result of `normal_contact`, used with `mu`. It provides the element size and the material.
    element : (float, float) or float
        Only with `bound`: size (h1, h2) of an element, mm. In line contact, the width and the
        length of the strips, or only the width: then plane strain is assumed, with forces per mm of
        length.
    mu : float, or array_like of shape (n1, n2) or (n,)
        Coefficient of friction, used with `pressed`; one number or one per element.
    bound : array_like of shape (n1, n2) or (n,)
        Traction bound g = μ p of each element, N/mm², instead of `pressed` and `mu`. It is zero
        outside the contact, and infinite where the bodies are bonded (μ = ∞). One axis is line
        contact.
    material : Material or (Material, Material)
        Only with `bound`: one material for both bodies, or the first and the second (see
        `contact.Material`).
    shift : array_like
        Rigid shift of the bodies since the previous tractions, mm: (δx, δy), or in line contact a
        number along x. Tractions and displacements have its direction. It may be a field of shape
        (2, n1, n2) or (n,), for example for a rotation. In the paper's symbols it is -w δt. In line
        contact, shift and force may have two components, the second along the strips; then the
        tractions have two as well.
    force : array_like
        Total tangential force (Fx, Fy), N; in line contact a number, in plane strain in N/mm. Give
        either this or the shift. If the shift is a field (bodies strained by a remote load), you
        may give both: then the uniform shift for the force is added. A force of μ P, to within
        1e-9, makes all elements slide. The slip then opposes the force everywhere, as after a long
        way, and the returned shift is the one at which the last element starts to slide.
    previous : TangentialResult, optional
        Result of the preceding `friction` on the same grid, whose tractions are the initial state.
    reference : float, optional
        In plane strain, and on surfaces that repeat along one of two axes, the distance at which a
        line load causes no displacement, mm; by default the length of the grid across the line
        load.
    periodic : bool or (bool, bool), optional
        Whether the surfaces repeat, as in `normal_contact`; by default as in `pressed`. If they
        repeat along all axes, displacements and shifts are relative to the mean.
    tolerance : float
        Allowed slip where the bodies stick, and allowed slip that does not oppose the traction
        where they slide, relative to the largest displacement. The bound holds exactly.
    nested : bool
        Whether to compute the initial guess on coarser grids.
    max_products : int
        Limit of matrix-vector products; beyond it the search fails with a `ContactError`.
    progress : callable, optional
        Called as ``progress(products, residual)`` after each product, with the violation for the
        last areas; while the initial guess is computed on coarser grids, with 0 products.

    Returns
    -------
    TangentialResult

    Warns
    -----
    ContactWarning
        If the input looks wrong: the contact is less than 10 elements across; mu is above 2, but
        finite; or the two bodies are unlike, as the coupling of normal and tangential tractions is
        neglected (see `frictional_contact`). `TangentialResult.warnings` lists all warnings.

    Raises
    ------
    ValueError, TypeError
        If the input is invalid (it is checked before any work), or if the force exceeds what
        friction can carry, so that the bodies would slide off.
    ContactError
        If the iteration does not converge. The message names the violated condition.

    See Also
    --------
    normal_contact : computes the pressures.
    rolling : for bodies that roll on each other.
    subsurface_stresses : the stresses below the surface.

    Examples
    --------
    Cattaneo and Mindlin: half of the largest force that a Hertzian contact can carry.

    >>> import numpy as np
    >>> from toeplitz_mg.contact import surfaces
    >>> from toeplitz_mg.contact import Material, friction, normal_contact
    >>> steel, element = Material.from_shear(82000.0, 0.28), (0.01, 0.01)
    >>> gap = surfaces.sphere((64, 64), element, radius=10.0)
    >>> contact = normal_contact(gap, element, material=steel, force=100.0)
    >>> shifted = friction(contact, mu=0.3, force=(15.0, 0.0))
    >>> bool(shifted.stick.any() and shifted.sliding.any())
    True
    >>> a, G, nu = np.sqrt(contact.approach * 10.0), steel.G, steel.nu
    >>> exact = 3 * 30.0 * 2 * (2 - nu) / (16 * G * a) * (1 - (1 - 15.0 / 30.0) ** (2 / 3))
    >>> f"{shifted.shift[0] * 1e3:.3f} µm, {exact * 1e3:.3f} by theory"
    '0.466 µm, 0.466 by theory'
    """
    g, element, material, periodic = check_pressed(pressed, bound, element, material, periodic, mu)
    grid = Grid.of(g.shape, element, material, reference, periodic)
    if is_lateral(previous) or has_two_components(g.shape, shift, force):
        grid = replace(grid, directions="xy")
    search = tolerance, nested, max_products, progress
    asked = grid.agree(Shifted.of, grid, g, shift, force, previous, *search)
    result = shift_bodies(grid, g, asked, progress)
    result = doubts.add(result, doubts.examine_friction(grid, mu))
    known = getattr(pressed, "warnings", ())
    doubts.warn(check_converged(result, tolerance).warnings, within=grid.callers, known=known)
    return result


@dataclass(frozen=True)
class Shifted:
    """The checked arguments of `friction`."""

    shift: list[float] | str | None  # The uniform shift; "a field" if it varies over the elements.
    force: Any
    tolerance: float
    nested: bool
    max_products: int
    # The shift, as an array that broadcasts to a field.
    change: Array | None = field(compare=False)
    before: Array | None = field(compare=False)  # The tractions of `previous`.
    previous: TangentialResult | None = field(compare=False)

    @classmethod
    def of(
        cls,
        grid: Grid,
        g: Array,
        shift: ArrayLike | None,
        force: ArrayLike | None,
        previous: TangentialResult | None,
        tolerance: float,
        nested: bool,
        max_products: int,
        progress: Progress | None,
    ) -> Self:
        """Return the checked arguments for the traction bound `g`, or raise an error."""
        check_iteration(tolerance, max_products, progress)
        shape = grid.components, *g.shape
        before = None if previous is None else check_previous(previous, grid, shape)
        change, of_elements = _read_shift(shift, force, shape)
        told = None if change is None else "a field" if of_elements else change.ravel().tolist()
        if force is not None:
            check_force(force, np.inf, grid)
        force = refuse_masked("force", in_unit("force", force, grid.force_unit)).tolist()
        return cls(told, force, tolerance, bool(nested), max_products, change, before, previous)


def shift_bodies(
    grid: Grid, g: Array, asked: Shifted, progress: Progress | None
) -> TangentialResult:
    """Return the result of `friction` for the traction bound `g`, converged or not."""
    g, b = drop_rounding(g, grid.vectors), np.zeros((grid.components, *g.shape))
    force, change, previous = asked.force, asked.change, asked.previous
    before = b if asked.before is None else asked.before
    if change is not None:
        b = b + change
    if force is None and grid.has_free_mean and grid.vectors.count(g) == prod(grid.shape):
        raise ValueError(
            "shift is given, but where periodic surfaces touch and stick everywhere the shift from "
            "their mean displacement is zero under any force: give the force"
        )
    total, all_slides = None, False
    if force is not None:
        total, all_slides = check_force(force, grid.vectors.sum(g), grid)
    window = grid.window((g > 0.0) | before.any(axis=0), MARGIN)
    g, b, before = (window.cut(x) for x in (g, b, before))
    vectors = window.grid.vectors
    with count_products() as work:
        products = Products(window.grid.tangential(), asked.max_products)
        guess, least = None, 0.0
        if previous is not None:
            u = products(before)
            b, least = b + u, vectors.max(np.abs(u))
        if total is not None:
            least = max(least, _displace_by_mean(window.grid, products.A, g, total, before))
        problem = Problem(window.grid, g, b, asked.tolerance, least, progress)
        if previous is not None:
            guess = admit(problem, clip(before, g), np.zeros(g.shape, bool))
        how = {"all_slides": all_slides, "nested": asked.nested}
        state, slip = find_tractions(problem, total, products, guess, **how)
    state, slip, count, units = window.same((state, slip, products.count, products.units(work)))
    result = make_result(problem, state, window, count, units, slip)
    moved = result.shift
    if change is not None:  # A given force adds a uniform shift.
        if force is not None:
            change = change + problem.uniform(state.shift)
        moved = as_given(change, is_field=asked.shift == "a field")
    return remake(result, shift=moved, total_shift=add_shifts(moved, previous, window.whole))


def find_tractions(
    problem: Problem,
    total: Array | None,
    A: Products,
    guess: tuple[Array, Areas] | None,
    *,
    all_slides: bool,
    nested: bool,
) -> tuple[State, Array | None]:
    """Return the state after a shift; the sum of the tractions may be given.

    If all elements slide, the slip is returned too, since it does not follow from the
    displacements.
    """
    if all_slides:
        assert total is not None
        return slide_off(problem, total, A)
    state = solve_shifted(problem, Loads.of_sums(total, problem.b), A, guess, nested=nested)
    return (replace(state, shift=np.zeros(len(problem.b))) if total is None else state), None


def _displace_by_mean(grid: Any, A: Any, g: Array, total: Array, before: Array) -> float:
    """Return the displacement of one element by the mean traction, before or now.

    It is a scale on periodic surfaces, where a uniform traction causes no displacement.
    """
    sums = [float(np.linalg.norm(x)) for x in (total, sum_components(before, grid.vectors))]
    return grid.diagonal(A) * max(sums) / (grid.vectors.count(g) or np.inf)


def _read_shift(shift: Any, force: Any, shape: tuple[int, ...]) -> tuple[Array | None, bool]:
    """Return the given shift, or None, and whether it varies over the elements."""
    change = None if shift is None else check_shift(shift, shape)
    of_elements = change is not None and is_field(shift, shape[0])
    if (shift is None) == (force is None) and not (of_elements and force is not None):
        raise ValueError(
            f"shift is {show(shift)} and force is {show(force)}, but just one of the two must be "
            "given, unless the shift is an array over the grid"
        )
    return change, of_elements


def make_result(
    problem: Problem,
    state: State,
    window: Any,
    products: int,
    work: float,
    slip: Array | None = None,
    **more: Any,
) -> TangentialResult:
    """Return the result on the whole grid in the user's shapes, with the fields in `more`."""
    q, contact = state.q, problem.g > 0.0
    whole_contact = window.extend(contact)
    if slip is None:
        slip = state.u - problem.b - problem.uniform(state.shift)
    is_line = len(q) == 1

    def whole(x: Array) -> Array:
        x = window.extend(x)
        return x[0] if is_line else x

    total = problem.grid.area * sum_components(q, problem.vectors)
    if "shift" not in more:
        more["shift"] = as_given(state.shift)
    more.setdefault("total_shift", more["shift"])
    if "power" not in more:
        lost = np.where(state.areas.slide, q * slip, 0.0)
        more["power"] = problem.grid.area * (0.0 - problem.vectors.sum(lost))
    if "moment" not in more and len(window.whole.shape) == 2:
        x, y = window.whole.centres()
        qx, qy = window.extend(q)
        moment = window.whole.vectors.sum(x[:, None] * qy - y * qx)
        more["moment"] = problem.grid.area * moment
    more |= {
        "area": problem.vectors.count(contact) * problem.grid.area,
        "stick_area": problem.vectors.count(state.areas.stick) * problem.grid.area,
        "force": float(total[0]) if is_line else total,
        "energy": 0.5 * problem.grid.area * problem.vectors.dot(q, state.u),
    }
    return make(
        TangentialResult,
        **window.same(more),
        material=window.whole.material,
        shape=window.whole.shape,
        element=window.whole.element,
        centres=window.whole.centres(),
        traction=whole(q),
        displacement=whole(np.where(contact, state.u, 0.0)),
        contact=whole_contact,
        periodic=window.whole.periodic,
        touches_edge=touches_edge(window.whole, whole_contact),
        slip=whole(np.where(contact, slip, 0.0)),
        stick=window.extend(state.areas.stick),
        bound=window.extend(problem.g),
        products=products,
        work=work,
        iterations=state.iterations,
        residual=state.residual,
        warnings=doubts.examine_bound(window.whole, whole_contact),
    )


def slide_off(problem: Problem, total: Array, A: Products) -> tuple[State, Array]:
    """Return the state in which all elements slide along the force `total`, and the slip.

    The shift is the one at which the last element begins to slide along the force.
    """
    contact, vectors = problem.g > 0.0, problem.vectors
    n = np.broadcast_to(direction(problem.uniform(total)), problem.b.shape)
    q = scale_to_bound(n, problem.g, contact)
    u = A(q)
    ahead = np.where(contact, u - problem.b, 0.0)
    forwards = along(ahead, n)
    shift = np.zeros(len(q))
    if elements := vectors.count(contact):
        farthest = vectors.max(np.where(contact, forwards, -np.inf))
        # Across the force the shift is the mean displacement of the elements.
        across = sum_components(ahead - forwards * n, vectors) / elements
        shift = across + farthest * direction(total)
        forwards = np.where(contact, forwards - farthest, 0.0)
    areas = Areas(np.zeros_like(contact), contact)
    return State(q, u, areas, shift, residual=0.0), forwards * n


def add_shifts(moved: Any, previous: TangentialResult | None, grid: Any) -> Any:
    """Return the sum of a shift and those that led to the previous tractions."""
    if previous is None or (before := previous.total_shift) is None:
        return moved
    # One may be uniform, and the other a field.
    shape = grid.components, *previous.contact.shape  # With several ranks, of the rows of one.
    given, earlier = (check_shift(x, shape) for x in (moved, before))
    fields = (is_field(x, grid.components) for x in (moved, before))
    return as_given(given + earlier, is_field=any(fields))


def is_field(shift: Any, components: int) -> bool:
    """Whether a shift is given for each element, rather than for the whole bodies.

    The number of elements does not tell: a rank may have a single one.
    """
    return np.shape(shift) not in ((), (components,))


def as_given(shift: Array, *, is_field: bool = False) -> Any:
    """Return a shift, (components, ...), in the user's form: a field, or one for the bodies."""
    if is_field:
        return shift[0] if len(shift) == 1 else shift
    return float(shift.ravel()[0]) if len(shift) == 1 else shift.ravel()
