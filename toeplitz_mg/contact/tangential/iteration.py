"""Steps towards the steady state of rolling: approximate inverses with Anderson acceleration.

A step applies the approximate inverse to the residual. Before that it combines the last changes
with the least residual; their displacements are known, so this takes no product. While the areas
are constant, this is the method of minimal residuals (Anderson acceleration of a linear iteration
is GMRES). If they change, no product is lost, since K is the same.
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

# If pieces of a line contact have fewer elements on average, the inverse is not corrected at edges:
# with some 15 elements the products are the same, with 3 the correction takes up to twice as many.
SHORT_PIECES = 12
STEEPEST = -0.5  # Lower limit of γ for inverting the diagonal, if friction falls.
DEPENDENT = 1e-6  # Relative addition to squared norms, as changes may be linearly dependent.


class Iteration:
    """Steps of an accelerated iteration.

    M are approximate inverses of K plus multiples of the unit matrix; `depth` is the largest number
    of changes that are combined.

    References
    ----------
    D. G. Anderson, Iterative procedures for nonlinear integral equations, J. ACM 12 (1965).
    H. F. Walker, P. Ni, Anderson acceleration for fixed-point iterations, SIAM J. Numer. Anal. 49
    (2011).
    """

    def __init__(self, problem: Problem, loads: Loads, M: ShiftedInverses, depth: int) -> None:
        self._problem, self._loads, self._M = problem, loads, M
        # The last changes of tractions, and of displacements in contact, over the residual.
        self._changes = np.empty((2, depth, *problem.b.shape), M.dtype)
        self._inside = problem.g > 0.0
        self._is_in_pieces = _is_in_short_pieces(self._inside, problem.vectors)
        self._steps, self._scale = 0, 1.0
        self._before: tuple[Array, Array] | None = None
        self._slide: Array | None = None

    def __call__(
        self, now: Look, areas: Areas, q: Array, u: Array, eta: float
    ) -> tuple[Array, None, int]:
        """Return a change of the tractions q with displacements u (see `settling.Step`)."""
        law, vectors, M = now.law, self._problem.vectors, self._M
        dq, du = self._remember(q, u)
        T = law.T.astype(M.dtype)
        stiffness = np.minimum(law.stiffness, STIFFEST * M.diagonal).astype(M.dtype)
        scale = self._scale = vectors.max(np.abs(law.r)) or 1.0
        # The first row is the residual, the others are its reductions by the changes.
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
        """Return the change of tractions whose magnitude depends on the slip.

        Along the traction, 1/γ is added to K if friction rises; if it falls, the diagonal is
        inverted instead.
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
        """Return the last changes of tractions and displacements, including those to q and u."""
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
    """Whether a contact is along a line and consists of short pieces."""
    if prod(inside.shape[1:]) > 1:
        return False
    pieces = vectors.count(inside[:-1] & ~inside[1:])
    return vectors.count(inside) < SHORT_PIECES * pieces


def _leave(fields: Array) -> None:
    """Leave fields unchanged: the projection to all fields."""


def _least(products: Array) -> Array:
    """Return the weights of rows that reduce the first one most, from their inner products."""
    G, right = products[1:, 1:].copy(), products[1:, 0]
    if not len(G):
        return right
    diagonal = G.ravel()[:: len(G) + 1]
    diagonal *= 1.0 + DEPENDENT
    diagonal[diagonal == 0.0] = 1.0
    _, weights, fails = lapack.dposv(G, right)
    # The square of a stiff change may overflow.
    return np.zeros(len(G)) if fails else weights
