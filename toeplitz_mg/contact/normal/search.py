"""The search for the elements in contact, an active set method with decreasing energy.

While a set C is fixed, the equation on it is A p = δ - z. Conjugate gradients solve it until the
misfit is below the violation of the inequalities (tension in C, penetration elsewhere); then the
set changes. On other elements the pressure is zero or, with a hardness, may be equal to it. If a
change does not lower the energy ½ p·Ap - (δ - z)·p, the next equations are solved more accurately;
if that does not help, projected gradients decrease the energy, and the search continues with their
set.

Pressures are scaled so that the diagonal of A is 1.
"""

from dataclasses import dataclass, replace
from functools import cached_property, partial
from math import prod
from typing import Any, NamedTuple

import numpy as np

from toeplitz_mg._typing import Array, Progress
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.inverse import Inverse
from toeplitz_mg.contact.normal.inner import Area, Look, solve_on_set
from toeplitz_mg.contact.normal.part import Part, Whole
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.projected_gradients import descend, energy
from toeplitz_mg.operators import ToeplitzOperator

STRIKES = 3  # Consecutive changes without a lower energy, before projected gradients are used.
LEAST_FALL = 1e-6  # Smallest relevant decrease of the energy, over it and the squared residual.
TIGHTER = 0.1  # Factor for the misfit left on the set, after a change without a lower energy.
RESCUE = 40  # Steps of projected gradients: enough to leave a cycle of sets.
NEAR = 4.0  # Gap that may close in the solution on a set, over the largest error before.
SPARSE = 0.2  # Up to this share of elements, fields are restricted to possible contact.
ROUGH = 0.1  # Above this residual, a product in single precision is sufficient after a step.
FLAT = 1e-4  # Smallest interference, over the displacement of an element by the mean pressure.
BALANCED = 1e-15  # Relative error of the sum of projected pressures that counts as rounding.


@dataclass(frozen=True)
class Iterate:
    """Admissible pressures, their displacements u, and the set C of elements in contact.

    It is exact if u = A p is a product in double precision, not a sum of changes.
    """

    p: Array
    u: Array
    C: Array
    is_exact: bool = True


def find_set(
    search: Any, A: Products, p: Array, C: Array, *, u: Array | None = None, eta: float
) -> tuple[Iterate, Any, tuple[int, ...]]:
    """Search for pressures and a set until the residual is small, or the products are used up.

    Parameters
    ----------
    search : Search
    A : Products
    p, C, u : ndarray
        Initial admissible pressures and set; the displacements A p, if known.
    eta : float
        The misfit to leave on the first sets, for `Search.advance`.

    Returns
    -------
    now, law, iterations
        The last iterate, its errors, and the numbers of iterations on the sets.
    """
    vectors, A.progress, b = A.vectors, search.progress, search.b
    if u is None:
        u = A(p) if vectors.count(p) else vectors.zeros(p)
    now = Iterate(p, u, C)
    strikes, lowest = 0, np.inf
    iterations: list[int] = []
    while True:
        law = search.look(now)
        A.residual = law.residual
        if A.exhausted or (law.residual <= search.tolerance and now.is_exact):
            return now, law, tuple(iterations)
        if law.residual <= search.tolerance:
            now = replace(now, u=A(now.p), is_exact=True)
            continue
        if strikes == STRIKES:
            p, u = descend(A, b, now.p, search.project, A.A.norm_bound, RESCUE, vectors)
            now, strikes = Iterate(p, u, search.set_of(p)), 0
            lowest = min(lowest, energy(p, u, b, vectors))
            continue
        now, count = search.advance(A, now, law, eta)
        iterations.append(count)
        reached = energy(now.p, now.u, b, vectors)
        # A local error should lower the energy by its square; less may be rounding.
        falls = lowest - reached > LEAST_FALL * law.residual**2 * abs(reached)
        strikes = 0 if falls else strikes + 1
        eta = TIGHTER * eta if strikes else eta
        lowest = min(lowest, reached)


class Law(NamedTuple):
    """The errors of pressures and a set."""

    look: Look
    touching: float  # The given approach, or the one at which nothing penetrates.
    interference: float  # The depth to which the undeformed bodies penetrate each other.
    residual: float  # The complementarity error relative to the interference.


