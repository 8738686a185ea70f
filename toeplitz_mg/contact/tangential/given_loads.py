"""Loads that are given in the place of creepages, and what is wrong with tractions then.

The creepages that belong to the loads are unknowns as the tractions are, and each step is for all
at once. A change of the tractions takes up what is missing of the loads, and the creepages are
those that leave the least slip.
"""

from dataclasses import dataclass, replace

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.tangential.coulomb import Areas, Tangent, make_admissible, size
from toeplitz_mg.contact.tangential.motion import Complement, inner_products
from toeplitz_mg.contact.tangential.problem import Linearisation, Problem, linearise
from toeplitz_mg.engine.vectors import Vectors

CARRYING = 8  # Attempts to restore the loads without a product: the rest is left to the next step.
CARRIED = 1e-12  # Part of the loads that is missing which is rounding.


@dataclass(frozen=True)
class Loads:
    """Loads that are given in the place of creepages.

    Attributes
    ----------
    units : ndarray of shape (m, components, ...)
        The displacements in a step, were there no slip, by a unit of each unknown creepage: minus
        the rigid slip.
    arms : ndarray of shape (m, components, ...)
        Fields whose inner products with the tractions are the loads.
    wanted : ndarray of shape (m,)
        The loads.
    """

    units: Array
    arms: Array
    wanted: Array

    def missing(self, q: Array, vectors: Vectors) -> Array:
        """Return what is missing of the loads."""
        return self.wanted - inner_products(self.arms, q, vectors)

    def error(self, q: Array, vectors: Vectors) -> float:
        """Return the largest part of a load that is missing, of what tractions of a sign give."""
        if not len(self.wanted):
            return 0.0
        missing = np.abs(self.missing(q, vectors))
        carried = np.array([vectors.sum(np.abs(arm * q)) for arm in self.arms])
        scale = np.maximum(carried, np.abs(self.wanted))
        # A load of zero has the scale of the others, in the unit of its own tractions.
        sizes = [vectors.sum(size(arm) * size(q)) for arm in self.arms]
        scale = np.maximum(scale, sizes)
        return float(np.max(missing / np.where(scale > 0.0, scale, 1.0)))


@dataclass(frozen=True)
class Look:
    """What is wrong with tractions whose creepages are unknown, as far as loads are given.

    Attributes
    ----------
    law : Linearisation
        Coulomb's law, with the creepages that suit the tractions best.
    creepages : ndarray of shape (m,)
        Those of them that are unknown.
    b : ndarray
        The displacements in a step, were there no slip, with these creepages.
    missing : ndarray of shape (m,)
        What is missing of the loads.
    residual : float
    """

    law: Linearisation
    creepages: Array
    b: Array
    missing: Array
    residual: float


def look(problem: Problem, loads: Loads, areas: Areas, q: Array, u: Array) -> Look:
    """Say what is wrong with tractions q, with the displacements u = K q."""
    if not len(loads.wanted):
        law = linearise(problem, areas, q, u)
        return Look(law, loads.wanted, problem.b, loads.wanted, law.residual)
    vectors = problem.vectors
    T = Tangent(areas, q, vectors, balanced=())
    creepages = complement(loads.units, T, vectors).coordinates(T(u - problem.b))
    b = problem.b + vectors.combine(creepages, loads.units)
    law = linearise(replace(problem, b=b), areas, q, u)
    missing, error = loads.missing(q, vectors), loads.error(q, vectors)
    return Look(law, creepages, b, missing, max(law.residual, error))


def complement(fields: Array, T: Tangent, vectors: Vectors) -> Complement:
    """Return the complement of some fields among the tangents."""
    return Complement(np.array([T(f) for f in fields]).reshape(fields.shape), vectors)


def carry(problem: Problem, loads: Loads, areas: Areas, q: Array) -> Array:
    """Change tractions so that they carry the loads, as far as they can in these areas."""
    vectors = problem.vectors
    for _ in range(CARRYING if len(loads.wanted) else 0):
        if loads.error(q, vectors) <= CARRIED:
            break
        T = Tangent(areas, q, vectors, balanced=())
        v = complement(loads.arms, T, vectors).reach(loads.missing(q, vectors))
        q, _ = make_admissible(q + v, problem.g, areas, areas.slide, None, vectors)
    return q
