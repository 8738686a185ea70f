"""Search for the elements in contact: an active set, and conjugate gradients on it.

On a set the system A p = δ - z is solved only to the accuracy at which the set is known to be
wrong: the iteration stops as soon as its residual is below the violation of the two inequalities
of `normal`.

Pressures are in units of the displacement that an element gives itself: the diagonal of A is 1.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.counted import Products, dot
from toeplitz_mg.contact.grid import Grid, coarsened, refined
from toeplitz_mg.contact.inverse import Inverse
from toeplitz_mg.contact.normal.inner import Area, Look, conjugate_gradients
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.solvers.projected_gradients import descend

COARSE = 1.5e-3, 1e-2  # tolerance of the first guess, on a coarser grid: from, to, and between
ROUGH = 0.2  # of the detail that the coarser grid does not have
DAMPING = 0.5  # of the step by which the pressures follow the detail of a finer grid
RESCUE = 40  # products of projected gradients, where the sets cycle


class State(NamedTuple):
    """Pressures and their displacements, the approach, and how they were found."""

    p: Array
    u: Array
    approach: float
    residual: float = 0.0
    iterations: tuple[int, ...] = ()


@dataclass(frozen=True)
class Search:
    """A problem on one grid, and how well it is to be solved."""

    grid: Grid
    z: Array
    approach: float | None
    force: float | None
    tolerance: float
    progress: Callable[[int, float], object] | None = None

    @cached_property
    def _coefficients(self) -> Array:
        return self.grid.normal_coefficients()

    @property
    def unit(self) -> float:
        """The displacement of an element by a unit pressure on it."""
        return float(self._coefficients.flat[0])

    @cached_property
    def matrix(self) -> ToeplitzOperator:
        """The matrix whose diagonal is 1."""
        return ToeplitzOperator(self._coefficients / self.unit)

    @property
    def total(self) -> float:
        """The sum of the pressures, where the force is given."""
        assert self.force is not None
        return self.force / self.grid.area * self.unit

    @cached_property
    def lowest(self) -> float:
        """The gap where the bodies are nearest."""
        return float(self.z.min())

    def first_guess(self, *, nested: bool) -> tuple[Array, Array]:
        """Pressures and elements in contact: from a coarser grid, or a superset of the contact."""
        coarse = self._coarser() if nested else None
        if coarse is not None:
            state = coarse.run(Products(coarse.matrix, 200), coarse.first_guess(nested=True))
            p = self._refined(state, self.unit / coarse.unit)
            if p.any():
                return p, p > 0.0
        if self.approach is not None:
            return np.zeros(self.z.shape), self.z < self.approach
        return np.full(self.z.shape, self.total / self.z.size), np.ones(self.z.shape, bool)

    def _coarser(self) -> "Search | None":
        """The problem on a coarser grid, or None where that says nothing."""
        grid = self.grid.coarser()
        if grid is None:
            return None
        z = coarsened(self.z, len(grid.shape))
        if self.approach is not None and not (z < self.approach).any():
            return None  # the averages touch nowhere
        detail = np.abs(self.z - refined(z, self.z.shape)).max() / (np.ptp(self.z) or 1.0)
        tolerance = float(np.clip(ROUGH * detail, *COARSE))
        return Search(grid, z, self.approach, self.force, tolerance)

    def _refined(self, coarse: State, ratio: float) -> Array:
        """Interpolate from a coarser grid, and follow the detail that it does not have.

        A step of Jacobi's iteration, without a product, as displacements are smooth.
        """
        p, u = (refined(x, self.z.shape) for x in (coarse.p, coarse.u))
        p = np.maximum(ratio * p - DAMPING * (u + self.z - coarse.approach), 0.0)
        if self.force is not None and p.any():
            p *= self.total / p.sum()
        return p

    def run(self, A: Products, guess: tuple[Array, Array]) -> State:
        """Find the pressures and the area of contact, from some pressures and elements."""
        M = Inverse(self.matrix)
        balanced = self.force is not None
        p, C = guess
        u = A(p) if p.any() else np.zeros_like(p)
        is_exact = True  # u, to double precision
        eta, strikes, lowest = 0.5, 0, np.inf
        iterations: list[int] = []
        while True:
            w = u + self.z - (self.approach or 0.0)
            now = Look.at(p, w, Area(C, np.float64), balanced=balanced)
            approach = now.mean if self.approach is None else self.approach
            scale = approach - self.lowest
            # On a coarser grid the interference may be below the rounding of the gap.
            residual = now.error / scale if scale > 0.0 else 0.0
            if now.tension == 0.0 and (residual <= self.tolerance or A.exhausted):
                if is_exact or A.exhausted:
                    touching = approach + (now.lowest if balanced else 0.0)
                    return State(p, u, touching, residual, tuple(iterations))
                u, is_exact = A(p), True
                continue
            if self.progress is not None:
                self.progress(A.count, residual)
            M.fit(C)
            change = conjugate_gradients(
                A, M, C, p, now, eta=eta, tolerance=self.tolerance * scale, balanced=balanced
            )
            iterations.append(change.iterations)
            p, u, is_exact = p + change.p, u + change.u, False
            if not (change.is_solved or A.exhausted):  # an answer, or all that single precision can
                u, is_exact = A(p), True
                continue
            C = (C & ((p > 0.0) | ((p == 0.0) & change.below))) | (~C & change.below)
            if p.min() < 0.0:
                p = self._clipped(p)
                u, is_exact = A(p), True
            if not C.any():  # where it would touch first
                C = self.z == self.lowest
            b = (0.0 if balanced else approach) - self.z
            energy = dot(p, 0.5 * u - b)
            # Each change should lower the energy. Where it does not, first solve more exactly.
            if energy < lowest:
                strikes = 0
            else:
                strikes, eta = strikes + 1, eta / 10.0
            if strikes == 3:
                p, u = descend(A, b, p, self._nearest, A.A.norm_bound, RESCUE)
                C, strikes, energy = p > 0.0, 0, dot(p, 0.5 * u - b)
            lowest = min(lowest, energy)

    def _clipped(self, p: Array) -> Array:
        """Without tension, and of the given sum: near the pressures, if not the nearest."""
        p = np.maximum(p, 0.0)
        return p if self.force is None else p * (self.total / p.sum())

    def _nearest(self, p: Array) -> Array:
        """The nearest admissible pressures."""
        if self.force is None:
            return np.maximum(p, 0.0)
        # Those of the given sum are max(p - c, 0) with the constant c that gives the sum.
        ordered = np.sort(p, axis=None)[::-1]
        c = (np.cumsum(ordered) - self.total) / np.arange(1, p.size + 1)
        c = c[np.flatnonzero(ordered > c)[-1]]
        return np.asarray(np.maximum(p - c, 0.0))
