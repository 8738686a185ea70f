"""Drop-in for `scipy.linalg.solve_toeplitz`: choose a method, solve, and check the solution."""

import warnings
from cmath import isfinite
from math import prod
from typing import Any, Literal, overload

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike
from scipy.sparse import issparse
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.engine.ranks import is_serial
from toeplitz_mg.solvers.checks import check_numbers
from toeplitz_mg.solvers.toeplitz.elsewhere import solve_elsewhere
from toeplitz_mg.solvers.toeplitz.levinson import is_faster_at_once, solve_at_once
from toeplitz_mg.solvers.toeplitz.methods import METHODS, RECURSION, Method
from toeplitz_mg.solvers.toeplitz.refinement import (
    GOOD,
    ILL_CONDITIONED,
    ROUNDING,
    RTOL,
    SINGULAR,
    Found,
    SolveInfo,
    solve_and_correct,
    solve_system,
)
from toeplitz_mg.solvers.toeplitz.scaling import exponents, scale_back
from toeplitz_mg.solvers.toeplitz.sizes import CORRECTED, SHORT
from toeplitz_mg.solvers.toeplitz.system import ToeplitzSystem
from toeplitz_mg.values import is_foreign, real, refuse_masked

AT_ONCE = "levinson for all at once"  # The method for many small systems.


