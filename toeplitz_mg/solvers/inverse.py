"""The inverse of a Toeplitz matrix as an operator: one solve, then as cheap as two products."""

from contextlib import suppress

import numpy as np
from scipy.linalg import norm

from toeplitz_mg._typing import Array
from toeplitz_mg.operators import GridOperator, ToeplitzOperator
from toeplitz_mg.operators.gohberg_semencul import GohbergSemencul
from toeplitz_mg.operators.structure import squeeze_line, unwrap_toeplitz
from toeplitz_mg.preconditioners.choice import candidates_for_inverse
from toeplitz_mg.preconditioners.schur import schur_column
from toeplitz_mg.solvers.cg import cg_by_recurrence
from toeplitz_mg.values import positive

MOSTLY_ROUNDING = 1e-12  # ‖e₁ - A x‖ below which a step adds as much rounding as it removes.


class ToeplitzInverse(GridOperator):
    """The inverse of a symmetric positive definite Toeplitz matrix.

    Attributes
    ----------
    A : ToeplitzOperator
    G : GohbergSemencul
        The inverse by the formula alone.
    steps : int
        Steps of iterative refinement in each product.
    residual : float
        ‖v - A A⁻¹v‖/‖v‖, measured for a vector v that is a constant and as much random.
    """

    def __init__(self, A: ToeplitzOperator, G: GohbergSemencul, steps: int) -> None:
        super().__init__(A.dtype, A.grid_shape, (1 + steps) * G.work + steps * A.work)
        self.A = A
        self.G = G
        self.steps = steps
        n = A.shape[0]
        v = (1.0 + np.random.default_rng(0).standard_normal(n)).astype(A.dtype)
        self.residual = float(norm(v - A.apply(self.apply(v))) / norm(v))

    @property
    def refined(self) -> "ToeplitzInverse":
        """The inverse with one step of refinement more, at 3 work units: 2 G - G A G from G."""
        return ToeplitzInverse(self.A, self.G, self.steps + 1)

    def apply(self, V: Array, out: Array | None = None) -> Array:
        """Multiply each row of `V` (see `GridOperator.apply`)."""
        X = self.G.apply(V)
        for _ in range(self.steps):
            X += self.G.apply(V - self.A.apply(X))
        if out is None:
            return X
        out[...] = X
        return out

    def __repr__(self) -> str:
        refined = f", refined {self.steps}x" if self.steps else ""
        return f"<ToeplitzInverse {self.shape[0]}{refined}, residual {self.residual:.1e}>"


def toeplitz_inverse(A: ToeplitzOperator, *, rtol: float | None = None) -> ToeplitzInverse:
    """Return A⁻¹ as an operator, by the Gohberg-Semencul formula.

    Parameters
    ----------
    A : ToeplitzOperator
        Symmetric positive definite, of one axis with more than one element.
    rtol : float, optional
        The relative residual ‖b - A x‖/‖b‖ that x = A⁻¹ b is to have; by default 1e-10, and for
        float32 1e-3.

    Returns
    -------
    ToeplitzInverse
        A symmetric operator of the shape and dtype of `A`. A product, with one vector or many,
        costs four complex transforms of length n: two work units. Its attribute `residual` is what
        was measured; `refined` is the operator with a step of iterative refinement more.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where the residual measured is above `rtol`, also after one step of refinement: the matrix
        is not positive definite, or too ill-conditioned for what was asked.
    ValueError
        Where `A` has several axes, or is not symmetric; where `rtol` is not positive.
    TypeError
        Where `A` is no ToeplitzOperator.

    Notes
    -----
    The first column x = A⁻¹ e₁ is solved for by CG to 1e-6, with `spectral_preconditioner`, or
    with `fsai_preconditioner` where the coefficients decay slowly, or else by the Schur algorithm,
    and then corrected by the inverse that it gives until its residual is 1e-12, or decreases no
    more.
    Where the formula alone does not meet `rtol` and one step of refinement does, the refined
    operator is returned.

    References
    ----------
    See `toeplitz_mg.operators.gohberg_semencul`.

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator(1.0 / (1.0 + np.arange(1000)))
    >>> A_inverse = tmg.toeplitz_inverse(A)
    >>> B = np.random.default_rng(0).standard_normal((1000, 64))
    >>> bool(np.linalg.norm(A @ (A_inverse @ B) - B) <= 1e-10 * np.linalg.norm(B))
    True
    """
    full, mask = unwrap_toeplitz(A)
    if mask is not None:
        raise TypeError("A is a MaskedOperator, whose inverse the formula does not give")
    line = squeeze_line(full)
    if rtol is None:
        rtol = 1e-10 if full.dtype == np.float64 else 1e-3
    rtol = positive("rtol", rtol)
    x = first_column(line.astype(np.float64))
    inverse = ToeplitzInverse(full, GohbergSemencul(x.astype(full.dtype)), 0)
    if not inverse.residual <= rtol:
        inverse = inverse.refined
    if not inverse.residual <= rtol:
        raise np.linalg.LinAlgError(
            f"the residual achieved is {inverse.residual:.1e}, but {rtol:.1e} was asked for: A is "
            "not positive definite, or too ill-conditioned"
        )
    return inverse


def first_column(A: ToeplitzOperator) -> Array:
    """Solve A x = e₁ as well as float64 allows."""
    unit = np.zeros(A.shape[0])
    unit[0] = 1.0
    x = _by_cg(A, unit)
    if x is None:
        x = schur_column(A.c)[0]
    best, residual, r = x, np.inf, unit - A @ x
    # The column gives an inverse, and that corrects the column, at 3 work units a step.
    G = GohbergSemencul(x)
    while (size := float(norm(r))) < 0.5 * residual:
        best, residual = x, size
        if size <= MOSTLY_ROUNDING:
            break
        x = x + G @ r
        r = unit - A @ x
    return best


def _by_cg(A: ToeplitzOperator, unit: Array) -> Array | None:
    """Solve A x = e₁ by CG to 1e-6, or return None where no preconditioner leads there soon."""
    for candidate in candidates_for_inverse(A):
        with suppress(np.linalg.LinAlgError):
            M = candidate.make(A)
            x, _, converged = cg_by_recurrence(A, unit, M=M, rtol=1e-6, maxiter=50)
            if converged:
                return x
    return None
