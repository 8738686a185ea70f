"""The problem of Coulomb's law and elasticity together, its states, and what is wrong with them."""

from dataclasses import dataclass, replace
from functools import cached_property, partial
from operator import itemgetter

import numpy as np

from toeplitz_mg._typing import Array, Progress
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.products import for_coarser_grids
from toeplitz_mg.contact.tangential.coulomb import Areas, Tangent, along, scale_to_bound, size
from toeplitz_mg.contact.tangential.falling import THIN, SlipLaw
from toeplitz_mg.engine.vectors import Vectors

COARSE = 3e-3  # Tolerance on a coarser grid: a better guess saves no product on the finer one.
SHARP = 0.3  # Part of the tolerance beyond which no areas are solved more exactly.
STIFFEST = 1e20  # Largest λ over the diagonal of A: single precision ends at 1e38.
SMALL = 0.1  # Bound below which an element carries less of a load, over the largest.
TINY = 1e-15  # Least bound, relative to the largest, of what is in contact.


def drop_rounding(g: Array, vectors: Vectors) -> Array:
    """Return traction bounds, with no contact where they are rounding of the largest.

    The tractions of such elements are nothing, but what their directions do would never settle.
    """
    return np.where(g < TINY * largest_bound(g, vectors), 0.0, g)


def largest_bound(g: Array, vectors: Vectors) -> float:
    """Return the largest of traction bounds that are finite, or zero."""
    return vectors.max(np.where(np.isfinite(g), g, 0.0))


def extend(C: Array, x: Array) -> Array:
    """Return fields on a grid that are x on the elements C, and zero elsewhere."""
    field = np.zeros((*x.shape[:-1], *C.shape), x.dtype)
    field[..., C] = x
    return field


@dataclass(frozen=True)
class Problem:
    """Find tractions whose slip s = A q - b obeys Coulomb's law.

    Attributes
    ----------
    grid : Grid
    g : ndarray
        Traction bound.
    b : ndarray of shape (components, ...)
        The displacements, were there no slip, by what is given of the motion.
    tolerance : float
        The violation that is allowed, over the largest displacement or `least`.
    least : float
        A displacement below which none counts as the largest.
    progress : callable, optional
    falling : SlipLaw, optional
        How the bound depends on the slip; then g is that without any.
    """

    grid: Grid
    g: Array
    b: Array
    tolerance: float
    least: float = 0.0
    progress: Progress | None = None
    falling: SlipLaw | None = None

    def coarser(self, coarsest: int | None = None) -> "Problem | None":
        """Return the problem on elements of twice the size, to be solved roughly, or None."""
        grid = self.grid.coarser(coarsest)
        if grid is None:
            return None
        g, b = self.grid.coarsen(self.g), self.grid.coarsen(self.b)
        progress = for_coarser_grids(self.progress)
        return Problem(grid, g, b, COARSE, self.least, progress)

    def restrict(self, C: Array) -> "Problem":
        """Return the problem on the elements in contact only, as one axis."""
        falling = self.falling and self.falling.within(partial(extend, C), itemgetter(C))
        return replace(self, g=self.g[C], b=np.ascontiguousarray(self.b[:, C]), falling=falling)

    @property
    def vectors(self) -> Vectors:
        """The inner products, sums and extremes of fields."""
        return self.grid.vectors

    @cached_property
    def divisor(self) -> Array:
        """The bound by which a stiffness λ = |s|/g is divided."""
        return np.where(self.g > 0.0, self.g, 1.0)

    @cached_property
    def carriers(self) -> Array:
        """The share of each element in what is added to carry a load: less where it bears little.

        Tractions on a small bound would turn by any angle otherwise, and never settle.
        """
        small = SMALL * largest_bound(self.g, self.vectors)
        return np.minimum(self.g / small, 1.0) if small > 0.0 else np.ones_like(self.g)

    @cached_property
    def largest(self) -> float:
        """The largest displacement, were there no slip."""
        return self.largest_of(self.b)

    def largest_of(self, u: Array) -> float:
        """Return the largest of some displacements in contact."""
        return self.vectors.max(np.where(self.g > 0.0, size(u), 0.0))

    def uniform(self, vector: Array) -> Array:
        """Return the components of a vector, to broadcast with fields."""
        return vector.reshape(-1, *(1,) * self.g.ndim)

    def excess(self, q: Array) -> float:
        """Return the largest amount by which the tractions exceed the bound, or zero."""
        return max(0.0, self.vectors.max(size(q) - self.g))


