"""Row-sum modification of the FFT preconditioner: M̄ and M̄_imp (paper, §4.2 and §5.4)."""

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array, Mask
from toeplitz_mg.engine.workspace import workspace
from toeplitz_mg.operators import GridOperator, ToeplitzOperator, apply_to_rows
from toeplitz_mg.operators.base import grid_of, work_of
from toeplitz_mg.operators.lifting import lift, restrict, unwrap_toeplitz
from toeplitz_mg.operators.positivity import ritz_values, rounding
from toeplitz_mg.preconditioners.fft import fft_preconditioner
from toeplitz_mg.values import real

Lag = tuple[int, ...]  # A lag, or an index of a coefficient, along each axis.

REACH = 5  # Most unit steps between elements that count as near.
DENSE = 1024  # Most unknowns for which all eigenvalues are computed, in some tenths of a second.
STEPS = 40  # Lanczos steps for larger matrices; a step costs two work units.
# Largest γ max(A 1) for which M̄ is assumed to converge as a smoother. For 10,000 random
# nonnegative kernels and masks the largest eigenvalue of M̄ A was at most 1.12 max(1, γ max(A 1));
# it must be below 2.
CONVERGENT = 1.7


class RowSumModified(GridOperator):
    """M minus a diagonal matrix, such that every row sum is γ (paper, Eq. 19 and 22).

    Attributes
    ----------
    M : ToeplitzOperator or MaskedOperator
    diagonal : ndarray of shape (N,)
        The row sums of M minus γ.
    gamma : float
        Every row sum of this operator.
    certified : bool
        Whether it is proved to be positive definite.
    """

    def __init__(self, M: LinearOperator, diagonal: Array, gamma: float, certified: bool) -> None:
        super().__init__(M.dtype, grid_of(M), work_of(M), M.shape[0])
        self.M = M
        self.diagonal = diagonal
        self.diagonal.flags.writeable = False
        self.gamma = gamma
        self.certified = certified
        self._by_signs = certified  # Proved by the signs of the coefficients, not by eigenvalues.

    def toarray(self) -> Array:
        """Return the dense matrix, shape (N, N)."""
        return self.M.toarray() - np.diag(self.diagonal)

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        change = workspace(X.shape, np.result_type(X, self.dtype))
        np.multiply(X, self.diagonal, out=change)  # First, because `out` may be X.
        out = apply_to_rows(self.M, X, out)
        out -= change
        return out

    def converges(self, A: LinearOperator) -> bool | None:
        """Whether x ← x + S (b - A x) converges; None if one product does not decide it.

        Suppose that no off-diagonal coefficient of M is positive. Then M is a block of the inverse
        of a nonnegative circulant, and A⁻¹ ≤ M entry by entry. So the graph Laplacian L in
        M̄ = γ I + L is at most that in A⁻¹ = diag(A⁻¹ 1) + L_A. An eigenvalue of M̄ A above 1 then
        has a positive, nearly constant eigenvector, and is near γ times the row sums of A.
        """
        full, _ = unwrap_toeplitz(A)
        if not (self._by_signs and (full.lags >= 0.0).all()):
            return None
        largest = float((A @ np.ones(A.shape[0], A.dtype)).max())
        return True if self.gamma * largest <= CONVERGENT else None

    def __repr__(self) -> str:
        return f"<RowSumModified, row sums {self.gamma:.4g}, of {self.M!r}>"


