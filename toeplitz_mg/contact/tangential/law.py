"""Coulomb's law and elasticity: the problem, its states, and their errors.

Fields have the shape (components, ...): one component in line contact, two on a surface. Tractions
q are admissible if |q| ≤ g. With the slip s = A q - b they satisfy

    stick  s = 0, |q| ≤ g  (Eq. 2);        slide  q = -g s/|s|  (Eq. 3).

While the sets are fixed, q may change by any vector where it sticks, and by a tangent vector of the
circle |q| = g where it slides. With one component there is no tangent: the sign is fixed.
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

ROUNDING = 4.0 * np.finfo(np.float64).eps  # Relative rounding error of |q|.
ON_BOUND = 1e-12  # Relative distance at which a traction counts as on the bound.
COARSE = 3e-3  # Tolerance on a coarser grid: a better guess saves no product on the finer one.
STIFFEST = 1e20  # Largest λ over the diagonal of A: single precision ends at 1e38.
SMALL = 0.1  # Elements with a smaller bound, over the largest, carry less of a load.
TINY = 1e-15  # Smallest bound, relative to the largest, of an element in contact.
DIFFERENCE = 1e-7  # Relative change of the slip for the derivative of friction.
FLAT = 1e-6  # Below this γ the slip does not determine the traction's magnitude.
TURN = 2.0  # Largest change of a traction perpendicular to it, over its magnitude.
THIN = 1e-6  # Smallest |q| over the bound by which the slip is divided.


@dataclass(frozen=True)
class Areas:
    """Elements that stick, and elements that slide: masks of the shape of the grid."""

    stick: Array
    slide: Array

    @classmethod
    def of(cls, q: Array, g: Array) -> "Areas":
        """Return areas in which the elements on the bound slide."""
        slide = (g > 0.0) & (size(q) >= g * (1.0 - ON_BOUND))
        return cls((g > 0.0) & ~slide, slide)

    def exchange(self, out: Array, back: Array) -> "Areas":
        """Return areas in which the sticking elements `out` slide, and the sliding `back` stick."""
        return Areas((self.stick & ~out) | back, (self.slide & ~back) | out)


def size(q: Array) -> Array:
    """Return |q| in each element."""
    if len(q) == 1:
        return np.abs(q[0])
    x, y = q  # Squares of allowed values neither under- nor overflow.
    return np.sqrt(x * x + y * y)


def direction(q: Array) -> Array:
    """Return q/|q|, exactly ±1 for one component; zero where q is."""
    a = size(q)
    return q / np.where(a > 0.0, a, 1.0)


def clip(q: Array, g: Array) -> Array:
    """Return the nearest tractions within the bound: |q| ≤ g, including rounding."""
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
    """Return tractions scaled to the bound on some elements, within it on the others."""
    if len(q) == 1:
        return np.clip(np.where(on_circle & (q != 0.0), np.copysign(g, q), q), -g, g)
    a, within = size(q), g * (1.0 - ROUNDING)
    outside = (on_circle | (a > within)) & (a > 0.0)
    return q * np.where(outside, within / np.where(outside, a, 1.0), 1.0)


class Tangent:
    """The directions in which admissible tractions may change for fixed areas."""

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
        """Project a field orthogonally to these directions; v·n may be given."""
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
    """Return traction bounds in which values at rounding level are set to zero.

    The tractions of such elements are negligible, but their directions would never converge.
    """
    return np.where(g < TINY * largest_bound(g, vectors), 0.0, g)


def largest_bound(g: Array, vectors: Vectors) -> float:
    """Return the largest finite traction bound, or zero."""
    return vectors.max(np.where(np.isfinite(g), g, 0.0))


def extend(C: Array, x: Array) -> Array:
    """Return fields on a grid that are x on the elements C, and zero elsewhere."""
    field = np.zeros((*x.shape[:-1], *C.shape), x.dtype)
    field[..., C] = x
    return field


@dataclass(frozen=True)
class SlipLaw:
    """The bound of each element as a function of its slip."""

    # Takes the magnitude of the slip divided by the distance rolled, and returns the bound.
    of_slip: Callable[[Array], Array]
    h: float  # The distance rolled in a step.
    k0: float  # The diagonal of K.
    part: float = 1.0  # Share of the slip that friction depends on.

    def at(self, s: Array) -> Array:
        """Return the bound of elements with slip s in a step."""
        return self.of_slip(self.part / self.h * np.maximum(s, 0.0))

    def slope(self, s: Array) -> Array:
        """Return γ at the slip s."""
        s = np.maximum(s, 0.0)
        step = DIFFERENCE * (s + (float(s.max(initial=0.0)) or self.h))
        with np.errstate(invalid="ignore"):  # For bonded elements.
            return np.nan_to_num(self.k0 * (self.at(s + step) - self.at(s)) / step)

    def within(self, extend: Callable[[Array], Array], cut: Callable[[Array], Array]) -> Self:
        """Return the law for fields that are mapped by `extend` to fields of this law, and back."""
        of_slip = self.of_slip
        return replace(self, of_slip=lambda s: cut(of_slip(extend(s))))

    def change(self, now: Any, areas: Areas, q: Array, v: Array, g: Array) -> tuple[Array, Array]:
        """Return tractions changed by v, to be scaled, and the magnitudes to scale them to.

        Where elements slide, that is the bound for the slip that the linear system predicts.
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
    """Find tractions whose slip s = A q - b satisfies Coulomb's law."""

    grid: Grid
    g: Array  # Traction bound.
    # (components, ...): the displacements without slip, from the given part of the motion.
    b: Array
    tolerance: float  # The allowed violation, over the largest displacement or `least`.
    least: float = 0.0  # Lower limit for the scale of the displacements.
    progress: Progress | None = None
    falling: SlipLaw | None = None  # If the bound depends on the slip; g is then that without slip.

    def coarser(self, coarsest: int | None = None) -> "Problem | None":
        """Return the problem on elements of twice the size with a loose tolerance, or None."""
        grid = self.grid.coarser(coarsest)
        if grid is None:
            return None
        g, b = self.grid.coarsen(self.g), self.grid.coarsen(self.b)
        progress = for_coarser_grids(self.progress)
        return Problem(grid, g, b, COARSE, self.least, progress)

    def restrict(self, C: Array) -> "Problem":
        """Return the problem on the elements in contact only, as fields with one axis."""
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
        """The weight of each element in changes that carry a load; smaller for small bounds.

        Otherwise tractions with a small bound would turn by any angle, and never converge.
        """
        small = SMALL * largest_bound(self.g, self.vectors)
        return np.minimum(self.g / small, 1.0) if small > 0.0 else np.ones_like(self.g)

    @cached_property
    def largest(self) -> float:
        """The largest displacement in contact without slip."""
        return self.vectors.max(np.where(self.g > 0.0, size(self.b), 0.0))

    def uniform(self, vector: Array) -> Array:
        """Return the components of a vector, to be broadcast with fields."""
        return vector.reshape(-1, *(1,) * self.g.ndim)

    def excess(self, q: Array) -> float:
        """Return the largest amount by which the tractions exceed the bound, or zero."""
        return max(0.0, self.vectors.max(size(q) - self.g))


