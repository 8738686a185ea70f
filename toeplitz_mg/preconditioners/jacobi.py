"""The damped Jacobi iteration: a multiple of the unit matrix, because the diagonal is constant."""

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.operators import GridOperator
from toeplitz_mg.operators.lifting import check_hermitian, lift, unwrap_toeplitz
from toeplitz_mg.operators.positivity import require_positive_diagonal
from toeplitz_mg.values import real


class ScaledIdentity(GridOperator):
    """The unit matrix times a positive number."""

    def __init__(
        self, dtype: DTypeLike, grid_shape: tuple[int, ...], size: int, factor: float
    ) -> None:
        super().__init__(dtype, grid_shape, 0.0, size)
        self.factor = self.dtype.type(factor)

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """Multiply each row of `X` (see `GridOperator.apply`)."""
        return np.multiply(X, self.factor, out=out)

    def converges(self, A: LinearOperator) -> bool:
        """Whether x ← x + S (b - A x) converges, from a bound on the norm of `A`."""
        full, _ = unwrap_toeplitz(A, check_hermitian)
        return float(self.factor.real) * full.norm_bound < 2.0

    def __repr__(self) -> str:
        return f"<ScaledIdentity {self.shape[0]}, {self.factor.real:.3g}>"


@lift(accepts="Hermitian", parts=(), numpy_only=True)
def jacobi_preconditioner(A: LinearOperator, omega: float | None = None) -> LinearOperator:
    """Return ω/a₀ times the unit matrix: the damped Jacobi (or Richardson) smoother.

    Use it in `multigrid`, with `linear_interpolation` or `modulated_interpolation`, for a matrix
    whose symbol has a zero. As a preconditioner of `cg` it changes nothing.

    Parameters
    ----------
    A : ToeplitzOperator or ToeplitzSum, or MaskedOperator of one
        Symmetric or Hermitian positive definite, of any number of axes.
    omega : float, optional
        Damping factor. By default ω/a₀ = 4/(3 ‖C‖₂), where C is the circulant in which `A` is
        embedded for its products: ω = 2/3 for the symbol 2 - 2 cos θ.

    Returns
    -------
    ScaledIdentity
        Same shape and dtype as `A`. A product costs no work unit.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the diagonal or `omega` is not positive.
    TypeError, ValueError
        If `A` is not a Toeplitz operator, or not Hermitian, or if `omega` is not a real number.

    See Also
    --------
    multigrid : takes it as `smoother=`.
    fft_rsm_preconditioner : the smoother for symbols without a zero.

    References
    ----------
    G. Fiorentino, S. Serra, Multigrid methods for Toeplitz matrices, Calcolo 28 (1991);
    R. Chan, Q. Chang, H. Sun, Multigrid method for ill-conditioned symmetric Toeplitz systems,
    SIAM J. Sci. Comput. 19 (1998).

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator(np.r_[2.0, -1.0, np.zeros(998)])
    >>> M = tmg.multigrid(
    ...     A, smoother=tmg.jacobi_preconditioner, interpolation=tmg.linear_interpolation
    ... )
    >>> x, info = tmg.richardson(A, np.ones(1000), M=M, rtol=1e-8, maxiter=12)
    >>> info
    0
    """
    full, _ = unwrap_toeplitz(A, check_hermitian)
    a0 = float(full.c.flat[0].real)
    require_positive_diagonal(a0)
    factor = 4.0 / 3.0 / full.norm_bound if omega is None else real("omega", omega) / a0
    if not 0.0 < factor < np.inf:
        raise np.linalg.LinAlgError(
            f"omega is {factor * a0:.3g} and the diagonal of A {a0:.3g}, but the quotient must be "
            "positive and finite"
        )
    return ScaledIdentity(A.dtype, full.grid_shape, A.shape[0], factor)
