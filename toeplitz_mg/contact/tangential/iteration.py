"""Steps towards the steady state of rolling, by approximate inverses and Anderson's acceleration.

A step changes the tractions as the approximate inverse has it. Before that it combines the last
changes, whose displacements are known, so that what a combination removes in the areas of now is
known too, without a product: the one that leaves least is taken. While the areas stay that is the
minimal residual method (Anderson's acceleration of a linear iteration is GMRES); and where they
change, no product is lost, as K is the same.
"""

from math import prod

import numpy as np
from scipy.linalg import lapack

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.tangential.law import (
    FLAT,
    STIFFEST,
    Areas,
    Linearisation,
    Problem,
    Tangent,
    along,
)
from toeplitz_mg.contact.tangential.loads import CARRIED, Loads, Look, complement
from toeplitz_mg.engine.vectors import Vectors
from toeplitz_mg.preconditioners.causal import ShiftedInverses

# Elements of a piece of contact on a line, in the mean, below which the inverse is cut at no edge:
# in pieces of some 15 it takes as many products either way, in those of 3 up to twice as many.
SHORT_PIECES = 12
STEEPEST = -0.5  # Least γ by which the diagonal is inverted, where friction falls.
DEPENDENT = 1e-6  # Relative addition to squared norms, so that changes may depend on each other.


class Iteration:
    """Steps of an accelerated iteration, one after the other.

    M are approximate inverses of K and additions to its diagonal, and `depth` the most changes that
    are combined.

    References
    ----------
    D. G. Anderson, Iterative procedures for nonlinear integral equations, J. ACM 12 (1965).
    H. F. Walker, P. Ni, Anderson acceleration for fixed-point iterations, SIAM J. Numer. Anal. 49
    (2011).
    """

    def __init__(self, problem: Problem, loads: Loads, M: ShiftedInverses, depth: int) -> None:
        self._problem, self._loads, self._M = problem, loads, M
        # The last changes of tractions, and of displacements in contact, over what was wrong.
        self._changes = np.empty((2, depth, *problem.b.shape), M.dtype)
        self._inside = problem.g > 0.0
        self._is_in_pieces = _is_in_short_pieces(self._inside, problem.vectors)
        self._steps, self._scale = 0, 1.0
        self._before: tuple[Array, Array] | None = None
        self._slide: Array | None = None

    def __call__(
        self, now: Look, areas: Areas, q: Array, u: Array, eta: float
    ) -> tuple[Array, None, int]:
        """Return a change of the tractions q, whose displacements are u (see `settling.Step`)."""
        law, vectors, M = now.law, self._problem.vectors, self._M
        dq, du = self._remember(q, u)
        T = law.T.astype(M.dtype)
        stiffness = np.minimum(law.stiffness, STIFFEST * M.diagonal).astype(M.dtype)
        scale = self._scale = vectors.max(np.abs(law.r)) or 1.0
        # The first row is what is wrong, the others are what the changes remove of it.
        rows = np.empty((1 + len(dq), *q.shape), M.dtype)
        rows[0] = law.r / scale
        rows[1:] = law.remove(dq, du, T, stiffness)
        if is_loaded := len(self._loads.wanted) > 0:
            for row in rows[1:]:
                row[...] = now.of_slip(row)
        weights = _least(vectors.gram(rows))
        vectors.add_combination(-weights, rows[1:], rows[0])
        if self._slide is None or vectors.count(areas.slide ^ self._slide):
            self._invert, self._slide = M.at(stiffness), areas.slide
        project = _leave if self._is_in_pieces else T.project_each
        if law.slope is None:
            v = T(self._invert(rows[0], project))
        else:
            v = self._invert_along(rows[0], law, T, stiffness)
        vectors.add_combination(weights, dq, v)
        v = scale * v.astype(np.float64)
        if is_loaded:
            of_tractions = complement(self._loads.arms, law.T, vectors, self._problem.carriers)
            v = of_tractions(v)
            if self._loads.error(q, vectors) > CARRIED:
                v += of_tractions.reach(now.missing)
        return v, None, 1

    def _invert_along(self, r: Array, law: Linearisation, T: Tangent, stiffness: Array) -> Array:
        """Return the change of tractions whose sizes depend on the slip.

        Along them, 1/γ adds to K where friction rises; where it falls, it is the diagonal that is
        inverted.
        """
        assert law.slope is not None
        M, slope = self._M, law.slope.astype(self._M.dtype)
        rises = slope > FLAT
        softer = np.where(rises, 1.0 / np.where(rises, slope, 1.0), 0.0)
        along_n = along(r, T.n) * (1.0 + np.abs(slope))
        r = T(r) + T.n * (softer * along_n)
        part = np.where(rises, 1.0 / np.sqrt(1.0 + softer), 0.0)

        def project_each(rows: Array) -> None:
            kept = part * np.einsum("kc...,c...->k...", rows, T.n)
            T.project_each(rows)
            rows += T.n * kept[:, None]

        size = along_n / (M.diagonal * (1.0 + np.maximum(slope, STEEPEST)))
        if rises.any():
            rising = M.at(M.diagonal * softer)(r, project_each)
            size = np.where(rises, along(rising, T.n), size)
        return T(M.at(stiffness)(r, project_each)) + T.n * size

    def _remember(self, q: Array, u: Array) -> tuple[Array, Array]:
        """Return the last changes of tractions and of displacements, with those to q and u."""
        depth = self._changes.shape[1]
        if self._before is not None:
            dq, du = (now - before for now, before in zip((q, u), self._before, strict=True))
            self._changes[0, self._steps % depth] = dq / self._scale
            self._changes[1, self._steps % depth] = np.where(self._inside, du / self._scale, 0.0)
            self._steps += 1
        self._before = q, u
        dq, du = self._changes[:, : min(self._steps, depth)]
        return dq, du


def _is_in_short_pieces(inside: Array, vectors: Vectors) -> bool:
    """Whether a contact is along a line, and in pieces of few elements, where these end."""
    if prod(inside.shape[1:]) > 1:
        return False
    pieces = vectors.count(inside[:-1] & ~inside[1:])
    return vectors.count(inside) < SHORT_PIECES * pieces


def _leave(fields: Array) -> None:
    """Project fields to all, in place."""


def _least(products: Array) -> Array:
    """Return the weights of rows that leave least of the first one, from their inner products."""
    G, right = products[1:, 1:].copy(), products[1:, 0]
    if not len(G):
        return right
    diagonal = G.ravel()[:: len(G) + 1]
    diagonal *= 1.0 + DEPENDENT
    diagonal[diagonal == 0.0] = 1.0
    _, weights, fails = lapack.dposv(G, right)
    # Where a change is stiff, its square may overflow.
    return np.zeros(len(G)) if fails else weights