@dataclass(frozen=True)
class State:
    """Tractions, displacements, areas, and the unknown creepages or shift for given loads."""

    q: Array
    u: Array
    areas: Areas
    shift: Array
    residual: float = np.inf
    iterations: tuple[int, ...] = ()

    def extend(self, C: Array) -> "State":
        """Return the state on a grid from one on the elements in contact."""
        whole = partial(extend, C)
        areas = Areas(whole(self.areas.stick), whole(self.areas.slide))
        return replace(self, q=whole(self.q), u=whole(self.u), areas=areas)


@dataclass(frozen=True)
class Linearisation:
    """Coulomb's law linearised about some tractions."""

    T: Tangent
    minus_slip: Array  # b - A q.
    stiffness: Array  # λ = |s|/g where an element slides against the traction.
    r: Array  # The residual for Newton's step.
    scale: float  # The largest displacement without slip.
    residual: float  # The largest violation, relative to `scale`.
    # For friction that depends on the slip: the bound, and γ where elements slide.
    bound: Array | None = None
    slope: Array | None = None
    k0: float = 0.0

    def remove(self, dq: Array, du: Array, T: Tangent, stiffness: Array) -> Array:
        """Return the reductions of r by changes of tractions and displacements, k each."""
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
        """Return the change of r by changes u of the slip, (k, components, ...)."""
        return self.remove(np.zeros_like(u), u, self.T, np.zeros(()))


def linearise(
    problem: Problem, areas: Areas, q: Array, u: Array, T: Tangent | None = None
) -> Linearisation:
    """Linearise Coulomb's law about the tractions q with displacements u = A q.

    The directions T in which they may change can be given.
    """
    vectors = problem.vectors
    T = T or Tangent(areas, q)
    minus_slip = problem.b - u
    against = along(minus_slip, T.n)  # By Eq. 3 the slip opposes the traction.
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
    """Return admissible tractions and areas near the given ones."""
    g = problem.g
    contact = g > 0.0
    q = np.where(contact, q, 0.0)
    slide = slide & contact & np.isfinite(g) & (size(q) > 0.0)
    if problem.falling is not None:
        g = np.where(slide, size(q), g)
    return scale_to_bound(q, g, slide), Areas(contact & ~slide, slide)
