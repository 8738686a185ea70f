"""The steady state of rolling, directly: the areas of stick and slip for a matrix not symmetric.

The areas and Newton's method are those of `stick_slip`, with K = A - S in the place of A. As K is
not symmetric, GMRES takes the place of conjugate gradients, and there is no energy that each change
of the areas should lower (`active_sets`): progress is a smaller residual, and where there is none
for long, rolling step by step leads on.

GMRES is preconditioned by inverses of the symbol of K, â(θ)(1 - e^{iθ₁}), plus ν, for a few ν.
Where elements stick it is K that is to be inverted, and where they slide K + λ, with λ of any size:
in each place the inverses are interpolated to its λ. So the products hardly depend on the number of
elements. (With one ν for all, they doubled from 128² elements to 512².)

Where forces are given, the creepages that belong to them are unknowns as the tractions are, and
Newton's method is for all at once. A change of the tractions takes up what is missing of the
forces; the rest of it is orthogonal to the fields whose inner products with tractions the forces
are, and the slip that it removes to the rigid slip by unknown creepages, which follow from that. So
a case by force takes about as many products as one by creepage.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.tangential.coulomb import (
    Areas,
    Tangent,
    along,
    clip,
    make_admissible,
    size,
)
from toeplitz_mg.contact.tangential.motion import Complement, inner_products
from toeplitz_mg.contact.tangential.stick_slip import (
    COARSE_PRODUCTS,
    SHARP,
    STIFFEST,
    Linearisation,
    Problem,
    State,
    linearise,
    refine_guess,
    solve,
)
from toeplitz_mg.engine.krylov_space import KrylovSpace
from toeplitz_mg.engine.vectors import Vectors
from toeplitz_mg.operators import apply_to_rows

REDUCTION = 0.01  # Reduction of the residual by one solution where the problem is linearised.
SINGLE = 1e-5  # Reduction of the residual for which single precision is good.
LEAST_UNIT, MOST_UNIT = 1e-12, 1e12  # Least and largest diagonal of K in its range.
BETTER = 0.9  # Factor of the least residual so far, below which a new one is progress.
CARRYING = 8  # Attempts to restore the loads without a product: the rest is left to the next step.
CARRIED = 1e-12  # Part of the loads that is missing which is rounding.
STEP_TOLERANCE = 1e-6  # Tolerance of a step of rolling that only leads to the steady state.


@dataclass(frozen=True)
class SteadyOptions:
    """How long the search for the steady state of rolling goes on.

    Attributes
    ----------
    iterations : int
        Most iterations of GMRES between two changes of the areas, all of whose vectors are kept.
    patience : int
        Changes of the areas without a smaller residual, after which it rolls step by step over the
        length of the grid, and searches on from there.

    See Also
    --------
    rolling : takes it as ``options=``.
    """

    iterations: int = 60
    patience: int = 30


@dataclass(frozen=True)
class Loads:
    """Loads that are given in the place of creepages.

    Attributes
    ----------
    units : ndarray of shape (m, components, ...)
        The displacements in a step, were there no slip, by a unit of each unknown creepage: minus
        the rigid slip.
    arms : ndarray of shape (m, components, ...)
        Fields whose inner products with the tractions are the loads.
    wanted : ndarray of shape (m,)
        The loads.
    """

    units: Array
    arms: Array
    wanted: Array

    def missing(self, q: Array, vectors: Vectors) -> Array:
        """Return what is missing of the loads."""
        return self.wanted - inner_products(self.arms, q, vectors)

    def error(self, q: Array, vectors: Vectors) -> float:
        """Return the largest part of a load that is missing, of what tractions of a sign give."""
        if not len(self.wanted):
            return 0.0
        missing = np.abs(self.missing(q, vectors))
        carried = np.array([vectors.sum(np.abs(arm * q)) for arm in self.arms])
        scale = np.maximum(carried, np.abs(self.wanted))
        # A load of zero has the scale of the others, in the unit of its own tractions.
        sizes = [vectors.sum(size(arm) * size(q)) for arm in self.arms]
        scale = np.maximum(scale, sizes)
        return float(np.max(missing / np.where(scale > 0.0, scale, 1.0)))


@dataclass(frozen=True)
class Look:
    """What is wrong with tractions whose creepages are unknown, as far as loads are given.

    Attributes
    ----------
    law : Linearisation
        Coulomb's law, with the creepages that suit the tractions best.
    creepages : ndarray of shape (m,)
        Those of them that are unknown.
    b : ndarray
        The displacements in a step, were there no slip, with these creepages.
    missing : ndarray of shape (m,)
        What is missing of the loads.
    residual : float
    """

    law: Linearisation
    creepages: Array
    b: Array
    missing: Array
    residual: float


def look(problem: Problem, loads: Loads, areas: Areas, q: Array, u: Array) -> Look:
    """Say what is wrong with tractions q, with the displacements u = K q."""
    vectors, b, creepages = problem.vectors, problem.b, loads.wanted
    if len(loads.wanted):
        T = Tangent(areas, q, vectors, balanced=())
        creepages = _complement(loads.units, T, vectors).coordinates(T(u - b))
        b = b + vectors.combine(creepages, loads.units)
        problem = replace(problem, b=b)
    law = linearise(problem, areas, q, u)
    missing, error = loads.missing(q, vectors), loads.error(q, vectors)
    return Look(law, creepages, b, missing, max(law.residual, error))


def _complement(fields: Array, T: Tangent, vectors: Vectors) -> Complement:
    """Return the complement of some fields among the tangents."""
    return Complement(np.array([T(f) for f in fields]).reshape(fields.shape), vectors)


def find_steady_state(
    problem: Problem,
    K: Products,
    loads: Loads,
    *,
    guess: tuple[Array, Areas] | None = None,
    nested: bool,
    options: SteadyOptions,
) -> State:
    """Find the tractions and the areas of stick and slip of the steady state.

    Parameters
    ----------
    problem : Problem
        Its b is minus the rigid slip in a step of one element, by what is given of it.
    K : Products
        Products with A - S.
    loads : Loads
        The loads that are given in the place of creepages.
    guess : (ndarray, Areas), optional
        Admissible tractions and areas to start from.
    nested : bool
        Whether to start from the solution on coarser grids, where there is no guess.
    options : SteadyOptions

    Returns
    -------
    State
        Its shift is the unknown creepages.
    """
    g, vectors = problem.g, problem.vectors
    q, areas = guess or _first_guess(problem, loads, nested=nested, options=options)
    q = _carry(problem, loads, areas, q)
    u = K(q) if vectors.count(q) else np.zeros_like(q)
    k0 = problem.grid.diagonal(K.A)
    dtype = np.float32 if LEAST_UNIT < k0 < MOST_UNIT else np.float64
    M, dense = None, problem.grid.steady_array(K.A)
    best, patience = np.inf, options.patience
    iterations: list[int] = []
    while True:
        now = look(problem, loads, areas, q, u)
        if now.residual <= problem.tolerance or K.exhausted:
            return State(q, u, areas, now.creepages, now.residual, tuple(iterations))
        K.progress, K.residual = problem.progress, now.residual
        if dense is not None:
            v, count = _direct_step(loads, now, areas, dense), 1
        else:
            if M is None:
                M = problem.grid.invert_shifted(K.A, dtype)
            v, count = _newton_step(problem, loads, now, areas, q, K, M, options)
        iterations.append(count)
        q = q + v
        out = areas.stick & (size(q) > g)
        on_circle = areas.slide | out
        q, _ = make_admissible(q, g, areas, on_circle, None, vectors)
        q = _carry(problem, loads, areas.exchange(out, np.zeros_like(out)), q)
        u = K(q)
        b = now.b
        if len(loads.wanted):
            b = look(problem, loads, areas.exchange(out, np.zeros_like(out)), q, u).b
        back = areas.slide & (along(b - u, now.law.T.n) < 0.0)
        areas = areas.exchange(out, back)
        patience = options.patience if now.residual < BETTER * best else patience - 1
        best = min(best, now.residual)
        if patience == 0:
            q, areas = _roll_on(replace(problem, b=now.b), q, K)
            u, best, patience = K(q), np.inf, options.patience


def _carry(problem: Problem, loads: Loads, areas: Areas, q: Array) -> Array:
    """Change tractions so that they carry the loads, as far as they can in these areas."""
    vectors = problem.vectors
    for _ in range(CARRYING if len(loads.wanted) else 0):
        if loads.error(q, vectors) <= CARRIED:
            break
        T = Tangent(areas, q, vectors, balanced=())
        v = _complement(loads.arms, T, vectors).reach(loads.missing(q, vectors))
        q, _ = make_admissible(q + v, problem.g, areas, areas.slide, None, vectors)
    return q


def _direct_step(loads: Loads, now: Look, areas: Areas, K: Array) -> Array:
    """Return the change of the tractions by Newton's method, from the matrix as an array."""
    law, components, size = now.law, len(now.law.r), areas.stick.size
    # The tangents: each direction where it sticks, and across the traction where it slides.
    stuck = np.flatnonzero(areas.stick)
    stuck = np.concatenate([stuck + k * size for k in range(components)])
    turning = np.flatnonzero(areas.slide) if components == 2 else stuck[:0]
    # The unit vector (x, y) is across the traction, which points along (y, -x).
    y, x = law.T.n.reshape(2, size)[:, turning] if len(turning) else np.zeros((2, 0))
    x = -x

    def on_tangents(v: Array) -> Array:
        """Return the components of vectors, the columns of an array, along the tangents."""
        if not len(turning):
            return v[stuck]
        across = x[:, None] * v[turning] + y[:, None] * v[turning + size]
        return np.concatenate([v[stuck], across])

    n, m = len(stuck) + len(turning), len(loads.wanted)
    v = np.zeros(law.r.size)
    if n == 0:
        return v.reshape(law.r.shape)
    system, right = np.zeros((n + m, n + m)), np.concatenate([np.empty(n), now.missing])
    system[:n, :n] = on_tangents(on_tangents(K).T).T
    last = np.arange(len(stuck), n)
    system[last, last] += law.stiffness.reshape(-1)[turning]
    right[:n] = on_tangents(law.r.reshape(-1, 1))[:, 0]
    if m:
        system[:n, n:] = -on_tangents(loads.units.reshape(m, -1).T)
        system[n:, :n] = on_tangents(loads.arms.reshape(m, -1).T).T
        # Where too little sticks, the loads have no change of the tractions that restores them.
        change = np.linalg.lstsq(system, right)[0]
    else:
        change = np.linalg.solve(system, right)
    v[stuck] = change[: len(stuck)]
    if len(turning):
        v[turning], v[turning + size] = x * change[last], y * change[last]
    return v.reshape(law.r.shape)


