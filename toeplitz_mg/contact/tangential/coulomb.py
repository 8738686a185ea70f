"""Coulomb's law on a set of elements that stick and a set that slide (Eq. 2-3).

Fields have the shape (components, ...): one component in line contact, two on a surface. The
tractions q are admissible where |q| ≤ g. With the slip s = A q - b they obey

    stick  s = 0, |q| ≤ g  (Eq. 2);        slide  q = -g s/|s|  (Eq. 3).

While the sets are fixed, q may change by any vector where it sticks, and along the circle |q| = g
where it slides: by a tangent vector. In one component there is none of those, the sign stays.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.vectors import Vectors

ROUNDING = 4.0 * np.finfo(np.float64).eps  # Relative rounding of |q|, however it is computed.
ON_BOUND = 1e-12  # Relative distance from the bound at which a traction counts as on it.


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
    """

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
