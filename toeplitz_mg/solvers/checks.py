"""Shared by all iterations: the checks of a system, and a loop with a true residual."""

from collections.abc import Callable
from math import inf, prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import issparse
from scipy.sparse.linalg import LinearOperator, aslinearoperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import NUMPY, Library, library_of
from toeplitz_mg.engine.ranks import ranks_of
from toeplitz_mg.engine.vectors import VECTORS, Vectors, power_above
from toeplitz_mg.operators.base import apply_to_rows, library_for
from toeplitz_mg.values import count, is_foreign, is_traced, real

# Smallest b relative to the first residual, in units of the smallest number with full precision.
FAINT = 1e8

Watch = Callable[[], object]  # Called after each iteration; returns True to stop.


class System(NamedTuple):
    """A checked system A x = b, a preconditioner and an initial guess; vectors have shape (n,)."""

    A: LinearOperator
    M: LinearOperator | None
    b: Array
    x0: Array | str | None  # The string is "Mb", for M @ b.
    maxiter: int
    residuals: list[float]
    dtype: np.dtype[Any]  # The dtype of the solution.
    vectors: Vectors
    inner: LinearOperator | None  # A in the lower precision of the iteration, if any.


def check_system(
    A: Any,
    b: ArrayLike,
    x0: Any,
    M: Any,
    rtol: float,
    atol: float,
    maxiter: int | None,
    residuals: list[float] | None = None,
    callback: Callable[..., object] | None = None,
    inner: Any = None,
) -> System:
    """Return a system with vectors of shape (n,); raise an error if it is not valid.

    Raises
    ------
    ValueError, TypeError
        As for `cg`; with several ranks also if the arguments differ between them.
    """
    ranks = ranks_of(A)
    with ranks.agree() as same:
        system = _check_own(A, b, x0, M, rtol, atol, maxiter, residuals, callback, inner)
        same["rtol, atol, maxiter"] = rtol, atol, maxiter
        same["the dtype of A, M, b and x0"] = system.dtype
        same["whether there is a first guess"] = x0 if isinstance(x0, str) else x0 is not None
        for name, given in (("A", A), ("M", M), ("inner", inner)):
            same[name] = getattr(given, "kind", None)
    if maxiter is None:
        # 10 for each unknown, including those of other ranks.
        system = system._replace(maxiter=int(sum(ranks.gather(system.maxiter))))
    return system