@lift(accepts="symmetric", parts=("components",), numpy_only=True)
def fft_rsm_preconditioner(
    A: LinearOperator, gamma: float | None = None, *, dtype: DTypeLike | None = None
) -> LinearOperator:
    """Return M̄, the FFT preconditioner with constant row sums (on a mask, M̄_imp).

    Parameters
    ----------
    A : ToeplitzOperator, ToeplitzSum or CoupledOperator, or MaskedOperator of one
        Symmetric positive definite, of any number of axes.
    gamma : float, optional
        The row sum γ, positive. By default the smallest row sum of M on the whole grid (paper,
        Eq. 20).
    dtype : float32 or float64, optional
        Precision in which the preconditioner is stored and applied; by default that of `A`. float32
        halves the memory and takes less time, also inside an iteration in float64.

    Returns
    -------
    RowSumModified
        M̄ = M - diag(sum(M) - γ) ≈ A⁻¹ (paper, Eq. 19), symmetric, same shape as `A`. Its attribute
        `certified` tells whether it is proved to be positive definite. One product costs one work
        unit. On a mask M_r takes the place of M (Eq. 22).

    Raises
    ------
    numpy.linalg.LinAlgError
        If γ is not larger than the rounding errors of the row sums of M, if M̄ is found not to be
        positive definite, or if `fft_preconditioner` raises it.
    TypeError, ValueError
        If `A` is not a Toeplitz operator, or not symmetric.

    See Also
    --------
    fft_preconditioner : M, without the modification.
    multigrid : uses M̄ as its smoother.
    richardson : the paper's FFT+RSM solver, with M̄ as the preconditioner.

    Notes
    -----
    M is made as if there were unknowns beyond the grid or the mask, so that its row sums are too
    large at the ends. Making them constant by lowering the diagonal brings all eigenvalues of
    I - M̄ A into (-1, 1): M̄ is a smoother for multigrid and, with `richardson`, a solver.

    M̄ is γ I plus a graph Laplacian whose weights are the negated off-diagonal coefficients of M.
    It is positive definite if none of these coefficients is positive, or if the negative ones
    outweigh the others, as in the paper's problems on every grid of multigrid. Otherwise its
    eigenvalues are computed for up to 1024 unknowns. Beyond, 40 steps of Lanczos's method look for
    a negative eigenvalue of M̄ A, at 80 work units; if they find none, M̄ is accepted, but not
    `certified`.

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator(1.0 / np.arange(1.0, 7.0))
    >>> M_bar = tmg.fft_rsm_preconditioner(A)
    >>> bool(np.allclose(M_bar @ np.ones(6), M_bar.gamma))
    True
    """
    M_bar = modify_row_sums(A, gamma, dtype)
    if not M_bar.certified:
        smallest = find_smallest_eigenvalue(A, M_bar)
        if smallest <= 0.0:
            raise np.linalg.LinAlgError(
                f"M with the row sums gamma = {M_bar.gamma:.3g} is not positive definite (an "
                f"eigenvalue of it, or of its product with A, is {smallest:.3g} or less): use "
                "fft_preconditioner(A)"
            )
        M_bar.certified = M_bar.shape[0] <= DENSE
    return M_bar


def modify_row_sums(
    A: LinearOperator, gamma: float | None = None, dtype: DTypeLike | None = None
) -> RowSumModified:
    """Return M̄ like `fft_rsm_preconditioner`, but without a search if it is not `certified`."""
    full, mask = unwrap_toeplitz(A)
    M = fft_preconditioner(full, dtype=dtype)
    # One product with ones gives the row sums. Eq. 20 takes γ on the whole grid, also for a mask.
    row_sums = M @ np.ones(full.shape[0], dtype=M.dtype)
    gamma = float(row_sums.min()) if gamma is None else real("gamma", gamma)
    if not 0.0 < gamma < np.inf:
        raise np.linalg.LinAlgError(
            f"the row sum gamma is {gamma:.3g}, but must be positive and finite: use "
            "fft_preconditioner(A), or give a positive gamma"
        )
    certified = is_certainly_positive(M, mask, gamma)
    if mask is not None:
        M = restrict(M, mask)
        row_sums = M @ np.ones(M.shape[0], dtype=M.dtype)
    if not gamma > (least := rounding(row_sums, M.dtype)):
        raise np.linalg.LinAlgError(
            f"the row sum gamma is {gamma:.3g}, but must be above the rounding error of the row "
            f"sums of M, {least:.2g}, so that M̄ is not singular: use fft_preconditioner(A), or "
            + ("a larger gamma" if M.dtype == np.float64 else "a larger gamma, or dtype=np.float64")
        )
    return RowSumModified(M, row_sums - M.dtype.type(gamma), gamma, certified)