@overload
def solve_toeplitz(
    c_or_cr: Any,
    b: ArrayLike,
    check_finite: bool = ...,
    *,
    rtol: float | None = ...,
    on_singular: Literal["raise", "nan"] = ...,
    full_output: Literal[False] = ...,
) -> Array: ...
@overload
def solve_toeplitz(
    c_or_cr: Any,
    b: ArrayLike,
    check_finite: bool = ...,
    *,
    rtol: float | None = ...,
    on_singular: Literal["raise", "nan"] = ...,
    full_output: Literal[True],
) -> tuple[Array, SolveInfo]: ...
def solve_toeplitz(
    c_or_cr: Any,
    b: ArrayLike,
    check_finite: bool = True,
    *,
    rtol: float | None = None,
    on_singular: Literal["raise", "nan"] = "raise",
    full_output: bool = False,
) -> Array | tuple[Array, SolveInfo]:
    """Solve A x = b for a Toeplitz matrix A: drop-in for `scipy.linalg.solve_toeplitz`.

    Large systems take O(n log n) operations instead of O(n²) if n coefficients resolve the symbol
    of A, whether A is symmetric or not, real or complex, definite or not. Other positive definite
    systems take O(n log² n). What remains is solved by a recursion of n² steps, and small systems
    as in SciPy.

    Parameters
    ----------
    c_or_cr : array_like of shape (..., n), or tuple (c, r) of such
        First column, or first column and first row; r[0] is ignored. Without r the first row is the
        conjugate of c. Leading dimensions are a batch, as in SciPy.
    b : array_like of shape (n,) or (..., n, k)
    check_finite : bool
        Whether to check for NaN and infinities. If false, their solution is NaN.
    rtol : float, optional
        Tolerance: the solution must satisfy ‖b - A x‖ ≤ rtol ‖b‖ or, where rounding does not allow
        this, have the backward error of a direct method. The default is 1e-12, with one exception:
        for up to 2047 unknowns and an A that is not symmetric positive definite, the solution of
        SciPy's recursion is returned if its backward error is below 2e-12. Its residual is mostly
        below 1e-9; to correct it would take a second recursion.
    on_singular : {"raise", "nan"}
        Whether a system without a solution raises a LinAlgError, or returns NaN (the solutions of
        the other systems of a batch are then kept).
    full_output : bool
        Whether to return a `SolveInfo` as well.

    Returns
    -------
    x : ndarray of the shape of `b`, float64 or complex128
    info : SolveInfo
        Only with `full_output`: the method, iterations, residual and backward error; for a batch,
        arrays of these.

    Raises
    ------
    numpy.linalg.LinAlgError
        If A is exactly or numerically singular, or x (or b) is beyond the range of float64. A
        solution is accepted if its residual is below 1e-8 ‖b‖, or below 0.1 ‖b‖ with a backward
        error below 2e-12 and an ‖x‖ that does not show a singular matrix. Triangular matrices,
        unless they are large, are solved by substitution in any case, with a warning if x may be
        wrong.
    TypeError
        If an argument has no numbers.
    ValueError
        If shapes do not match, numbers are not finite, or `rtol` is not between 0 and 1.

    Warns
    -----
    scipy.linalg.LinAlgWarning
        If the residual, or the rounding error of A x, is above 1e-8 ‖b‖ and `rtol`. Either A is so
        ill-conditioned that x may have few correct digits, or x is the solution of SciPy's
        recursion, which ``rtol=1e-12`` would improve. For a triangular matrix, whose x may grow
        without losing digits, only if digits are lost.

    See Also
    --------
    scipy.linalg.solve_toeplitz : SciPy's function, in O(n²).
    toeplitz_inverse : for many right-hand sides.
    select_method : tells which method is tried first, and why.
    cg : for grids and masks.
    gmres : for sums with diagonal matrices.

    Notes
    -----
    Arrays of CuPy, torch and JAX stay on their device: one system at a time is solved by CG with
    `default_preconditioner`, or by GMRES. Inside `jax.jit`, `jax.grad` and `jax.vmap` a callback
    solves, with derivatives with respect to c, r and b; systems without a solution give NaN.

    The residual of every solution is computed, and the solution is corrected if necessary. Methods
    are chosen without timing, so the same call gives the same bits in every process on one machine.

    Examples
    --------
    >>> import numpy as np
    >>> from toeplitz_mg import solve_toeplitz
    >>> solve_toeplitz([2.0, 1.0], [4.0, 5.0])
    array([1., 2.])
    >>> c = 1.0 / (1.0 + np.arange(100_000))
    >>> x, info = solve_toeplitz(c, np.ones(100_000), full_output=True)
    >>> info.method, info.residual <= 1e-12
    ('cg in the DCT domain', True)
    """
    if rtol is not None and not 0.0 < real("rtol", rtol) < 1.0:
        raise ValueError(f"rtol is {rtol}, but must be between 0 and 1")
    if is_foreign(b) or any(map(is_foreign, c_or_cr if type(c_or_cr) is tuple else (c_or_cr,))):
        elsewhere = solve_elsewhere(c_or_cr, b, rtol, solve_toeplitz)
        return elsewhere if full_output else elsewhere[0]
    c, r, b = _read(c_or_cr, b)
    is_batch = c.ndim > 1 or r.ndim > 1 or b.ndim > 2
    if on_singular not in ("raise", "nan"):
        raise ValueError(f"on_singular is {on_singular!r}, but must be 'raise' or 'nan'")
    if c.size <= SHORT and (done := _solve_short(c, r, b, rtol)) is not None:
        return done if full_output else done[0]
    with np.errstate(all="ignore"):  # The residual shows overflow.
        if is_batch:
            x, info, worst = _solve_batch(c, r, b, check_finite, rtol, on_singular)
        else:
            x, found = _solve_unless_singular(c, r, b, check_finite, rtol, on_singular)
            info, worst = found.info, found.info if found.is_doubtful else None
    if worst is not None:
        reason = "A is ill-conditioned, and x may have few correct digits"
        if rtol is None and worst.backward_error > GOOD:
            reason = "the recursion has lost digits of x, and rtol=1e-12 corrects them"
        warnings.warn(
            f"‖b - A x‖/‖b‖ is {worst.residual:.1e} although x is the solution of a system that "
            f"differs from this one by {worst.backward_error:.1e}: {reason}",
            scipy.linalg.LinAlgWarning,
            stacklevel=2,
        )
    return (x, info) if full_output else x


