"""The inverse of a Toeplitz matrix as an operator: one solve, then as cheap as two products."""

from functools import cached_property

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.columns.columns import NEAR, Columns
from toeplitz_mg.columns.first_column import double_line, find_columns
from toeplitz_mg.columns.gohberg_semencul import GohbergSemencul, TriangularFactors
from toeplitz_mg.engine.arrays.library import NUMPY
from toeplitz_mg.engine.conjugate_gradients import SAFE_SIZES
from toeplitz_mg.engine.products import DENSE
from toeplitz_mg.engine.vectors import norm
from toeplitz_mg.operators import GridOperator, ToeplitzOperator
from toeplitz_mg.operators.lifting import accept_any, of_numpy, unwrap_toeplitz
from toeplitz_mg.preconditioners.fsai.preconditioner import fsai_preconditioner
from toeplitz_mg.preconditioners.traits import decays_slowly
from toeplitz_mg.solvers.cg import Descent
from toeplitz_mg.solvers.checks import by_recurrence
from toeplitz_mg.solvers.refined_column import RefinedColumn, refine_column
from toeplitz_mg.solvers.reflection import levinson_column
from toeplitz_mg.solvers.szego import LogDeterminant, log_determinant, warn_of_error
from toeplitz_mg.solvers.toeplitz.cosine_cg import CosineSolver
from toeplitz_mg.solvers.toeplitz.cosine_form import CosineForm
from toeplitz_mg.solvers.toeplitz.sizes import PANELS, SHORT
from toeplitz_mg.values import positive


class ToeplitzInverse(GridOperator):
    """The inverse of a Toeplitz matrix.

    Attributes
    ----------
    A : ToeplitzOperator
    G : GohbergSemencul
        The inverse by the formula, without refinement.
    steps : int
        Number of steps of iterative refinement in each product.
    residual : float
        ‖v - A A⁻¹v‖/‖v‖, measured with one vector v.
    logdet, logdet_error : float
        log det A and an estimate of its error, for a positive definite A.
    diagonal_sums : ndarray of shape (n,)
        The sums of the diagonals of A⁻¹, for a positive definite A.
    refined : ToeplitzInverse
        The inverse with one more step of refinement.

    See Also
    --------
    toeplitz_inverse : computes it.
    toeplitz_logdet : the log-determinant only.
    """

    def __init__(
        self, A: ToeplitzOperator, G: GohbergSemencul | TriangularFactors, steps: int
    ) -> None:
        work = (1 + steps) * G.work + steps * A.work
        super().__init__(A.dtype, A.grid_shape, work, library=A.library)
        self.A = A
        self.G = G
        self.steps = steps

    @cached_property
    def residual(self) -> float:
        """‖v - A A⁻¹v‖/‖v‖ for a vector v with a constant and an equally large random part."""
        v = (1.0 + np.random.default_rng(0).standard_normal(self.shape[0])).astype(self.dtype)
        size, v = norm(v), self.library.from_numpy(v)
        return float(self.vectors.norm(v - self.A.apply(self.apply(v)))) / size

    @property
    def logdet(self) -> float:
        """The logarithm of det A for a positive definite A (see `toeplitz_logdet`)."""
        warn_of_error(self._logdet, self.shape[0], stacklevel=3)
        return self._logdet.value

    @property
    def logdet_error(self) -> float:
        """An estimate, rather too large, of the absolute error of `logdet`."""
        return self._logdet.error

    @cached_property
    def diagonal_sums(self) -> Array:
        """Σ_i (A⁻¹)_(i,i+k), k = 0 … n - 1, shape (n,), for a positive definite A.

        For a real A the first is the derivative of log det A by c[0], and twice entry k is that by
        c[k]. For a parameter of c, take the inner product of these derivatives with that of c. They
        cost about three work units.
        """
        sums = self._column.polynomial.diagonal_sums
        sums.flags.writeable = False
        return sums

    @cached_property
    def _column(self) -> RefinedColumn:
        """The column of the inverse, as exact as double precision allows."""
        if not self.A.is_hermitian:
            raise TypeError(
                f"A is {self.A!r}, but must be symmetric or Hermitian, and positive definite, for "
                "the log-determinant and the sums of diagonals"
            )
        x = self.G.x.astype(np.result_type(self.G.x, np.float64))
        return refine_column(Columns(_line_of(self.A), x))

    @cached_property
    def _logdet(self) -> LogDeterminant:
        A = _line_of(self.A)
        return log_determinant(A, lambda start: self._column)

    @property
    def refined(self) -> "ToeplitzInverse":
        """The inverse with one more step of refinement, at 3 work units: 2 G - G A G from G."""
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

    def _adjoint(self) -> "ToeplitzInverse":
        return self if self.G.is_hermitian else ToeplitzInverse(self.A.H, self.G.H, self.steps)

    def __repr__(self) -> str:
        refined = f", refined {self.steps}x" if self.steps else ""
        return f"<ToeplitzInverse {self.shape[0]}{refined}, residual {self.residual:.1e}>"


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # The residual shows overflow.
def toeplitz_inverse(A: ToeplitzOperator, *, rtol: float | None = None) -> ToeplitzInverse:
    """Return A⁻¹ as an operator, by the Gohberg–Semencul formula.

    Parameters
    ----------
    A : ToeplitzOperator
        Of one axis (other axes may have one element). Any Hermitian positive definite matrix, or a
        general one whose symbol has Wiener–Hopf factors (see `spectral_preconditioner`).
    rtol : float, optional
        Required relative residual ‖b - A x‖/‖b‖ of x = A⁻¹ b; by default 1e-10, and 1e-3 in single
        precision.

    Returns
    -------
    ToeplitzInverse
        An operator with the shape and dtype of `A`, Hermitian if `A` is. A product costs two work
        units a vector. Its attribute `residual` is the residual as measured; `refined` is the
        operator with one more step of iterative refinement.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the measured residual is above `rtol` even after one step of refinement: the matrix is
        not positive definite, or too ill-conditioned for this tolerance. Also if the symbol of a
        matrix that is not Hermitian (with more than 256 unknowns) has no factors, or n is too small
        for them to be useful.
    ValueError
        If `A` has several axes, `rtol` is not positive, or the coefficients are below 1e-100 or
        above 1e100 in size.
    TypeError
        If `A` is not a ToeplitzOperator.

    See Also
    --------
    solve_toeplitz : for a few right-hand sides.
    spectral_preconditioner : an approximate inverse, with a shorter set-up.
    toeplitz_logdet : the log-determinant.

    Notes
    -----
    The first column x = A⁻¹ e₁ is computed to about 1e-6 by CG, with cosine transforms or with
    `fsai_preconditioner` if the coefficients decay slowly; or from the factors of the symbol; or by
    the Schur algorithm. Newton's method then corrects it, in one to five steps, until its residual
    is 1e-12 or no longer decreases. The first row of a matrix that is not symmetric is computed in
    the same way. If the formula does not meet `rtol` but one step of refinement does, the refined
    operator is returned.

    For arrays of other libraries than NumPy the column is computed on the processor, and products
    are made by that library.

    References
    ----------
    See `toeplitz_mg.columns.gohberg_semencul`.

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
    full, mask = unwrap_toeplitz(A, accept_any)
    if mask is not None:
        raise TypeError(
            "A is a MaskedOperator, but must be a Toeplitz matrix for the inversion formula: use "
            "cg, or gmres, with chan_preconditioner(A)"
        )
    line = _line_of(full)
    if rtol is None:
        rtol = 1e-10 if full.dtype.char in "dD" else 1e-3
    rtol = positive("rtol", rtol)
    G = first_columns(line).inverse
    if full.dtype != line.dtype:
        row = None if G.is_hermitian else G.y.astype(full.dtype)
        G = GohbergSemencul(G.x.astype(full.dtype), row)
    on_own = G if full.library is NUMPY else TriangularFactors(G, full.library)
    inverse = ToeplitzInverse(full, on_own, 0)
    if not inverse.residual <= rtol:
        inverse = inverse.refined
    if not inverse.residual <= rtol:
        rule = "not positive definite, or " if full.is_hermitian else ""
        small = inverse.residual <= NEAR
        raise np.linalg.LinAlgError(
            f"the residual achieved is {inverse.residual:.1e}, but must be at most {rtol:.1e}: A "
            f"is {rule}too ill-conditioned"
            + (f": rtol={10.0 * inverse.residual:.0e} accepts it" if small else "")
        )
    return inverse


def _line_of(A: ToeplitzOperator) -> ToeplitzOperator:
    """Return the matrix in double precision, with NumPy's coefficients."""
    return double_line(of_numpy(A))


