"""Least squares with Toeplitz matrices, by normal equations with a Toeplitz preconditioner."""

import warnings
from contextlib import suppress
from math import hypot, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import LinAlgWarning
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.conjugate_gradients import SAFE_SIZES
from toeplitz_mg.engine.vectors import norm, power_above
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.base import require_numpy
from toeplitz_mg.operators.composed import DiagonalisedOperator
from toeplitz_mg.operators.rectangular import NormalMatrix, RectangularToeplitz
from toeplitz_mg.preconditioners import chan_preconditioner, default_preconditioner
from toeplitz_mg.solvers.cg import cg
from toeplitz_mg.solvers.checks import check_numbers
from toeplitz_mg.solvers.toeplitz.solve import solve_toeplitz
from toeplitz_mg.values import count, finite, positive

MAXITER = 5000  # Most iterations by default; a matrix that needs more is nearly singular.
CORRECTIONS = 3  # Most solves of the normal equations; each starts from the residual of A itself.
LEAST_GAIN = 0.5  # Another correction is made if the last one reduced the error below this factor.


class LeastSquaresInfo(NamedTuple):
    """Method, iterations and accuracy of a least-squares solution by `toeplitz_lstsq`.

    Attributes
    ----------
    method : str
    iterations : int
    residual : float
        ‖b - A x‖.
    error : float
        The backward error, which `rtol` bounds. With r = b - A x and R = (‖r‖² + damp² ‖x‖²)^½ it
        is the smaller of ‖Aᴴ r - damp² x‖ / (‖A‖ R) and R / ‖b‖, as in `scipy.sparse.linalg.lsqr`:
        x is the exact solution for a matrix or a right-hand side with a relative change of this
        size.

    See Also
    --------
    toeplitz_lstsq : returns it with ``full_output=True``.
    """

    method: str
    iterations: int
    residual: float
    error: float


def toeplitz_lstsq(
    A: Any,
    b: ArrayLike,
    damp: float = 0.0,
    *,
    rtol: float = 1e-8,
    maxiter: int | None = None,
    M: LinearOperator | None = None,
    full_output: bool = False,
) -> Any:
    """Minimise ‖A x - b‖² + damp² ‖x‖² for a Toeplitz matrix A, rectangular or square.

    Use it for deconvolution, filter identification and linear prediction. On one axis, full and
    valid convolutions take one solve with a Toeplitz matrix. Other problems are solved by conjugate
    gradients with a Toeplitz preconditioner.

    Parameters
    ----------
    A : ToeplitzOperator, RectangularToeplitz, or tuple (c, r) of array_like
        Of shape (m, n), of one axis or several.
    b : array_like of shape (m,) or (m, k)
    damp : float
        Regularisation as in `scipy.sparse.linalg.lsqr`.
    rtol : float
        Tolerance for the backward error (`LeastSquaresInfo.error`). The relative error of x is then
        about `rtol` times the condition number of A, or times its square if the residual is as
        large as b.
    maxiter : int, optional
        Maximum number of iterations, by default 10 n, but not more than 5000.
    M : LinearOperator, optional
        Approximate inverse of ``A.H @ A + damp**2 * I``; by default one is selected.
    full_output : bool
        Whether to return a `LeastSquaresInfo` as well.

    Returns
    -------
    x : ndarray of shape (n,) or (n, k)
        A minimiser. If it is not unique (fewer rows than columns, no `damp`), a valid convolution
        returns the one with the smallest norm.
    info : LeastSquaresInfo
        Only with `full_output`; for several right-hand sides, the largest numbers.

    Raises
    ------
    numpy.linalg.LinAlgError
        If x overflows.
    TypeError
        If `A` is not a Toeplitz matrix, or `b` has no numbers.
    ValueError
        If shapes do not match, numbers are not finite, or `damp`, `rtol` or `maxiter` is negative.

    Warns
    -----
    scipy.linalg.LinAlgWarning
        If the iteration has not converged: A is too ill-conditioned for `rtol`, or `maxiter` is too
        small.

    See Also
    --------
    scipy.sparse.linalg.lsqr : for any operator, without a preconditioner.
    RightPreconditioned : adds a preconditioner to `lsqr`.
    solve_toeplitz : for square systems.

    Notes
    -----
    AᴴA is a Toeplitz matrix if A is a full convolution, and AAᴴ is if A is a valid one: the system
    with that matrix is solved, in the second case for y with x = Aᴴy. Otherwise the preconditioner
    is made for the Toeplitz matrix that AᴴA would be with all rows of the full convolution. The
    residual is computed with A itself, and x is corrected until the tolerance is met.

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator.convolution([1.0, 0.5, 0.25], 1000)
    >>> x = np.sin(np.arange(1000.0))
    >>> found, info = tmg.toeplitz_lstsq(A, A @ x, full_output=True)
    >>> bool(abs(found - x).max() < 1e-10), info.method
    (True, 'Toeplitz normal equations')
    """
    if isinstance(A, tuple):
        A = ToeplitzOperator(*A)
    if not isinstance(A, ToeplitzOperator | RectangularToeplitz):
        raise TypeError(
            f"A is of type {type(A).__name__}, but must be a Toeplitz matrix: a ToeplitzOperator, "
            "a RectangularToeplitz or (c, r); for others use scipy.sparse.linalg.lsqr"
        )
    require_numpy(A, "toeplitz_lstsq")
    damp, tolerance = finite("damp", damp), positive("rtol", rtol)
    if damp < 0.0:
        raise ValueError(f"damp is {damp}, but must not be negative")
    if maxiter is not None:
        count("maxiter", maxiter)
    B = check_numbers("b", b)
    if B.ndim not in (1, 2) or B.shape[0] != A.shape[0]:
        raise ValueError(f"b has shape {B.shape}, but must have the {A.shape[0]} rows of A")
    if not np.isfinite(B).all():
        raise ValueError("b has entries that are not finite, but all must be")
    dtype = np.result_type(A.dtype, B, np.float32)
    A = A.astype(np.result_type(A.dtype, np.float64))
    of_A, of_b = _size(A.lags), _size(B)
    if M is not None or SAFE_SIZES[0] < of_A < SAFE_SIZES[1]:
        of_A = 1.0
    normal = _NormalEquations(A / of_A, (damp / of_A) ** 2, M, maxiter)
    columns = B.reshape(len(B), -1).T.astype(np.result_type(B, np.float64)) / of_b
    found = [normal.solve(column, tolerance) for column in columns]
    info = LeastSquaresInfo(
        normal.method, *map(max, zip(*(rest for _, rest in found), strict=True))
    )
    if not info.error <= tolerance:
        warnings.warn(
            f"the error is {info.error:.2g}, but should be at most {rtol}: A is too "
            "ill-conditioned, or maxiter too small: use a larger damp, rtol or maxiter",
            LinAlgWarning,
            stacklevel=2,
        )
    # These factors are powers of two, so that no digit changes.
    with np.errstate(over="ignore"):
        X = (np.stack([x for x, _ in found], axis=1) * (of_b / of_A)).astype(dtype)
    info = info._replace(residual=info.residual * of_b)
    if not np.isfinite(X).all():
        raise np.linalg.LinAlgError(f"x is beyond the largest {dtype}: divide b by a number")
    x = X if B.ndim == 2 else X[:, 0]
    return (x, info) if full_output else x


