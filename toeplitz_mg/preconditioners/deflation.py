"""Subdomain deflation of the FFT preconditioner: P M (paper, §4.1)."""

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.operators.base import GridOperator, apply_to_rows, grid_of, work_of
from toeplitz_mg.operators.lifting import check_symmetric, lift, unwrap
from toeplitz_mg.preconditioners.fft import fft_preconditioner
from toeplitz_mg.values import count


class SubdomainDeflated(GridOperator):
    """P M with P = I - M A Z E⁻¹ Zᵀ and E = Zᵀ M A Z (paper, Eq. 15-17).

    Attributes
    ----------
    M : LinearOperator
    starts : ndarray of int
        The first unknown of each subdomain: column j of Z is 1 from starts[j] to starts[j + 1].
    """

    def __init__(self, A: LinearOperator, M: LinearOperator, n_subdomains: int) -> None:
        super().__init__(M.dtype, grid_of(M), work_of(M), M.shape[0])
        self.M = M
        n = M.shape[0]
        parts = np.array_split(np.arange(n), n_subdomains)
        self.starts = np.array([part[0] for part in parts])
        self._sizes = np.array([len(part) for part in parts])
        # The columns of Z and of M A Z are stored as rows.
        Z = np.repeat(np.eye(n_subdomains, dtype=self.dtype), self._sizes, axis=1)
        self._MAZ = apply_to_rows(M, apply_to_rows(A, Z))
        E = self._sum(self._MAZ).T.astype(np.float64)
        self._E_inverse = np.linalg.inv(E).astype(self.dtype)

    def _sum(self, y: Array) -> Array:
        """Return Zᵀ y for each row y."""
        return np.add.reduceat(y, self.starts, axis=-1)

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        Y = apply_to_rows(self.M, X, out)
        Y -= self._sum(Y) @ self._E_inverse.T @ self._MAZ
        return Y

    def apply_transpose(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` by (P M)ᵀ = M (I - Z E⁻ᵀ (M A Z)ᵀ), where M is symmetric."""
        coefficients = X @ self._MAZ.T @ self._E_inverse
        return apply_to_rows(self.M, X - np.repeat(coefficients, self._sizes, axis=-1), out)

    def _adjoint(self) -> "TransposedDeflation":
        return TransposedDeflation(self)

    def __repr__(self) -> str:
        return f"<SubdomainDeflated, {len(self.starts)} subdomains, of {self.M!r}>"


class TransposedDeflation(GridOperator):
    """(P M)ᵀ, the transpose of a `SubdomainDeflated` P M."""

    def __init__(self, PM: SubdomainDeflated) -> None:
        super().__init__(PM.dtype, PM.grid_shape, PM.work, PM.shape[0])
        self.PM = PM

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        return self.PM.apply_transpose(X, out)

    def _adjoint(self) -> SubdomainDeflated:
        return self.PM

    def __repr__(self) -> str:
        return f"<TransposedDeflation of {self.PM!r}>"


@lift(accepts="symmetric", parts=(), numpy_only=True)
def fft_sd_preconditioner(A: LinearOperator, n_subdomains: int | None = None) -> SubdomainDeflated:
    """Return P M, the FFT preconditioner deflated by the constants on subdomains.

    Parameters
    ----------
    A : ToeplitzOperator, ToeplitzSum or CoupledOperator, or MaskedOperator of one
        Symmetric positive definite, of any number of axes.
    n_subdomains : int, optional
        Number of subdomains: consecutive, nearly equal parts of the unknowns. By default 2, as in
        the paper (1 if there is only one unknown).

    Returns
    -------
    SubdomainDeflated
        P M, same shape and dtype as `A`. One product costs one work unit; `n_subdomains` vectors
        are stored. P M is **not symmetric**, and singular (Zᵀ P M = 0): a smoother, whose coarse
        grid must correct the deflated components. Do not use it with `scipy.sparse.linalg.cg`.

    Raises
    ------
    TypeError
        If `n_subdomains` is not an integer, or `A` not a Toeplitz operator.
    ValueError
        If there are fewer unknowns than subdomains.
    numpy.linalg.LinAlgError
        If `fft_preconditioner` raises it.

    See Also
    --------
    fft_preconditioner : M, without deflation.
    fft_rsm_preconditioner : a better smoother.

    Notes
    -----
    The result for r is y - M A Z E⁻¹ Zᵀ y with y = M r. As a smoother, P M is delicate. With the
    paper's coarse grids (``coarsest=2`` and `rediscretised`), V(1,0) and V(0,1) converge on the
    paper's tests 1 and 2, but V(1,1) does not (paper, §5.1). With the defaults of `multigrid`, and
    on masks, the cycles may diverge, which `richardson` reports. Prefer `fft_rsm_preconditioner`.

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> PM = tmg.fft_sd_preconditioner(tmg.ToeplitzOperator(0.9 ** np.arange(6)))
    >>> y = PM @ np.arange(6.0)
    >>> bool(np.allclose([y[:3].sum(), y[3:].sum()], 0.0))
    True
    """
    if n_subdomains is not None:
        count("n_subdomains", n_subdomains)
    M = fft_preconditioner(A)
    check_symmetric(unwrap(A)[0])  # `fft_preconditioner` accepts complex matrices too.
    n_subdomains = min(2, A.shape[0]) if n_subdomains is None else int(n_subdomains)
    if n_subdomains > A.shape[0]:
        raise ValueError(
            f"n_subdomains is {n_subdomains}, but must lie between 1 and the number of unknowns, "
            f"{A.shape[0]}"
        )
    return SubdomainDeflated(A, M, n_subdomains)