def select_method(c_or_cr: Any, b: ArrayLike) -> Method:
    """Return the method that `solve_toeplitz` tries first, and why, without solving.

    Parameters
    ----------
    c_or_cr : array_like of shape (n,), or tuple (c, r) of such
        First column, or first column and first row.
    b : array_like of shape (n,) or (n, k)
        Only its shape and dtype are used.

    Returns
    -------
    Method
        With its `name` and the reason, `why`. Whether the method fails, for example because A is
        not positive definite, is known only when the system is solved.

    Raises
    ------
    TypeError, ValueError
        As for `solve_toeplitz`; also for a batch, and for zero unknowns.

    See Also
    --------
    solve_toeplitz : ``full_output=True`` returns the name of the method that was used.

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> k = np.arange(10_000)
    >>> tmg.select_method(0.9**k, np.ones(10_000)).name
    'cg in the DCT domain'
    >>> tmg.select_method(np.where(k < 2, 2.0 - 3.0 * k, 0.0), np.ones(10_000))
    banded: few diagonals: LAPACK takes O(n) steps
    """
    c, r, b = _read(c_or_cr, b)
    system = _arrange(c, r, b)
    if system is None:
        raise ValueError(f"b has shape {b.shape}, but must not be empty: there is nothing to solve")
    if not system.is_of_usual_size:
        system, _ = _scale(system)
    return next(method for method in METHODS if method.fits(system))


def _read(c_or_cr: Any, b: ArrayLike) -> tuple[Array, Array, Array]:
    """Return the first column, the first row and the right-hand sides as arrays of numbers."""
    c, r = c_or_cr, None
    if isinstance(c_or_cr, tuple):
        if len(c_or_cr) != 2:
            raise ValueError(
                f"c_or_cr is a tuple of {len(c_or_cr)}, but must be (c, r), the first column and "
                "the first row; a column alone is an array or a list"
            )
        c, r = c_or_cr
    c, b = _numbers(c, "c"), _numbers(b, "b")
    if r is not None:
        r = _numbers(r, "r")
    elif c.dtype.kind == "c":
        r = c.conj()
    else:
        r = c  # The same array shows that A is symmetric, without a test of the numbers.
    return c, r, b


def _numbers(values: ArrayLike, name: str) -> Array:
    if type(values) is np.ndarray and values.dtype in (np.float64, np.complex128):
        return values  # A short cut.
    if isinstance(values, LinearOperator) or issparse(values) or not is_serial(values):
        raise TypeError(
            f"{name} is {values!r}, but must be an array: for a ToeplitzOperator A on one axis use "
            "A[:, 0] for c and A[0, :] for r; for a sparse matrix its first column as an array"
        )
    array = check_numbers(name, refuse_masked(name, values))
    return array.astype(np.complex128 if array.dtype.kind == "c" else np.float64, copy=False)


def _solve_short(
    c: Array, r: Array, b: Array, rtol: float | None
) -> tuple[Array, SolveInfo] | None:
    """Solve one small system by Levinson's recursion; return None if that is not enough.

    `solve_system` does the same and more, but takes three times the calls, which dominate here.
    """
    if not (c.ndim == 1 and c.size > 0 and b.shape == c.shape == r.shape):
        return None
    if not c.dtype == r.dtype == b.dtype or not isfinite(r[0]):
        return None
    system = ToeplitzSystem(c, r, np.ascontiguousarray(b))
    if not system.is_of_usual_size or min(system.widths) == 0:
        return None
    try:
        X, found, is_good, _ = solve_and_correct(RECURSION, system, rtol)
    except np.linalg.LinAlgError:
        return None
    return (X, found.info) if is_good and not found.is_doubtful else None


