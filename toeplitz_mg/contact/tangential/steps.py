"""Rolling step by step, towards the steady state or with changing bounds (Eq. 8).

The contact rolls towards positive x. A point at x now was at x + h before a step of one element, so
Eq. (8) reads, with the rigid slip w in a step,
    s = w + A q - S q',        (S q)(x) = (A q)(x + h).

Each step is a problem of friction, in which S q' - w are the displacements without slip.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Element, Numbers, Progress
from toeplitz_mg.contact import doubts
from toeplitz_mg.contact.checks import check_iteration, check_previous, check_rolled, is_lateral
from toeplitz_mg.contact.curves import RollingSteps
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.results import NormalResult, TangentialResult, check_converged
from toeplitz_mg.contact.results.base import remake
from toeplitz_mg.contact.tangential.law import Problem, admit, clip, drop_rounding
from toeplitz_mg.contact.tangential.loads import Loads
from toeplitz_mg.contact.tangential.motion import Motion
from toeplitz_mg.contact.tangential.rolling import make_rolling_result
from toeplitz_mg.contact.tangential.solving import solve_shifted
from toeplitz_mg.contact.window import MARGIN
from toeplitz_mg.engine.work import count_products
from toeplitz_mg.halfspace.materials import Bodies
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.values import count, in_unit


def rolling_steps(
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
    slip: ArrayLike | None = None,
    pole: tuple[float, float] = (0.0, 0.0),
    steps: int,
    previous: TangentialResult | None = None,
    tolerance: float = 1e-8,
    max_products: int = 2000,
    progress: Progress | None = None,
    keep: bool = True,
) -> RollingSteps:
    """Roll step by step from given tractions: one element per step (Eq. 8).

    Parameters
    ----------
    pressed, element, mu, bound, material, longitudinal, lateral, spin, slip, pole
        As for `rolling`.
    tolerance, max_products
        As for `rolling`, for each step.
    force : (float, float) or float, optional
        Tangential force (Fx, Fy) in each step, N, instead of creepages, which are then found. None
        leaves a component free. In line contact a number is the longitudinal force.
    steps : int
        The number of steps.
    previous : TangentialResult, optional
        Tractions before the first step: a result of any function for tangential contact on this
        grid; by default zero. To follow changing bounds, creepages or forces, call with ``steps=1``
        for each change.
    progress : callable, optional
        Called as ``progress(products, residual)`` after each product of a step.
    keep : bool
        Whether the results of all steps are kept. Otherwise only their numbers are kept.

    Returns
    -------
    RollingSteps
        An iterator that computes the result of each step on request, with the slip divided by the
        distance rolled, and with the methods `plot`, `to_dataframe`, `to_xarray` and `save`.

    Warns
    -----
    ContactWarning
        As for `rolling`, once for all steps.

    Raises
    ------
    ValueError, TypeError
        If the input is invalid. It is checked before any work.
    ContactError
        If the iteration does not converge. The message names the violated condition.

    See Also
    --------
    rolling : computes the steady state directly.

    Examples
    --------
    >>> import numpy as np
    >>> from toeplitz_mg.contact import Material, rolling, rolling_steps
    >>> x = np.linspace(-0.95, 0.95, 20)
    >>> g, soft = 0.3 * np.sqrt(1 - x**2), Material.from_shear(1.0, 0.3)
    >>> case = dict(bound=g, element=0.1, material=soft, longitudinal=-0.1)
    >>> *_, last = rolling_steps(steps=60, **case)
    >>> bool(np.allclose(last.traction, rolling(**case).traction, atol=1e-6))
    True
    """
    g, element, material = check_rolled(pressed, bound, element, material, mu)
    grid = Grid.of(g.shape, element, material, None)
    force = in_unit("force", force, grid.force_unit)
    motion = (longitudinal, lateral, spin), force, None, slip, pole
    search = tolerance, max_products, progress
    asked = grid.agree(Stepped.of, grid, g.shape, motion, steps, previous, *search)
    about = doubts.examine_friction(grid, mu)
    results = roll_steps(grid, g, asked, progress, about)
    return RollingSteps(results, asked.steps, bool(keep))


@dataclass(frozen=True)
class Stepped:
    """The checked arguments of `rolling_steps`; `previous` are the tractions."""

    motion: Motion
    steps: int
    tolerance: float
    max_products: int
    previous: Array | None = field(compare=False)

    @classmethod
    def of(
        cls,
        grid: Grid,
        shape: tuple[int, ...],
        asked: tuple[Any, ...],
        steps: int,
        previous: TangentialResult | None,
        tolerance: float,
        max_products: int,
        progress: Progress | None,
    ) -> Self:
        """Return the checked arguments, or raise an error (see `rolling.Rolled`)."""
        motion = Motion.of(shape, *asked, beside_lateral=is_lateral(previous))
        check_iteration(tolerance, max_products, progress)
        steps, q = count("steps", steps), None
        if previous is not None:
            q = check_previous(previous, grid, (len(motion.directions), *shape))
        return cls(motion, steps, tolerance, max_products, q)


def roll_steps(
    grid: Grid, g: Array, asked: Stepped, progress: Progress | None, about: tuple[str, ...] = ()
) -> Iterator[TangentialResult]:
    """Yield the results of `rolling_steps` for the traction bound `g` (see `roll`)."""
    motion, tolerance = asked.motion, asked.tolerance
    q = np.zeros((len(motion.directions), *g.shape)) if asked.previous is None else asked.previous
    if grid.directions != motion.directions:
        grid = replace(grid, directions=motion.directions)
    g = drop_rounding(g, grid.vectors)
    motion.check_loads(grid, g)
    h = grid.element[0]
    total = None
    if unknown := list(motion.unknown):
        total = np.full(len(q), np.nan)
        total[unknown] = motion.wanted / grid.area
    w = h * motion.rigid_slip(grid)
    area = grid.area * grid.vectors.count(g > 0.0)
    about = (
        *doubts.examine_bound(grid, g > 0.0),
        *doubts.examine_creepages(motion.creepages, area),
        *about,
    )
    window = grid.window((g > 0.0) | q.any(axis=0), MARGIN)
    q, g, w, grid = window.cut(q), window.cut(g), window.cut(w), window.grid
    vectors, loads = grid.vectors, Loads.of_sums(total, q)

    doubts.warn(about, within=1 + window.whole.callers)

    def march(q: Array) -> Iterator[TangentialResult]:
        A, S = grid.tangential(), grid.upstream()
        for _ in range(asked.steps):
            with count_products() as work:
                products = Products(A, asked.max_products)
                b = apply_to_rows(S, q.reshape(-1)).reshape(q.shape) - w
                least = vectors.max(np.abs(w))
                problem = Problem(grid, g, b, asked.tolerance, least, progress)
                guess = admit(problem, clip(q, g), np.zeros(g.shape, bool))
                state = solve_shifted(problem, loads, products, guess, nested=False)
            cost = products.count + 1, products.units(work)
            state, cost = window.same((state, cost))
            q, slip = state.q, (state.u - b - vectors.combine(state.shift, loads.units)) / h
            found = motion.complete(-state.shift / h)
            result = make_rolling_result(
                motion, problem, state, window, cost, slip, found, is_steady=False
            )
            yield check_converged(remake(result, warnings=about), tolerance)

    return march(q)
