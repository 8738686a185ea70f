"""Coulomb's law on a set of elements that stick and a set that slide (Eq. 2-3).

Fields have the shape (components, ...): one component in line contact, two on a surface. The
tractions q are admissible where |q| ≤ g. With the slip s = A q - b they obey

    stick  s = 0, |q| ≤ g  (Eq. 2);        slide  q = -g s/|s|  (Eq. 3).

While the sets are fixed, q may change by any vector where it sticks, and along the circle |q| = g
where it slides: by a tangent vector. In one component there is none of those, the sign stays.
"""

from dataclasses import dataclass
from math import hypot

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.vectors import Vectors

ROUNDING = 4.0 * np.finfo(np.float64).eps  # Relative rounding of |q|, however it is computed.
ON_BOUND = 1e-12  # Relative distance from the bound at which a traction counts as on it.
STEPS = 100  # Steps of Newton's method for a given sum: a dozen are usual.
HALVINGS = 40  # Halvings of a step of Newton's method: after so many it moves nothing.
FAR = 1e9  # What is added to tractions, over the largest, from where they do not turn any more.
BALANCED = 1e-13  # Error of a sum that is rounding, over it or over the sum of the sizes.


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
    """Directions in which the tractions may change while the areas are fixed.

    Parameters
    ----------
    areas : Areas
    q : ndarray
        Admissible, |q| = g where it slides.
    vectors : Vectors
        The inner products of fields.
    balanced : tuple of int
        The components whose sum is given, so that the changes have the sum zero.
    """

    def __init__(
        self, areas: Areas, q: Array, vectors: Vectors, *, balanced: tuple[int, ...]
    ) -> None:
        self._vectors = vectors
        self.inside = areas.stick | areas.slide
        self._is_everywhere = bool(self.inside.all())
        a = size(q)
        self.n = q / np.where(areas.slide & (a > 0.0), a, np.inf)
        self._balanced = list(balanced)
        if balanced:
            self._units = np.zeros((len(balanced), *q.shape))
            for k, component in enumerate(balanced):
                self._units[k, component] = 1.0
            self.project_each(self._units)
            self._normals = _invert(vectors.gram(self._units))

    def astype(self, dtype: DTypeLike) -> "Tangent":
        """Return the same directions in another precision."""
        other = object.__new__(Tangent)
        other.__dict__.update(self.__dict__)
        other.n = self.n.astype(dtype)
        if self._balanced:
            other._units = self._units.astype(dtype)
        return other

    def _project(self, v: Array, along_n: Array | None = None) -> Array:
        """Project a field orthogonally to the tangents, of any sum."""
        if along_n is None:
            along_n = along(v, self.n)
        v = v - self.n * along_n
        if not self._is_everywhere:
            v *= self.inside
        return v

    def project_each(self, rows: Array) -> None:
        """Project fields, (k, components, ...), in place, of any sum."""
        rows -= self.n * np.einsum("kc...,c...->k...", rows, self.n)[:, None]
        if not self._is_everywhere:
            rows *= self.inside

    def multiplier(self, s: Array) -> Array:
        """Return the components of the uniform field nearest to `s` in these directions.

        Those whose sum is not given are zero.
        """
        multiplier = np.zeros(len(s))
        multiplier[self._balanced] = self._weights(s)
        return multiplier

    def _weights(self, s: Array) -> Array:
        weights: Array = self._normals @ self._vectors.dots(self._units, s)
        return weights

    def __call__(self, v: Array) -> Array:
        """Project a field orthogonally to these directions."""
        return self.project(v)

    def project(self, v: Array, along_n: Array | None = None) -> Array:
        """Project a field orthogonally to these directions, where v·n may be known."""
        v = self._project(v, along_n)
        if self._balanced:
            v -= self._vectors.combine(self._weights(v), self._units)
        return v


def _invert(G: Array) -> Array:
    """Return the pseudo-inverse of inner products; a number has one without a decomposition."""
    return 1.0 / np.where(G > 0.0, G, np.inf) if len(G) == 1 else np.linalg.pinv(G)


def along(v: Array, n: Array) -> Array:
    """Return v·n in each element."""
    product: Array = v[0] * n[0]
    for k in range(1, len(v)):
        product += v[k] * n[k]
    return product


def make_admissible(
    q: Array, g: Array, areas: Areas, on_circle: Array, total: Array | None, vectors: Vectors
) -> tuple[Array, Areas]:
    """Scale tractions to the bound on some elements, and restore the sum of all (see `balance`).

    The elements that stick carry what is missing, or else all turn. The areas change only where
    that does not do either.
    """
    q = scale_to_bound(q, g, on_circle)
    if total is None:
        return q, areas
    p = balance(q, g, total, areas.stick, None, vectors)
    if p is None and len(q) > 1:  # Almost all slides: turn tractions on the circle too.
        p = balance(q, g, total, (g > 0.0) & np.isfinite(g), areas.slide, vectors)
    if p is not None:
        return p, areas
    q = project(q, g, total, vectors)
    return q, Areas.of(q, g)


