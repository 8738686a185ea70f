"""Systems: a solution is as good as it is said to be."""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.linalg
from numpy.random import Generator
from scipy.sparse.linalg import LinearOperator

import toeplitz_mg as tmg
from comparisons.reliability.trials import FAILED, REFUSED, RIGHT, TOLD, Outcome
from comparisons.systems.random_matrices import log_uniform, random_column, random_grid, random_mask
from toeplitz_mg._typing import Array

EPS = float(np.finfo(np.float64).eps)
BACKWARD = 1e-11  # Backward error above which there has to be an error or a warning.
ILL = 1e-7  # Relative residual that nobody should get without a warning (it warns from 1e-8 on).
SINGULAR = 1e12  # Condition number from which a refusal is due.
MOST = 400  # Unknowns of the dense checks.
PRECONDITIONERS: list[Callable[[LinearOperator], LinearOperator] | None] = [
    *(None, None, tmg.default_preconditioner, tmg.sine_preconditioner, tmg.chan_preconditioner)
]


def drop_in(rng: Generator) -> Outcome:
    """Try `solve_toeplitz` on any matrix: the backward error in long doubles, and what it says."""
    family, c, r = _line(rng)
    n = len(c)
    columns = int(rng.choice([1, 1, 1, 2, 5]))
    B = rng.standard_normal((n, columns)) * _sizes(rng, columns)
    if rng.random() < 0.1:
        B[:, 0] = 0.0
    if rng.random() < 0.1:
        B *= rng.random(B.shape) < 0.1
    dense = scipy.linalg.toeplitz(c, r)
    scale = np.abs(dense).max()
    condition = float(np.linalg.cond(dense / scale)) if scale else np.inf
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            X, info = tmg.solve_toeplitz((c, r), B, full_output=True)
        except np.linalg.LinAlgError as error:
            due = condition > SINGULAR or _out_of_range(dense, B)
            return Outcome(
                family, REFUSED if due else FAILED, f"condition {condition:.0e}: {error}"
            )
    if not np.isfinite(X).all():
        return Outcome(family, FAILED, "the solution is not finite")
    backward, residual = _errors(dense, X, B)
    if backward > BACKWARD:
        return Outcome(family, TOLD if told else FAILED, f"backward error {backward:.0e}")
    if residual > ILL and not told:
        return Outcome(family, FAILED, f"residual {residual:.0e} without a warning")
    if not info.residual <= 10.0 * residual + 1e3 * EPS * condition:
        return Outcome(family, FAILED, f"says {info.residual:.0e}, but has {residual:.0e}")
    if residual > 10.0 * info.residual + 1e3 * EPS * max(1.0, min(condition, 1e6)):
        return Outcome(family, FAILED, f"says {info.residual:.0e}, but has {residual:.0e}")
    return Outcome(family, TOLD if told else RIGHT, f"residual {residual:.0e}")


def iteration(rng: Generator) -> Outcome:
    """Try `cg` and `richardson`, with or without M: where they say converged, it is true."""
    axes = int(rng.integers(1, 4))
    shape = random_grid(rng, int(log_uniform(rng, 1, MOST)), axes)
    name, c = random_column(rng, shape)
    dtype = np.float32 if rng.random() < 0.2 and 1e-30 < abs(c.flat[0]) < 1e30 else np.float64
    A: tmg.ToeplitzOperator | tmg.MaskedOperator = tmg.ToeplitzOperator(c.astype(dtype))
    if rng.random() < 0.4:
        A = tmg.MaskedOperator(A, random_mask(rng, shape))
    dense = A.toarray().astype(np.float64)
    condition = float(np.linalg.cond(dense))
    b = rng.standard_normal(A.shape[0]) * _sizes(rng, 1)[0]
    rtol = log_uniform(rng, 1e-12, 1e-2)
    preconditioner = PRECONDITIONERS[rng.integers(len(PRECONDITIONERS))]
    solve: Callable[..., tuple[Array, int]] = tmg.richardson if rng.random() < 0.25 else tmg.cg
    family = f"{solve.__name__}, {np.dtype(dtype)}"
    options: dict[str, Any] = {}
    if solve is tmg.cg and dtype == np.float64 and rng.random() < 0.3:
        family = "cg, inner float32"
        try:
            options["inner"] = A.astype(np.float32)
        except (ValueError, OverflowError) as error:
            return Outcome(family, REFUSED, str(error))
    x0 = rng.standard_normal(A.shape[0]) if rng.random() < 0.2 else None
    try:
        M = None if preconditioner is None else preconditioner(A)
    except np.linalg.LinAlgError as error:
        return Outcome(family, REFUSED, str(error))
    if solve is tmg.richardson and M is None:
        M = tmg.jacobi_preconditioner(A, omega=0.1)
    maxiter = int(rng.choice([50, 500]))
    x, info = solve(A, b, x0, rtol=rtol, M=M, maxiter=maxiter, **options)
    if not np.isfinite(x).all():
        fails = info == 0 or solve is tmg.cg
        return Outcome(family, FAILED if fails else TOLD, f"{name}: not finite, info {info}")
    residual, noise = _residual(dense, x, b)
    # Products have the precision of A, whatever that of the vectors.
    noise *= 1e3 * max(float(np.finfo(kind).eps) for kind in (x.dtype, A.dtype))
    size = float(np.linalg.norm(b / (np.abs(b).max() or 1.0)) * np.abs(b).max())
    if info == 0 and residual > 10.0 * rtol * size + noise:
        note = f"{name}: info 0, residual {residual / size:.0e}, rtol {rtol:.0e}"
        return Outcome(family, FAILED, f"{note}, condition {condition:.0e}")
    easy = condition < 1e3 and rtol > 1e-10 and maxiter == 500 and M is None
    if info > 0 and easy and dtype == np.float64 and x0 is None:
        return Outcome(family, FAILED, f"{name}: not converged, condition {condition:.0e}")
    return Outcome(family, TOLD if info else RIGHT)