def _size(a: Array) -> float:
    """Return a power of two above the largest absolute value; 1 if all numbers are zero."""
    return 2.0 ** int(power_above(np.abs(a).max(initial=0.0)))


class _NormalEquations:
    """The normal equations of a least-squares problem, or of its dual, and their solver."""

    def __init__(self, A: Any, shift: float, M: Any, maxiter: int | None) -> None:
        self.A, self.adjoint, self.shift = A, A.H, shift
        self._maxiter = min(10 * max(A.shape[1], 1), MAXITER) if maxiter is None else maxiter
        N = NormalMatrix(A, 1.0, shift)
        dual = NormalMatrix(A.H, 1.0, shift)
        self._is_dual = M is None and not N.is_toeplitz and dual.is_toeplitz
        self._matrix: Any = dual if self._is_dual else N
        self.method, self._M, self._c = "conjugate gradients", M, None
        if self._matrix.is_toeplitz:
            self.method = "Toeplitz " + ("dual equations" if self._is_dual else "normal equations")
            self._matrix = ToeplitzOperator.from_lags(self._matrix.lags)
            if len(self._matrix.squeezed.grid_shape) == 1 and M is None:
                self._c = self._matrix.squeezed.c
        if M is None and self._c is None:
            self._M = precondition(self._matrix)

    def solve(self, b: Array, rtol: float) -> tuple[Array, tuple[int, float, float]]:
        """Return x, the number of iterations, ‖b - A x‖ and the error."""
        dtype = np.result_type(self.A.dtype, b)
        x, y = (np.zeros(n, dtype) for n in self.A.shape[::-1])
        r, g, error = self._residual(b, x, y)
        iterations = 0
        for _ in range(CORRECTIONS):
            if error <= rtol or iterations >= self._maxiter:
                break
            change, steps = self._correct(g, rtol / error, self._maxiter - iterations)
            iterations += steps
            # Not x = Aᴴ(y + change), because the terms may be much larger than x.
            trial = x + (self.adjoint @ change if self._is_dual else change)
            trial_y = y + change if self._is_dual else y
            previous, (r_new, g_new, new) = error, self._residual(b, trial, trial_y)
            if not new < error:
                break
            x, y, r, g, error = trial, trial_y, r_new, g_new, new
            if error > LEAST_GAIN * previous:
                break
        return x, (iterations, norm(r), error)

    def _residual(self, b: Array, x: Array, y: Array) -> tuple[Array, Array, float]:
        """Return b - A x, the residual of the solved equations, and the error."""
        r = b - self.A @ x
        gradient = self.adjoint @ r - self.shift * x
        size = hypot(norm(r), sqrt(self.shift) * norm(x))
        if error := norm(gradient):
            error = min(error / (self.A.norm_bound * size), size / norm(b))
        return r, r - self.shift * y if self._is_dual else gradient, error

    def _correct(self, g: Array, rtol: float, maxiter: int) -> tuple[Array, int]:
        """Return the solution for a right-hand side, and the number of iterations."""
        if self._c is not None:
            quiet = warnings.catch_warnings(action="ignore", category=LinAlgWarning)
            with suppress(np.linalg.LinAlgError), quiet:  # Errors are corrected or reported later.
                return solve_toeplitz(self._c, g), 1
        residuals: list[float] = []
        x, _ = cg(self._matrix, g, rtol=rtol / 2, maxiter=maxiter, M=self._M, residuals=residuals)
        return x, len(residuals) - 1


