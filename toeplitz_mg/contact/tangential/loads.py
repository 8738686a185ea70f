"""Loads that are given instead of creepages, and the errors of tractions then.

The unknown creepages are found together with the tractions, in the same steps. A change of the
tractions adds what is missing of the loads, and the creepages minimise the slip.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy.linalg import null_space
from scipy.linalg.lapack import dpotrf, dtrtri

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.tangential.law import (
    Areas,
    Linearisation,
    Problem,
    Tangent,
    clip,
    direction,
    linearise,
    scale_to_bound,
    size,
)
from toeplitz_mg.contact.tangential.motion import BeyondBound
from toeplitz_mg.engine.vectors import Vectors

CARRYING = 8  # Attempts to restore the loads without a product; the next step does the rest.
CONTRADICT = 1e-12  # Loads of which at most this share can be carried contradict each other.
NEARLY = 0.8  # Above this share of the limit of a load, the given creepages matter.
CARRIED = 1e-12  # Missing share of the loads that counts as rounding.
DEPENDENT = 1e-12  # Relative size below which a field counts as a combination of others.


def inner_products(fields: Array, v: Array, vectors: Vectors) -> Array:
    """Return the inner products of several fields (or none) with another."""
    if not len(fields):
        return np.zeros(0)
    return vectors.dots(fields.reshape(len(fields), -1), v.reshape(-1))


class Complement:
    """The fields orthogonal to some others, of shape (m, components, ...).

    With weights, corrections are proportional to the weights, as if changes cost less there.
    """

    def __init__(self, fields: Array, vectors: Vectors, weights: Array | None = None) -> None:
        self._vectors, self._fields = vectors, fields
        self._added = fields if weights is None else fields * weights
        gram = np.array([inner_products(fields, f, vectors) for f in self._added])
        self._inverse = _invert(gram) if len(fields) else np.zeros((0, 0))

    def adding(self, added: Array) -> "Complement":
        """Return the same complement, reached by adding `added`, fields with known products."""
        other = object.__new__(Complement)
        other.__dict__.update(self.__dict__)
        other._added = added
        return other

    def astype(self, dtype: DTypeLike) -> "Complement":
        """Return the same with fields in another precision."""
        other = object.__new__(Complement)
        other.__dict__.update(self.__dict__)
        other._fields, other._added = (x.astype(dtype) for x in (self._fields, self._added))
        return other

    def coordinates(self, v: Array) -> Array:
        """Return the coefficients of the combination of the fields that is nearest to v."""
        return self._inverse @ inner_products(self._fields, v, self._vectors)

    def reach(self, products: Array) -> Array:
        """Return the smallest field with these inner products with the fields."""
        return self._vectors.combine(self._inverse @ products, self._added)

    def __call__(self, v: Array) -> Array:
        """Return the nearest field that is orthogonal to the fields."""
        if not len(self._fields):
            return v
        return v - self._vectors.combine(self.coordinates(v), self._added)


def _invert(gram: Array) -> Array:
    """Return the inverse of a small Gram matrix of fields that may be linearly dependent."""
    sizes = np.sqrt(gram.diagonal())
    sizes[sizes == 0.0] = 1.0
    scale = sizes[:, None] * sizes
    cosines = gram / scale
    factor, fails = dpotrf(cosines)
    # The squares of the parts of each field that are independent of the previous fields.
    if fails or not (factor.diagonal() ** 2 > DEPENDENT).all():
        return np.linalg.pinv(cosines, DEPENDENT) / scale
    inverse, _ = dtrtri(factor)
    return inverse @ inverse.T / scale


@dataclass(frozen=True)
class Loads:
    """Loads that are given instead of creepages."""

    # (m, components, ...): the displacements in a step without slip, per unit of each unknown
    # creepage; this is minus the rigid slip.
    units: Array
    # (m, components, ...): fields whose inner products with the tractions are the loads.
    arms: Array
    wanted: Array  # The loads.

    @classmethod
    def of_sums(cls, total: Array | None, like: Array) -> "Loads":
        """Return loads that are sums of the tractions; a uniform shift belongs to each.

        The total is None, or NaN in components in which none is given; `like` is a field.
        """
        total = np.full(len(like), np.nan) if total is None else total
        given = np.flatnonzero(total == total)
        units = np.zeros((len(given), *like.shape))
        units[np.arange(len(given)), given] = 1.0
        return cls(units, units, total[given])

    def restrict(self, C: Array) -> "Loads":
        """Return the loads for the elements in contact only, as fields with one axis."""
        return Loads(self.units[..., C], self.arms[..., C], self.wanted)

    def coarser(self, grid: Any, coarse: Problem, longer: float = 1.0) -> "Loads":
        """Return the loads on a coarser grid, whose steps of rolling may be longer."""
        units, arms = (
            np.array([grid.coarsen(f) for f in fields]).reshape(len(fields), *coarse.b.shape)
            for fields in (self.units, self.arms)
        )
        # A larger element has more of the loads.
        return Loads(longer * units, coarse.grid.area / grid.area * arms, self.wanted)

    def spread(self, g: Array, vectors: Vectors) -> Array:
        """Return tractions with these loads, proportional to the bound; bonded elements first."""
        bonded = np.isinf(g)
        share = bonded.astype(np.float64) if vectors.count(bonded) else g
        return Complement(self.arms, vectors, share).reach(self.wanted)

    def project(self, q: Array, g: Array, vectors: Vectors) -> Array:
        """Return the nearest tractions within a bound that have these loads."""
        q = np.where(g > 0.0, q, 0.0)
        if not len(self.wanted):
            return clip(q, g)
        from scipy.optimize import minimize  # Slow to import.

        # They are q + c arms, clipped, where c minimises a convex function whose gradient is the
        # missing loads.
        lengths = np.sqrt([vectors.dot(arm, arm) for arm in self.arms])
        arms = self.arms / lengths.reshape(-1, *(1,) * q.ndim)
        unit = np.sqrt(vectors.dot(q, q)) or 1.0
        wanted = self.wanted / lengths / unit

        def of(c: Array) -> Array:
            return clip(q + vectors.combine(c * unit, arms), g)

        def fall(c: Array) -> tuple[float, Array]:
            z = (q + vectors.combine(c * unit, arms)) / unit
            inside = clip(z, g / unit)
            value = vectors.dot(inside, z - 0.5 * inside) - float(c @ wanted)
            return value, inner_products(arms, inside, vectors) - wanted

        found = minimize(fall, np.zeros(len(arms)), jac=True, options={"gtol": CARRIED})
        return of(found.x)

    @cached_property
    def _lengths(self) -> Array:
        """The norms of the arms, of shape (m, ...)."""
        return np.array([size(arm) for arm in self.arms])

    def missing(self, q: Array, vectors: Vectors) -> Array:
        """Return the missing part of the loads."""
        return self.wanted - inner_products(self.arms, q, vectors)

    def share(self, g: Array, vectors: Vectors) -> float:
        """Return the loads divided by the largest ones of the same ratio that a bound can carry.

        If they are certainly carried, an upper bound below 1 is returned.
        """
        most = self.carried(g, vectors)
        shares = self._shares(most)
        if len(shares) < 2 or not min(most) > 0.0 or vectors.count(np.isinf(g)):
            return float(np.abs(shares).max(initial=0.0))
        # Distribute the bound among the loads; the share of one adds to the others as well.
        brought = [inner_products(self.arms, g * direction(arm), vectors) for arm in self.arms]
        of_parts = np.array(brought) / most
        parts, *_ = np.linalg.lstsq(of_parts.T, shares)
        total = float(np.abs(parts).sum())
        if np.allclose(parts @ of_parts, shares) and total < 1.0:
            return total  # An upper bound, which is sufficient.
        return self.find_limit(g, vectors)[0]

    def find_limit(self, g: Array, vectors: Vectors) -> tuple[float, Array]:
        """Return the exact value of `share`, and the slip at which the most is carried.

        For a slip by creepages c, sliding tractions carry the most in the direction of c: the
        product of the loads with c is h(c), the sum of g times the magnitude of the slip. The
        smallest h(c) among all c whose product with the loads is 1 is the largest multiple of the
        loads.
        """
        most = self.carried(g, vectors)
        shares = self._shares(most)
        if not shares.any() or not (most > 0.0).all():
            return float(np.abs(shares).max(initial=0.0)), np.zeros_like(self.arms[0])
        from scipy.optimize import minimize  # Slow to import.

        arms = self.arms / most.reshape(-1, *(1,) * (self.arms.ndim - 1))
        start, others = shares / (shares @ shares), null_space(shares[None])

        def carry(y: Array) -> tuple[float, Array]:
            slip = vectors.combine(start + others @ y, arms)
            push = inner_products(arms, g * direction(slip), vectors)
            return vectors.sum(g * size(slip)), others.T @ push

        found = minimize(carry, np.zeros(others.shape[1]), jac=True) if others.size else None
        weights = start if found is None else start + others @ found.x
        slip = vectors.combine(weights, arms)
        least = vectors.sum(g * size(slip))
        return (1.0 / least if least > CONTRADICT else np.inf), slip

    def carried(self, g: Array, vectors: Vectors) -> Array:
        """Return the largest value of each load on its own for a traction bound."""
        lengths = self._lengths
        # Where the arm is zero, an infinite bound carries nothing either.
        most = [vectors.sum(np.where(length > 0.0, g, 0.0) * length) for length in lengths]
        return np.array(most)

    def _shares(self, most: Array) -> Array:
        """Return the loads divided by the largest value of each on its own."""
        pairs = zip(self.wanted.tolist(), most.tolist(), strict=True)
        return np.array([(a / b if b else np.inf) if a else 0.0 for a, b in pairs])

    def check_share(self, g: Array, vectors: Vectors, bearer: str = "friction") -> None:
        """Refuse loads that the bearer's bound g carries one by one, but not together."""
        share = self.share(g, vectors)
        if share == np.inf:
            raise BeyondBound(
                "no tractions in the contact have these forces and this moment together: on a "
                "single element, for example, the moment follows from the forces; give one of them"
            )
        if not share < 1.0:
            raise BeyondBound(
                f"the loads together are {share:.4g} times what {bearer} carries in this "
                "proportion: reduce the force or the moment, or give a creepage instead of one"
            )

    def check_beside(self, g: Array, b: Array, vectors: Vectors) -> None:
        """Raise an error for a single load that no creepage gives with the slip of the given ones.

        This is a moment: its arm ends half an element behind the point of the spin's slip.
        """
        if len(self.wanted) != 1 or vectors.count(np.isinf(g)):
            return
        wanted, most = abs(float(self.wanted[0])), float(self.carried(g, vectors)[0])
        if wanted > NEARLY * most and not wanted < (limit := self._limit_beside(g, b, vectors)):
            raise BeyondBound(
                f"the load is of size {wanted:g}, but must be less than {limit:g}, the most that "
                "friction carries with the creepages that are given: there everything slides"
            )

    def _limit_beside(self, g: Array, b: Array, vectors: Vectors) -> float:
        """Return the largest load for sliding by the slip in b plus any unknown creepage."""
        from scipy.optimize import minimize_scalar  # Slow to import.

        contact, sign = g > 0.0, float(np.sign(self.wanted[0]))
        unit, given = (np.where(contact, x, 0.0) for x in (self.units[0], b))
        longest = [vectors.max(size(x)) or 1.0 for x in (unit, given)]

        def carry(angle: float) -> float:
            slip = np.cos(angle) / longest[0] * unit + np.sin(angle) / longest[1] * given
            return sign * float(inner_products(self.arms, g * direction(slip), vectors)[0])

        # From large creepages of one sign to large ones of the other.
        ends = (0.0, np.pi)
        between = minimize_scalar(lambda angle: -carry(angle), bounds=ends, method="bounded")
        return max(*map(carry, ends), carry(float(between.x)))

    def error(self, q: Array, vectors: Vectors) -> float:
        """Return the largest missing share of a load, relative to tractions of one sign."""
        if not len(self.wanted):
            return 0.0
        missing = np.abs(self.missing(q, vectors))
        # A zero load is scaled like the others, in the unit of its own tractions.
        carried = inner_products(self._lengths, size(q), vectors)
        scale = np.maximum(carried, np.abs(self.wanted))
        return float(np.max(missing / np.where(scale > 0.0, scale, 1.0)))


