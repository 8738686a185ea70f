"""Rolling contact in the steady state: tractions by creepage, or by force (Eq. 1-8).

Step by step (`steps`) the slip is s = w + A q - S q'. In the steady state, where q' = q, it is
s = w + K q with K = A - S. This is still a (block) Toeplitz matrix, though not symmetric: the
steady state is found directly, without marching.
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
# Rounding of what creepages leave of a slip that is given, over that slip, at most.
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
    """Roll steadily towards positive x, by creepages or forces: tractions, slip, areas of stick.

    Parameters
    ----------
    pressed : NormalResult
        The bodies that are pressed together, a result of `normal_contact`, with `mu`. Element and
        material are taken from it.
    element : (float, float) or float
        With a traction bound, size (h1, h2) of an element, mm. In line contact the width and the
        length of the strips, or the width alone: plane strain, with forces per mm of length.
    mu : float, or array_like of shape (n1, n2) or (n,)
        With a normal result, the coefficient of friction, of all elements or of each.
    bound : array_like of shape (n1, n2) or (n,)
        In the place of `pressed` and `mu`, the traction bound g = μ p of each element, N/mm²: zero
        outside the contact, and infinite where the bodies are bonded (μ = ∞). One axis is line
        contact.
    material : Material or (Material, Material)
        With a traction bound, of both bodies, or of the first and the second (see
        `contact.Material`).
    longitudinal, lateral : float
        Creepages: rigid slip along x and y over the distance rolled.
    spin : float
        The spin φ about the pole, 1/mm: rigid slip -φ y along x, φ x along y.
    force : (float, float) or float, optional
        The tangential force (Fx, Fy) on the first body in the place of creepages, which are then
        found, N; None in the place of one that is not given, as in (Fx, None). In line contact a
        number for the longitudinal one alone; in plane strain in N/mm. A force of μ P, to 1e-9 of
        it, lets all slide, by any creepages that are large enough: those that would be found, slip
        and power are NaN then.
    moment : float, optional
        The moment of the tractions about the pole, in the place of the spin, N mm.
    slip : array_like of shape (2, n1, n2), or (n,) in line contact, optional
        Rigid slip over the distance rolled that adds to that by creepages: of bodies that are not
        flat, or deform. In line contact also (2, n).
    pole : (float, float)
        The point that the spin turns about, and the moment is taken about, from the middle of the
        grid, mm.
    falling : callable or (float, float, float), optional
        Friction that depends on the slip: called as ``falling(s)`` with the size of the slip over
        the distance rolled in each element, it returns the factor of the bound there, at least
        zero. Of a speed v, the slip is at v s. The bound of the result is the product. Loads that
        the friction of no slip does not carry are reached by creepages, to 10 times the tolerance.
        A force that falls again beyond some creepage belongs to two: that is found which belongs
        to less slip, unless a `guess` is near the other.

        Three numbers (μ_s, μ_k, s₀) are μ(s) = μ_k + (μ_s - μ_k) exp(-s/s₀) with the same s: the
        coefficient without slip, in the place of `mu`, which is left out or equal, that of fast
        slip, and the slip over the distance rolled on which it falls. A `bound` is then μ_s p.
    guess : TangentialResult, optional
        A result of rolling on this grid, whose tractions and areas the search starts from, in the
        place of those of coarser grids.
    tolerance : float
        The violation of Coulomb's law, as in `friction`, over the largest rigid slip. What is left
        of a slip that is given counts down to the rounding of that: creepages may undo it.
    nested : bool
        Whether the first guess comes from coarser grids.
    max_products : int
        More products with the matrix than that, in all, are taken for a failure.
    progress : callable, optional
        Called as ``progress(products, residual)`` after each product, with the violation of the
        last areas; on coarser grids, where the first guess comes from, with 0 products.
    options : SteadyOptions, optional
        How long the search goes on before it rolls step by step.

    Returns
    -------
    TangentialResult
        The result has the slip over the distance rolled, and the creepages.

    Warns
    -----
    ContactWarning
        Where the contact is less than 10 elements across; where mu is above 2, but not infinite, or
        a creepage, that by spin at the contact's radius, above 0.1; where the bodies are unlike,
        as the coupling of normal and tangential tractions is left out (see
        `frictional_rolling`); and where a force lets all slide, so that creepages are NaN.
        `TangentialResult.warnings` lists them.

    Raises
    ------
    ValueError, TypeError
        For input that makes no sense, before any work.
    ContactError
        Where the tolerance is not reached: it says what is violated.

    See Also
    --------
    normal_contact : finds the pressures.
    rolling_steps : the way to the steady state.
    friction : of bodies that shift.

    Examples
    --------
    Carter: a cylinder that drives, sticks in 0.6 of its contact and carries 1 - 0.4² of μ P.

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

    Friction that falls from 0.3 to 0.2, by numbers:

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
    """Return what a result has of the loads that are given, for an error."""
    reached = ""
    if force is not None:
        given = tuple(F if F is None else float(F) for F in np.ravel(force).tolist())
        reached = f"; of the force {given if len(given) > 1 else given[0]} it has {result.force}"
    if moment is not None:
        reached += f"; of the moment {moment} it has {result.moment:.6g}"
    return reached


@dataclass(frozen=True)
class Rolled:
    """Arguments of `rolling`, checked; see there."""

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
        """Return the arguments, or say what is wrong with them.

        What is `asked` are the arguments of `Motion.of`.
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
    """Return what `rolling` finds for the traction bound `g`, converged or not.

    A force that is all that friction carries may let all slide, or else it is refused. Friction may
    depend on the slip, which `falling` takes to a factor.
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
        # What is left of parts that cancel each other may be their rounding.
        least = ROUNDING / asked.tolerance * h * given
        law = None
        if of_slip is not None:
            law = SlipLaw(of_slip, h, grid.diagonal(products.A)).within(window.extend, window.cut)
        problem = Problem(grid, g, b, asked.tolerance, least, progress, law)
        start = None
        # Without any slip or load there are no tractions: no guess is nearer.
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
        # The slip is of K, the displacements are of A.
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
    """Refuse loads that friction does not carry; return whether it carries them without slip."""
    vectors = window.grid.vectors
    try:
        motion.check_loads(window.whole, g)
        loads.check_share(window.cut(g), vectors)
        loads.check_beside(window.cut(g), b, vectors)
    except BeyondBound:  # The bound without slip says nothing of what is carried.
        if of_slip is None:
            raise
        most = np.max([of_slip(np.full(g.shape, s)) for s in SLIPS], axis=0)
        motion.check_loads(window.whole, most, ANY_SLIP)
        loads.check_share(window.cut(most), vectors, ANY_SLIP)
        return False
    return True


def _slide(grid: Grid, g: Array, asked: Rolled, total: Array) -> TangentialResult:
    """Return the result where all slides along a force, by any creepages that are large enough."""
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
    """Return the result, with the slip over the distance rolled, the moment and the power.

    The cost is in products, and in units of work. Before the steady state the bodies store some of
    the power of forces and creepages, and what slip dissipates is that of the tractions on it.
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