def _solve_batch(
    c: Array, r: Array, b: Array, check_finite: bool, rtol: float | None, on_singular: str
) -> tuple[Array, SolveInfo, SolveInfo | None]:
    """Solve each system of a batch, with broadcast shapes.

    Return x, the arrays of a `SolveInfo`, and the worst one if a warning is needed.
    """
    core = min(b.ndim, 2)
    shapes = f"c has shape {c.shape}, r {r.shape} and b {b.shape}, but "
    if not c.shape[-1:] == r.shape[-1:] == b.shape[-core:][:1]:
        raise ValueError(
            f"{shapes}all must have one length n: on the last axis of c and, in a batch, of b with "
            "the shape (..., n, columns), on the last but one"
        )
    try:
        batch = np.broadcast_shapes(c.shape[:-1], r.shape[:-1], b.shape[:-core])
    except ValueError:
        raise ValueError(
            f"{shapes}all dimensions before those of a system must be those of one batch"
        ) from None
    if 0 in batch:
        raise ValueError(f"the batch has shape {batch}, but must not be empty")
    is_hermitian = c.shape == r.shape and not c[..., 0].imag.any()
    is_hermitian = is_hermitian and (r is c or np.array_equal(c[..., 1:], r[..., 1:].conj()))
    c, r, b = (
        np.broadcast_to(a, batch + a.shape[a.ndim - k :]) for a, k in ((c, 1), (r, 1), (b, core))
    )
    n, count = c.shape[-1], prod(batch)
    x = np.empty(b.shape, np.result_type(c, r, b))
    rest, is_doubtful = np.ones(count, bool), np.zeros(count, bool)
    names, steps = np.full(count, AT_ONCE, object), np.ones(count, int)
    errors = np.full((2, count), np.nan)
    if x.size and is_faster_at_once(count, n):
        rows = None if is_hermitian else r.reshape(-1, n)
        y, residuals, backward = solve_at_once(c.reshape(-1, n), rows, b.reshape(count, n, -1))
        errors[:] = residuals, backward
        rest = ~((residuals <= (rtol or RTOL)) | ((backward <= ROUNDING) & (residuals <= SINGULAR)))
        is_doubtful = ~rest & (residuals > max(ILL_CONDITIONED, rtol or RTOL))
        x[...] = y.reshape(b.shape)
    for k in np.flatnonzero(rest):
        own = tuple(map(int, np.unravel_index(k, batch)))
        try:
            x[own], found = _solve_unless_singular(
                c[own], r[own], b[own], check_finite, rtol, on_singular
            )
        except np.linalg.LinAlgError as error:
            raise np.linalg.LinAlgError(f"system {own}: {error}") from None
        names[k], steps[k], *errors[:, k] = found.info
        is_doubtful[k] = found.is_doubtful
    fields: Any = (a.reshape(batch) for a in (names, steps, *errors))
    if not is_doubtful.any():
        return x, SolveInfo(*fields), None
    worst = int(np.argmax(np.where(is_doubtful, errors[0], -1.0)))
    info = SolveInfo(names[worst], int(steps[worst]), *errors[:, worst].tolist())
    return x, SolveInfo(*fields), info


def _solve_unless_singular(
    c: Array, r: Array, b: Array, check_finite: bool, rtol: float | None, on_singular: str
) -> tuple[Array, Found]:
    """Solve one system; return NaN for a refused system if `on_singular` is "nan"."""
    try:
        return _solve(c, r, b, check_finite, rtol)
    except np.linalg.LinAlgError:
        if on_singular == "raise":
            raise
        x = np.full(b.shape, np.nan, np.result_type(c, r, b))
        return x, Found(SolveInfo("none", 0, np.nan, np.nan))