def is_certainly_positive(M: ToeplitzOperator, mask: Mask | None, gamma: float) -> bool:
    """Whether M with its row sums changed to γ is certainly positive definite.

    It is γ I plus the Laplacian of the graph whose edges (i, i + k) have the weights -m_k. So it is
    positive definite if

    - no m_k off the diagonal is positive, or
    - the norm of the Laplacian of the positive m_k is below γ.

    A positive m_k between near elements does not count if the weights of unit steps outweigh it:
    (x_i - x_{i+k})² ≤ |k| Σ (differences along a path of unit steps)², and each step along axis a
    lies on |k_a| such paths. The path must be active if its ends are.
    """
    lags = M.lags.copy()
    centre = tuple(n - 1 for n in M.grid_shape)
    steps = np.identity(lags.ndim, dtype=int)
    weights = np.array(
        [0.0 if n == 1 else -lags[_at(centre, e)] for e, n in zip(steps, M.grid_shape, strict=True)]
    )
    lags[centre] = 0.0
    for k in _near(M.grid_shape):
        m = lags[_at(centre, k)]
        if m > 0.0 and (mask is None or _is_path_active(mask, k)):
            weights -= m * np.abs(k).sum() * np.abs(k)
            lags[_at(centre, k)] = lags[_at(centre, tuple(-j for j in k))] = 0.0
    return bool((weights >= 0.0).all()) and _laplacian_of_positive(lags, M.grid_shape) < gamma


def _at(centre: Lag, k: Any) -> Lag:
    return tuple(c + int(j) for c, j in zip(centre, k, strict=True))


def _near(grid_shape: tuple[int, ...]) -> list[Lag]:
    """Return one of each pair of near lags k and -k, without the unit steps."""
    reach = [min(REACH, n - 1) for n in grid_shape]
    lags = product(*(range(-r, r + 1) for r in reach))
    return [k for k in lags if k > (0,) * len(k) and 2 <= sum(map(abs, k)) <= REACH]


def _is_path_active(mask: Mask, k: Lag) -> bool:
    """Whether all paths between active elements at the lag k are active.

    A path goes along the first axis, then along the second, and so on.
    """

    def shift(p: Lag) -> Array:
        window = [
            slice(max(0, -j) + q, n - max(0, j) + q)
            for j, q, n in zip(k, p, mask.shape, strict=True)
        ]
        return mask[tuple(window)]

    ends = shift((0,) * len(k)) & shift(k)
    point = [0] * len(k)
    for axis, steps in enumerate(k):
        for _ in range(abs(steps)):
            point[axis] += 1 if steps > 0 else -1
            if (ends & ~shift(tuple(point))).any():
                return False
    return True


def _laplacian_of_positive(lags: Array, grid_shape: tuple[int, ...]) -> float:
    """Bound the norm of the graph Laplacian of the positive coefficients.

    The pairs at one lag form paths, whose Laplacian has eigenvalues below 4. If the lag is half the
    grid or more, they form single edges, whose Laplacian has the eigenvalue 2.
    """
    positive = np.maximum(lags, 0.0)
    paths = positive[tuple(slice(n // 2, 2 * n - 1 - n // 2) for n in grid_shape)]
    # M has each pair twice, at the lags k and -k.
    return float(positive.sum() + paths.sum())


def find_smallest_eigenvalue(A: LinearOperator, M_bar: LinearOperator) -> float:
    """Return the smallest eigenvalue of M̄, or for a large matrix an estimate of that of M̄ A.

    The estimate is too large, and may be positive although M̄ is indefinite. But nearly all
    eigenvalues of M̄ A lie near 1, so Lanczos's method soon finds a negative one.
    """
    if M_bar.shape[0] <= DENSE:
        return float(np.linalg.eigvalsh(M_bar.toarray()).min())
    return float(ritz_values(A, M_bar, STEPS)[0])
