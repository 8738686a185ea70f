"""Conjugate gradient steps for bodies that are shifted, whose matrix is symmetric (Eq. 2-3).

For fixed areas, the system of Newton's method (see `settling`) is symmetric positive definite on
the changes that preserve the loads. Conjugate gradients solve it on the elements in contact, mostly
in single precision, to the accuracy at which the areas or the linearisation are known.
"""

from functools import cached_property
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.contact.inverse import invert_on
from toeplitz_mg.contact.products import Products
from toeplitz_mg.contact.tangential.law import STIFFEST, Areas, Problem, along
from toeplitz_mg.contact.tangential.loads import Complement, Loads, Look, complement
from toeplitz_mg.engine.conjugate_gradients import ConjugateGradients
from toeplitz_mg.operators import apply_to_rows

LOCAL = 0.5  # Multiple of 1/a₀ added to M where elements slide, where M is too small.
MOST = 200  # Limit of iterations for fixed areas; rounding prevents further progress.
SINGLE = 1e-5  # Largest reduction of the misfit in single precision.
SHARP = 0.3  # Areas are solved no more accurately than this share of the tolerance.


class ConjugateSteps:
    """Newton steps on the elements in contact, by conjugate gradients.

    Problem, loads and products are for these elements; `whole` is the grid, its matrix, and the
    mask of the elements.
    """

    def __init__(
        self, problem: Problem, loads: Loads, A: Products, whole: tuple[Any, Any, Array]
    ) -> None:
        self._problem, self._loads, self._A, self._whole = problem, loads, A, whole

    @cached_property
    def _M(self) -> Any:
        """The approximate inverse, built on demand: an initial guess may be accurate enough."""
        return invert_on(*self._whole)

    def __call__(
        self, now: Look, areas: Areas, q: Array, u: Array, eta: float
    ) -> tuple[Array, Array, int]:
        """Return a change of the tractions, that of the displacements, and the iterations."""
        problem, law, vectors, A, M = (
            self._problem,
            now.law,
            self._problem.vectors,
            self._A,
            self._M,
        )
        grid, matrix, _ = self._whole
        a0, slide = grid.diagonal(matrix), areas.slide
        # After a step without progress, double precision determines the rest.
        dtype = M.dtype if eta == 1.0 else np.dtype(np.float64)
        misfit = vectors.max(np.abs(law.r)) or 1.0
        T, lam = law.T.astype(dtype), np.minimum(law.stiffness, STIFFEST * a0).astype(dtype)
        keep_loads = complement(self._loads.arms, law.T, vectors)
        keep = keep_loads.astype(dtype)
        r = keep((law.r / misfit).astype(dtype))
        v, Av, Ad = (np.zeros_like(r) for _ in range(3))
        # Where elements slide, λ adds to A, and the scaled M is too small for smooth fields.
        weight = np.where(slide, 1.0 / np.sqrt(1.0 + law.stiffness / a0), 1.0).astype(dtype)
        local = np.where(slide, LOCAL / a0, 0.0).astype(dtype)

        def multiply(d: Array, out: Array) -> Array:
            return keep(T(A(d, Ad) + lam * d))

        def precondition(r: Array, out: Array) -> Array:
            y = weight * r
            y = weight * (apply_to_rows(M, y.reshape(-1)).reshape(y.shape) + local * y)
            return keep(T(y))

        iteration, count = ConjugateGradients(multiply, precondition, vectors), 0
        least = max(SHARP * problem.tolerance * law.scale / misfit, SINGLE * (dtype == np.float32))
        while count < MOST and not A.exhausted:
            # Three errors of areas and linearisation: |q| > g where it sticks, |q| > g where it
            # slides (the circle is curved), and slip along the traction.
            excess = a0 * problem.excess(q + misfit * v)
            slipping = law.minus_slip - misfit * Av
            slipping = self._less_shift(keep_loads, slipping)
            wrong = max(excess, -vectors.min(along(slipping, law.T.n))) / misfit
            if vectors.max(np.abs(r)) <= max(least, eta * wrong):
                break
            length = iteration.step(r)
            if length == 0.0:
                break  # The rest is below the rounding error of elements with far larger bounds.
            v = vectors.axpy(length, iteration.direction, v)
            Av = vectors.axpy(length, Ad, Av)
            r = vectors.axpy(-length, iteration.product, r)
            count += 1
        # Rounding in single precision violates the tangents and the loads slightly: correct this.
        v = keep_loads(law.T(misfit * v.astype(np.float64)))
        return v, misfit * Av.astype(np.float64), count

    def _less_shift(self, keep_loads: Complement, slipping: Array) -> Array:
        """Return minus a slip, less the uniform slip that fits it best if loads are given."""
        if not len(self._loads.wanted):
            return slipping
        shift = keep_loads.coordinates(slipping)
        return slipping - self._problem.vectors.combine(shift, self._loads.units)