@dataclass(frozen=True)
class Look:
    """The errors of tractions, with the creepages that suit them best if loads are given."""

    law: Linearisation  # Coulomb's law with these creepages.
    creepages: Array  # The unknown creepages.
    b: Array  # The displacements in a step without slip, with these creepages.
    # Of the slip by unknown creepages, in the directions in which the tractions may change.
    of_slip: Complement
    missing: Array  # The missing part of the loads.
    residual: float


def look(problem: Problem, loads: Loads, areas: Areas, q: Array, u: Array) -> Look:
    """Return the errors of tractions q with displacements u = K q."""
    vectors = problem.vectors
    if not len(loads.wanted):
        law = linearise(problem, areas, q, u)
        nothing = Complement(loads.units, vectors)
        return Look(law, loads.wanted, problem.b, nothing, loads.wanted, law.residual)
    T = Tangent(areas, q)
    of_slip, creepages, b = _suit(problem, loads, T, u)
    law = linearise(replace(problem, b=b), areas, q, u, T)
    if law.slope is not None:
        of_slip = of_slip.adding(law.of_slip(loads.units))
    missing, error = loads.missing(q, vectors), loads.error(q, vectors)
    return Look(law, creepages, b, of_slip, missing, max(law.residual, error))


def find_displacements(problem: Problem, loads: Loads, areas: Areas, q: Array, u: Array) -> Array:
    """Return the displacements without slip, with the creepages that suit the tractions best."""
    if not len(loads.wanted):
        return problem.b
    return _suit(problem, loads, Tangent(areas, q), u)[-1]


def _suit(problem: Problem, loads: Loads, T: Tangent, u: Array) -> tuple[Complement, Array, Array]:
    """Return the complement, the creepages that minimise the slip, and b with them."""
    of_slip = complement(loads.units, T, problem.vectors)
    creepages = of_slip.coordinates(T(u - problem.b))
    return of_slip, creepages, problem.b + problem.vectors.combine(creepages, loads.units)


def complement(
    fields: Array, T: Tangent, vectors: Vectors, weights: Array | None = None
) -> Complement:
    """Return the complement of some fields among the tangents."""
    tangents = fields.copy()
    T.project_each(tangents)
    return Complement(tangents, vectors, weights)


def carry(problem: Problem, loads: Loads, areas: Areas, q: Array) -> Array:
    """Change tractions so that they carry the loads, as far as possible with these areas."""
    vectors = problem.vectors
    for _ in range(CARRYING if len(loads.wanted) else 0):
        if loads.error(q, vectors) <= CARRIED:
            break
        T = Tangent(areas, q)
        v = complement(loads.arms, T, vectors, problem.carriers).reach(loads.missing(q, vectors))
        q = scale_to_bound(q + v, problem.g, areas.slide)
    return q
