"""Panagiotopoulos' alternation between the normal and the tangential problem until both hold.

For pressures p, the tangential problem has the bound μ p and the displacements by p. For its
tractions q, the normal problem has a gap that is larger by their displacements. Solving one after
the other is a map p → p', whose fixed point solves both. It is a contraction for the usual K of the
materials and μ. Anderson's acceleration combines the last three pairs, restricted to the elements
in contact in the last one: elsewhere the combination would press on an open gap.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.checks import SLIDES, bound_of, measure_from_contact
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.normal import problem as normal
from toeplitz_mg.contact.normal import starts
from toeplitz_mg.contact.normal.search import Iterate, Search
from toeplitz_mg.contact.products import Products, Report
from toeplitz_mg.contact.results import NormalResult, TangentialResult
from toeplitz_mg.contact.results.base import remake
from toeplitz_mg.contact.tangential import friction
from toeplitz_mg.contact.tangential.law import Problem, State, admit, drop_rounding
from toeplitz_mg.contact.window import MARGIN, Window
from toeplitz_mg.operators import apply_to_rows

DEPTH = 2  # Number of differences of pairs that are combined: more save nothing, or diverge.


@dataclass(frozen=True)
class Coupling:
    """The displacements along the surface by pressures, and across it by tractions."""

    matrices: tuple[Any, ...]  # For the displacements along x and y by the pressures.

    @property
    def is_there(self) -> bool:
        """Whether pressures displace the bodies along the surface."""
        return any(A is not None for A in self.matrices)

    def along(self, p: Array) -> Array:
        """Return the displacements along the surface by pressures, of shape (components, ...)."""
        return np.stack(
            [
                np.zeros(p.shape) if A is None else apply_to_rows(A, p.ravel()).reshape(p.shape)
                for A in self.matrices
            ]
        )

    def across(self, q: Array) -> Array:
        """Return the normal displacements by tractions: by reciprocity, the transpose."""
        u = np.zeros(q.shape[1:])
        for A, traction in zip(self.matrices, q, strict=True):
            if A is not None:  # An odd matrix is minus its transpose.
                u -= apply_to_rows(A, traction.ravel()).reshape(u.shape)
        return u


@dataclass
class Pressing:
    """Normal contact with a gap that tractions change."""

    grid: Grid
    z: Array  # The gap before loading, minus `distance`, its minimum.
    coupling: Coupling
    approach: float | None  # Minus `distance` too.
    force: float | None  # Either this or the approach is None.
    tolerance: float
    max_products: int  # For each solution.
    report: Report
    products: int = 0  # So far.
    iterations: list[int] = field(default_factory=list)  # Of conjugate gradients.
    distance: float = 0.0

    def __post_init__(self) -> None:
        """Measure the gap and the approach from first contact."""
        self.z, self.distance, self.approach = measure_from_contact(
            self.z, self.approach, self.grid.vectors
        )

    def begin(self, q: Array | None, *, nested: bool) -> Array:
        """Return the pressures for tractions q (or none), without an initial guess."""
        z = self.z if q is None else self.z + self.coupling.across(q)
        return self._run(z, None, nested=nested)

    def solve(self, q: Array, p: Array) -> Array:
        """Return the pressures for tractions q, starting from p."""
        return self._run(self.z + self.coupling.across(q), p, nested=False)

    def look(self, q: Array, p: Array) -> float:
        """Return the violation of the conditions of contact by pressures p with tractions q."""
        return self._state(q, p).residual

    def balance(self, p: Array) -> Array:
        """Scale pressures to the given sum, if there is one."""
        if self.force is None or not p.any():
            return p
        scaled: Array = p * (self.force / self.grid.area / p.sum())
        return scaled

    def result(self, q: Array, p: Array) -> NormalResult:
        """Return the result; its stiffness is None, as the tractions change with the approach.

        Its work is not set, since it is known only for both problems together.
        """
        state = self._state(q, p)._replace(iterations=tuple(self.iterations))
        result = normal.make_result(self.grid, self.z, state, self.products, 0.0, self.distance)
        return remake(result, stiffness=None) if self.coupling.is_there else result

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
        state = starts.solve(search, products, nested=nested, guess=guess)
        self._add(products.count)
        self.iterations += state.iterations
        p: Array = state.p / search.unit
        return p

    def _add(self, products: int) -> None:
        self.products += products
        self.report.add(products, self.max_products)

    def _is_apart(self, z: Array) -> bool:
        """Return whether the bodies do not touch for the gap z."""
        if self.approach is None:
            return self.force == 0.0
        return not (z < self.approach).any()

    def _state(self, q: Array, p: Array) -> starts.State:
        """Return the state for pressures p, with normal displacements by p and q."""
        if self.force == 0.0:
            return starts.State(p, np.zeros(p.shape), 0.0)
        across = self.coupling.across(q)
        search = self._search(self.z + across)
        x = p * search.unit
        u = apply_to_rows(search.matrix, x.ravel()).reshape(x.shape)
        self._add(1)
        law = search.look(Iterate(x, u, p > 0.0))
        return starts.State(p, u + across, law.touching, law.residual)


class Found(NamedTuple):
    """The solution of the tangential problem for given pressures, in a window."""

    problem: Problem
    state: State
    window: Window
    slip: Array | None  # None if it follows from the displacements.


@dataclass
class Shifting:
    """Friction of shifted bodies, with bound and displacements that depend on the pressures."""

    grid: Grid
    coupling: Coupling
    mu: Array  # The coefficient of friction, one number or one per element.
    # (components, ...): the displacements along the surface without slip and pressures.
    b: Array
    total: Array | None  # (components,): the sum of the tractions, if given.
    least: float  # Lower limit for the scale of the displacements.
    tolerance: float
    max_products: int
    nested: bool
    report: Report
    q: Array | None  # The tractions on the whole grid: the last ones, or an initial guess.
    slide: Array | None = None  # The elements that slid in the last solution.
    products: int = 0  # Products so far.
    window: Window | None = None  # Around the last contact, with the matrix restricted to it.
    matrix: Any = None
    found: Found | None = None  # The last solution.

    def __call__(self, p: Array) -> Array:
        """Return the tractions for pressures p."""
        g = drop_rounding(bound_of(self.mu, p), self.grid.vectors)
        window = self._fit(g > 0.0)
        b = self.b - self.coupling.along(p)
        limits = self.tolerance, self.least, self.report
        problem = Problem(window.grid, window.cut(g), window.cut(b), *limits)
        products = Products(self.matrix, self.max_products)
        guess, total, carried = None, self.total, g.sum() * (1.0 - SLIDES)
        if self.q is not None:
            slide = np.zeros(self.grid.shape, bool) if self.slide is None else self.slide
            guess = admit(problem, window.cut(self.q), window.cut(slide))
        # A force that reaches or exceeds the bound makes all elements slide.
        all_slides = total is not None and bool(np.linalg.norm(total) >= carried)
        how = {"all_slides": all_slides, "nested": self.nested}
        state, slip = friction.find_tractions(problem, total, products, guess, **how)
        self.products += products.count
        self.report.add(products.count, self.max_products)
        self.found = Found(problem, state, window, slip)
        self.slide, self.q = window.extend(state.areas.slide), window.extend(state.q)
        return self.q

    def result(self, p: Array) -> TangentialResult:
        """Return the result, with all displacements along the surface."""
        assert self.found is not None
        problem, state, window, slip = self.found
        # The work of both problems together is in the normal result.
        result = friction.make_result(problem, state, window, self.products, 0.0, slip)
        return add_displacements(result, self.coupling.along(p), self.grid)

    def _fit(self, contact: Array) -> Window:
        """Return a window of all elements in contact; the last one if it contains them."""
        window = self.window
        if window is None or window.cut(contact).sum() < contact.sum():
            self.window = window = self.grid.window(contact, MARGIN)
            self.matrix = window.grid.tangential()
        return window


@dataclass
class Rolling:
    """Rolling, with bound and displacements that depend on the pressures."""

    grid: Grid
    coupling: Coupling  # For the displacements here; `upstream` for those one element ahead.
    upstream: Coupling
    mu: Array  # The coefficient of friction, one number or one per element.
    # Returns the result of `rolling` for a traction bound, an additional rigid slip, and an initial
    # guess (a result or None).
    solve: Callable[[Array, Array, TangentialResult | None], TangentialResult]
    slip: Array  # (components, ...): the given part of that slip.
    found: TangentialResult | None = None  # The last solution.
    products: int = 0  # Products so far.

    def __call__(self, p: Array) -> Array:
        """Return the tractions for pressures p."""
        strain = (self.coupling.along(p) - self.upstream.along(p)) / self.grid.element[0]
        self.found = self.solve(bound_of(self.mu, p), self.slip + strain, self.found)
        self.products += self.found.products
        return self.found.traction.reshape(self.slip.shape)

    def result(self, p: Array) -> TangentialResult:
        """Return the result, with all displacements along the surface."""
        assert self.found is not None
        # The work of both problems together is in the normal result.
        result = remake(self.found, products=self.products, work=0.0)
        return add_displacements(result, self.coupling.along(p), self.grid)


def add_displacements(result: TangentialResult, u: Array, grid: Grid) -> TangentialResult:
    """Add the displacements along the surface by pressures to a result.

    Warnings about neglected coupling are left out; the normal result has those about resolution.
    """
    shape = result.traction.shape
    displacement = result.displacement + np.where(result.contact, u, 0.0).reshape(shape)
    energy = 0.5 * grid.area * float((result.traction * displacement).sum())
    return remake(result, displacement=displacement, energy=energy, warnings=())


def alternate(
    pressing: Pressing,
    shear: Callable[[Array], Array],
    p: Array,
    *,
    tolerance: float,
    most: int,
    report: Report,
) -> tuple[Array, Array, tuple[float, ...]]:
    """Find pressures that satisfy both problems, in at most so many iterations.

    `shear` returns the tangential tractions for pressures. Returns the pressures, these tractions,
    and the violation of the conditions of normal contact in each iteration.
    """
    pairs: list[tuple[Array, Array]] = []
    residuals: list[float] = []
    while True:
        q = shear(p)
        residuals.append(pressing.look(q, p))
        report.look(residuals[-1])
        if residuals[-1] <= tolerance or len(residuals) == most or report.exhausted:
            return p, q, tuple(residuals)
        pairs = [*pairs, (p, pressing.solve(q, p))][-DEPTH - 1 :]
        p = pressing.balance(_accelerate(pairs))


def _accelerate(pairs: list[tuple[Array, Array]]) -> Array:
    """Return an approximate fixed point of a map from pairs x, y of arguments and values.

    Anderson's method: among the affine combinations of the pairs, take the y of the one with the
    least |y - x|. Where that is negative, or the y of the last pair is zero, take the last y.
    """
    _, image = pairs[-1]
    if len(pairs) == 1:
        return image
    steps = [y - x for x, y in pairs]
    differences = [(steps[-1] - step).ravel() for step in steps[:-1]]
    weights, *_ = np.linalg.lstsq(np.stack(differences, axis=1), steps[-1].ravel(), rcond=None)
    mixed = image.copy()
    for weight, (_, earlier) in zip(weights, pairs[:-1], strict=True):
        mixed -= weight * (image - earlier)
    return np.where((image > 0.0) & (mixed > 0.0), mixed, image)
