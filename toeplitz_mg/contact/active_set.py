"""Search for the elements in contact: an active set, and conjugate gradients on it.

On a set the system A p = δ - z is solved only to the accuracy at which the set is known to be
wrong: the iteration stops as soon as its residual is below the violation of the two inequalities
of `normal`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.contact.grid import Grid, coarsened
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.projected import descend
from toeplitz_mg.operators import apply_to_rows
from toeplitz_mg.operators.transforms import near_fast_length
from toeplitz_mg.preconditioners.symbol import sampled_symbol
from toeplitz_mg.preconditioners.trigonometric import cosine_inverse

Array = NDArray[Any]

COARSE = 3e-3  # tolerance of the first guess, on a coarser grid
LONG = 20  # iterations, after which the product is made anew
RESCUE = 40  # products of projected gradients, where the sets cycle


class State(NamedTuple):
    """Pressures and their displacements, the approach, and how they were found."""

    p: Array
    u: Array
    approach: float
    residual: float
    iterations: tuple[int, ...]


class _Set:
    """Elements in contact, with a mask to multiply by: that is faster than to index by them."""

    def __init__(self, C: Array) -> None:
        self.mask = C.astype(np.float64)
        self.size = int(np.count_nonzero(C))

    def mean(self, x: Array) -> float:
        """The mean of a field in contact."""
        return float(np.vdot(x, self.mask)) / self.size


class _Look(NamedTuple):
    """What is wrong with some pressures and a set of elements in contact."""

    gap: Array  # this and r until the next look only
    r: Array  # minus the gap, in contact
    approach: float
    misfit: float  # the largest gap in contact
    tension: float  # the largest negative pressure, as a displacement
    violation: float  # of the set: that, and penetration elsewhere
    scale: float  # the largest interference
    touching: float  # the approach at which nothing penetrates, to the last bit
    residual: float


class _Matrix(NamedTuple):
    """The products, a preconditioner, and the diagonal."""

    A: Products
    M: LinearOperator  # of A / a0, as single precision ends at 1e38
    a0: float

    @classmethod
    def of(cls, A: Products) -> "_Matrix":
        a0 = float(A.A.c.flat[0])
        symbol = sampled_symbol(A.A, tuple(near_fast_length(n) for n in A.A.grid_shape)) / a0
        try:
            return cls(A, cosine_inverse(A.A, symbol, np.float32), a0)
        except np.linalg.LinAlgError:  # very long elements: the symbol sinks into the rounding
            return cls(A, cosine_inverse(A.A, symbol), a0)


@dataclass(frozen=True)
class Search:
    """A problem on one grid, and how well it is to be solved."""

    grid: Grid
    z: Array
    approach: float | None
    force: float | None
    tolerance: float
    progress: Callable[[int, float], object] | None = None

    @property
    def total(self) -> float:
        """The sum of the pressures, where the force is given."""
        assert self.force is not None
        return self.force / self.grid.area

    @cached_property
    def fields(self) -> tuple[Array, ...]:
        """Fields to write on: to touch new memory takes as long as the arithmetic."""
        return tuple(np.empty(self.z.shape) for _ in range(3))

    @cached_property
    def lowest(self) -> float:
        """The gap where the bodies are nearest."""
        return float(self.z.min())

    def coarser(self) -> "Search | None":
        """The problem on a coarser grid, or None where that says nothing."""
        grid = self.grid.coarser()
        if grid is None:
            return None
        z = coarsened(self.z, len(grid.shape))
        if self.approach is not None and not (z < self.approach).any():
            return None  # the averages touch nowhere
        return Search(grid, z, self.approach, self.force, COARSE)

    def run(self, A: Products, guess: tuple[Array, Array]) -> State:
        """Find the pressures and the area of contact, from some pressures and elements."""
        matrix = _Matrix.of(A)
        p, C = guess
        u = A(p) if p.any() else np.zeros_like(p)
        eta, strikes, lowest = 1.0, 0, np.inf
        iterations: list[int] = []
        while True:
            area = _Set(C)
            now = self._look(p, u, area, matrix.a0)
            is_admissible = now.tension == 0.0
            if is_admissible and (now.residual <= self.tolerance or A.exhausted):
                return State(p, u, now.touching, now.residual, tuple(iterations))
            if self.progress is not None:
                self.progress(A.count, now.residual)
            now, count = self._iterate(p, u, area, now, matrix, eta)
            iterations.append(count)
            if now.tension == 0.0 and now.residual <= self.tolerance:
                if count > LONG:  # never trust a long recurrence
                    u = A(p)
                continue
            C = (C & ((p > 0.0) | ((p == 0.0) & (now.gap < 0.0)))) | (~C & (now.gap < 0.0))
            if now.tension > 0.0:
                p = self._clipped(p)
                u = A(p)
            if not C.any():  # where it would touch first
                C = self.z == self.lowest
            b = (now.approach if self.force is None else 0.0) - self.z
            energy = float(np.vdot(p, 0.5 * u - b))
            # Each change should lower the energy. Where it does not, first solve more exactly.
            if energy < lowest:
                strikes = 0
            else:
                strikes, eta = strikes + 1, eta / 10.0
            if strikes == 3:
                p, u = descend(A, b, p, self._nearest, A.A.norm_bound, RESCUE)
                C, strikes, energy = p > 0.0, 0, float(np.vdot(p, 0.5 * u - b))
            lowest = min(lowest, energy)

    def _look(self, p: Array, u: Array, area: _Set, a0: float) -> _Look:
        w, r, outside = self.fields
        np.add(u, self.z, out=w)
        approach = area.mean(w) if self.approach is None else self.approach
        w -= approach
        np.multiply(w, area.mask, out=r)
        np.subtract(w, r, out=outside)
        low, high, least = float(r.min()), float(r.max()), float(outside.min())
        np.negative(r, out=r)
        tension = a0 * max(0.0, -float(p.min()))
        violation, misfit = max(tension, -least), max(high, -low)
        scale = approach - self.lowest
        touching, error = approach, max(misfit, violation)
        if self.approach is None:  # it is free: no gap is to be negative
            lowest = min(low, least)
            touching, error = approach + lowest, max(high - lowest, tension)
        return _Look(w, r, approach, misfit, tension, violation, scale, touching, error / scale)

    def _iterate(
        self, p: Array, u: Array, area: _Set, now: _Look, matrix: _Matrix, eta: float
    ) -> tuple[_Look, int]:
        """Conjugate gradients on a set, on the plane of the given force, as far as it is worth.

        They change p and u in place, from where `now` looked at them.
        """
        A, M, a0 = matrix
        d, y, rho, count = np.zeros_like(p), np.empty_like(p), 0.0, 0
        unit = now.misfit or 1.0  # of the residuals, for single precision
        while not A.exhausted:
            if now.misfit <= max(eta * now.violation, 0.1 * self.tolerance * now.scale):
                break
            if now.tension == 0.0 and now.residual <= self.tolerance:
                break
            np.multiply(now.r, 1.0 / unit, out=y)
            apply_to_rows(M, y.reshape(-1), out=y.reshape(-1))
            y *= area.mask
            if self.force is not None:
                y -= np.multiply(area.mask, area.mean(y), out=self.fields[2])
            rho, before = float(np.vdot(now.r, y)), rho
            d *= rho / before if count else 0.0
            d += y
            Ad = A(d)
            step = rho / float(np.vdot(d, Ad))
            p += np.multiply(d, step, out=y)
            u += np.multiply(Ad, step, out=y)
            count += 1
            now = self._look(p, u, area, a0)
        return now, count

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
