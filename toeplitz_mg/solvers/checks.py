"""Checks of what the iterations are given."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import issparse
from scipy.sparse.linalg import LinearOperator, aslinearoperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import NUMPY, Library, library_of
from toeplitz_mg.engine.ranks import ranks_of
from toeplitz_mg.engine.vectors import Vectors
from toeplitz_mg.operators.base import library_for
from toeplitz_mg.values import count, is_foreign, real


class System(NamedTuple):
    """A system A x = b, a preconditioner and a first guess, all checked, of shape (n,)."""

    A: LinearOperator
    M: LinearOperator | None
    b: Array
    x0: Array | None
    maxiter: int
    residuals: list[float]
    dtype: np.dtype[Any]  # That of the solution.
    vectors: Vectors
    inner: LinearOperator | None  # A in the precision of the iteration, where that is less.


def check_system(
    A: Any,
    b: ArrayLike,
    x0: ArrayLike | None,
    M: Any,
    rtol: float,
    atol: float,
    maxiter: int | None,
    residuals: list[float] | None = None,
    callback: Callable[..., object] | None = None,
    inner: Any = None,
) -> System:
    """Return a system with vectors of shape (n,), or say what is wrong with it.

    Raises
    ------
    ValueError
        For shapes that do not match, numbers that are not finite, negative tolerances, a `maxiter`
        below 1, or, on ranks, arguments or operators of a kind that is not that of all.
    TypeError
        For vectors that are not of numbers, a `maxiter` that is no integer, or `residuals` that
        are no list, a `callback` that is no function, or for operators of which one is on ranks
        and the other is not.
    """
    ranks = ranks_of(A)
    with ranks.agree() as same:
        system = _check_own(A, b, x0, M, rtol, atol, maxiter, residuals, callback, inner)
        same["rtol, atol, maxiter"] = rtol, atol, maxiter
        same["the dtype of A, M, b and x0"] = system.dtype
        same["whether there is a first guess"] = x0 is not None
        for name, given in (("A", A), ("M", M), ("inner", inner)):
            same[name] = getattr(given, "kind", None)
    if maxiter is None:
        # There are 10 for each unknown, also for those of other ranks.
        system = system._replace(maxiter=int(sum(ranks.gather(system.maxiter))))
    return system


def _check_own(
    A: Any,
    b: ArrayLike,
    x0: ArrayLike | None,
    M: Any,
    rtol: float,
    atol: float,
    maxiter: int | None,
    residuals: list[float] | None,
    callback: Callable[..., object] | None,
    inner: Any,
) -> System:
    A = check_operator("A", A)
    n = A.shape[0]
    if A.shape != (n, n):
        raise ValueError(f"A has shape {A.shape}, but must be square")
    M = None if M is None else check_operator("M", M)
    if M is not None:
        check_place("M", M, A)
        if M.shape != A.shape:
            raise ValueError(f"M has shape {M.shape}, but A has {A.shape}")
    for name, tolerance in (("rtol", rtol), ("atol", atol)):
        if not 0.0 <= real(name, tolerance) < np.inf:
            raise ValueError(f"{name} is {tolerance}, but must be finite and not negative")
    maxiter = 10 * n if maxiter is None else count("maxiter", maxiter)
    library = library_for(A)
    guess = None if x0 is None else _vector(x0, "x0", n, library)
    if residuals is None:
        residuals = []
    elif not isinstance(residuals, list):
        raise TypeError(
            f"residuals is {residuals!r}, but must be a list, which will be filled: make one by "
            "residuals = []"
        )
    if callback is not None and not callable(callback):
        raise TypeError(f"callback is {callback!r}, but must be a function, or None")
    b = _vector(b, "b", n, library)
    dtype = np.result_type(A.dtype, *(library.dtype(v) for v in (b, guess) if v is not None))
    if M is not None and M.dtype.kind == "c":
        dtype = np.result_type(dtype, np.complex64)
    within = None if inner is None else _check_inner(inner, A, dtype)
    return System(
        A, M, b, guess, maxiter, residuals, dtype, ranks_of(A).vectors_for(A, dtype), within
    )


def _check_inner(inner: Any, A: LinearOperator, dtype: np.dtype[Any]) -> LinearOperator:
    try:
        B = check_operator("inner", inner)
    except TypeError:
        raise TypeError(
            f"inner is {inner!r}, but must be A in less precision, as A.astype(np.float32)"
        ) from None
    check_place("inner", B, A)
    if B.shape != A.shape:
        raise ValueError(f"inner has shape {B.shape}, but A has {A.shape}")
    if np.dtype(B.dtype).char not in ("fdFD" if dtype.kind == "c" else "fd"):
        raise TypeError(
            f"inner has dtype {B.dtype}, but must be A in less precision, and A and b give the "
            f"dtype {dtype}"
        )
    return B


def check_precision(system: System) -> np.dtype[Any]:
    """Return the dtype of the solution, which must be one that BLAS has."""
    if system.dtype.char not in "fdFD":
        raise TypeError(
            f"A and b give the dtype {system.dtype}, but the iteration is in float32 or float64, "
            "real or complex"
        )
    return system.dtype


def check_numbers(name: str, values: Any, library: Library = NUMPY) -> Array:
    """Return an array of numbers, real or complex, of a library."""
    array = library.read(name, values)
    if library.dtype(array).kind not in "buifc":
        what = f"has dtype {array.dtype}" if array.ndim else f"is {array.item()!r}"
        raise TypeError(f"{name} {what}, but must be of numbers")
    return array


def check_place(name: str, M: Any, A: Any) -> None:
    """Refuse an operator that is not on the same ranks as A, or on none as it."""
    if ranks_of(M) is not ranks_of(A):
        raise TypeError(
            f"{name} is {M!r}, and A is {A!r}, but both must be of toeplitz_mg.slabs, on the same "
            "slab, or none of them"
        )
    theirs, ours = library_for(M), library_for(A)
    if theirs is not ours:
        raise TypeError(
            f"{name} has arrays of {theirs.name} ({theirs.device}), and A of {ours.name} "
            f"({ours.device}), but both must have arrays of one library on one device"
        )


def check_operator(name: str, A: Any) -> LinearOperator:
    """Return a matrix, dense or sparse, or what has products, as an operator of numbers.

    What has `vectors` of its own, as an operator of this package or of one of its slabs, is
    returned as it is.
    """
    if hasattr(A, "vectors"):
        return A
    if not hasattr(A, "matvec"):
        if is_foreign(A):
            raise TypeError(
                f"{name} is an array of {library_of(A).name}, but must be an operator: a "
                "ToeplitzOperator, or a preconditioner of one"
            )
        if callable(A):
            raise TypeError(
                f"{name} is {A!r}, but must be a matrix or an operator: call a function that makes "
                "one, as chan_preconditioner(A); of one that multiplies vectors it is "
                "scipy.sparse.linalg.LinearOperator(A.shape, function)"
            )
        if not issparse(A):
            A = check_numbers(name, A)
            if A.ndim != 2:
                raise TypeError(f"{name} has shape {A.shape}, but must be a matrix or an operator")
        elif A.dtype.kind not in "buifc":
            raise TypeError(f"{name} has dtype {A.dtype}, but must be of numbers")
    return aslinearoperator(A)


def _vector(values: ArrayLike, name: str, n: int, library: Library) -> Array:
    array, xp = check_numbers(name, values, library), library.xp
    if array.shape not in ((n,), (n, 1)):
        raise ValueError(f"{name} has shape {array.shape}, but A has {(n, n)}")
    if not xp.all(xp.isfinite(array)):
        raise ValueError(f"{name} has entries that are not finite")
    if library.dtype(array).kind in "bui" or library.dtype(array) == np.float16:
        array = library.cast(array, np.float64)
    return xp.reshape(array, (n,))