def _newton_step(
    problem: Problem,
    loads: Loads,
    now: Look,
    areas: Areas,
    q: Array,
    K: Products,
    M: Any,
    options: SteadyOptions,
) -> tuple[Array, int]:
    """Return a change of the tractions, and the iterations."""
    law, vectors = now.law, problem.vectors
    T, lam, r = law.T, law.stiffness, law.r
    k0 = problem.grid.diagonal(K.A)
    invert = M.at(np.where(areas.slide, lam, 0.0))
    of_slip = _complement(loads.units, T, vectors)
    of_tractions = _complement(loads.arms, T, vectors)
    first = np.zeros_like(q)
    if loads.error(q, vectors) > CARRIED:
        first = of_tractions.reach(now.missing)
        r = of_slip(r - T(K(first)) - lam * first)
    if vectors.norm(r) == 0.0:
        return first, 0
    largest = vectors.max(np.abs(r))
    exact = max(SHARP * problem.tolerance * law.scale, SINGLE * largest)
    if len(r) > 1 and vectors.count(areas.slide):  # The circle |q| = g is linearised.
        exact = max(exact, REDUCTION * largest)
    most = min(options.iterations, max(1, K.limit - K.count))
    # All of them are kept, so that what is wrong with each iterate is told without a product more.
    directions = np.empty((most, *r.shape), M.dtype)
    along_n = np.empty((most, *r.shape[1:]), M.dtype)
    T, lam = T.astype(M.dtype), np.minimum(lam, STIFFEST * k0).astype(M.dtype)

    def multiply(v: Array, out: Array) -> Array:
        d = directions[space.dimension]
        d[...] = of_tractions(T(invert(T(v))))
        Kd = K(d)
        along_n[space.dimension] = along(Kd, T.n)
        return of_slip(T(Kd) + lam * d)

    space = KrylovSpace(multiply, r.shape, M.dtype, most, vectors)
    space.begin(r)
    against = along(law.minus_slip, law.T.n)
    while True:
        space.extend()
        weights, k = space.weights(), space.dimension
        v = first + vectors.combine(weights, directions[:k])
        slips = vectors.min(against - vectors.combine(weights, along_n[:k]))
        goal = max(exact, k0 * problem.excess(q + v), -slips)
        if vectors.max(np.abs(space.residual())) <= goal or k == most:
            return v, k


