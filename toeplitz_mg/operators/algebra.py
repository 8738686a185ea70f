"""The operators +, -, *, /, @ and [] of matrices.

The methods `scaled` and `plus` of a class return its combinations with numbers, diagonal matrices
and operators of its kind. For others SciPy composes operators, which no preconditioner supports.
"""

from collections.abc import Callable
from functools import wraps
from numbers import Real
from operator import index as integer
from reprlib import repr
from typing import Any

import numpy as np
from scipy.sparse import issparse
from scipy.sparse.linalg import LinearOperator, aslinearoperator

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.arrays.library import NUMPY, library_of
from toeplitz_mg.values import is_foreign, refuse_masked


def read_factor(x: Any, n: int) -> Any:
    """Return a number as it is, the entries of a diagonal sparse matrix, and None for all else.

    Parameters
    ----------
    x : object
    n : int
        The number of rows that the matrix must have.

    Raises
    ------
    TypeError
        For a masked array.
    ValueError
        If the number, or an entry of the diagonal, is not finite.

    Examples
    --------
    >>> from scipy.sparse import diags_array
    >>> read_factor(diags_array([1.0, 2.0]), 2)
    array([1., 2.])
    >>> read_factor(2, 2)
    2.0
    """
    if type(x) is np.ndarray:
        if x.ndim > 0:  # One or several vectors.
            return None
        x = x[()]
    if np.ma.isMaskedArray(x):
        refuse_masked("x", x)
    if is_foreign(x) and x.ndim == 0:  # In some libraries nearly every number is an array.
        x = library_of(x).to_numpy(x)[()]
    if issparse(x):
        return _read_diagonal(x, n)
    number: Any = None
    if isinstance(x, np.generic):
        number = x if x.dtype.kind in "fciub" else None
    elif isinstance(x, complex | Real):
        try:
            number = x if isinstance(x, complex) else float(x)
        except OverflowError:
            number, x = np.inf, repr(x)
    if number is not None and not np.isfinite(number):
        raise ValueError(f"a matrix is multiplied by, or added to, {x}, but it must be finite")
    return number


def _read_diagonal(x: Any, n: int) -> Array | None:
    """Return the entries of a sparse matrix if it is diagonal and of this size, else None."""
    if x.shape != (n, n) or x.dtype.kind not in "fciub":
        return None
    entries = x.tocoo()
    rows, columns = entries.coords
    if entries.data[rows != columns].any():
        return None
    # Sums and products of integers and booleans would overflow or saturate.
    dtype = x.dtype if x.dtype.char in "fdFD" else "D" if x.dtype.kind == "c" else "d"
    diagonal = np.zeros(n, dtype)
    np.add.at(diagonal, rows, entries.data)
    if not np.isfinite(diagonal).all():
        k = int(np.argmin(np.isfinite(diagonal)))
        raise ValueError(f"a diagonal has {diagonal[k]} at {k}, but all entries must be finite")
    return diagonal


