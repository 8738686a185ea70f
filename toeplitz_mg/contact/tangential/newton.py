"""Steps of Newton's method for the steady state of rolling, by GMRES.

GMRES makes the residual orthogonal to one product after the other ("simpler GMRES"), so that it is
known after each of them, and how far it has to go depends on what else is wrong.

While the areas change, no step needs to be exact: there the approximate inverse alone makes one.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.tangential.coulomb import Areas, along
from toeplitz_mg.contact.tangential.given_loads import CARRIED, Loads, Look, complement
from toeplitz_mg.contact.tangential.problem import SHARP, STIFFEST, Problem
from toeplitz_mg.engine.vectors import Vectors

REDUCTION = 1e-3  # Reduction of the residual by one solution where the problem is linearised.
# Residual that is left in given areas, over what is wrong with these: with more of it they change
# more often, with less of it iterations are spent on areas that will not stay.
ETA = 0.4
FALLS = 0.5  # Factor of the residual by which a step by the approximate inverse alone is good.
SINGLE = 1e-5  # Reduction of the residual for which single precision is good.
# Part of a product's size that may be left before it is made orthogonal again: with a tenth of it,
# what is left grows in single precision after ten iterations.
CANCELLED = 0.5
ROUNDING = 10.0  # Machine epsilons that are left of a product which adds nothing.


@dataclass
class Steps:
    """Steps of Newton's method, one after the other.

    Attributes
    ----------
    problem, loads, K
        The arguments of `settling.settle`.
    M : ShiftedInverses
        Approximate inverses of K and additions to its diagonal.
    most : int
        Most iterations of GMRES in a step.
    """

    problem: Problem
    loads: Loads
    K: Products
    M: Any
    most: int
    _slide: Array | None = field(default=None, init=False)
    _goal: float = field(default=np.inf, init=False)

    def __call__(self, now: Look, areas: Areas, q: Array) -> tuple[Array, int]:
        """Return a change of the tractions, and the iterations of GMRES."""
        before, self._slide = self._slide, areas.slide
        changed = before is None or self.problem.vectors.count(before ^ areas.slide) > 0
        # Given loads are carried by what GMRES makes orthogonal to them.
        if changed and now.residual < self._goal and not len(self.loads.wanted):
            self._goal = FALLS * now.residual
            return make_step_without_product(now, self.M, self.problem.vectors), 0
        self._goal = np.inf
        return make_step(self.problem, self.loads, now, areas, q, self.K, self.M, self.most)


def make_step_without_product(now: Look, M: Any, vectors: Vectors) -> Array:
    """Return a change of the tractions by the approximate inverse."""
    law = now.law
    largest = vectors.max(np.abs(law.r)) or 1.0
    stiffness = np.minimum(law.stiffness, STIFFEST * M.diagonal).astype(M.dtype)
    v: Array = M.at(stiffness)((law.r / largest).astype(M.dtype))
    return law.T(largest * v.astype(np.float64))


def make_step(
    problem: Problem,
    loads: Loads,
    now: Look,
    areas: Areas,
    q: Array,
    K: Products,
    M: Any,
    most: int,
) -> tuple[Array, int]:
    """Return a change of the tractions by Newton's method, and the iterations of GMRES.

    Parameters
    ----------
    problem, loads, K
        The arguments of `settling.settle`.
    now : Look
        What is wrong with the tractions q in these areas.
    M : ShiftedInverses
        Approximate inverses of K and additions to its diagonal.
    most : int
        Most iterations.

    References
    ----------
    H. F. Walker, L. Zhou, A simpler GMRES, Numer. Linear Algebra Appl. 1 (1994).
    """
    law, vectors, is_loaded = now.law, problem.vectors, len(loads.wanted) > 0
    T, lam, minus_slip, r = law.T, law.stiffness, law.minus_slip, law.r
    first: Any = 0.0
    if is_loaded:
        of_slip = complement(loads.units, T, vectors)
        of_tractions = complement(loads.arms, T, vectors)
        if loads.error(q, vectors) > CARRIED:
            first = of_tractions.reach(now.missing)
            K_first = K(first)
            minus_slip = minus_slip - K_first
            r = of_slip(r - T(K_first) - lam * first)
    largest = vectors.max(np.abs(r))
    if largest == 0.0:
        return np.zeros_like(q) + first, 0
    exact = max(SHARP * problem.tolerance * law.scale / largest, SINGLE)
    if len(r) > 1 and vectors.count(areas.slide):  # The circle |q| = g is linearised.
        exact = max(exact, REDUCTION)
    most = min(most, max(1, K.limit - K.count))
    dtype, k0, invert = M.dtype, M.diagonal, M.at(lam)
    T, lam = T.astype(dtype), np.minimum(lam, STIFFEST * k0).astype(dtype)
    # Each row is a part of the residual, the change of the tractions that removes it, and the
    # displacements of that. The first row is what is left, after minus all changes.
    rows = np.empty((most + 1, 3, *r.shape), dtype)
    rows[0] = 0.0
    rows[0, 0] = r / largest
    k = 0
    while True:
        k += 1
        part, d, Kd = rows[k]
        d[...] = T(invert(rows[k - 1, 0]))
        if is_loaded:
            d[...] = of_tractions(d)
        Kd[...] = K(d)
        part[...] = T(Kd) + lam * d
        if is_loaded:
            part[...] = of_slip(part)
        adds = _take_out(rows, k, vectors)
        rest = vectors.max(np.abs(rows[0, 0]))
        v, Kv = -largest * rows[0, 1:].astype(np.float64)
        # What is wrong with the areas and with the linearisation is left to the next step.
        slips = vectors.min(along(minus_slip - Kv, law.T.n))
        v += first
        wrong = max(k0 * problem.excess(q + v), -slips) / largest
        if not adds or rest <= max(exact, ETA * wrong) or k == most:
            return v, k


def _take_out(rows: Array, k: int, vectors: Vectors) -> bool:
    """Take out of what is left, the first row, all that row k can; whether that is anything.

    The part of the residual in row k is made orthogonal to those in the rows before.
    """
    parts, row = rows[:k, 0], rows[k]
    before, size = np.inf, vectors.norm(row[0])
    least = ROUNDING * float(np.finfo(rows.dtype).eps) * size
    while size < CANCELLED * before:
        weights = vectors.dots(parts, row[0])
        if k > 1:
            vectors.add_combination(-weights[1:], rows[1:k], row)
        size, before = vectors.norm(row[0]), size
    if not least < size < np.inf:
        return False
    row /= size
    vectors.axpy(-weights[0] / size, row, rows[0])
    return True
