"""The search for the sets of a contact problem: its energy descends from one set to the next.

The elements in contact, or those that stick and those that slide, are an active set: while it is
fixed, the problem is an equation. That is solved only to the accuracy at which the set is known to
be wrong, and then the set changes. Where this does not lower the energy ½ x·Ax - b·x of the
tractions x, the next equations are solved more exactly; where that does not help either, projected
gradients descend from there, and the search goes on with the set that they find.
"""

from dataclasses import dataclass, replace
from typing import Generic, NamedTuple, Protocol, Self, TypeVar

import numpy as np

from toeplitz_mg._typing import Array, Progress
from toeplitz_mg.contact.products import Products
from toeplitz_mg.solvers.projected_gradients import descend, energy

STRIKES = 3  # Changes of the set in a row without a lower energy, after which gradients descend.
TIGHTER = 0.1  # Factor, at each of those changes, of the misfit that is left on a set.
RESCUE = 40  # Steps of projected gradients: enough to leave the sets that come back.

Sets = TypeVar("Sets")
Law = TypeVar("Law", bound="Violation")


@dataclass(frozen=True)
class Iterate(Generic[Sets]):
    """Tractions that obey the inequalities of the problem, and sets of elements.

    Attributes
    ----------
    x : ndarray
        The tractions.
    u : ndarray
        Their displacements A x.
    sets : object
        Whatever the problem calls its sets.
    is_exact : bool
        Whether `u` has the accuracy of a product in double precision.
    """

    x: Array
    u: Array
    sets: Sets
    is_exact: bool = True

    @classmethod
    def of(cls, A: Products, x: Array, sets: Sets) -> Self:
        """Multiply the tractions, unless they are all zero."""
        return cls(x, A(x) if x.any() else np.zeros_like(x), sets)

    def multiply_again(self, A: Products) -> Self:
        """Make the displacements exact."""
        return replace(self, u=A(self.x), is_exact=True)


class Violation(Protocol):
    """What is wrong with an iterate."""

    @property
    def residual(self) -> float:
        """The largest violation of the conditions of contact, relative to what is natural."""


class Search(Protocol[Sets, Law]):
    """A problem of contact, with the matrix A, as `find_sets` asks for it."""

    @property
    def tolerance(self) -> float:
        """Of the residual."""

    @property
    def progress(self) -> Progress | None:
        """What is told of each change of the sets."""

    @property
    def b(self) -> Array:
        """The right-hand side in the energy."""

    def look(self, now: Iterate[Sets]) -> Law:
        """Return what is wrong with an iterate."""

    def advance(
        self, A: Products, now: Iterate[Sets], law: Law, eta: float
    ) -> tuple[Iterate[Sets], int]:
        """Solve on the sets, change them, and return what that gives and the iterations it took.

        `eta` is the misfit that may be left on the sets, relative to how wrong they are.
        """

    def project(self, x: Array) -> Array:
        """Return the tractions nearest to these that obey the inequalities."""

    def sets_of(self, x: Array) -> Sets:
        """Return the sets that such tractions have."""


class Found(NamedTuple, Generic[Sets, Law]):
    """The end of a search, and the iterations of each advance."""

    now: Iterate[Sets]
    law: Law
    iterations: tuple[int, ...]


def find_sets(
    search: Search[Sets, Law], A: Products, start: Iterate[Sets], eta: float
) -> Found[Sets, Law]:
    """Search for the sets of a problem until it is solved, or the products are used up.

    Parameters
    ----------
    search : Search
    A : Products
    start : Iterate
    eta : float
        As in `Search.advance`; it shrinks where the energy does not fall.
    """
    now, lowest, strikes = start, np.inf, 0
    iterations: list[int] = []
    while True:
        law = search.look(now)
        if A.exhausted or (law.residual <= search.tolerance and now.is_exact):
            return Found(now, law, tuple(iterations))
        if law.residual <= search.tolerance:
            now = now.multiply_again(A)
            continue
        if strikes == STRIKES:
            x, u = descend(A, search.b, now.x, search.project, A.A.norm_bound, RESCUE)
            now, strikes = Iterate(x, u, search.sets_of(x)), 0
            lowest = min(lowest, energy(x, u, search.b))
            continue
        if search.progress is not None:
            search.progress(A.count, law.residual)
        now, count = search.advance(A, now, law, eta)
        iterations.append(count)
        reached = energy(now.x, now.u, search.b)
        if reached < lowest:
            strikes = 0
        else:
            strikes, eta = strikes + 1, TIGHTER * eta
        lowest = min(lowest, reached)