@dataclass(frozen=True)
class Search:
    """A problem on one grid, with its tolerance."""

    grid: Grid
    z: Array  # The gap before loading.
    approach: float | None
    force: float | None  # Either this or the approach is None.
    # The allowed complementarity error, relative to the interference.
    tolerance: float
    progress: Progress | None = None
    hardness: float = np.inf  # The largest pressure.
    # The matrix and its inverse in single precision, if gap and pressure have exchanged their roles
    # (see `starts`).
    exchanged: tuple[ToeplitzOperator, ToeplitzOperator] | None = None

    @cached_property
    def _scaled(self) -> tuple[ToeplitzOperator, float]:
        return (self.exchanged[0], 1.0) if self.exchanged else self.grid.scaled_normal()

    @property
    def b(self) -> Array:
        """The right-hand side in the energy ½ p·Ap - b·p."""
        return (self.approach or 0.0) - self.z

    @property
    def matrix(self) -> ToeplitzOperator:
        """The matrix with unit diagonal."""
        return self._scaled[0]

    @property
    def unit(self) -> float:
        """The displacement of an element due to a unit pressure on it."""
        return self._scaled[1]

    @property
    def total(self) -> float:
        """The sum of the pressures, if the force is given."""
        assert self.force is not None
        return self.force / self.grid.area * self.unit

    @property
    def most(self) -> float:
        """The hardness in the unit of the pressures."""
        return self.hardness * self.unit

    @cached_property
    def inverse(self) -> Inverse:
        """An approximate inverse, to be fitted to a set."""
        return Inverse(self.grid, self.matrix, self.exchanged and self.exchanged[1])

    @cached_property
    def lowest(self) -> float:
        """The smallest gap."""
        return self.grid.vectors.min(self.z)

    def put_out_of_reach(self) -> Array:
        """Return the gap with infinite values replaced by finite ones that never close.

        No displacement exceeds the sum of the pressures, which is that of an element that carries
        all. If the approach is given, displacements in contact are at most that; if their mean is
        zero, one element may have the sum of all others.
        """
        z, vectors = self.z, self.grid.vectors
        where = vectors.xp.where
        farthest = vectors.max(where(z < np.inf, z, 0.0))
        most = 2.0 + self.grid.has_free_mean * prod(self.grid.shape)
        far = most * self.approach if self.approach is not None else farthest + self.total
        return where(z < np.inf, z, max(far, farthest))

    def look(self, now: Iterate) -> Law:
        """Return the errors of pressures and a set."""
        yields = room = None
        if self.hardness < np.inf:
            yields, room = (now.p == self.most) & ~now.C, self.most - now.p
        vectors = self.grid.vectors
        area = Area(now.C, np.float64, vectors, yields)
        if self.approach is None:
            gap = vectors.elementwise(vectors.xp.add, now.u, self.z)
            look = Look.at(now.p, gap, area, balanced=True, room=room)
            approach = look.mean
            touching = approach + (look.lowest if room is None else 0.0)
        else:
            approach = touching = self.approach
            gap = vectors.elementwise(lambda u, z: u + z - approach, now.u, self.z)
            look = Look.at(now.p, gap, area, balanced=False, room=room)
        interference = approach - self.lowest
        if interference <= 0.0 and self.force is not None and (total := vectors.sum(now.p)) > 0.0:
            # If the mean displacement is free, that of a wrong set may be below the summits. Its
            # average weighted by any pressures p is above them, by pᵀ A p over their sum.
            interference = vectors.dot(now.p, gap) / total - self.lowest
        if self.force is not None and self.grid.has_free_mean:
            # For a flat that touches everywhere, it is the rounding error of the displacements.
            interference = max(interference, FLAT * self.total / prod(self.grid.shape))
        # The interference may be below the rounding error of the gap.
        residual = look.error / interference if interference > 0.0 else 0.0
        return Law(look, touching, interference, residual)

    def advance(self, A: Products, now: Iterate, law: Law, eta: float) -> tuple[Iterate, int]:
        """Solve on the set until the misfit is `eta` times its violation, and change the set.

        The number of iterations is returned too.
        """
        C, M, count, gap = now.C, self.inverse, 0, law.look.gap
        p, part, vectors = now.p, None, A.vectors
        while vectors.count(C):  # It is empty if all elements in contact yield.
            M.fit(C)
            part = self._part(C, law.look)
            change = solve_on_set(
                A,
                M,
                C,
                now.p,
                law.look,
                part=part,
                most=self.most,
                eta=eta,
                tolerance=self.tolerance * law.interference,
                balanced=self.force is not None,
            )
            count += change.iterations
            if part is None:
                add = partial(vectors.elementwise, vectors.xp.add)
                p, u = add(now.p, change.p), add(now.u, change.u)
                gap, now = change.gap, Iterate(p, u, C, is_exact=False)
            else:
                p = part.put(part.cut(now.p) + change.p, now.p)
                gap = part.put(change.gap, law.look.gap)
            if change.is_solved or A.exhausted:
                break
            # Possibly a solution, or the limit of single precision: check in double precision.
            now = Iterate(p, A(p), C)
            law = self.look(now)
            if law.look.tension == 0.0 and law.residual <= self.tolerance:
                return now, count
        C = self.change(p, gap)
        is_bounded = self.hardness < np.inf
        is_admissible = vectors.min(p) >= 0.0 and not (is_bounded and vectors.max(p) > self.most)
        if part is not None or not is_admissible:
            p = p if is_admissible else self.clip(p)
            if is_bounded:
                C |= self.set_of(p)
            if law.residual > ROUGH:
                return Iterate(p, self._follow(A, now, p), C, is_exact=False), count
            return Iterate(p, A(p), C), count
        return replace(now, C=C), count

    def _follow(self, A: Products, now: Iterate, p: Array) -> Array:
        """Return the displacements of pressures near an iterate, to single precision."""
        change = p - now.p
        largest = A.vectors.peak(change) or 1.0
        following: Array = now.u + largest * A(A.vectors.cast(change / largest, self.inverse.dtype))
        return following

    def _part(self, C: Array, look: Look) -> Part | Whole | None:
        """Return the elements that are or may come in contact, if they are few."""
        vectors, reach = self.grid.vectors, NEAR * max(look.misfit, look.violation)
        near = vectors.elementwise(lambda C, gap: C | (gap < reach), C, look.gap)
        if self.hardness < np.inf or vectors.count(near) > SPARSE * prod(self.grid.shape):
            return None
        return Part(near) if vectors.cuts_fields else Whole()

    def change(self, p: Array, gap: Array) -> Array:
        """Return the elements whose pressure is free from now on.

        These are elements with pressure, elements that penetrate, and yielding elements that open.
        If there are none, the elements that touch first are taken.
        """
        most, vectors = self.most, self.grid.vectors
        C = vectors.elementwise(lambda p, gap: (p > 0.0) | ((p == 0.0) & (gap < 0.0)), p, gap)
        if most < np.inf:
            C &= (p < most) | ((p == most) & (gap > 0.0))
        if not vectors.count(C) and not vectors.count(p >= most):
            C = self.z == self.lowest
        return C

    def set_of(self, p: Array) -> Array:
        """Return the set of pressures: the elements that are pressed, by less than the hardness."""
        return (p > 0.0) & (p < self.most)

    def clip(self, p: Array) -> Array:
        """Return admissible pressures with the given sum, near these if not nearest.

        The missing sum is shared among the elements that are between the bounds.
        """
        vectors = self.grid.vectors
        xp = vectors.xp
        p = xp.clip(p, 0.0, self.most)
        if self.force is None:
            return p
        if self.hardness == np.inf:
            p *= self.total / vectors.sum(p)
            return p
        lack = self.total - vectors.sum(p)
        share = xp.where(self.set_of(p), p if lack < 0.0 else self.most - p, 0.0)
        room = vectors.sum(share)
        if abs(lack) > room:
            return self.project(p)
        return xp.clip(p + share * (lack / room), 0.0, self.most) if room > 0.0 else p

    def project(self, p: Array) -> Array:
        """Return the nearest admissible pressures with the given sum."""
        clip = self.grid.vectors.xp.clip
        if self.force is None:
            return clip(p, 0.0, self.most)
        # They are p - c, clipped, with the constant c that gives the sum, by Newton's method; a
        # step that leaves the bracket is replaced by bisection.
        vectors, most, total = self.grid.vectors, self.most, self.total
        low, high = vectors.min(p) - min(most, total), vectors.max(p)
        c = low
        while True:
            clipped = clip(p - c, 0.0, most)
            excess = vectors.sum(clipped) - total
            if excess > 0.0:
                low = c
            else:
                high = c
            inside = vectors.count((clipped > 0.0) & (clipped < most))
            following = c + excess / inside if inside else high
            if not low < following < high:
                following = 0.5 * (low + high)
            if abs(excess) <= BALANCED * total or not low < following < high:
                return clipped
            c = following
