"""An approximate inverse of the matrix of steady rolling on a fragmented area, by FSAI and sums.

The area consists of runs of elements along the rolling direction, the first axis. The matrix is K =
A D, where A is symmetric and D takes the difference between each element and the next one ahead: (D
q)_i = q_i - q_(i+1). If q is zero outside the area, w = D q is zero except there and on the element
behind each run, and the sum of w over a run and that element is zero. Conversely, any such w has
the sums q_i = w_i + q_(i+1), from the leading end of a run on. So K q = r on the area means

    A w = r + β,  with a field β on the elements behind the runs for which the sums of w vanish.

FSAI of A on the area and these elements gives F ≈ A⁻¹ and w = F r + F β. A displacement β changes
mainly the sum of its own run, by about the same factor everywhere. The mean factor is found by
applying F once to random signs (Hutchinson); the sums of F r are divided by it.

References
----------
M. F. Hutchinson, A stochastic estimator of the trace of the influence matrix for Laplacian
smoothing splines, Commun. Stat. Simul. Comput. 18 (1989).
"""

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg._typing import Array, Mask
from toeplitz_mg.operators import MaskedOperator, ToeplitzOperator, apply_to_rows
from toeplitz_mg.preconditioners.choice import quick_fsai


class InverseOnRuns:
    """The approximate inverse of A times differences along the first axis, on an area.

    It is exact if the area is one run and F = A⁻¹.

    Parameters
    ----------
    A : ToeplitzOperator
        Symmetric positive definite, on a grid with one more element along the first axis than the
        area, so that there is an element behind every run.
    area : ndarray of bool, of shape (n1, n2)
    dtype : float32 or float64
        The precision in which FSAI is applied.

    Raises
    ------
    numpy.linalg.LinAlgError
        If FSAI is refused.
    """

    def __init__(self, A: ToeplitzOperator, area: Mask, dtype: DTypeLike) -> None:
        longer = np.pad(area, ((1, 0), (0, 0)))
        leads, behind = longer.copy(), np.zeros_like(longer)
        leads[:-1] &= ~longer[1:]
        behind[:-1] = longer[1:] & ~longer[:-1]
        both = longer | behind
        self._F, self._dtype = quick_fsai(MaskedOperator(A, both), dtype=dtype), np.dtype(dtype)
        self._cells, self._count = np.flatnonzero(area), np.count_nonzero(both)
        self._inside, self._behind = np.flatnonzero(longer[both]), np.flatnonzero(behind[both])
        # The order of these elements: run by run, from the leading end to the element behind it.
        number = np.zeros(longer.shape, np.intp)
        number[both] = np.arange(self._count)
        backwards = both[::-1].T
        self._order = number[::-1].T[backwards]
        self._leads = np.flatnonzero(leads[::-1].T[backwards])
        self._lengths = np.diff(self._leads, append=self._count)
        signs = np.random.default_rng(0).choice([-1.0, 1.0], len(self._behind))
        F_signs = self._invert(self._behind, signs)
        self._response = float(signs @ self._sum(F_signs)[self._behind]) / len(signs)

    def __call__(self, r: Array) -> Array:
        """Return the field on the area that K maps to `r`."""
        w = self._invert(self._inside, r.reshape(-1)[self._cells])
        w += self._invert(self._behind, -self._sum(w)[self._behind] / self._response)
        field = np.zeros(r.shape, self._dtype)
        field.reshape(-1)[self._cells] = self._sum(w)[self._inside]
        return field

    def _invert(self, where: Array, values: Array) -> Array:
        """Return F f, where f has these values at these places and is zero elsewhere."""
        f = np.zeros(self._count, self._dtype)
        f[where] = values
        return apply_to_rows(self._F, f)

    def _sum(self, w: Array) -> Array:
        """Return the sums from the leading end of each run; behind it, the sum over the run."""
        in_order = w[self._order].astype(np.float64)
        sums = np.cumsum(in_order)
        sums -= np.repeat(sums[self._leads] - in_order[self._leads], self._lengths)
        q = np.empty_like(sums)
        q[self._order] = sums
        return q
