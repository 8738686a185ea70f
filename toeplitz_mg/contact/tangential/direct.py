"""Steady rolling of few elements: Newton's method with the matrix as an array.

The search knows the elements in contact only, as one axis. Its linear systems are solved in single
precision, which leaves a part of some 1e-6 of each to the next one.

It starts from the leading edge. The growth of the tractions is that of bonded bodies here, so that
the start is exact where nothing slips.
"""

import numpy as np
from scipy.linalg import lapack

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.steady_matrices import SteadyArray
from toeplitz_mg.contact.tangential.coulomb import Areas
from toeplitz_mg.contact.tangential.given_loads import Loads, Look
from toeplitz_mg.contact.tangential.leading_edge import roll_backwards
from toeplitz_mg.contact.tangential.problem import STIFFEST, Problem, State, admit
from toeplitz_mg.contact.tangential.settling import settle


def find_directly(
    problem: Problem,
    loads: Loads,
    K: Products,
    array: SteadyArray,
    guess: tuple[Array, Areas] | None,
    patience: int,
) -> State:
    """Find the steady state from the matrix as an array, or how far the areas settle.

    Parameters
    ----------
    problem, loads, K, patience
        The arguments of `settling.settle`, on a grid.
    array : SteadyArray
        The matrix K of the elements in contact.
    guess : (ndarray, Areas), optional
        Admissible tractions and areas; by default those from the leading edge backwards.
    """
    C = problem.g > 0.0
    few = Loads(loads.units[..., C], loads.arms[..., C], loads.wanted)
    on_contact = problem.restrict(C)
    if guess is None:
        q, slide = np.zeros(problem.b.shape), np.zeros(C.shape, bool)
        if not len(loads.wanted):  # Where loads are given, something must stick to carry them.
            q[:, C] = array.solve(on_contact.b.reshape(-1)).reshape(on_contact.b.shape)
            q, slide = roll_backwards(q, problem.g)
        guess = admit(problem, q, slide)
    q, areas = guess
    products = Products(array, K.limit)
    products.count = K.count
    state = settle(
        on_contact,
        few,
        products,
        (np.ascontiguousarray(q[:, C]), Areas(areas.stick[C], areas.slide[C])),
        lambda now, areas, q: (_newton_step(now, areas, array, few), 1),
        patience,
    )
    K.count = products.count
    return state.extend(C)


def _combine(solutions: Array, arms: Array, wanted: Array) -> Array:
    """Return the first column, and of the others what makes its products with arms as wanted."""
    q, others = solutions[:, 0], solutions[:, 1:]
    if len(wanted):
        # Units differ, and where too little sticks nothing restores the loads.
        sizes = [np.linalg.norm(x, axis=1) for x in (arms, others.T)]
        of_arms, of_others = (np.where(s > 0.0, s, 1.0) for s in sizes)
        system = (arms @ others) / of_arms[:, None] / of_others
        weights = np.linalg.lstsq(system, (wanted - arms @ q) / of_arms)[0]
        q = q + others @ (weights / of_others)
    return q


def _newton_step(now: Look, areas: Areas, K: SteadyArray, loads: Loads) -> Array:
    """Return the change of the tractions by Newton's method."""
    law, given = now.law, len(loads.wanted)
    # Loads are to be restored to their last digit.
    matrix = K.array if given else K.rough
    tangents = _Tangents(areas, law.T.n)
    if not tangents.count:
        return np.zeros_like(law.r)
    system = tangents.of_rows(np.ascontiguousarray(tangents.of_rows(matrix).T)).T
    stiffness = np.minimum(law.stiffness, STIFFEST * K.array[0, 0])
    system.ravel("K")[:: len(system) + 1][tangents.stuck :] += stiffness[tangents.turning]
    scale = float(np.abs(law.r).max()) or 1.0
    fields = np.concatenate([law.r[None] / scale, loads.units]).reshape(1 + given, -1)
    right = tangents.of_rows(fields.T.astype(matrix.dtype))
    gesv = lapack.sgesv if matrix.dtype == np.float32 else lapack.dgesv
    *_, solutions, is_singular = gesv(system, right, overwrite_a=True, overwrite_b=True)
    if is_singular:  # There is no step, the areas do not settle, and the search goes on by GMRES.
        return np.zeros_like(law.r)
    solutions = solutions.astype(np.float64)
    solutions[:, 0] *= scale
    arms = tangents.of_rows(loads.arms.reshape(given, -1).T).T if given else loads.arms
    return tangents.combine(_combine(solutions, arms, now.missing))


class _Tangents:
    """A basis of the tangents: each direction where it sticks, across the traction where it slides.

    Parameters
    ----------
    areas : Areas
    n : ndarray of shape (components, m)
        The directions of the tractions where it slides.

    Attributes
    ----------
    stuck : int
        How many of the tangents are of elements that stick; the others follow.
    turning : ndarray of int
        The elements of these others: in one component there are none.
    """

    def __init__(self, areas: Areas, n: Array) -> None:
        components, m = self._shape = n.shape
        stuck = np.flatnonzero(areas.stick)
        self._stuck = np.concatenate([stuck + k * m for k in range(components)])
        self.stuck = len(self._stuck)
        self.turning = np.flatnonzero(areas.slide) if components == 2 else stuck[:0]
        self._across = n[::-1, self.turning] * [[-1.0], [1.0]] if len(self.turning) else n[:, :0]

    @property
    def count(self) -> int:
        """How many there are."""
        return self.stuck + len(self.turning)

    def of_rows(self, V: Array) -> Array:
        """Return the components along the tangents of fields, the columns of an array."""
        parts = np.empty((self.count, V.shape[1]), V.dtype)
        V.take(self._stuck, axis=0, out=parts[: self.stuck], mode="clip")
        if len(self.turning):
            x, y = self._across.astype(V.dtype)[..., None]
            along_y = self.turning + self._shape[1]
            parts[self.stuck :] = x * V.take(self.turning, axis=0) + y * V.take(along_y, axis=0)
        return parts

    def combine(self, weights: Array) -> Array:
        """Return the field with these components along the tangents."""
        v = np.zeros(self._shape)
        v.reshape(-1)[self._stuck] = weights[: self.stuck]
        if len(self.turning):
            v[:, self.turning] = self._across * weights[self.stuck :]
        return v