def _first_guess(
    problem: Problem, loads: Loads, *, nested: bool, options: SteadyOptions
) -> tuple[Array, Areas]:
    coarse = problem.coarser() if nested else None
    if coarse is None:
        return np.zeros(problem.b.shape), Areas(problem.g > 0.0, np.zeros(problem.g.shape, bool))
    # The rigid slip in a step is in proportion to the step.
    fine, grid = problem.grid, coarse.grid
    longer = grid.element[0] / fine.element[0]
    coarse = replace(coarse, b=coarse.b * longer)
    units, arms = (_coarsen_each(fine, fields, coarse.b) for fields in (loads.units, loads.arms))
    loads = Loads(longer * units, grid.area / fine.area * arms, loads.wanted)
    K = Products(grid.steady(grid.tangential()), COARSE_PRODUCTS)
    return refine_guess(problem, find_steady_state(coarse, K, loads, nested=True, options=options))


def start_from(problem: Problem, q: Array, slide: Array) -> tuple[Array, Areas]:
    """Return admissible tractions and areas to start from, of another case."""
    contact = problem.g > 0.0
    q = np.where(contact, q, 0.0)
    slide = slide & contact & np.isfinite(problem.g) & (size(q) > 0.0)
    areas = Areas(contact & ~slide, slide)
    return make_admissible(q, problem.g, areas, slide, None, problem.vectors)


def _coarsen_each(grid: Any, fields: Array, like: Array) -> Array:
    """Return the averages of fields on the coarser grid."""
    return np.array([grid.coarsen(f) for f in fields]).reshape(len(fields), *like.shape)


def _roll_on(problem: Problem, q: Array, K: Products) -> tuple[Array, Areas]:
    """Roll over the length of the grid step by step (Eq. 8): slow, but towards the steady state."""
    A, S = problem.grid.tangential(), problem.grid.upstream()
    for _ in range(problem.grid.shape[0]):
        b = problem.b + apply_to_rows(S, q.reshape(-1)).reshape(q.shape)
        products = Products(A, K.limit - K.count)
        tolerance = max(problem.tolerance, STEP_TOLERANCE)
        step = replace(problem, b=b, tolerance=tolerance, progress=K.tell_more)
        q = solve(step, products, clip(q, problem.g), nested=False).q
        K.count += products.count + 1
        if K.exhausted:
            break
    return q, Areas.of(q, problem.g)