def _check_own(
    A: Any,
    b: ArrayLike,
    x0: ArrayLike | str | None,
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
        raise ValueError(f"A has shape {A.shape}, but must be square (expected 2-D)")
    if M is not None:
        M = check_operator("M", M)
        check_place("M", M, A)
        if M.shape != A.shape:
            raise ValueError(f"M has shape {M.shape}, but A has {A.shape}")
    for name, tolerance in (("rtol", rtol), ("atol", atol)):
        # SciPy also raises a ValueError for None and "legacy", and accepts infinity.
        is_number = tolerance is not None and not isinstance(tolerance, str)
        if not (is_number and real(name, tolerance) >= 0.0):
            raise ValueError(f"{name} is {tolerance!r}, but must be a number that is not negative")
    most = 10 * n if maxiter is None else count("maxiter", maxiter)
    library = library_for(A)
    if isinstance(x0, str):
        if x0 != "Mb":
            raise ValueError(f"x0 is {x0!r}, but must be a vector, or 'Mb', which is M @ b")
    elif x0 is not None:
        x0 = _vector(x0, "x0", n, library)
    if residuals is None:
        residuals = []
    elif not isinstance(residuals, list):
        raise TypeError(
            f"residuals is {residuals!r}, but must be a list, which will be filled: use "
            "residuals = []"
        )
    if callback is not None and not callable(callback):
        raise TypeError(f"callback is {callback!r}, but must be a function, or None")
    b = _vector(b, "b", n, library)
    given = [library.dtype(v) for v in (b, x0) if not isinstance(v, str | None)]
    dtype = np.result_type(_dtype_of(A), *given)
    if M is not None and _dtype_of(M).kind == "c":
        dtype = np.result_type(dtype, np.complex64)
    inner = None if inner is None else _check_inner(inner, A, dtype)
    return System(A, M, b, x0, most, residuals, dtype, ranks_of(A).vectors_for(A, dtype), inner)


def _dtype_of(A: LinearOperator) -> np.dtype[Any]:
    # SciPy's IdentityOperator has no dtype.
    return np.dtype(np.float64 if A.dtype is None else A.dtype)


def _check_inner(inner: Any, A: LinearOperator, dtype: np.dtype[Any]) -> LinearOperator:
    try:
        B = check_operator("inner", inner)
    except TypeError:
        raise TypeError(
            f"inner is {inner!r}, but must be A in lower precision, such as A.astype(np.float32)"
        ) from None
    check_place("inner", B, A)
    if B.shape != A.shape:
        raise ValueError(f"inner has shape {B.shape}, but A has {A.shape}")
    if np.dtype(B.dtype).char not in ("fdFD" if dtype.kind == "c" else "fd"):
        raise TypeError(
            f"inner has dtype {B.dtype}, but must be A in lower precision, and A and b have the "
            f"dtype {dtype}"
        )
    return B


def check_precision(system: System) -> np.dtype[Any]:
    """Return the dtype of the solution; raise an error if BLAS does not support it."""
    if system.dtype.char not in "fdFD":
        raise TypeError(
            f"A and b have the dtype {system.dtype}, but must have float32 or float64, real or "
            "complex, for an iteration"
        )
    return system.dtype


def check_numbers(name: str, values: Any, library: Library = NUMPY) -> Array:
    """Return an array of real or complex numbers, of a library."""
    array = library.read(name, values)
    if library.dtype(array).kind not in "buifc":
        what = f"has dtype {array.dtype}" if array.ndim else f"is {array.item()!r}"
        raise TypeError(f"{name} {what}, but must be of numbers")
    return array


def check_place(name: str, M: Any, A: Any) -> None:
    """Refuse an operator whose ranks or array library differ from those of A."""
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
    """Return a matrix, dense or sparse, or an object with products, as a linear operator.

    Objects with their own `vectors`, such as operators of this package and on slabs, are returned
    unchanged.
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
                f"{name} is {A!r}, but must be a matrix or an operator: call the function that "
                "makes one, such as chan_preconditioner(A); for a function that multiplies use "
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
    if is_traced(values):
        raise TypeError(
            f"{name} is traced by JAX, and has no numbers yet: inside of jit and grad use "
            "solve_toeplitz, or jax.scipy.sparse.linalg.cg with lambda x: A @ x"
        )
    array, xp = check_numbers(name, values, library), library.xp
    if array.shape not in ((n,), (n, 1)):
        remedy = ""
        if array.ndim == 2 and array.shape[0] == n:
            remedy = f": take one column at a time, {name}[:, k]"
        elif prod(array.shape) == n:
            remedy = f": write {name}.ravel()"
        raise ValueError(f"{name} has shape {array.shape}, but A has {(n, n)}{remedy}")
    if not xp.all(xp.isfinite(array)):
        raise ValueError(f"{name} has entries that are not finite, but all must be")
    if library.dtype(array).kind in "bui" or library.dtype(array) == np.float16:
        array = library.cast(array, np.float64)
    return xp.reshape(array, (n,))


class Iterate:
    """An iterate x and its residual r, which subclasses change in `advance`.

    The residual and all quantities derived from it are divided by a power of two. So no square
    overflows or underflows, and no digit changes.

    Attributes
    ----------
    x : ndarray
    b, r : ndarray
        The right-hand side and the residual, divided by `scale`.
    size, size_of_b : float
        The norms of `r` and `b`.
    iterations : int
        The number of iterations so far; ``system.residuals`` has the norms of r for all of them.
    """

    def __init__(self, system: System) -> None:
        A, b, dtype = system.A, system.b, system.dtype
        self.system, self.iterations = system, 0
        self.vectors = vectors = system.vectors
        self.x, peak = vectors.zeros(b, dtype), vectors.peak(b)
        guess = self._first_guess()
        if guess is not None:
            self.x = vectors.copy(guess, self.x)
            b = vectors.copy(b, vectors.zeros(b, dtype))
            size = 1.0
            with np.errstate(over="ignore", invalid="ignore"):  # `info` reports overflow.
                r = b - apply_to_rows(A, self.x)
                if not vectors.peak(r) < inf:
                    size = 2.0 ** (int(power_above(max(peak, vectors.peak(self.x)))) - 1)
                    r = b / size - apply_to_rows(A, self.x / size)
                above = vectors.peak(r) * size
            if peak < FAINT * np.finfo(dtype).tiny * above < inf:
                # b would underflow compared to this residual, so the guess is useless.
                guess, self.x = None, vectors.zeros(b, dtype)
            else:
                peak = max(peak, above)
        # The largest entry then lies between 1 and 2: the vectors are in the range of float32.
        self.scale = 2.0 ** (int(power_above(peak)) - 1)
        # Copy, because products of a user's A or M may return memory that they reuse.
        with np.errstate(over="ignore", invalid="ignore"):
            self.b = vectors.cast(b, dtype) / self.scale
            if guess is None:
                self.r = vectors.copy(self.b, vectors.empty(self.b))
            else:
                self.r = vectors.cast(r, dtype) * (size / self.scale)
        self.size_of_b, self.size = vectors.norm(self.b), vectors.norm(self.r)
        self.record()

    def _first_guess(self) -> Array | None:
        system = self.system
        if not isinstance(system.x0, str):
            return system.x0
        guess = self.vectors.copy(system.b, self.vectors.zeros(system.b, system.dtype))
        with np.errstate(over="ignore", invalid="ignore"):  # The error below reports overflow.
            guess = guess if system.M is None else apply_to_rows(system.M, guess)
        if not self.vectors.peak(guess) < inf:
            raise ValueError("x0 is 'Mb', but M @ b has entries that are not finite")
        return guess

    def goal(self, rtol: float, atol: float) -> float:
        """Return the goal for the norm of `r`."""
        return max(rtol * self.size_of_b, atol / self.scale)

    def zero(self) -> tuple[Array, int]:
        """Return the result of an iteration for b = 0."""
        self.system.residuals[:] = [0.0]
        return self.vectors.zeros(self.x), 0

    def reach(self, goal: float, most: int, watch: Watch | None = None) -> bool:
        """Iterate until `size` reaches the goal, at most until there are `most` iterations.

        Return whether it is reached. `watch` is called after each one; it returns True to stop.
        """
        self.begin()
        is_stopped: object = False
        while not self.size <= goal:
            if is_stopped or self.iterations == most or not self.size < inf:
                return False
            if not self.advance(goal):
                return False
            self.iterations += 1
            self.record()
            is_stopped = watch is not None and watch()
        return True

    def begin(self) -> None:
        """Start an iteration from `r`."""

    def advance(self, goal: float) -> bool:
        """Do one iteration, which sets `size`; return False if it is impossible."""
        raise NotImplementedError

    def solution(self) -> Array:
        """Return the solution so far."""
        return self.x

    def compute_residual(self) -> None:
        """Compute `r` and `size` by a product with A."""
        with np.errstate(over="ignore", invalid="ignore"):
            r = self.vectors.divide(self.x, self.scale, self.r)
            r = apply_to_rows(self.system.A, r, r)
            self.r = self.vectors.subtract(self.b, r, r)
        self.size = self.vectors.norm(self.r)

    def record(self) -> None:
        """Record `size` for this iteration, replacing an earlier value."""
        self.system.residuals[self.iterations :] = [self.size * self.scale]


def by_recurrence(
    iteration: Callable[[System], Iterate],
    A: LinearOperator,
    b: Array,
    *,
    M: LinearOperator | None,
    rtol: float,
    maxiter: int,
    residuals: list[float] | None = None,
    watch: Watch | None = None,
) -> tuple[Array, int, bool]:
    """Return the solution, the number of iterations, and whether the recurrence converged.

    For callers who know that A, M and b are valid NumPy arrays of one dtype, and who compute the
    residual of the result and correct it themselves.
    """
    residuals = [] if residuals is None else residuals
    state = iteration(System(A, M, b, None, maxiter, residuals, b.dtype, VECTORS, None))
    converged = state.reach(state.goal(rtol, 0.0), maxiter, watch)
    return state.solution(), state.iterations, converged