def require_safe_sizes(A: ToeplitzOperator) -> None:
    """Raise a ValueError if squares of norms might be outside the range of float64."""
    low, high = SAFE_SIZES
    if A.norm_bound and not low <= A.norm_bound <= high:
        raise ValueError(
            f"the coefficients of A are of size {A.norm_bound:.1e}, but must be of {low:.0e} to "
            f"{high:.0e} for its inverse: divide A by their size, and the inverse too"
        )


def first_columns(A: ToeplitzOperator, start: Array | None = None) -> Columns:
    """Return the solutions of A x = e₁ and, unless A is Hermitian, of Aᴴ w = e₁, in float64.

    `start` is an approximation of x, if one is known. Raises a ValueError if squares of norms might
    be outside the range of float64.
    """
    require_safe_sizes(A)
    return find_columns(A, solve=_solve if start is None else lambda A: Columns(A, start))


def _solve(A: ToeplitzOperator) -> Columns | None:
    """Return the columns, directly for few unknowns or roughly by CG; None for other matrices."""
    n = A.shape[0]
    unit = np.eye(1, n)[0]
    if not A.is_hermitian and n <= DENSE:
        dense = A.toarray()
        return Columns(A, np.linalg.solve(dense, unit), np.linalg.solve(dense.conj().T, unit))
    if A.is_hermitian and n <= SHORT:
        return Columns(A, levinson_column(A.c)[0])
    if not A.is_hermitian or A.dtype.kind == "c":
        return None
    if n < PANELS:
        solver = CosineSolver(CosineForm(A.c), A.norm_bound)
        return Columns(A, solver.solve(unit[np.newaxis], NEAR)[0][0])
    if decays_slowly(A.c):
        M = fsai_preconditioner(A)
        x, _, converged = by_recurrence(Descent, A, unit, M=M, rtol=NEAR, maxiter=50)
        return Columns(A, x) if converged else None
    return None