def precondition(A: Any) -> LinearOperator | None:
    """Return a preconditioner for normal equations; None if all are refused."""
    for function in (default_preconditioner, chan_preconditioner):
        with suppress(np.linalg.LinAlgError):
            return function(A)
    return None


class RightPreconditioned(LinearOperator):
    """The matrix [A R; damp R]: a right preconditioner for `scipy.sparse.linalg.lsqr` and `lsmr`.

    The problem min ‖A x - b‖² + damp² ‖x‖² becomes min ‖[A R; damp R] y - [b; 0]‖² with x = R y. Do
    not use SciPy's own `damp`, which would add damp² ‖y‖² instead.

    Parameters
    ----------
    A : LinearOperator of shape (m, n)
    M : DiagonalisedOperator of shape (n, n)
        Approximate inverse of ``A.H @ A + damp**2 * I``, made by `cosine_preconditioner`,
        `chan_preconditioner` or `fft_preconditioner`; R is its square root.
    damp : float

    Raises
    ------
    TypeError
        If `M` is not such an operator, so that its square root is not known.
    ValueError
        If shapes do not match, `damp` is negative, or `M` is not positive definite.

    See Also
    --------
    toeplitz_lstsq : solves the problem directly.

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> from scipy.sparse import eye_array
    >>> from scipy.sparse.linalg import lsqr
    >>> A = tmg.ToeplitzOperator.convolution([0.25, 0.5, 0.25], 1000, "same")
    >>> M = tmg.cosine_preconditioner(A.H @ A + 0.01 * eye_array(1000))
    >>> K = tmg.RightPreconditioned(A, M, damp=0.1)
    >>> y, *_ = lsqr(K, K.extend(np.ones(1000)), atol=1e-10, btol=1e-10)
    >>> x = tmg.toeplitz_lstsq(A, np.ones(1000), damp=0.1)
    >>> bool(abs(K.solution(y) - x).max() < 1e-7)
    True
    """

    def __init__(self, A: LinearOperator, M: Any, damp: float = 0.0) -> None:
        m, n = A.shape
        if not isinstance(M, DiagonalisedOperator):
            raise TypeError(
                f"M is {M!r}, but must be a DiagonalisedOperator, whose square root is known: use "
                "cosine_preconditioner, chan_preconditioner or fft_preconditioner"
            )
        if M.shape != (n, n) or finite("damp", damp) < 0.0:
            raise ValueError(
                f"M has shape {M.shape} and damp is {damp}, but M must be of shape {(n, n)}, and "
                "damp not negative"
            )
        p = M.product
        if not np.all(p.spectrum > 0.0):
            raise ValueError("M has eigenvalues that are not positive, but all must be")
        root = M.library.diagonalise(
            np.sqrt(p.spectrum), p.fft_shape, p.grid_shape, p.dtype, p.transforms
        )
        self.A, self.R, self.damp = A, DiagonalisedOperator(root, f"√ {M.name}"), float(damp)
        super().__init__(np.result_type(A.dtype, M.dtype), (m + n if damp else m, n))

    def extend(self, b: ArrayLike) -> Array:
        """Return the right-hand side [b; 0]."""
        b = check_numbers("b", b)
        return np.concatenate([b, np.zeros(self.shape[0] - len(b), b.dtype)])

    def solution(self, y: ArrayLike) -> Array:
        """Return x = R y."""
        return self.R @ check_numbers("y", y)

    def _matvec(self, y: Array) -> Array:
        z = self.R @ y.ravel()
        return np.concatenate([self.A @ z, self.damp * z][: 1 + bool(self.damp)])

    def _rmatvec(self, v: Array) -> Array:
        v, m = v.ravel(), self.A.shape[0]
        z = self.A.H @ np.ascontiguousarray(v[:m])
        return self.R @ (z + self.damp * v[m:] if self.damp else z)
