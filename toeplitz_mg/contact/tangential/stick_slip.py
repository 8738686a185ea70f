"""The areas of stick and slip: Coulomb's law and elasticity together, by Newton's method.

The elements that stick, and those that slide, are an active set. On a set Newton's method
linearises Coulomb's law: on an element that slides the traction turns on the circle |q| = g, and
the slip resists that with λ = |s|/g, so that a step v of the tractions solves

    Tᵀ (A + Λ) T v = Tᵀ (b - A q)

with T the tangent vectors. It is symmetric positive definite; conjugate gradients solve it only to
the accuracy at which the set, or the linearisation, is known to be wrong. (Without Λ this
converges for ν = 0 alone.)
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.counted import Products, dot
from toeplitz_mg.contact.grid import Grid, coarsened, refined
from toeplitz_mg.contact.inverse import LocalInverse, is_local_better
from toeplitz_mg.contact.normal.problem import Progress
from toeplitz_mg.contact.tangential.coulomb import (
    Areas,
    Tangent,
    admissible,
    along,
    in_proportion,
    nearest,
    size,
)
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.preconditioners import cosine_preconditioner
from toeplitz_mg.solvers.projected_gradients import descend

COARSE = 3e-3  # tolerance of the first guess, on a coarser grid
COARSE_PRODUCTS = 200
LOCAL = 0.5  # of the inverse of the diagonal is added to that of A, where elements slide
MOST = 200  # iterations of conjugate gradients, before rounding keeps them from the rest
RESCUE = 40  # products of projected gradients, where the sets cycle


@dataclass(frozen=True)
class Problem:
    """Find tractions whose slip s = A q - b obeys Coulomb's law.

    Attributes
    ----------
    grid : Grid
    g : ndarray
        Traction bound.
    b : ndarray of shape (components, ...)
        The displacements, were there no slip. With a total they lack a uniform shift.
    total : ndarray of shape (components,) or None
        Sum of the tractions, where the force is given.
    tolerance : float
        Relative to the largest displacement, of b or `least`.
    least : float
    progress : callable, optional
    """

    grid: Grid
    g: Array
    b: Array
    total: Array | None
    tolerance: float
    least: float = 0.0
    progress: Progress | None = None

    def coarser(self) -> "Problem | None":
        """The problem on elements of twice the size, solved roughly."""
        grid = self.grid.coarser()
        if grid is None:
            return None
        levels = len(grid.shape)
        g, b = coarsened(self.g, levels), coarsened(self.b, levels)
        total = None if self.total is None else self.total * (self.grid.area / grid.area)
        return Problem(grid, g, b, total, COARSE, self.least)

    def uniform(self, vector: Array) -> Array:
        """The components of a vector, to broadcast with fields."""
        return vector.reshape(-1, *(1,) * self.g.ndim)


@dataclass(frozen=True)
class State:
    """Tractions, displacements, areas, and the shift that belongs to a force."""

    q: Array
    u: Array
    areas: Areas
    shift: Array
    residual: float = np.inf
    iterations: tuple[int, ...] = ()


@dataclass(frozen=True)
class Linearised:
    """Coulomb's law about some tractions.

    Attributes
    ----------
    T : Tangent
    shift : ndarray of shape (components,)
    minus_slip : ndarray
        b + shift - A q.
    stiffness : ndarray
        λ = |s|/g where it slides against the traction.
    r : ndarray
        What Newton's step is to remove.
    scale : float
        The largest displacement, were there no slip.
    residual : float
        The largest violation, relative to that.
    """

    T: Tangent
    shift: Array
    minus_slip: Array
    stiffness: Array
    r: Array
    scale: float
    residual: float


def linearised(problem: Problem, areas: Areas, q: Array, u: Array) -> Linearised:
    """Linearise Coulomb's law about the tractions q, with the displacements u = A q."""
    contact, b = problem.g > 0.0, problem.b
    T = Tangent(areas, q, balanced=problem.total is not None)
    shift = np.zeros(len(q)) if problem.total is None else T.multiplier(u - b)
    target = b + problem.uniform(shift)
    minus_slip = target - u
    against = along(minus_slip, T.n)  # Eq. 3 wants the slip to oppose the traction
    stiffness = np.maximum(against, 0.0) / np.where(areas.slide, _not_tiny(problem.g), 1.0)
    r = T(minus_slip)
    scale = max(problem.least, float(np.max(size(target), where=contact, initial=0.0)))
    violation = max(float(size(r).max()), -float(against.min()))
    residual = violation / scale if scale > 0.0 else 0.0
    return Linearised(T, shift, minus_slip, stiffness, r, scale, residual)


def _not_tiny(g: Array) -> Array:
    """A bound by which one can divide."""
    return np.maximum(g, 1e-15 * float(np.max(g, where=np.isfinite(g), initial=0.0)))