def _solve(
    c: Array,
    r: Array,
    b: Array,
    check_finite: bool,
    rtol: float | None,
    *,
    most_at_once: int = CORRECTED,
) -> tuple[Array, Found]:
    """Solve one system, with one right-hand side or many."""
    system = _arrange(c, r, b, most_at_once)
    if system is None:
        return np.zeros(b.shape, np.result_type(c, r, b)), Found(SolveInfo("none", 0, 0.0, 0.0))
    if system.is_of_usual_size and isfinite(r[0]):
        X, found = solve_system(system, rtol)
    elif system.is_complex and c.dtype == r.dtype == np.float64 and most_at_once:
        # The real and the imaginary part of b may have very different sizes.
        return _solve(c, r, b, check_finite, rtol, most_at_once=0)
    else:
        X, found = _solve_unusual(system, rtol, check_finite)
    if system.parts == 2:
        X = X[: len(X) // 2] + 1j * X[len(X) // 2 :]
    elif b.ndim == 1:
        return X, found
    return np.ascontiguousarray(X.T.reshape(b.shape)), found


def _arrange(c: Array, r: Array, b: Array, most_at_once: int = CORRECTED) -> ToeplitzSystem | None:
    """Return the system with right-hand sides as rows; None if there are none.

    With a real matrix and a complex b, the real and imaginary parts are solved as separate rows. Up
    to `most_at_once` unknowns a single column is solved as a complex one, in fewer calls.
    """
    if c.ndim != 1 or r.shape != c.shape or b.ndim == 0 or len(b) != len(c):
        raise ValueError(
            f"c has shape {c.shape}, r {r.shape} and b {b.shape}, but all must have the length of c"
        )
    if b.size == 0:
        return None
    is_complex = c.dtype.kind == "c" or r.dtype.kind == "c"
    parts = 1
    if b.dtype.kind == "c" and not is_complex:
        is_complex = b.size == len(b) <= most_at_once
        parts = 1 if is_complex else 2
    dtype = np.complex128 if is_complex else np.float64
    B = b if b.ndim == 1 else b.T if b.shape[1] != 1 else b[:, 0]
    if parts == 2:
        B = np.concatenate([np.atleast_2d(B.real), np.atleast_2d(B.imag)])
    B = np.ascontiguousarray(B, dtype)
    if c[0].real < 0.0:
        # Negate both sides, because a negative definite matrix becomes positive definite.
        B = -B
        c, r = (-c, -r) if r is not c else 2 * (-c,)
    if is_complex and (c.dtype.kind != "c" or r.dtype.kind != "c"):
        c, r = c.astype(dtype), r.astype(dtype)
    return ToeplitzSystem(c, r, B, parts)


def _solve_unusual(
    system: ToeplitzSystem, rtol: float | None, check_finite: bool
) -> tuple[Rows, Found]:
    """Solve a system, if it is finite, after scaling by powers of two, which changes no digit.

    Then no norm and no transform overflows or underflows.
    """
    c, r, B, parts = system.c, system.r, np.atleast_2d(system.B), system.parts
    for name, a in (("c", c), ("r", r if check_finite else r[1:]), ("b", B)):
        if np.isfinite(a).all():
            continue
        if check_finite:
            raise ValueError(f"{name} has entries that are not finite, but all must be")
        unknown = Found(SolveInfo("none", 0, np.nan, np.nan))
        X = np.full_like(B, np.nan)
        good = np.isfinite(B).all(axis=1)
        if name == "b" and good.any():  # Only some columns are not finite.
            X[good], found = _solve_unusual(ToeplitzSystem(c, r, B[good]), rtol, check_finite)
            unknown = Found(found.info._replace(residual=np.nan, backward_error=np.nan))
        return X.reshape(system.B.shape), unknown
    scaled, powers = _scale(system)
    X, found = solve_system(scaled, rtol)
    return scale_back(X, powers, parts).reshape(system.B.shape), found


def _scale(system: ToeplitzSystem) -> tuple[ToeplitzSystem, Array]:
    """Return the system scaled by powers of two, and the powers of its solutions as a column."""
    c, r, B, parts = system.c, system.r, np.atleast_2d(system.B), system.parts
    of_A, of_B = exponents(np.concatenate([c, r[1:]])), exponents(B)
    scale = np.ldexp(1.0, -of_A)
    weights = None
    if parts == 2:  # The weight of the larger part is 1; a part that is zero has none.
        powers = np.where(B.any(axis=1), of_B[:, 0], of_B.min()).reshape(2, -1)
        weights = np.ldexp(1.0, powers - powers.max(axis=0)).ravel()
    B = B * np.ldexp(1.0, -of_B)
    return ToeplitzSystem(c * scale, r * scale, B, parts, weights), of_B - of_A