@dataclass(frozen=True)
class State:
    """Tractions, displacements, areas, and the unknown creepages, or the shift, of given loads."""

    q: Array
    u: Array
    areas: Areas
    shift: Array
    residual: float = np.inf
    iterations: tuple[int, ...] = ()

    def extend(self, C: Array) -> "State":
        """Return the state on a grid, where it is one on the elements in contact."""
        whole = partial(extend, C)
        areas = Areas(whole(self.areas.stick), whole(self.areas.slide))
        return replace(self, q=whole(self.q), u=whole(self.u), areas=areas)


@dataclass(frozen=True)
class Linearisation:
    """Coulomb's law about some tractions.

    Attributes
    ----------
    T : Tangent
    minus_slip : ndarray
        b - A q.
    stiffness : ndarray
        λ = |s|/g where it slides against the traction.
    r : ndarray
        What Newton's step is to remove.
    scale : float
        The largest displacement, were there no slip.
    residual : float
        The largest violation, relative to that.
    bound, slope : ndarray, optional
        Of friction that depends on the slip, the size of the traction and γ where it slides.
    k0 : float
    """

    T: Tangent
    minus_slip: Array
    stiffness: Array
    r: Array
    scale: float
    residual: float
    bound: Array | None = None
    slope: Array | None = None
    k0: float = 0.0

    def remove(self, dq: Array, du: Array, T: Tangent, stiffness: Array) -> Array:
        """Return what changes of tractions and displacements, (k, components, ...), remove of r."""
        rows = stiffness * dq
        rows += du
        T.project_each(rows)
        if self.slope is not None:
            along_q, along_u = (np.einsum("kc...,c...->k...", x, T.n) for x in (dq, du))
            weight = (1.0 / (1.0 + np.abs(self.slope))).astype(dq.dtype)
            slope = self.slope.astype(dq.dtype)
            rows += T.n * (weight * (slope * along_u + self.k0 * along_q))[:, None]
        return rows

    def of_slip(self, u: Array) -> Array:
        """Return what a change u of the slip alone, (k, components, ...), adds to r."""
        return self.remove(np.zeros_like(u), u, self.T, np.zeros(()))


def linearise(
    problem: Problem, areas: Areas, q: Array, u: Array, T: Tangent | None = None
) -> Linearisation:
    """Linearise Coulomb's law about the tractions q, with the displacements u = A q.

    The directions T in which they may change may be known.
    """
    vectors = problem.vectors
    T = T or Tangent(areas, q)
    minus_slip = problem.b - u
    against = along(minus_slip, T.n)  # Eq. 3 wants the slip to oppose the traction.
    r = T(minus_slip, against)
    scale = max(problem.least, problem.largest)
    violation = max(vectors.max(size(r)), -vectors.min(against))
    residual = violation / scale if scale > 0.0 else np.inf if violation > 0.0 else 0.0
    if (falling := problem.falling) is None:
        stiffness = np.maximum(against, 0.0) / problem.divisor
        return Linearisation(T, minus_slip, stiffness, r, scale, residual)
    rho, slide, k0 = size(q), areas.slide, falling.k0
    bound = np.where(slide, falling.at(against), rho)
    slope = np.where(slide, falling.slope(against), 0.0)
    r += T.n * (k0 / (1.0 + np.abs(slope)) * (bound - rho))
    off = np.abs(bound - rho) / (1.0 + np.maximum(slope, 0.0))
    away = vectors.max(np.where(areas.stick, np.maximum(rho - problem.g, 0.0), off))
    largest = max(largest_bound(problem.g, vectors), largest_bound(bound, vectors)) or 1.0
    residual = max(residual, away / largest, k0 * away / scale if scale > 0.0 else 0.0)
    divisor = np.where(slide, np.maximum(rho, THIN * bound), problem.divisor)
    stiffness = np.maximum(against, 0.0) / divisor
    return Linearisation(T, minus_slip, stiffness, r, scale, residual, bound, slope, k0)


def admit(problem: Problem, q: Array, slide: Array) -> tuple[Array, Areas]:
    """Return admissible tractions and areas from some that are nearly so."""
    g = problem.g
    contact = g > 0.0
    q = np.where(contact, q, 0.0)
    slide = slide & contact & np.isfinite(g) & (size(q) > 0.0)
    if problem.falling is not None:
        g = np.where(slide, size(q), g)
    return scale_to_bound(q, g, slide), Areas(contact & ~slide, slide)