def solve(problem: Problem, A: Products, guess: Array | None, *, nested: bool) -> State:
    """Find the tractions and the areas of stick and slip.

    Parameters
    ----------
    problem : Problem
    A : Products
    guess : ndarray or None
        Admissible tractions to start from, that are not too far off.
    nested : bool
        Whether to start from the solution on coarser grids, where there is no guess.
    """
    g, b, total = problem.g, problem.b, problem.total
    q, areas = _first_guess(problem, guess, nested=nested)
    u = A(q) if q.any() else np.zeros_like(q)
    M = _inverse(A.A, g > 0.0)
    a0 = diagonal(A.A)
    eta, strikes, lowest = 1.0, 0, np.inf
    iterations: list[int] = []
    while True:
        law = linearised(problem, areas, q, u)
        if law.residual <= problem.tolerance or A.exhausted:
            return State(q, u, areas, law.shift, law.residual, tuple(iterations))
        if problem.progress is not None:
            problem.progress(A.count, law.residual)
        v, Av, count = _newton_step(problem, law, areas, q, A, M, a0, eta)
        iterations.append(count)
        T, q, u = law.T, q + v, u + Av
        out = areas.stick & (size(q) > g)
        back = areas.slide & (along(_slip_reversed(problem, T, b - u), T.n) < 0.0)
        on_circle = areas.slide | out
        areas = areas.changed(out, back)
        if out.any() or (len(q) > 1 and on_circle.any()):
            q, areas = admissible(q, g, areas, on_circle, total)
            u = A(q)
        energy = dot(q, 0.5 * u - b)
        # Each change should lower the energy. Where it does not, first solve more exactly.
        if energy < lowest:
            strikes = 0
        else:
            strikes, eta = strikes + 1, eta / 10.0
        if strikes == 3:
            q, u = descend(A, b, q, lambda x: nearest(x, g, total), A.A.norm_bound, RESCUE)
            areas, strikes = Areas.of(q, g), 0
            energy = dot(q, 0.5 * u - b)
        lowest = min(lowest, energy)


def _newton_step(
    problem: Problem,
    law: Linearised,
    areas: Areas,
    q: Array,
    A: Products,
    M: Callable[[Array], Array],
    a0: float,
    eta: float,
) -> tuple[Array, Array, int]:
    """Return a change of the tractions, that of the displacements, and the iterations."""
    T, lam, r = law.T, law.stiffness, law.r
    contact = problem.g > 0.0
    v, Av = np.zeros_like(q), np.zeros_like(q)
    # Where elements slide, λ adds to A. There M, so scaled, is too small for what is smooth.
    weight = np.where(areas.slide, 1.0 / np.sqrt(1.0 + lam / a0), 1.0)
    local = np.where(areas.slide, LOCAL / a0, 0.0)
    d, rho, count = v, 0.0, 0
    while count < MOST and not A.exhausted:
        # Three things may be wrong with the set, and with the linearisation: |q| > g where it
        # sticks, |q| > g where it slides (the circle is curved), and slip along the traction.
        excess = a0 * float(np.max(size(q + v) - problem.g, where=contact, initial=0.0))
        along_n = along(_slip_reversed(problem, T, law.minus_slip - Av), T.n)
        wrong = max(excess, -float(along_n.min()))
        if np.abs(r).max() <= max(0.3 * problem.tolerance * law.scale, eta * wrong):
            break
        y = weight * r
        y = T(weight * (M(y) + local * y))
        rho, before = dot(r, y), rho
        d = y + (rho / before) * d if count else y
        Ad = A(d)
        Hd = T(Ad + lam * d)
        curvature = dot(d, Hd)
        if not (rho > 0.0 and curvature > 0.0):
            break  # what is left is below the rounding of other elements, as of far larger bounds
        step = rho / curvature
        v += step * d
        Av += step * Ad
        r = r - step * Hd
        count += 1
    return v, Av, count


def _inverse(A: Any, contact: Array) -> Callable[[Array], Array]:
    """An approximate inverse of A on the elements in contact."""
    if is_local_better(A, contact):
        with suppress(np.linalg.LinAlgError):
            return LocalInverse(A, np.broadcast_to(contact, A.grid_shape))
    M = cosine_preconditioner(A)
    return lambda r: apply_to_rows(M, r.reshape(-1)).reshape(r.shape)


def _slip_reversed(problem: Problem, T: Tangent, s: Array) -> Array:
    """Minus the slip, for the shift that belongs to it where the force is given."""
    return s if problem.total is None else s - problem.uniform(T.multiplier(s))


def _first_guess(problem: Problem, guess: Array | None, *, nested: bool) -> tuple[Array, Areas]:
    """Admissible tractions, and areas."""
    g, total = problem.g, problem.total
    everything_sticks = Areas(g > 0.0, np.zeros(g.shape, bool))
    if guess is not None:
        return guess, everything_sticks
    coarse = problem.coarser() if nested else None
    if coarse is not None:
        A = Products(coarse.grid.tangential(), COARSE_PRODUCTS)
        return refined_guess(problem, solve(coarse, A, None, nested=True))
    if total is None:
        return np.zeros(problem.b.shape), everything_sticks
    return in_proportion(total, g), everything_sticks


def refined_guess(problem: Problem, coarse: State) -> tuple[Array, Areas]:
    """Admissible tractions and areas from those of a coarser grid."""
    g = problem.g
    contact = g > 0.0
    q = np.where(contact, refined(coarse.q, g.shape), 0.0)
    slide = refined(coarse.areas.slide.astype(np.float64), g.shape) > 0.5
    slide &= contact & np.isfinite(g) & (size(q) > 0.0)
    return admissible(q, g, Areas(contact & ~slide, slide), slide, problem.total)


def diagonal(A: LinearOperator) -> float:
    """The entry on the diagonal, of the first component."""
    blocks = getattr(A, "blocks", ((A,),))
    return float(blocks[0][0].c.flat[0])
