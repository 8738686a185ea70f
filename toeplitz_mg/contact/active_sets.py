"""The search for the sets of a contact problem: its energy descends from one set to the next.

The elements in contact, or those that stick and those that slide, are an active set: while it is
fixed, the problem is an equation. That is solved only to the accuracy at which the set is known to
be wrong, and then the set changes. Where this does not lower the energy ½ x·Ax - b·x of the
tractions x, the next equations are solved more exactly; where that does not help either, projected
gradients descend from there, and the search goes on with the set that they find.
"""

from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from toeplitz_mg._typing import Array, Progress
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.projected_gradients import descend, energy

STRIKES = 3  # Changes of the sets in a row without a lower energy, after which gradients descend.
LEAST_FALL = 1e-6  # Fall of the energy that counts, over it and the square of the residual.
TIGHTER = 0.1  # Factor of the misfit left on the sets, at a change that does not lower the energy.
RESCUE = 40  # Steps of projected gradients: enough to leave the sets that come back.


@dataclass(frozen=True)
class Iterate:
    """Tractions x that obey the inequalities of a problem, their displacements u, and its sets.

    Attributes
    ----------
    x, u : ndarray
    sets : object
        What the problem itself takes for its sets of elements.
    is_exact : bool
        Whether u = A x is a product in double precision, and not a sum of changes.
    """

    x: Array
    u: Array
    sets: Any
    is_exact: bool = True


class Search(Protocol):
    """What `find_sets` asks of a problem."""

    def look(self, now: Iterate) -> Any:
        """Return what is wrong with an iterate: its `residual` is the largest violation."""

    def advance(self, A: Products, now: Iterate, law: Any, eta: float) -> tuple[Iterate, int]:
        """Solve on the sets until the misfit is `eta` times what is wrong with them; change them.

        What `look` returned is `law`. The number of iterations is returned too.
        """

    def project(self, x: Array) -> Array:
        """Return the tractions nearest to these that obey the inequalities."""

    def sets_of(self, x: Array) -> Any:
        """Return the sets that such tractions have."""


def find_sets(
    search: Search,
    A: Products,
    x: Array,
    sets: Any,
    *,
    u: Array | None = None,
    b: Array,
    eta: float,
    tolerance: float,
    progress: Progress | None,
) -> tuple[Iterate, Any, tuple[int, ...]]:
    """Search for tractions and sets until the residual is small, or the products are used up.

    Parameters
    ----------
    search : Search
    A : Products
    x : ndarray
        Tractions to start from, that obey the inequalities.
    sets : object
        Sets to start from.
    u : ndarray, optional
        The displacements A x, where they are known.
    b : ndarray
        The right-hand side in the energy ½ x·Ax - b·x.
    eta : float
        The misfit that is left on the first sets, as `Search.advance` takes it.
    tolerance : float
        The residual that is small enough.
    progress : callable, optional
        Called as ``progress(products, residual)`` after each product, with the residual of the
        last sets.

    Returns
    -------
    now : Iterate
    law : object
        What is wrong with it.
    iterations : tuple of int
        The iterations on the sets, one after the other.
    """
    vectors, A.progress = A.vectors, progress
    if u is None:
        u = A(x) if vectors.count(x) else vectors.zeros(x)
    now = Iterate(x, u, sets)
    strikes, lowest = 0, np.inf
    iterations: list[int] = []
    while True:
        law = search.look(now)
        A.residual = law.residual
        if A.exhausted or (law.residual <= tolerance and now.is_exact):
            return now, law, tuple(iterations)
        if law.residual <= tolerance:
            now = replace(now, u=A(now.x), is_exact=True)
            continue
        if strikes == STRIKES:
            x, u = descend(A, b, now.x, search.project, A.A.norm_bound, RESCUE, vectors)
            now, strikes = Iterate(x, u, search.sets_of(x)), 0
            lowest = min(lowest, energy(x, u, b, vectors))
            continue
        now, count = search.advance(A, now, law, eta)
        iterations.append(count)
        reached = energy(now.x, now.u, b, vectors)
        # What is wrong by some part should lower the energy by its square: less may be rounding.
        falls = lowest - reached > LEAST_FALL * law.residual**2 * abs(reached)
        strikes = 0 if falls else strikes + 1
        eta = TIGHTER * eta if strikes else eta
        lowest = min(lowest, reached)
