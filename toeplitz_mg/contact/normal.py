"""Normal contact: pressures and the area of contact of two half-spaces that are pressed together.

The pressures p and the gap w = A p + z - δ (Eq. 6-7) are complementary:

    in contact  w = 0, p ≥ 0;        elsewhere  w ≥ 0, p = 0.

The elements in contact are an active set. On a set the system A p = δ - z is solved by conjugate
gradients, but only to the accuracy at which the set is known to be wrong: the iteration stops as
soon as its residual is below the violation of the two inequalities.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.contact.checks import check_iteration, field, normal_load
from toeplitz_mg.contact.grid import Element, Grid, coarsened, in_range, refined
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.projected import descend
from toeplitz_mg.contact.result import ContactResult, converged
from toeplitz_mg.operators import apply_to_rows, count_products
from toeplitz_mg.preconditioners import cosine_preconditioner

Array = NDArray[Any]
Progress = Callable[[int, float], object]

COARSE = 3e-3  # tolerance of the first guess, on a coarser grid
LONG = 20  # iterations, after which the product is made anew
RESCUE = 40  # products of projected gradients, where the sets cycle


def normal_contact(
    gap: ArrayLike,
    element: Element,
    *,
    material: Any,
    approach: float | None = None,
    force: float | None = None,
    reference: float | None = None,
    tolerance: float = 1e-8,
    nested: bool = True,
    max_products: int = 2000,
    progress: Progress | None = None,
) -> ContactResult:
    """Press two bodies together: pressures, area of contact, force and approach.

    Parameters
    ----------
    gap : array_like of shape (n1, n2) or (n,)
        Between the bodies before they touch, at the centres of the elements, mm; up to a
        constant, that adds to the approach. One level is line contact. See `surfaces`.
    element : (float, float) or float
        Size (h1, h2) of an element, mm. In line contact the width and the length of the strips,
        or the width alone: plane strain, with forces per mm of length.
    material : Material or (G, nu)
        Shear modulus (N/mm²) and Poisson's ratio of both bodies; of two materials, that of
        `halfspace.combined_material`. Against a rigid body, (2 G, nu).
    approach : float
        Of the bodies, from where the gap is given, mm.
    force : float
        N; in plane strain N/mm. Either this or the approach is given.
    reference : float, optional
        In plane strain, the distance at which a line load moves nothing, mm: it decides what
        approach belongs to a force. By default the length of the grid.
    tolerance : float
        Of the complementarity, relative to the largest interference: of the gap in contact, and
        of the depth of penetration elsewhere. Pressures are never negative.
    nested : bool
        Whether the first guess comes from coarser grids.
    max_products : int
        More products with the matrix than that are taken for a failure.
    progress : callable, optional
        Called as ``progress(products, residual)`` after each change of the area.

    Returns
    -------
    ContactResult

    Raises
    ------
    ValueError, TypeError
        For input that makes no sense, before any work.
    ContactError
        Where the tolerance is not reached: it says what is violated.

    Examples
    --------
    Hertz: a steel sphere of 10 mm on a steel plate.

    >>> from toeplitz_mg.contact.normal import normal_contact
    >>> from toeplitz_mg.contact import surfaces
    >>> gap = surfaces.sphere((64, 64), (0.01, 0.01), radius=10.0)
    >>> contact = normal_contact(gap, (0.01, 0.01), material=(82000.0, 0.28), force=100.0)
    >>> E_star = 82000.0 / (1.0 - 0.28)
    >>> a = (3 * 100.0 * 10.0 / (4 * E_star)) ** (1 / 3)
    >>> f"{contact.rigid:.5f} mm, {a**2 / 10.0:.5f} by Hertz"
    '0.00351 mm, 0.00351 by Hertz'
    """
    z = field("gap", gap)
    grid = Grid.of(z.shape, element, material, reference)
    load = normal_load(z, approach, force)
    check_iteration(tolerance, max_products)
    # A large distance would bury the interference in its rounding.
    distance = float(z.min())
    z = z - distance
    if approach is not None:
        approach = float(approach) - distance
        if approach <= 0.0:
            nothing = np.zeros(z.shape)
            return _result(grid, z, _State(nothing, nothing, approach, 0.0, ()), 0, 0.0, distance)
        in_range("the interference", approach)
    with count_products() as work:
        products = Products(grid.normal(), max_products)
        search = _Search(grid, z, approach, load, tolerance, progress)
        state = search.run(products, _first_guess(search, nested))
    result = _result(grid, z, state, products.count, work.units(z.size), distance)
    return converged(result, tolerance)


class _State(NamedTuple):
    """Pressures and their displacements, the approach, and how they were found."""

    p: Array
    u: Array
    approach: float
    residual: float
    iterations: tuple[int, ...]


class _Look(NamedTuple):
    """What is wrong with some pressures and a set of elements in contact."""

    gap: Array
    r: Array  # minus the gap, in contact
    approach: float
    misfit: float  # the largest gap in contact
    tension: float  # the largest negative pressure, as a displacement
    violation: float  # of the set: that, and penetration elsewhere
    scale: float  # the largest interference
    touching: float  # the approach at which nothing penetrates, to the last bit
    residual: float


@dataclass(frozen=True)
class _Search:
    """A problem on one grid, and how well it is to be solved."""

    grid: Grid
    z: Array
    approach: float | None
    force: float | None
    tolerance: float
    progress: Progress | None = None

    @property
    def total(self) -> float:
        """The sum of the pressures, where the force is given."""
        assert self.force is not None
        return self.force / self.grid.area

    def coarser(self) -> "_Search | None":
        grid = self.grid.coarser()
        if grid is None:
            return None
        z = coarsened(self.z, len(grid.shape))
        if self.approach is not None and not (z < self.approach).any():
            return None  # the averages touch nowhere
        return _Search(grid, z, self.approach, self.force, COARSE)

    def run(self, A: Products, guess: tuple[Array, Array]) -> _State:
        """Find the pressures and the area of contact, from some pressures and elements."""
        M = cosine_preconditioner(A.A)
        a0 = float(A.A.c.flat[0])
        p, C = guess
        u = A(p) if p.any() else np.zeros_like(p)
        eta, strikes, lowest = 1.0, 0, np.inf
        iterations: list[int] = []
        while True:
            now = self._look(p, u, C, a0)
            is_admissible = now.tension == 0.0
            if is_admissible and (now.residual <= self.tolerance or A.exhausted):
                return _State(p, u, now.touching, now.residual, tuple(iterations))
            if self.progress is not None:
                self.progress(A.count, now.residual)
            p, u, count = self._iterate(p, u, C, A, M, a0, eta)
            iterations.append(count)
            now = self._look(p, u, C, a0)
            if now.tension == 0.0 and now.residual <= self.tolerance:
                if count > LONG:  # never trust a long recurrence
                    u = A(p)
                continue
            C = (C & ((p > 0.0) | ((p == 0.0) & (now.gap < 0.0)))) | (~C & (now.gap < 0.0))
            if now.tension > 0.0:
                p = self._clipped(p)
                u = A(p)
            if not C.any():  # where it would touch first
                C = self.z == self.z.min()
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

    def _look(self, p: Array, u: Array, C: Array, a0: float) -> _Look:
        w = u + self.z
        approach = float(w[C].mean()) if self.approach is None else self.approach
        w -= approach
        r = np.where(C, -w, 0.0)
        tension = a0 * max(0.0, -float(p.min()))
        overlap = max(0.0, -float(np.min(w, where=~C, initial=0.0)))
        violation, misfit = max(tension, overlap), float(np.abs(r).max())
        scale = approach - float(self.z.min())
        touching, error = approach, max(misfit, violation)
        if self.approach is None:  # it is free: no gap is to be negative
            lowest = float(w.min())
            touching, error = approach + lowest, max(-float(r.min()) - lowest, tension)
        return _Look(w, r, approach, misfit, tension, violation, scale, touching, error / scale)

    def _iterate(
        self, p: Array, u: Array, C: Array, A: Products, M: LinearOperator, a0: float, eta: float
    ) -> tuple[Array, Array, int]:
        """Conjugate gradients on a set, on the plane of the given force, as far as it is worth."""
        d, rho, count = p, 0.0, 0
        while not A.exhausted:
            now = self._look(p, u, C, a0)
            if now.misfit <= max(eta * now.violation, 0.1 * self.tolerance * now.scale):
                break
            if now.tension == 0.0 and now.residual <= self.tolerance:
                break
            y = np.where(C, apply_to_rows(M, now.r.reshape(-1)).reshape(C.shape), 0.0)
            if self.force is not None:
                y[C] -= y[C].mean()
            rho, before = float(np.vdot(now.r, y)), rho
            d = y + (rho / before) * d if count else y
            Ad = A(d)
            step = rho / float(np.vdot(d, Ad))
            p = p + step * d
            u = u + step * Ad
            count += 1
        return p, u, count

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


def _first_guess(search: _Search, nested: bool) -> tuple[Array, Array]:
    """Pressures and elements in contact: from a coarser grid, or a superset of the contact."""
    z, grid = search.z, search.grid
    coarse = search.coarser() if nested else None
    if coarse is not None:
        A = Products(coarse.grid.normal(), 200)
        p = refined(coarse.run(A, _first_guess(coarse, nested)).p, grid.shape)
        if search.approach is not None:
            p[z >= search.approach] = 0.0
        if p.any():
            if search.force is not None:
                p *= search.total / p.sum()
            return p, p > 0.0
    if search.approach is not None:
        return np.zeros(grid.shape), z < search.approach
    return np.full(grid.shape, search.total / z.size), np.ones(grid.shape, bool)


def _result(
    grid: Grid, z: Array, state: _State, products: int, work: float, distance: float
) -> ContactResult:
    return ContactResult(
        element=grid.element,
        traction=state.p,
        displacement=state.u,
        contact=state.p > 0.0,
        force=float(state.p.sum() * grid.area),
        rigid=state.approach + distance,
        gap=state.u + z - state.approach,
        products=products,
        work=work,
        iterations=state.iterations,
        residual=state.residual,
    )