def project(q: Array, g: Array, total: Array | None, vectors: Vectors) -> Array:
    """Return the nearest tractions within the bound, of a given sum if there is one."""
    if total is None:
        return clip(q, g)
    p = balance(np.where(g > 0.0, q, 0.0), g, total, g > 0.0, None, vectors)
    # Too close to where all slides for the nearest: some that have the sum.
    return spread(total, g, vectors) if p is None else p


def spread(total: Array, g: Array, vectors: Vectors) -> Array:
    """Return tractions of a given sum in proportion to the bound; where some are bonded, there."""
    bonded = np.isinf(g)
    share = bonded.astype(np.float64) if vectors.count(bonded) else g
    wanted = np.nan_to_num(total).reshape(-1, *(1,) * g.ndim)
    return wanted * (share / (vectors.sum(share) or 1.0))


def balance(
    q: Array,
    g: Array,
    total: Array,
    movable: Array,
    on_circle: Array | None,
    vectors: Vectors,
) -> Array | None:
    """Give tractions a sum, by clip(q + c, g) where they are movable, with a constant c.

    Parameters
    ----------
    q : ndarray of shape (components, ...)
        Tractions.
    g : ndarray
        Their bound.
    total : ndarray of shape (components,)
        The sum that they shall have; NaN in a component that may have any.
    movable : ndarray of bool
        The elements where the tractions may change.
    on_circle : ndarray of bool or None
        Movable elements that stay on the circle |q| = g. Then it is q + c g in the place of
        q + c, which turns all of them by similar angles.
    vectors : Vectors
        The sums of fields.

    Returns
    -------
    ndarray of the shape of `q`, or None
        None where the movable elements cannot carry what is missing.
    """
    wanted = ~np.isnan(total)
    both, identity = np.outer(wanted, wanted), np.eye(len(q))

    def less(q: Array, total: Array) -> Array:
        return np.where(wanted, total - sum_components(q, vectors), 0.0)

    rest = less(np.where(movable, 0.0, q), total)
    z, g_m = q[:, movable], g[movable]
    circle, unit = np.zeros(g_m.shape, bool), np.ones_like(g_m)
    if on_circle is not None:
        circle, unit = on_circle[movable], g_m
    if not hypot(*rest) < vectors.sum(g_m) * (1.0 - ON_BOUND):
        return None
    # The sum is the gradient of a convex function of c: Newton's method, with a search along it.
    c = np.zeros(len(q))
    value, p = _primitive(z, g_m, circle, unit, vectors)
    farthest = vectors.max(size(z) / unit)
    missing = less(p, rest)
    goal = BALANCED * max(hypot(*total[wanted]), vectors.sum(size(p)))
    for _ in range(STEPS):
        error = hypot(*missing)
        if error <= goal:
            result = q.copy()
            result[:, movable] = p
            return result
        y = z + c[:, None] * unit
        a = size(y)
        outside = circle | (a > g_m)
        n = np.where(outside, direction(y), 0.0)
        weight = unit * np.where(outside, g_m / np.where(a > 0.0, a, 1.0), 1.0)
        weights = vectors.sum(weight)
        H = (1.0 + 1e-9) * weights * identity - sum(vectors.gather((weight * n) @ n.T))
        # Where any sum will do, c is zero and stays so.
        move = np.linalg.solve(np.where(both, H, identity), missing)
        for halvings in range(HALVINGS):
            trial = c + 0.5**halvings * move
            new, p = _primitive(z + trial[:, None] * unit, g_m, circle, unit, vectors)
            missing = less(p, rest)
            descends = new - trial @ rest < value - c @ rest
            if descends or hypot(*missing) < 0.5 * error:
                break
        else:
            return None
        c, value = trial, new
        if hypot(*c) > FAR * farthest:
            return None  # All are on the circle along one axis, and cannot turn.
    return None


def sum_components(q: Array, vectors: Vectors) -> Array:
    """Return the sum of each component of a field."""
    return sum(vectors.gather(q.reshape(len(q), -1).sum(axis=1)), start=np.zeros(len(q)))


def _primitive(
    z: Array, g: Array, circle: Array, unit: Array, vectors: Vectors
) -> tuple[float, Array]:
    """Return a convex function of c, z = q + c unit, and the tractions whose sum is its gradient.

    It is the sum of ½|z|²/unit, continued linearly where |z| > g, and linear on the circle.
    """
    a = size(z)
    inside = np.where(circle, g, np.minimum(a, g))
    return vectors.sum(inside * (a - 0.5 * inside) / unit), scale_to_bound(z, g, circle)
