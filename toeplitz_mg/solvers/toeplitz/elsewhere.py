"""Toeplitz systems on arrays of other libraries than NumPy, for example on a GPU, by iterations."""

from collections.abc import Callable
from contextlib import suppress
from math import nan
from typing import Any

import numpy as np

from toeplitz_mg.engine.arrays.library import library_of
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.preconditioners import default_preconditioner
from toeplitz_mg.preconditioners.circulant import (
    away_from_zero,
    chan_eigenvalues,
    smooth_inverse,
)
from toeplitz_mg.solvers.cg import cg
from toeplitz_mg.solvers.gmres import gmres
from toeplitz_mg.solvers.toeplitz.refinement import ILL_CONDITIONED, RTOL, SolveInfo
from toeplitz_mg.solvers.toeplitz.traced import solve_traced
from toeplitz_mg.values import is_foreign, is_traced

MAXITER = 500  # Most iterations of CG, and of GMRES.


def solve_elsewhere(
    c_or_cr: Any, b: Any, rtol: float | None, on_numpy: Callable[..., Any]
) -> tuple[Any, SolveInfo]:
    """Solve a system with arrays of another library; x is on the same device.

    If the iterations do not reach 1e-8, `on_numpy` solves the system on the processor. Inside
    `jax.jit` and `jax.grad` a callback calls it.

    Raises
    ------
    TypeError
        For arrays of two libraries.
    ValueError
        For a batch, and for shapes that do not match.
    numpy.linalg.LinAlgError
        If `on_numpy` raises it.
    """
    given = c_or_cr if isinstance(c_or_cr, tuple) else (c_or_cr,)
    if is_traced(b, *given):
        return solve_traced(given, b, on_numpy), SolveInfo("traced", 0, nan, nan)
    library = library_of(next(array for array in (b, *given) if is_foreign(array)))
    given = tuple(library.read(name, array) for name, array in zip("cr", given, strict=False))
    b = library.read("b", b)
    if any(array.ndim != 1 for array in given) or b.ndim not in (1, 2):
        shapes = [tuple(array.shape) for array in (*given, b)]
        raise ValueError(
            f"c_or_cr and b have shapes {shapes}, but on arrays of {library.name} must be those of "
            "one system: c and r of shape (n,), b of (n,) or (n, k)"
        )
    A = ToeplitzOperator(*given)
    if b.shape[0] != A.shape[0]:
        raise ValueError(f"b has shape {tuple(b.shape)}, but must have {A.shape[0]} rows")
    wanted = RTOL if rtol is None else rtol
    columns = [b] if b.ndim == 1 else [b[:, k] for k in range(b.shape[1])]
    with suppress(np.linalg.LinAlgError):
        M = _precondition(A)
        solved = [_solve(A, column, M, wanted) for column in columns]
        info = max((info for _, info in solved), key=lambda info: info.residual)
        if info.residual <= max(ILL_CONDITIONED, wanted):
            x = solved[0][0] if b.ndim == 1 else library.xp.stack([x for x, _ in solved], axis=1)
            return x, info
    c, r = (library.to_numpy(array) for array in (given[0], given[-1]))
    pair = (c, r) if len(given) == 2 else c
    x, info = on_numpy(pair, library.to_numpy(b), rtol=rtol, full_output=True)
    return library.from_numpy(x), info


def _precondition(A: ToeplitzOperator) -> Any:
    """Return a preconditioner; for a matrix that is not definite a circulant, for GMRES."""
    if A.is_hermitian:
        with suppress(np.linalg.LinAlgError):
            return default_preconditioner(A)
    return smooth_inverse(A, away_from_zero(chan_eigenvalues(A), A.dtype))


def _solve(A: ToeplitzOperator, b: Any, M: Any, rtol: float) -> tuple[Any, SolveInfo]:
    """Solve for one right-hand side by CG, and by GMRES if that does not converge."""
    size, tried = A.vectors.norm(b), []
    ways: list[tuple[str, Any, int]] = [("cg", cg, MAXITER), ("gmres", gmres, MAXITER // 20)]
    for name, iterate, most in ways[not A.is_hermitian :]:
        residuals: list[float] = []
        x, code = iterate(A, b, rtol=rtol, maxiter=most, M=M, residuals=residuals)
        residual = float(A.vectors.norm(b - A @ x)) / size if size else 0.0
        backward = residual * size / (A.norm_bound * A.vectors.norm(x) + size) if size else 0.0
        tried.append((x, SolveInfo(name, len(residuals) - 1, residual, backward)))
        if not code:
            break
    return min(tried, key=lambda found: found[1].residual)
