"""Coulomb's law and elasticity together: the problem, its states, and what is wrong with them.

Fields have the shape (components, ...): one component in line contact, two on a surface. The
tractions q are admissible where |q| ≤ g. With the slip s = A q - b they obey

    stick  s = 0, |q| ≤ g  (Eq. 2);        slide  q = -g s/|s|  (Eq. 3).

While the sets are fixed, q may change by any vector where it sticks, and along the circle |q| = g
where it slides: by a tangent vector. In one component there is none of those, the sign stays.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from operator import itemgetter
from typing import Any, Self

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array, Progress
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.products import for_coarser_grids
from toeplitz_mg.engine.vectors import Vectors

ROUNDING = 4.0 * np.finfo(np.float64).eps  # Relative rounding of |q|, however it is computed.
ON_BOUND = 1e-12  # Relative distance from the bound at which a traction counts as on it.
COARSE = 3e-3  # Tolerance on a coarser grid: a better guess saves no product on the finer one.
STIFFEST = 1e20  # Largest λ over the diagonal of A: single precision ends at 1e38.
SMALL = 0.1  # Bound below which an element carries less of a load, over the largest.
TINY = 1e-15  # Least bound, relative to the largest, of what is in contact.
DIFFERENCE = 1e-7  # Relative change of the slip by which the slope of friction is computed.
FLAT = 1e-6  # γ below which the slip says nothing of the size of the traction.
TURN = 2.0  # Largest change of a traction across itself, over its size.
THIN = 1e-6  # Least |q| over the bound by which the slip is divided.


@dataclass(frozen=True)
class Areas:
    """Elements that stick, and elements that slide: masks of the shape of the grid."""

    stick: Array
    slide: Array

    @classmethod
    def of(cls, q: Array, g: Array) -> "Areas":
        """Return the areas of which those on the bound slide."""
        slide = (g > 0.0) & (size(q) >= g * (1.0 - ON_BOUND))
        return cls((g > 0.0) & ~slide, slide)

    def exchange(self, out: Array, back: Array) -> "Areas":
        """Return the areas where `out` slides, which stuck, and `back` sticks, which slid."""
        return Areas((self.stick & ~out) | back, (self.slide & ~back) | out)


def size(q: Array) -> Array:
    """Return |q| in each element."""
    if len(q) == 1:
        return np.abs(q[0])
    x, y = q  # No square of a number that is allowed under- or overflows, so that this is enough.
    return np.sqrt(x * x + y * y)


def direction(q: Array) -> Array:
    """Return q/|q|, to the last bit ±1 in one component; zero where q is."""
    a = size(q)
    return q / np.where(a > 0.0, a, 1.0)


def clip(q: Array, g: Array) -> Array:
    """Return the nearest tractions within the bound: |q| ≤ g, however |q| is rounded."""
    if len(q) == 1:
        return np.clip(q, -g, g)
    a = size(q)
    outside = a > g * (1.0 - ROUNDING)
    if not outside.any():
        return q
    factor = np.ones_like(a)
    factor[outside] = g[outside] / a[outside] * (1.0 - ROUNDING)
    return q * factor


def scale_to_bound(q: Array, g: Array, on_circle: Array) -> Array:
    """Return tractions of the size of the bound on some elements, within it on the others."""
    if len(q) == 1:
        return np.clip(np.where(on_circle & (q != 0.0), np.copysign(g, q), q), -g, g)
    a, within = size(q), g * (1.0 - ROUNDING)
    outside = (on_circle | (a > within)) & (a > 0.0)
    return q * np.where(outside, within / np.where(outside, a, 1.0), 1.0)


class Tangent:
    """Directions in which admissible tractions may change while the areas are fixed."""

    def __init__(self, areas: Areas, q: Array) -> None:
        self.inside = areas.stick | areas.slide
        self._is_everywhere = bool(self.inside.all())
        a = size(q)
        self.n = q / np.where(areas.slide & (a > 0.0), a, np.inf)

    def astype(self, dtype: DTypeLike) -> "Tangent":
        """Return the same directions in another precision."""
        other = object.__new__(Tangent)
        other.__dict__.update(self.__dict__)
        other.n = self.n.astype(dtype)
        return other

    def __call__(self, v: Array, along_n: Array | None = None) -> Array:
        """Project a field orthogonally to these directions, where v·n may be known."""
        if along_n is None:
            along_n = along(v, self.n)
        v = v - self.n * along_n
        if not self._is_everywhere:
            v *= self.inside
        return v

    def project_each(self, rows: Array) -> None:
        """Project fields, (k, components, ...), in place."""
        rows -= self.n * np.einsum("kc...,c...->k...", rows, self.n)[:, None]
        if not self._is_everywhere:
            rows *= self.inside


def along(v: Array, n: Array) -> Array:
    """Return v·n in each element."""
    product: Array = v[0] * n[0]
    for k in range(1, len(v)):
        product += v[k] * n[k]
    return product


def sum_components(q: Array, vectors: Vectors) -> Array:
    """Return the sum of each component of a field."""
    return sum(vectors.gather(q.reshape(len(q), -1).sum(axis=1)), start=np.zeros(len(q)))


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
class SlipLaw:
    """The bound of each element by its slip."""

    # Takes the size of the slip over the distance rolled, and returns the bound.
    of_slip: Callable[[Array], Array]
    h: float  # The distance rolled in a step.
    k0: float  # The diagonal of K.
    part: float = 1.0  # That of the slip that friction depends on.

    def at(self, s: Array) -> Array:
        """Return the bound of elements that slip by s in a step."""
        return self.of_slip(self.part / self.h * np.maximum(s, 0.0))

    def slope(self, s: Array) -> Array:
        """Return γ at the slip s."""
        s = np.maximum(s, 0.0)
        step = DIFFERENCE * (s + (float(s.max(initial=0.0)) or self.h))
        with np.errstate(invalid="ignore"):  # Of bonded elements.
            return np.nan_to_num(self.k0 * (self.at(s + step) - self.at(s)) / step)

    def within(self, extend: Callable[[Array], Array], cut: Callable[[Array], Array]) -> Self:
        """Return the law of fields that are extended to those of this one, and cut from them."""
        of_slip = self.of_slip
        return replace(self, of_slip=lambda s: cut(of_slip(extend(s))))

    def change(self, now: Any, areas: Areas, q: Array, v: Array, g: Array) -> tuple[Array, Array]:
        """Return tractions that change by v, to be scaled, and the sizes they are to have.

        Where elements slide that is the bound of the slip that the linear system predicts.
        """
        n, rho, slide = now.law.T.n, size(q), areas.slide
        along_n = along(v, n)
        across = v - n * along_n
        turn = np.minimum(1.0, TURN * rho / np.where(size(across) > 0.0, size(across), 1.0))
        gamma, bound, s = now.law.slope, now.law.bound, along(now.law.minus_slip, n)
        predicted = rho + along_n
        flat = np.abs(gamma) <= FLAT
        s = s + np.where(flat, 0.0, (predicted - bound) * self.k0 / np.where(flat, 1.0, gamma))
        radius = np.where(gamma > 1.0, np.maximum(predicted, np.minimum(g, bound)), self.at(s))
        return q + np.where(slide, across * turn, v), np.where(slide, radius, g)


@dataclass(frozen=True)
class Problem:
    """Find tractions whose slip s = A q - b obeys Coulomb's law."""

    grid: Grid
    g: Array  # Traction bound.
    # (components, ...): the displacements, were there no slip, by what is given of the motion.
    b: Array
    tolerance: float  # The violation that is allowed, over the largest displacement or `least`.
    least: float = 0.0  # A displacement below which none counts as the largest.
    progress: Progress | None = None
    falling: SlipLaw | None = None  # How the bound depends on the slip; then g is that without any.

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
        """The largest displacement in contact, were there no slip."""
        return self.vectors.max(np.where(self.g > 0.0, size(self.b), 0.0))

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
    """Coulomb's law about some tractions."""

    T: Tangent
    minus_slip: Array  # b - A q.
    stiffness: Array  # λ = |s|/g where it slides against the traction.
    r: Array  # What Newton's step is to remove.
    scale: float  # The largest displacement, were there no slip.
    residual: float  # The largest violation, relative to that.
    # Of friction that depends on the slip, the size of the traction and γ where it slides.
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