def large(rng: Generator) -> Outcome:
    """Try `solve_toeplitz` for many unknowns, of all lengths, against SciPy's product."""
    n = int(log_uniform(rng, 1e3, 2e5))
    name, c = random_column(rng, (n,))
    b = rng.standard_normal(n) if rng.random() < 0.5 else np.ones(n)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            x, info = tmg.solve_toeplitz(c, b, full_output=True)
        except np.linalg.LinAlgError as error:
            # Only these two families need not be positive definite and well-conditioned.
            due = name in ("covariance", "slow decay", "differences")
            return Outcome(name, REFUSED if due else FAILED, f"n = {n}: {error}")
    r = b - scipy.linalg.matmul_toeplitz(c, x)
    # The norm of A is at most twice the sum.
    backward = np.linalg.norm(r) / (np.abs(c).sum() * np.linalg.norm(x) + np.linalg.norm(b))
    residual = float(np.linalg.norm(r) / np.linalg.norm(b))
    if backward > BACKWARD or (residual > ILL and not told):
        note = f"n = {n}, {info.method}: residual {residual:.0e}, backward {backward:.0e}"
        return Outcome(name, TOLD if told else FAILED, note)
    return Outcome(name, TOLD if told else RIGHT)


def _line(rng: Generator) -> tuple[str, Array, Array]:
    """Return a family, the first column and the first row of a matrix of one axis."""
    n = int(log_uniform(rng, 1, MOST))
    kind = rng.integers(10)
    if kind < 6:
        name, c = random_column(rng, (n,))
        return name, c * _range(rng), c * 1.0 if kind else c
    c, r = rng.standard_normal((2, n)) * np.exp(-np.arange(n) * rng.uniform(0.0, 1.0))
    r[0] = c[0]
    if kind == 6:
        return "general", c * (s := _range(rng)), r * s
    if kind == 7:
        c[0] = log_uniform(rng, 1e-16, 1e-3)  # Its leading blocks are nearly singular.
        return "symmetric", c, c
    if kind == 8:
        c = np.cos(np.arange(n) * rng.uniform(0.1, 3.0))  # It has rank 2.
        c[0] += log_uniform(rng, 1e-17, 1e-2)
        return "nearly singular", c, c
    return "indefinite", c * (s := _range(rng)), c * s


def _range(rng: Generator) -> float:
    """Return a unit: mostly 1, at times of any size that floating point has."""
    return log_uniform(rng, 1e-290, 1e290) if rng.random() < 0.15 else 1.0


def _sizes(rng: Generator, columns: int) -> Array:
    """Return the sizes of right-hand sides."""
    return np.array([log_uniform(rng, 1e-300, 1e300) if rng.random() < 0.15 else 1.0
                     for _ in range(columns)])  # fmt: skip


def _errors(dense: Array, X: Array, B: Array) -> tuple[float, float]:
    """Return the largest backward error and relative residual of all columns, in long doubles."""
    backward, relative = [0.0], [0.0]
    norm = np.abs(dense.astype(np.longdouble)).sum(axis=0).max()
    for x, b in zip(X.T, B.T, strict=True):
        residual, _ = _residual(dense, x, b)
        size = _norm(b)
        whole = norm * _norm(x) + size
        if whole > 0.0:
            backward.append(float(residual / whole))
        if size > 0.0:
            relative.append(float(residual / size))
    return max(backward), max(relative)


def _residual(dense: Array, x: Array, b: Array) -> tuple[np.longdouble, np.longdouble]:
    """Return ‖b - A x‖, and the size that its rounding is relative to, in long doubles."""
    A, x = dense.astype(np.longdouble), x.astype(np.longdouble)
    r = b.astype(np.longdouble) - A @ x
    return _norm(r), _norm(np.abs(A) @ np.abs(x)) + _norm(b)


def _norm(x: Array) -> np.longdouble:
    x = x.astype(np.longdouble)
    size = np.abs(x).max(initial=0.0)
    return np.sqrt(np.sum((x / size) ** 2)) * size if size > 0.0 else np.longdouble(0.0)


def _out_of_range(dense: Array, B: Array) -> bool:
    """Whether a solution may be larger or smaller than float64's numbers."""
    A = dense / np.abs(dense).max()
    peaks = np.abs(B).max(axis=0)
    B, peaks = B[:, peaks > 0.0] / peaks[peaks > 0.0], peaks[peaks > 0.0]
    sizes = np.log10(np.abs(np.linalg.solve(A, B)).max(axis=0)) + np.log10(peaks)
    sizes -= np.log10(np.abs(dense).max())
    return bool((sizes < -307.0).any() or (sizes > 307.0).any())