def scaling(side: str, method: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Return a multiplication method that scales by numbers and diagonals, on the left or right."""

    @wraps(method)
    def multiply(A: Any, x: Any) -> Any:
        factor = read_factor(x, A.shape[0 if side == "left" else 1])
        product = NotImplemented if factor is None else A.scaled(**{side: factor})
        if side == "right" and isinstance(x, LinearOperator):
            product = A.composed(x)
        if product is NotImplemented:
            _refuse_composition(A, x)
            return method(A, aslinearoperator(x) if issparse(x) else x)
        return product

    return multiply


def _refuse_composition(A: Any, x: Any) -> None:
    """Refuse compositions by SciPy on arrays of other libraries, which it would convert."""
    if not isinstance(x, LinearOperator):
        return
    names = {getattr(B, "library", NUMPY).name for B in (A, x)}
    if names != {NUMPY.name}:
        raise TypeError(
            f"{A!r} and {x!r} cannot be combined on arrays of {' and '.join(sorted(names))}: "
            "multiply by each, as in A @ x + B @ x or A @ (B @ x)"
        )


def add(A: Any, x: Any) -> Any:
    """Return A + x, for an operator or a sparse matrix x; also for 0, with which `sum` starts."""
    factor = read_factor(x, A.shape[0])
    if factor is not None and np.ndim(factor) == 0:
        if not factor:
            return A
        raise TypeError(
            f"sums and differences of A and a number, as {x}, are not defined: instead of s "
            "use s * scipy.sparse.eye_array(n), which has it on the diagonal"
        )
    if isinstance(x, np.ndarray):
        raise TypeError(
            f"sums and differences of A and an array, of shape {x.shape}, are not defined: use "
            "scipy.sparse.diags_array(d), with d on the diagonal, or for a dense matrix "
            "aslinearoperator(matrix)"
        )
    other = x if factor is None else factor
    if factor is not None or isinstance(x, LinearOperator):
        total = A.plus(other)
        if total is not NotImplemented:
            return total
    _refuse_composition(A, x)
    return LinearOperator.__add__(A, aslinearoperator(x) if issparse(x) else x)


def subtract(A: Any, x: Any) -> Any:
    """Return A - x."""
    if isinstance(x, LinearOperator):
        return LinearOperator.__sub__(A, x)
    # Not A + (-x), because unsigned integers have no negative.
    difference = add(-A, x)
    return NotImplemented if difference is NotImplemented else -difference


def subtract_from(A: Any, x: Any) -> Any:
    """Return x - A."""
    return add(-A, x)


def negate(A: Any) -> Any:
    """Return -A."""
    return -1 * A


def divide(A: Any, x: Any) -> Any:
    """Return A / x, for a number."""
    factor = read_factor(x, 0)
    if factor is None:
        return LinearOperator.__truediv__(A, x)
    if not factor:
        raise ZeroDivisionError(f"{A!r} is divided by {x}")
    # A NumPy scalar would give a quotient in its own precision.
    with np.errstate(over="ignore"):
        inverse = np.divide(1.0, factor, dtype=np.result_type(A.dtype, factor))
    if not np.isfinite(inverse):
        raise ValueError(f"{A!r} is divided by {x}, but 1/{x} is beyond its precision: scale A")
    return A * inverse


def power(A: Any, p: int) -> Any:
    """Return A to the power p."""
    _refuse_composition(A, A)
    return LinearOperator.__pow__(A, p)


def trace(A: Any) -> Any:
    """Return the sum of the entries (i, i)."""
    return A.diagonal().sum()


def take(A: Any, index: Any) -> Any:
    """Return the entry ``A[i, j]``; for slices, a dense part of the matrix."""
    if not isinstance(index, tuple) or len(index) != 2:
        raise IndexError(f"the index is {index!r}, but must have a row and a column, as A[0, 1]")
    rows, columns = map(_positions, ("row", "column"), index, A.shape)
    part = A.entries(np.atleast_1d(rows), np.atleast_1d(columns))
    return part.reshape(np.shape(rows) + np.shape(columns))[()]


def _positions(name: str, index: Any, length: int) -> Any:
    """Return an index, or the indices of a slice, counted from 0."""
    if isinstance(index, slice):
        return np.arange(length)[index]
    if np.ma.isMaskedArray(index):
        refuse_masked(f"the {name}", index)
    try:
        k = integer(index)
    except TypeError:
        raise IndexError(f"the {name} is {index!r}, but must be an integer or a slice") from None
    if not -length <= k < length:
        raise IndexError(f"the {name} is {k}, but must lie between {-length} and {length - 1}")
    return k % length


# SciPy's types for combined operators; their `args` are the operands.
_I = aslinearoperator(np.eye(1))
SUM, PRODUCT, MULTIPLE, POWER = type(_I + _I), type(_I @ _I), type(2.0 * _I), type(_I**2)


def is_hermitian(A: Any) -> bool | None:
    """Tell from the structure of an operator whether it is Hermitian; None if that is unknown.

    A product counts as Hermitian only if it is the same from both ends, such as S A S. A product of
    two Hermitian matrices is Hermitian if they commute, which is not known.

    Examples
    --------
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator([4.0, 2.0, 1.0])
    >>> S = tmg.fft_preconditioner(A)
    >>> is_hermitian(2 * S - S @ A @ S), is_hermitian(S @ A)
    (True, False)
    >>> is_hermitian(aslinearoperator(np.eye(3))) is None  # The entries are not inspected.
    True
    """
    if not isinstance(A, LinearOperator):
        return None
    if isinstance(A, PRODUCT):
        factors = _factors(A)
        known = [is_hermitian(B) for B in factors]
        if None in known or known.count(False) > 1:
            return None
        return all(known) and all(B is C for B, C in zip(factors, factors[::-1], strict=True))
    if isinstance(A, SUM | MULTIPLE | POWER):
        known = [is_hermitian(B) for B in A.args if isinstance(B, LinearOperator)]
        is_real = all(np.isreal(x) for x in A.args if not isinstance(x, LinearOperator))
        if is_real and all(known):
            return True
        is_other = known.count(False) == 1 and None not in known
        return False if is_real and is_other and not isinstance(A, POWER) else None
    if hasattr(A, "is_hermitian"):
        return None if A.is_hermitian is None else bool(A.is_hermitian)
    # A Hermitian operator of this package is its own adjoint.
    return A.H is A if hasattr(A, "grid_shape") else None


def _factors(A: Any) -> list[Any]:
    return [C for B in A.args for C in _factors(B)] if isinstance(A, PRODUCT) else [A]
