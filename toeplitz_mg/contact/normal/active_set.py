"""The search for the elements in contact: what `active_sets` asks for in normal contact.

On a set C of elements the equation is A p = δ - z: conjugate gradients solve it until their misfit
is below the violation of the inequalities, tension in C or penetration elsewhere.

Pressures are in units of the displacement that an element gives itself: the diagonal of A is 1.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import prod
from typing import NamedTuple

import numpy as np

from toeplitz_mg._typing import Array, Progress
from toeplitz_mg.contact.active_sets import Iterate, find_sets
from toeplitz_mg.contact.grid import Grid
from toeplitz_mg.contact.inverse import Inverse
from toeplitz_mg.contact.normal.inner import Area, Look, solve_on_set
from toeplitz_mg.contact.products import Products, for_coarser_grids
from toeplitz_mg.engine.threads import elementwise
from toeplitz_mg.operators import ToeplitzOperator

ETA = 0.5  # Misfit that is left on a set, relative to its violation, while the energy falls.
ROUGH = 0.2  # Tolerance on a coarser grid, relative to the detail of the gap that it does not have.
# Limits of the tolerance on a coarser grid: a finer guess, and a rougher, save nothing.
LEAST, MOST = 1.5e-3, 1e-2
DAMPING = 0.5  # Part of Jacobi's step by which the pressures follow the detail of a finer grid.
COARSE_PRODUCTS = 200  # Most products on a coarser grid, whose answer is but a guess.


class State(NamedTuple):
    """Pressures and their displacements, the approach, and how they were found."""

    p: Array
    u: Array
    approach: float
    residual: float = 0.0
    iterations: tuple[int, ...] = ()


class Law(NamedTuple):
    """What is wrong with pressures and a set."""

    look: Look
    touching: float  # The given approach, or else that at which nothing penetrates.
    interference: float  # The depth by which the bodies would penetrate each other.
    residual: float  # The error of complementarity, relative to the interference.


@dataclass(frozen=True)
class Search:
    """A problem on one grid, and how well it is to be solved.

    Attributes
    ----------
    grid : Grid
    z : ndarray
        The gap before the bodies touch.
    approach, force : float or None
        One of the two.
    tolerance : float
        The error of the complementarity that is allowed, relative to the interference.
    progress : callable, optional
    """

    grid: Grid
    z: Array
    approach: float | None
    force: float | None
    tolerance: float
    progress: Progress | None = None

    @cached_property
    def _scaled(self) -> tuple[ToeplitzOperator, float]:
        return self.grid.scaled_normal()

    @property
    def matrix(self) -> ToeplitzOperator:
        """The matrix whose diagonal is 1."""
        return self._scaled[0]

    @property
    def unit(self) -> float:
        """The displacement of an element by a unit pressure on it."""
        return self._scaled[1]

    @property
    def total(self) -> float:
        """The sum of the pressures, where the force is given."""
        assert self.force is not None
        return self.force / self.grid.area * self.unit

    @cached_property
    def _inverse(self) -> Inverse:
        return Inverse(self.grid, self.matrix)

    @cached_property
    def lowest(self) -> float:
        """The gap where the bodies are nearest."""
        return self.grid.vectors.min(self.z)

    def run(self, A: Products, *, nested: bool) -> State:
        """Find the pressures and the area of contact, with a first guess from coarser grids."""
        p, C = self._first_guess(nested=nested)
        b = (self.approach or 0.0) - self.z
        now, law, iterations = find_sets(
            self, A, p, C, b=b, eta=ETA, tolerance=self.tolerance, progress=self.progress
        )
        return State(now.x, now.u, law.touching, law.residual, iterations)

    def _first_guess(self, *, nested: bool) -> tuple[Array, Array]:
        """Return pressures and elements in contact: of a coarser grid, or more than in contact."""
        coarse = self._coarser() if nested else None
        if coarse is not None:
            state = coarse.run(Products(coarse.matrix, COARSE_PRODUCTS), nested=True)
            p = self._interpolate(state, self.unit / coarse.unit)
            if self.grid.vectors.count(p):
                return p, p > 0.0
        if self.approach is not None:
            return np.zeros(self.z.shape), self.z < self.approach
        everywhere = self.total / prod(self.grid.shape)
        return np.full(self.z.shape, everywhere), np.ones(self.z.shape, bool)

    def _coarser(self) -> "Search | None":
        """Return the problem on a coarser grid, or None where that says nothing."""
        grid = self.grid.coarser()
        if grid is None:
            return None
        z, vectors = self.grid.coarsen(self.z), self.grid.vectors
        if self.approach is not None and not grid.vectors.count(z < self.approach):
            return None  # The averages touch nowhere.
        detail = vectors.max(np.abs(self.z - self.grid.refine(z)))
        detail /= vectors.max(self.z) - self.lowest or 1.0
        tolerance = float(np.clip(ROUGH * detail, LEAST, MOST))
        progress = for_coarser_grids(self.progress)
        return Search(grid, z, self.approach, self.force, tolerance, progress)

    def _interpolate(self, coarse: State, ratio: float) -> Array:
        """Interpolate from a coarser grid, and follow the detail that it does not have.

        That is a step of Jacobi's iteration, without a product, as displacements are smooth.
        """
        p, u = (self.grid.refine(x) for x in (coarse.p, coarse.u))
        p = np.maximum(ratio * p - DAMPING * (u + self.z - coarse.approach), 0.0)
        if self.force is not None and self.grid.vectors.count(p):
            p *= self.total / self.grid.vectors.sum(p)
        return p

    def look(self, now: Iterate) -> Law:
        """Return what is wrong with pressures and a set."""
        area = Area(now.sets, np.float64, self.grid.vectors)
        if self.approach is None:
            look = Look.at(now.x, elementwise(np.add, now.u, self.z), area, balanced=True)
            approach, touching = look.mean, look.mean + look.lowest
        else:
            approach = touching = self.approach
            gap = elementwise(lambda u, z: u + z - approach, now.u, self.z)
            look = Look.at(now.x, gap, area, balanced=False)
        interference = approach - self.lowest
        # On a coarser grid the interference may be below the rounding of the gap.
        residual = look.error / interference if interference > 0.0 else 0.0
        return Law(look, touching, interference, residual)

    def advance(self, A: Products, now: Iterate, law: Law, eta: float) -> tuple[Iterate, int]:
        """Solve on the set C = `now.sets`, and change it."""
        C, M, count = now.sets, self._inverse, 0
        while True:
            M.fit(C)
            tolerance, balanced = self.tolerance * law.interference, self.force is not None
            change = solve_on_set(
                A, M, C, now.x, law.look, eta=eta, tolerance=tolerance, balanced=balanced
            )
            count += change.iterations
            x, u = elementwise(np.add, now.x, change.p), elementwise(np.add, now.u, change.u)
            now = Iterate(x, u, C, is_exact=False)
            if change.is_solved or A.exhausted:
                break
            # An answer, or all that single precision can do: look with double precision.
            now = replace(now, u=A(now.x), is_exact=True)
            law = self.look(now)
            if law.look.tension == 0.0 and law.residual <= self.tolerance:
                return now, count
        p = now.x
        # In contact remains what is pressed, or is not but below; what is below enters.
        C = elementwise(
            lambda C, p, b: np.where(C, (p > 0.0) | ((p == 0.0) & b), b), C, p, change.below
        )
        if not A.vectors.count(C):  # It goes on where the bodies would touch first.
            C = self.z == self.lowest
        if A.vectors.min(p) < 0.0:
            p = self._clip(p)
            return Iterate(p, A(p), C), count
        return replace(now, sets=C), count

    def sets_of(self, p: Array) -> Array:
        """Return the elements that are pressed."""
        return p > 0.0

    def _clip(self, p: Array) -> Array:
        """Return pressures without tension, of the given sum: near these, if not the nearest."""
        p = np.maximum(p, 0.0)
        return p if self.force is None else p * (self.total / self.grid.vectors.sum(p))

    def project(self, p: Array) -> Array:
        """Return the nearest pressures without tension, of the given sum."""
        if self.force is None:
            return np.maximum(p, 0.0)
        # The nearest ones are max(p - c, 0), with the constant c that gives the sum. Newton's
        # method finds it from below: each step leaves out the elements that would be below zero.
        c, vectors = -np.inf, self.grid.vectors
        while True:
            left = p > c
            following = (vectors.sum(p * left) - self.total) / vectors.count(left)
            if not following > c:
                return np.maximum(p - c, 0.0)
            c = following
