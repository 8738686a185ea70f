"""Steady rolling contact: tractions for given creepages or forces (Eq. 1-8).

Step by step (`steps`) the slip is s = w + A q - S q'. In the steady state q' = q, so s = w + K q
with K = A - S. K is a (block) Toeplitz matrix too, though not symmetric. So the steady state is
computed directly, without marching.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Element, Numbers, Progress
from toeplitz_mg.contact import doubts
from toeplitz_mg.contact.checks import check_iteration, check_previous, check_rolled, is_lateral
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.results import NormalResult, TangentialResult, check_converged
from toeplitz_mg.contact.tangential.by_loads import SLIPS, check_loads, find_by_slip
from toeplitz_mg.contact.tangential.falling import Law, examine, follow, multiply, read_law
from toeplitz_mg.contact.tangential.friction import make_result, slide_off
from toeplitz_mg.contact.tangential.law import ROUNDING as ROUNDED
from toeplitz_mg.contact.tangential.law import (
    Problem,
    SlipLaw,
    State,
    admit,
    drop_rounding,
    size,
)
from toeplitz_mg.contact.tangential.loads import Loads
from toeplitz_mg.contact.tangential.motion import LOADS, BeyondBound, Motion
from toeplitz_mg.contact.tangential.solving import SteadyOptions, find_steady_state
from toeplitz_mg.engine.work import count_products
from toeplitz_mg.halfspace.materials import Bodies
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.values import in_unit

ANY_SLIP = "friction at any slip"
# Rounding errors up to this share of a given slip remain if creepages cancel it.
ROUNDING = 1000.0 * float(np.finfo(np.float64).eps)


def rolling(
    pressed: NormalResult | None = None,
    element: Element | None = None,
    *,
    mu: Numbers | None = None,
    bound: Numbers | None = None,
    material: Bodies | None = None,
    longitudinal: float = 0.0,
    lateral: float = 0.0,
    spin: float = 0.0,
    force: Any = None,
    moment: float | None = None,
    slip: ArrayLike | None = None,
    pole: tuple[float, float] = (0.0, 0.0),
    falling: Law | None = None,
    guess: TangentialResult | None = None,
    tolerance: float = 1e-8,
    nested: bool = True,
    max_products: int = 2000,
    progress: Progress | None = None,
    options: SteadyOptions | None = None,
) -> TangentialResult:
    """Roll steadily towards positive x: find tractions, slip and the areas of stick and slip.

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
    longitudinal, lateral : float
        Creepages: rigid slip along x and y, divided by the distance rolled.
    spin : float
        Spin φ about the pole, 1/mm: rigid slip -φ y along x and φ x along y.
    force : (float, float) or float, optional
        Tangential force (Fx, Fy) on the first body, N, instead of creepages, which are then found.
        None leaves a component free, as in (Fx, None). In line contact a number is the longitudinal
        force; in plane strain in N/mm. A force of μ P, to within 1e-9, makes all elements slide at
        any sufficiently large creepages; then the free creepages, slip and power are NaN.
    moment : float, optional
        Moment of the tractions about the pole, N mm, instead of the spin.
    slip : array_like of shape (2, n1, n2), or (n,) in line contact, optional
        Rigid slip, divided by the distance rolled, that is added to that of the creepages, for
        bodies that are not flat or deform. In line contact also (2, n).
    pole : (float, float)
        The point about which the spin and the moment are taken, relative to the middle of the grid,
        mm.
    falling : callable or (float, float, float), optional
        Friction that depends on the slip. ``falling(s)`` gets the magnitude of the slip in each
        element, divided by the distance rolled, and returns the factor of the bound there, at least
        zero. At a speed v, the slip velocity is v s. The bound of the result includes the factor.
        Loads beyond the friction at zero slip are found by varying the creepages, to 10 times the
        tolerance. If the force falls beyond some creepage, two creepages have the same force: the
        result is the one with less slip, unless `guess` is closer to the other.

        Three numbers (μ_s, μ_k, s₀) mean μ(s) = μ_k + (μ_s - μ_k) exp(-s/s₀) with the same s: the
        coefficient without slip, which replaces `mu`, the one for fast slip, and the slip at which
        it decays. A `bound` is then μ_s p.
    guess : TangentialResult, optional
        A result of rolling on this grid, whose tractions and areas are the initial guess instead of
        those from coarser grids.
    tolerance : float
        Allowed violation of Coulomb's law, as in `friction`, relative to the largest rigid slip. If
        creepages cancel most of a given slip, the remainder counts, unless it is rounding.
    nested : bool
        Whether to compute the initial guess on coarser grids.
    max_products : int
        Limit of matrix-vector products in total; beyond it the search fails with a `ContactError`.
    progress : callable, optional
        Called as ``progress(products, residual)`` after each product, with the violation for the
        last areas; while the initial guess is computed on coarser grids, with 0 products.
    options : SteadyOptions, optional
        Limits of the direct search, after which it rolls step by step.

    Returns
    -------
    TangentialResult
        With the creepages, and the slip divided by the distance rolled.

    Warns
    -----
    ContactWarning
        If the input looks wrong: the contact is less than 10 elements across; mu is above 2, but
        finite; a creepage, or the spin times the contact radius, is above 0.1; or the bodies are
        unlike, as the coupling of normal and tangential tractions is neglected (see
        `frictional_rolling`). Also if a force makes all elements slide, so that creepages are NaN.
        `TangentialResult.warnings` lists all warnings.

    Raises
    ------
    ValueError, TypeError
        If the input is invalid. It is checked before any work.
    ContactError
        If the iteration does not converge. The message names the violated condition.

    See Also
    --------
    normal_contact : computes the pressures.
    rolling_steps : the transient to the steady state.
    friction : for bodies that are shifted.

    Examples
    --------
    Carter: a driving cylinder sticks in 0.6 of its contact and carries 1 - 0.4² of μ P.

    >>> import numpy as np
    >>> from toeplitz_mg.contact import surfaces
    >>> from toeplitz_mg.contact import Material, rolling
    >>> mu, a, R, G, nu = 0.3, 4.0, 500.0, 82000.0, 0.28
    >>> (x,) = surfaces.centres(200, 0.05)
    >>> p = G / (1 - nu) * np.sqrt(np.maximum(a**2 - x**2, 0.0)) / (2 * R)
    >>> creepage = -mu * (a - 0.6 * a) / R
    >>> rolled = rolling(
    ...     bound=mu * p, element=0.05, material=Material.from_shear(G, nu), longitudinal=creepage
    ... )
    >>> bool(abs(rolled.force / (mu * p.sum() * 0.05) - (1 - 0.6**2)) < 0.01)
    True

    Friction that falls from 0.3 to 0.2:

    >>> falls = rolling(
    ...     bound=mu * p, element=0.05, material=Material.from_shear(G, nu), longitudinal=-0.02,
    ...     falling=(0.3, 0.2, 0.005),
    ... )
    >>> round(float(falls.force / (mu * p.sum() * 0.05)), 2)  # Of μ_s P.
    0.67
    """
    mu, factor = read_law(falling, mu, bound)
    g, element, material = check_rolled(pressed, bound, element, material, mu)
    grid = Grid.of(g.shape, element, material, None)
    force = in_unit("force", force, grid.force_unit)
    asked = (longitudinal, lateral, spin), force, moment, slip, pole
    search = tolerance, nested, max_products, progress, options, guess
    rolled = grid.agree(Rolled.of, g.shape, asked, *search)
    result = roll(grid, g, rolled, progress, guess, may_slide=factor is None, falling=factor)
    result = doubts.add(result, doubts.examine_friction(grid, mu))
    check_converged(result, tolerance, compare_loads(result, force, moment))
    known = getattr(pressed, "warnings", ())
    doubts.warn(result.warnings, within=grid.callers, known=known)
    return result


def compare_loads(result: TangentialResult, force: Any, moment: float | None) -> str:
    """Return how the loads of a result compare with the given ones, for an error message."""
    reached = ""
    if force is not None:
        given = tuple(F if F is None else float(F) for F in np.ravel(force).tolist())
        reached = f"; of the force {given if len(given) > 1 else given[0]} it has {result.force}"
    if moment is not None:
        reached += f"; of the moment {moment} it has {result.moment:.6g}"
    return reached


@dataclass(frozen=True)
class Rolled:
    """The checked arguments of `rolling`."""

    motion: Motion
    tolerance: float
    nested: bool
    max_products: int
    options: SteadyOptions

    @classmethod
    def of(
        cls,
        shape: tuple[int, ...],
        asked: tuple[Any, ...],
        tolerance: float,
        nested: bool,
        max_products: int,
        progress: Progress | None,
        options: SteadyOptions | None,
        guess: TangentialResult | None = None,
    ) -> Self:
        """Return the checked arguments, or raise an error.

        `asked` are the arguments of `Motion.of`.
        """
        motion = Motion.of(shape, *asked, beside_lateral=is_lateral(guess))
        check_iteration(tolerance, max_products, progress)
        if not isinstance(options, SteadyOptions | None):
            raise TypeError(f"options is {options!r}, but must be contact.SteadyOptions(...)")
        return cls(motion, tolerance, bool(nested), max_products, options or SteadyOptions())


def roll(
    grid: Grid,
    g: Array,
    asked: Rolled,
    progress: Progress | None,
    guess: TangentialResult | None = None,
    *,
    may_slide: bool = False,
    falling: Callable[[Array], ArrayLike] | None = None,
) -> TangentialResult:
    """Return the result of `rolling` for the traction bound `g`, converged or not.

    A force equal to all that friction can carry makes all elements slide, or else is refused.
    `falling` gives the factor of the friction for a slip.
    """
    motion = asked.motion
    if grid.directions != motion.directions:
        grid = replace(grid, directions=motion.directions)
    g = drop_rounding(g, grid.vectors)
    if may_slide and (total := motion.find_sliding(grid, g)) is not None:
        return _slide(grid, g, asked, total)
    of_slip = falling and partial(multiply, g, falling)
    if of_slip is not None:
        g = of_slip(np.zeros(g.shape))
    before = None
    if guess is not None:
        q = check_previous(guess, grid, (grid.components, *g.shape), is_guess=True)
        before = q, guess.contact & ~guess.stick
    h, given = grid.element[0], motion.largest_slip(grid, g > 0.0)
    with count_products() as work:
        window = grid.window(g > 0.0)
        b = -h * window.cut(motion.rigid_slip(grid))
        loads = Loads(
            -h * window.cut(motion.units(grid)), window.cut(motion.arms(grid)), motion.wanted
        )
        is_carried = _check_loads(motion, window, loads, b, g, of_slip)
        grid, g = window.grid, window.cut(g)
        A = grid.tangential()
        products = Products(grid.steady(A), asked.max_products)
        # If terms cancel each other, what is left may be rounding.
        least = ROUNDING / asked.tolerance * h * given
        law = None
        if of_slip is not None:
            law = SlipLaw(of_slip, h, grid.diagonal(products.A)).within(window.extend, window.cut)
        problem = Problem(grid, g, b, asked.tolerance, least, progress, law)
        start = None
        # Without slip and load there are no tractions, so no guess is needed.
        if before is not None and (problem.largest > 0.0 or loads.wanted.any()):
            start = admit(problem, *(window.cut(x) for x in before))
        find = partial(find_steady_state, K=products, nested=asked.nested, options=asked.options)
        state = follow(find, products, problem, loads, start) if is_carried else None
        is_found = state is not None and state.residual <= asked.tolerance
        if state is None or (law is not None and loads.wanted.size and not is_found):
            state = find_by_slip(find, products, problem, loads)
        if law is not None:
            g = np.where(state.areas.slide, (1.0 + ROUNDED) * size(state.q), g)
            problem = replace(problem, g=g)
        if loads.wanted.size:
            problem = replace(problem, b=b + grid.vectors.combine(state.shift, loads.units))
        # The slip follows from K, the displacements from A.
        u = np.where(g > 0.0, apply_to_rows(A, state.q.reshape(-1)).reshape(b.shape), 0.0)
    slip, state = (state.u - problem.b) / h, replace(state, u=u)
    cost = products.count + 1, products.units(work)
    state, slip, cost = window.same((state, slip, cost))
    found = motion.complete(state.shift)
    result = make_rolling_result(motion, problem, state, window, cost, slip, found, is_steady=True)
    doubted = motion.doubts(window.whole, result)
    if of_slip is not None:
        doubted += examine(result, of_slip, asked.tolerance, products)
        check_loads([LOADS[k] for k in motion.unknown], loads, state.q, result, asked.tolerance)
    return doubts.add(result, doubted)


def _check_loads(
    motion: Motion,
    window: Any,
    loads: Loads,
    b: Array,
    g: Array,
    of_slip: Callable[[Array], Array] | None,
) -> bool:
    """Refuse loads that friction cannot carry; return whether it can without slip."""
    vectors = window.grid.vectors
    try:
        motion.check_loads(window.whole, g)
        loads.check_share(window.cut(g), vectors)
        loads.check_beside(window.cut(g), b, vectors)
    except BeyondBound:  # With falling friction, the bound without slip is no limit.
        if of_slip is None:
            raise
        most = np.max([of_slip(np.full(g.shape, s)) for s in SLIPS], axis=0)
        motion.check_loads(window.whole, most, ANY_SLIP)
        loads.check_share(window.cut(most), vectors, ANY_SLIP)
        return False
    return True


def _slide(grid: Grid, g: Array, asked: Rolled, total: Array) -> TangentialResult:
    """Return the result in which all elements slide along a force, at any large creepages."""
    motion, window = asked.motion, grid.window(g > 0.0)
    g = window.cut(g)
    with count_products() as work:
        products = Products(window.grid.tangential(), asked.max_products)
        b = np.zeros((grid.components, *g.shape))
        problem = Problem(window.grid, g, b, asked.tolerance)
        state, slip = slide_off(problem, total, products)
    slip, found = np.full_like(slip, np.nan), motion.complete(np.full(len(motion.unknown), np.nan))
    cost = products.count, products.units(work)
    state, cost = window.same((state, cost))
    result = make_rolling_result(motion, problem, state, window, cost, slip, found, is_steady=True)
    return doubts.add(result, (doubts.UNDETERMINED,))


def make_rolling_result(
    motion: Motion,
    problem: Problem,
    state: State,
    window: Any,
    cost: tuple[int, float],
    slip: Array,
    creepages: Array,
    *,
    is_steady: bool,
) -> TangentialResult:
    """Return the result, with the slip divided by the distance rolled, the moment and the power.

    The cost is in products and in work units. Before the steady state the bodies store part of the
    power of forces and creepages, so the dissipation is computed from tractions and slip.
    """
    loads, power = motion.work(window.whole, window.extend(state.q), creepages)
    more: dict[str, Any] = {"power": power} if is_steady else {}
    return make_result(
        problem,
        state,
        window,
        *cost,
        slip,
        shift=None,
        creepages=creepages if len(state.q) > 1 else float(creepages[0]),
        moment=float(loads[2]) if len(loads) > 2 else None,
        **more,
    )
