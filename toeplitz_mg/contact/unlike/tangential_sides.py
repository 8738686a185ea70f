"""The tangential sides of the alternation: bodies that are shifted, and bodies that roll."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.checks import SLIDES
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.products import Products, Report
from toeplitz_mg.contact.results import TangentialResult
from toeplitz_mg.contact.tangential.friction import make_result
from toeplitz_mg.contact.tangential.given_loads import Loads
from toeplitz_mg.contact.tangential.problem import Problem, State, admit, drop_rounding
from toeplitz_mg.contact.tangential.shifted import solve
from toeplitz_mg.contact.tangential.shifting import slide_off
from toeplitz_mg.contact.unlike.coupling import Coupling, add_displacements, bound_of
from toeplitz_mg.contact.window import MARGIN, Window


class Found(NamedTuple):
    """What solves the tangential problem of some pressures, in a window."""

    problem: Problem
    state: State
    window: Window
    slip: Array | None  # None where it is that of the displacements.


@dataclass
class Shifting:
    """Bodies that are shifted while pressures bound the tractions, and displace along the surface.

    Attributes
    ----------
    grid : Grid
    coupling : Coupling
    mu : ndarray
        The coefficient of friction, of all elements or of each.
    b : ndarray of shape (components, ...)
        The displacements along the surface, were there neither slip nor pressures.
    total : ndarray of shape (components,) or None
        The sum of the tractions, where that is given.
    least : float
        A displacement below which none counts as the largest.
    tolerance : float
    max_products : int
    nested : bool
    report : Report
    q : ndarray or None
        The tractions, on the whole grid: the last, or a first guess.
    slide : ndarray of bool, or None
        Where the bodies slid last.
    products : int
        Products so far.
    window, matrix : Window and LinearOperator, or None
        The elements around the last contact, and the matrix among them.
    found : Found or None
        What was found last.
    """

    grid: Grid
    coupling: Coupling
    mu: Array
    b: Array
    total: Array | None
    least: float
    tolerance: float
    max_products: int
    nested: bool
    report: Report
    q: Array | None
    slide: Array | None = None
    products: int = 0
    window: Window | None = None
    matrix: Any = None
    found: Found | None = None

    def __call__(self, p: Array) -> Array:
        """Return the tractions for pressures p."""
        g = drop_rounding(bound_of(self.mu, p), self.grid.vectors)
        window = self._fit(g > 0.0)
        b = self.b - self.coupling.along(p)
        problem = Problem(
            window.grid,
            window.cut(g),
            window.cut(b),
            self.tolerance,
            self.least,
            self.report,
        )
        products = Products(self.matrix, self.max_products)
        if self.total is not None and self._slides(g):
            state, slip = slide_off(problem, self.total, products)
        else:
            state, slip = self._solve(window, problem, products), None
        self.products += products.count
        self.report.add(products.count, self.max_products)
        self.found = Found(problem, state, window, slip)
        self.slide, self.q = window.extend(state.areas.slide), window.extend(state.q)
        return self.q

    def result(self, p: Array) -> TangentialResult:
        """Return what was found, with all displacements along the surface."""
        assert self.found is not None
        problem, state, window, slip = self.found
        # The work of both problems together is with the pressures.
        result = make_result(problem, state, window, self.products, 0.0, slip)
        return add_displacements(result, self.coupling.along(p), self.grid)

    def _solve(self, window: Window, problem: Problem, products: Products) -> State:
        """Return the state of stick and slip."""
        guess, loads = None, Loads.of_sums(self.total, problem.b)
        if self.q is not None:
            slide = np.zeros(self.grid.shape, bool) if self.slide is None else self.slide
            guess = admit(problem, window.cut(self.q), window.cut(slide))
        state = solve(problem, loads, products, guess, nested=self.nested)
        return state if len(loads.wanted) else replace(state, shift=np.zeros(len(problem.b)))

    def _slides(self, g: Array) -> bool:
        """Whether the given force is all that a bound carries, or more."""
        if self.total is None:
            return False
        return float(np.linalg.norm(self.total)) >= float(g.sum()) * (1.0 - SLIDES)

    def _fit(self, contact: Array) -> Window:
        """Return a window of all elements in contact: the last one, while that has them all."""
        window = self.window
        if window is None or window.cut(contact).sum() < contact.sum():
            self.window = window = self.grid.window(contact, MARGIN)
            self.matrix = window.grid.tangential()
        return window


@dataclass
class Rolling:
    """Bodies that roll while pressures bound the tractions, and displace along the surface.

    Attributes
    ----------
    grid : Grid
    coupling, upstream : Coupling
        Of the displacements here, and one element ahead.
    mu : ndarray
        The coefficient of friction, of all elements or of each.
    solve : callable
        Returns what `rolling` finds for a traction bound, a rigid slip over the distance rolled
        that adds to that of the creepages, and a result to start from, or None.
    slip : ndarray of shape (components, ...)
        The part of that slip that is given.
    found : TangentialResult or None
        What was found last.
    products : int
        Products so far.
    """

    grid: Grid
    coupling: Coupling
    upstream: Coupling
    mu: Array
    solve: Callable[[Array, Array, TangentialResult | None], TangentialResult]
    slip: Array
    found: TangentialResult | None = None
    products: int = 0

    def __call__(self, p: Array) -> Array:
        """Return the tractions for pressures p."""
        strain = (self.coupling.along(p) - self.upstream.along(p)) / self.grid.element[0]
        self.found = self.solve(bound_of(self.mu, p), self.slip + strain, self.found)
        self.products += self.found.products
        return self.found.traction.reshape(self.slip.shape)

    def result(self, p: Array) -> TangentialResult:
        """Return what was found, with all displacements along the surface."""
        assert self.found is not None
        # The work of both problems together is with the pressures.
        result = replace(self.found, products=self.products, work=0.0)
        return add_displacements(result, self.coupling.along(p), self.grid)
