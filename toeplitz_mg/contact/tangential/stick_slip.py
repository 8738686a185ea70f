"""The areas of stick and slip: Coulomb's law and elasticity together, by Newton's method.

The elements that stick, and those that slide, are an active set. On a set Newton's method
linearises Coulomb's law: on an element that slides the traction turns on the circle |q| = g, and
the slip resists that with λ = |s|/g, so that a step v of the tractions solves

    Tᵀ (A + Λ) T v = Tᵀ (b - A q)

with T the tangent vectors. It is symmetric positive definite; conjugate gradients solve it only to
the accuracy at which the set, or the linearisation, is known to be wrong. (Without Λ this
converges for ν = 0 alone.)

The search knows the elements in contact only, as one axis, and conjugate gradients work in single
precision on the change of the tractions, which is added up in double precision.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.active_sets import Iterate, find_sets
from toeplitz_mg.contact.inverse import extend_to_components, invert_on
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.tangential.coulomb import (
    Areas,
    along,
    make_admissible,
    project,
    size,
    spread,
)
from toeplitz_mg.contact.tangential.problem import (
    SHARP,
    STIFFEST,
    Linearisation,
    Problem,
    State,
    linearise,
    refine_guess,
)
from toeplitz_mg.engine.conjugate_gradients import ConjugateGradients
from toeplitz_mg.operators import apply_to_rows

ETA = 1.0  # Misfit that is left on the areas, relative to their violation, while the energy falls.
COARSE_PRODUCTS = 200  # Most products on a coarser grid, whose answer is but a guess.
LOCAL = 0.5  # Part of 1/a₀ added to M where elements slide, where M alone is too small.
MOST = 200  # Iterations on fixed areas, after which rounding keeps them from the rest.
SINGLE = 1e-5  # Reduction of the misfit for which single precision is good.


def solve(
    problem: Problem,
    A: Products,
    guess: Array | None,
    *,
    nested: bool,
    areas: Areas | None = None,
) -> State:
    """Find the tractions and the areas of stick and slip.

    Parameters
    ----------
    problem : Problem
    A : Products
    guess : ndarray or None
        Admissible tractions to start from, that are not too far off.
    nested : bool
        Whether to start from the solution on coarser grids, where there is no guess.
    areas : Areas, optional
        Those of the guess; by default everything sticks.
    """
    if guess is None or areas is None:
        guess, areas = _first_guess(problem, guess, nested=nested)
    grid, C = problem.grid, problem.g > 0.0
    if not grid.vectors.count(C):
        nothing = np.zeros_like(problem.b)
        return State(nothing, nothing, areas, np.zeros(len(nothing)), residual=0.0)
    q = np.ascontiguousarray(guess[:, C])
    on_contact = problem.restrict(C)
    restricted = Products(grid.restrict(A.A, extend_to_components(grid, A.A, C)), A.limit)
    restricted.count = A.count
    search = Search(on_contact, lambda: invert_on(grid, A.A, C), grid.diagonal(A.A))
    now, law, iterations = find_sets(
        search,
        restricted,
        q,
        Areas(areas.stick[C], areas.slide[C]),
        b=on_contact.b,
        eta=ETA,
        tolerance=problem.tolerance,
        progress=problem.progress,
    )
    A.count = restricted.count
    return State(now.x, now.u, now.sets, law.shift, law.residual, iterations).extend(C)


@dataclass(frozen=True)
class Search:
    """A problem on the elements in contact, whose sets are the areas of stick and slip.

    Attributes
    ----------
    problem : Problem
        Its fields are of these elements.
    invert : callable
        Returns an approximate inverse, in the precision of the iterations. On a coarser grid the
        first guess may be good enough: then none is set up.
    unit : float
        The diagonal of A.
    """

    problem: Problem
    invert: Callable[[], Any]
    unit: float

    @cached_property
    def M(self) -> Any:
        """The approximate inverse."""
        return self.invert()

    def look(self, now: Iterate) -> Linearisation:
        """Return what is wrong with tractions and areas."""
        return linearise(self.problem, now.sets, now.x, now.u)

    def advance(
        self, A: Products, now: Iterate, law: Linearisation, eta: float
    ) -> tuple[Iterate, int]:
        """Make a step of Newton's method on the areas, and change them."""
        problem, areas, T, vectors = self.problem, now.sets, law.T, self.problem.vectors
        v, Av, count = self._newton_step(A, now, law, eta)
        q, u, is_exact = now.x + v, now.u + Av, False
        out = areas.stick & (size(q) > problem.g)
        back = areas.slide & (along(problem.balance(T, problem.b - u), T.n) < 0.0)
        on_circle = areas.slide | out
        areas = areas.exchange(out, back)
        if vectors.count(out) or (len(q) > 1 and vectors.count(on_circle)):
            q, areas = make_admissible(q, problem.g, areas, on_circle, problem.total, vectors)
            u, is_exact = A(q), True
        return Iterate(q, u, areas, is_exact), count

    def project(self, q: Array) -> Array:
        """Return the nearest tractions within the bound, of the given sum."""
        return project(q, self.problem.g, self.problem.total, self.problem.vectors)

    def sets_of(self, q: Array) -> Areas:
        """Return the areas of which those on the bound slide."""
        return Areas.of(q, self.problem.g)

    def _newton_step(
        self, A: Products, now: Iterate, law: Linearisation, eta: float
    ) -> tuple[Array, Array, int]:
        """Return a change of the tractions, that of the displacements, and the iterations."""
        problem, q, slide = self.problem, now.x, now.sets.slide
        M, a0, vectors = self.M, self.unit, problem.vectors
        # Where the energy did not fall, double precision is to tell what is left.
        dtype = M.dtype if eta == ETA else np.dtype(np.float64)
        T, misfit = law.T.astype(dtype), vectors.max(np.abs(law.r)) or 1.0
        lam = np.minimum(law.stiffness, STIFFEST * a0).astype(dtype)
        r = (law.r / misfit).astype(dtype)
        v, Av, Ad = (np.zeros_like(r) for _ in range(3))
        # Where elements slide, λ adds to A, and M, so scaled, is too small for what is smooth.
        weight = np.where(slide, 1.0 / np.sqrt(1.0 + law.stiffness / a0), 1.0).astype(dtype)
        local = np.where(slide, LOCAL / a0, 0.0).astype(dtype)

        def multiply(d: Array, out: Array) -> Array:
            return T(A(d, Ad) + lam * d)

        def precondition(r: Array, out: Array) -> Array:
            y = weight * r
            return T(weight * (apply_to_rows(M, y.reshape(-1)).reshape(y.shape) + local * y))

        iteration, count = ConjugateGradients(multiply, precondition, vectors), 0
        least = max(SHARP * problem.tolerance * law.scale / misfit, SINGLE * (dtype == np.float32))
        while count < MOST and not A.exhausted:
            # Three things may be wrong with the set, and with the linearisation: |q| > g where it
            # sticks, |q| > g where it slides (the circle is curved), and slip along the traction.
            excess = a0 * problem.excess(q + misfit * v)
            along_n = along(problem.balance(law.T, law.minus_slip - misfit * Av), law.T.n)
            wrong = max(excess, -vectors.min(along_n)) / misfit
            if vectors.max(np.abs(r)) <= max(least, eta * wrong):
                break
            length = iteration.step(r)
            if length == 0.0:
                break  # The rest is below the rounding of elements with far larger bounds.
            v = vectors.axpy(length, iteration.direction, v)
            Av = vectors.axpy(length, Ad, Av)
            r = vectors.axpy(-length, iteration.product, r)
            count += 1
        # Single precision leaves the tangents, and the sum that is given, by its rounding.
        return law.T(misfit * v.astype(np.float64)), misfit * Av.astype(np.float64), count


def _first_guess(problem: Problem, guess: Array | None, *, nested: bool) -> tuple[Array, Areas]:
    """Return admissible tractions to start from, and areas."""
    g, total = problem.g, problem.total
    everything_sticks = Areas(g > 0.0, np.zeros(g.shape, bool))
    if guess is not None:
        return guess, everything_sticks
    coarse = problem.coarser() if nested else None
    if coarse is not None:
        A = Products(coarse.grid.tangential(), COARSE_PRODUCTS)
        return refine_guess(problem, solve(coarse, A, None, nested=True))
    if total is None:
        return np.zeros(problem.b.shape), everything_sticks
    return spread(total, g, problem.vectors), everything_sticks
