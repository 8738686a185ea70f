"""The normal side of the alternation: bodies that are pressed while tractions change the gap."""

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.active_sets import Iterate
from toeplitz_mg.contact.checks import measure_from_contact
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.normal.active_set import Search
from toeplitz_mg.contact.normal.problem import make_result
from toeplitz_mg.contact.normal.solving import State, solve
from toeplitz_mg.contact.products import Products, Report
from toeplitz_mg.contact.results import NormalResult
from toeplitz_mg.contact.unlike.coupling import Coupling
from toeplitz_mg.operators import apply_to_rows


@dataclass
class Pressing:
    """Bodies that are pressed together while tractions change the gap.

    Attributes
    ----------
    grid : Grid
    z : ndarray
        The gap before the bodies touch, less `distance`.
    distance : float
    coupling : Coupling
    approach, force : float or None
        One of the two; the approach less `distance`.
    tolerance : float
    max_products : int
        The limit of products in each solution.
    report : Report
        What is told of them.
    products : int
        Products so far.
    iterations : list of int
        Those of conjugate gradients.
    """

    grid: Grid
    z: Array
    distance: float
    coupling: Coupling
    approach: float | None
    force: float | None
    tolerance: float
    max_products: int
    report: Report
    products: int = 0
    iterations: list[int] = field(default_factory=list)

    @classmethod
    def of(
        cls,
        grid: Grid,
        z: Array,
        coupling: Coupling,
        approach: float | None,
        force: float | None,
        tolerance: float,
        max_products: int,
        report: Report,
    ) -> Self:
        """Return the problem of a gap, an approach from where it is given, or a force."""
        gap, distance, approach = measure_from_contact(z, approach, grid.vectors)
        return cls(grid, gap, distance, coupling, approach, force, tolerance, max_products, report)

    def begin(self, q: Array | None, *, nested: bool) -> Array:
        """Return the pressures with tractions q, or none."""
        z = self.z if q is None else self.z + self.coupling.across(q)
        return self._run(z, None, nested=nested)

    def solve(self, q: Array, p: Array) -> Array:
        """Return the pressures with tractions q, from those near by."""
        return self._run(self.z + self.coupling.across(q), p, nested=False)

    def look(self, q: Array, p: Array) -> float:
        """Return how far the pressures p violate the conditions of contact with tractions q."""
        return self._state(q, p).residual

    def balance(self, p: Array) -> Array:
        """Return pressures of the given sum, if one is given."""
        if self.force is None or not p.any():
            return p
        scaled: Array = p * (self.force / self.grid.area / p.sum())
        return scaled

    def result(self, q: Array, p: Array) -> NormalResult:
        """Return what was found; tractions that change with the approach leave no stiffness.

        The work is that of both problems together, which is not known here.
        """
        state = self._state(q, p)._replace(iterations=tuple(self.iterations))
        result = make_result(self.grid, self.z, state, self.products, 0.0, self.distance)
        return replace(result, stiffness=None) if self.coupling.is_there else result

    def _search(self, z: Array) -> Search:
        search = Search(self.grid, z, self.approach, self.force, self.tolerance, self.report)
        if np.isinf(z).any():
            search = replace(search, z=search.put_out_of_reach())
        return search

    def _run(self, z: Array, guess: Array | None, *, nested: bool) -> Array:
        if self._is_apart(z):
            return np.zeros(z.shape)
        search = self._search(z)
        products = Products(search.matrix, self.max_products)
        guess = None if guess is None or not guess.any() else guess * search.unit
        state = solve(search, products, nested=nested, guess=guess)
        self._add(products.count)
        self.iterations += state.iterations
        p: Array = state.p / search.unit
        return p

    def _add(self, products: int) -> None:
        self.products += products
        self.report.add(products, self.max_products)

    def _is_apart(self, z: Array) -> bool:
        """Return whether nothing is pressed where the gap is z."""
        if self.approach is None:
            return self.force == 0.0
        return not (z < self.approach).any()

    def _state(self, q: Array, p: Array) -> State:
        """Return the pressures p with all normal displacements, those by tractions q too."""
        if self.force == 0.0:
            return State(p, np.zeros(p.shape), 0.0)
        across = self.coupling.across(q)
        search = self._search(self.z + across)
        x = p * search.unit
        u = apply_to_rows(search.matrix, x.ravel()).reshape(x.shape)
        self._add(1)
        law = search.look(Iterate(x, u, p > 0.0))
        return State(p, u + across, law.touching, law.residual)
