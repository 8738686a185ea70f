"""Lift functions of a Toeplitz matrix to masks, components, and sums with diagonal matrices."""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from typing import Any, Literal, TypeVar, cast

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Mask
from toeplitz_mg.engine.arrays.library import NUMPY
from toeplitz_mg.operators.base import require_numpy, require_serial
from toeplitz_mg.operators.coefficients import require_range
from toeplitz_mg.operators.composed import BlockDiagonal, DiagonallyScaled
from toeplitz_mg.operators.coupled import CoupledOperator, Transposes, asymmetries
from toeplitz_mg.operators.masked import MaskedOperator
from toeplitz_mg.operators.rectangular import NormalMatrix
from toeplitz_mg.operators.sums import (
    ToeplitzSum,
    advise_of_negative,
    average,
    hermitian_part,
    terms_of,
)
from toeplitz_mg.operators.toeplitz import ToeplitzOperator

F = TypeVar("F", bound=Callable[..., LinearOperator])
Check = Callable[[ToeplitzOperator | CoupledOperator], None]
ADVICE = r"[:;][^:;]*_preconditioner\(A\)"  # The first advice in a message to use another one.


def stand_in(A: LinearOperator) -> LinearOperator:
    """Return the Toeplitz matrix that approximates a NormalMatrix; other operators unchanged."""
    return ToeplitzOperator.from_lags(A.lags) if isinstance(A, NormalMatrix) else A


def unwrap(A: LinearOperator) -> tuple[LinearOperator, Mask | None]:
    """Return the operator on the whole grid, and the mask or None."""
    return (A.full, A.mask) if isinstance(A, MaskedOperator) else (A, None)


def restrict(A: LinearOperator, mask: Mask | None) -> LinearOperator:
    """Return an operator on a mask; unchanged if the mask is None."""
    return A if mask is None else MaskedOperator(A, mask.reshape(A.grid_shape))


def components(full: CoupledOperator, mask: Mask | None) -> list[LinearOperator]:
    """Return the matrix of each component that has unknowns, on its part of the mask.

    Raises a ValueError if the diagonal block of a component is zero.
    """
    parts = [None] * len(full.blocks) if mask is None else mask
    return [
        restrict(full.component(i), part)
        for i, part in enumerate(parts)
        if part is None or part.any()
    ]


def coefficients_on_numpy(A: LinearOperator) -> LinearOperator:
    """Return an operator whose coefficients are NumPy arrays, for functions that read only these.

    It cannot multiply.
    """
    full, mask = unwrap(A)
    if isinstance(full, CoupledOperator):
        rows = [[block and coefficients_on_numpy(block) for block in row] for row in full.blocks]
        return restrict(CoupledOperator(cast(Any, rows), product=full._product), mask)
    if not isinstance(full, ToeplitzOperator):
        return A
    a = full.coefficients
    array = np.array(a.library.to_numpy(a.array))
    return restrict(ToeplitzOperator(replace(a, array=array), product=full._product), mask)


def of_numpy(A: ToeplitzOperator) -> ToeplitzOperator:
    """Return a Toeplitz matrix of any library with NumPy's arrays; one of NumPy unchanged."""
    if A.library is NUMPY:
        return A
    return ToeplitzOperator(cast(ToeplitzOperator, coefficients_on_numpy(A)).coefficients)


def check_hermitian(A: ToeplitzOperator | CoupledOperator) -> None:
    """Raise a ValueError unless a matrix is real symmetric or complex Hermitian."""
    if A.is_hermitian:
        return
    is_complex = A.dtype.kind == "c"
    if isinstance(A, CoupledOperator):
        shares = asymmetries(A.blocks, Transposes(conjugate=is_complex))
        i, j = max(shares, key=shares.__getitem__)
        share, which = shares[i, j], f"blocks[{i}][{j}] and the transpose of blocks[{j}][{i}]"
        which = which.replace("transpose", "conjugate transpose") if is_complex else which
    else:
        share = A.coefficients.asymmetry
        which = f"a[k] and {'the conjugate of ' if is_complex else ''}a[-k]"
    raise ValueError(
        f"A is {A!r}, but must be {'Hermitian' if is_complex else 'symmetric'}: use "
        f"chan_preconditioner(A), which takes any Toeplitz matrix, with gmres; {which} differ by "
        f"up to {share:.2g} of the largest coefficient: if that is rounding, average them"
    )


def check_symmetric(A: ToeplitzOperator | CoupledOperator) -> None:
    """Raise a ValueError unless a matrix is real and symmetric."""
    if A.dtype.kind == "c":
        solver = "gmres"
        if A.is_hermitian:
            solver = (
                "cg, or gmres without M if A is indefinite, or gmres if A stands for a sum that "
                "is not Hermitian"
            )
        raise ValueError(
            f"A is {A!r}, but must be real: use chan_preconditioner(A), which takes complex "
            f"matrices too, with {solver}"
        )
    check_hermitian(A)


def accept_any(A: ToeplitzOperator | CoupledOperator) -> None:
    """Accept every matrix: a check that does nothing."""


def unwrap_toeplitz(
    A: LinearOperator, check: Check = check_symmetric
) -> tuple[ToeplitzOperator, Mask | None]:
    """Return the Toeplitz matrix on the whole grid, and the mask or None.

    Raises a TypeError if `A` is neither a `ToeplitzOperator` nor a `MaskedOperator` of one, and the
    ValueError of `check` (`check_symmetric`, `check_hermitian` or `accept_any`).
    """
    full, mask = unwrap(stand_in(A))
    if not isinstance(full, ToeplitzOperator):
        require_serial("A", A)
        if isinstance(full, CoupledOperator):
            check(full)
        raise TypeError(
            f"A is of type {type(full).__name__}, but must be a ToeplitzOperator or a "
            f"MaskedOperator of one{_advise(full)}"
        )
    check(full)
    return full, mask


def _advise(other: Any) -> str:
    """Return the advice for an object that is not a Toeplitz operator."""
    if isinstance(other, CoupledOperator):
        return (
            "; to treat each of its components separately use componentwise(f)(A) for the "
            "function f that was called, such as componentwise(multigrid)(A)"
        )
    if isinstance(other, ToeplitzSum):
        return (
            ": use cg with default_preconditioner(A), or gmres with chan_preconditioner(A), "
            "which take sums"
        )
    if isinstance(other, LinearOperator):
        return (
            "; sums of Toeplitz matrices, and their products with diagonal matrices such as "
            "scipy.sparse.diags_array(d), are accepted; for others, such as C + D with a "
            "CoupledOperator C, use cg or gmres with default_preconditioner(C)"
        )
    if isinstance(other, np.ndarray | list | tuple):
        return ": use ToeplitzOperator(c) for the matrix with the first column c"
    return ""


def squeeze_line(A: ToeplitzOperator) -> ToeplitzOperator:
    """Return the matrix without axes of length one; raise a ValueError unless one axis is left."""
    line = A.squeezed
    if len(line.grid_shape) != 1:
        raise ValueError(
            f"A lives on the grid {A.grid_shape}, but must have one axis (with more than one "
            "element): use chan_preconditioner(A), which takes any number"
        )
    return line


CHECKS: dict[str, Check] = {
    "symmetric": check_symmetric,
    "symmetric part": check_symmetric,
    "Hermitian": check_hermitian,
    "any": accept_any,
}


def lift(
    accepts: Literal["symmetric", "symmetric part", "Hermitian", "any"] = "symmetric",
    parts: tuple[str, ...] = ("components", "mask"),
    numpy_only: bool = False,
) -> Callable[[F], F]:
    """Return a decorator that makes a preconditioner accept masks, components and sums.

    Parameters
    ----------
    accepts : {"symmetric", "symmetric part", "Hermitian", "any"}
        The Toeplitz matrices that the function accepts: real symmetric ones; the symmetric part of
        real ones; real symmetric and complex Hermitian ones; or any. Others are refused here if the
        function does not see the mask, otherwise by the function.
    parts : tuple of {"components", "mask"}
        With "components" the function is called with the matrix of each component of a
        `CoupledOperator`, and the result is block diagonal. With "mask" it is called with the
        `ToeplitzOperator` on the whole grid, and the result is restricted to the mask. Otherwise
        the function gets these operators unchanged.
    numpy_only : bool
        Whether to refuse operators on arrays of other libraries.

    Returns
    -------
    callable
        The decorator. For a `ToeplitzSum` the function gets the Toeplitz matrix that approximates
        it (see `toeplitz_mg.operators.sums.average`). The result is scaled by a diagonal matrix
        from both sides, and symmetric positive definite if that for the Toeplitz matrix is.

    Raises
    ------
    numpy.linalg.LinAlgError
        By the decorated function, if an entry of the diagonal of a sum is not positive.

    See Also
    --------
    componentwise : for existing functions.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.sparse import diags_array
    >>> import toeplitz_mg as tmg
    >>> @lift(accepts="symmetric")
    ... def inverse_of_diagonal(A):
    ...     return tmg.ToeplitzOperator(np.eye(1, A.shape[0])[0] / A.c[0])
    >>> A = tmg.ToeplitzOperator([2.0, 1.0, 0.5])
    >>> inverse_of_diagonal(tmg.MaskedOperator(A, [True, False, True])).shape
    (2, 2)
    >>> S = diags_array([1.0, 10.0, 100.0]) @ A
    >>> (inverse_of_diagonal(S) @ S.diagonal()).round(12)
    array([1., 1., 1.])
    """
    if accepts not in CHECKS:
        raise ValueError(f"accepts is {accepts!r}, but must be one of {', '.join(CHECKS)}")
    if not {*parts} <= {"components", "mask"}:
        raise ValueError(f'parts is {parts!r}, but must be a tuple of "components" and "mask"')

    def decorate(function: F) -> F:
        @wraps(function)
        def lifted(A: LinearOperator, *args: Any, **kwargs: Any) -> LinearOperator:
            if numpy_only:
                require_numpy(A, function.__name__.strip("_"))
            A = stand_in(A)
            full, mask = unwrap(A)
            T, scale = full, None
            if isinstance(full, ToeplitzSum):
                T, scale = average(full, mask, is_any=accepts == "any")
            elif accepts == "symmetric part" and isinstance(full, ToeplitzOperator):
                # Complex matrices are refused as given, not by their symmetric part.
                T = full if full.dtype.kind == "c" else hermitian_part(full)
            try:
                if "mask" in parts:
                    T, _ = unwrap_toeplitz(T, CHECKS[accepts])
                    M = restrict(function(T, *args, **kwargs), mask)
                else:
                    M = function(A if T is full else restrict(T, mask), *args, **kwargs)
            except np.linalg.LinAlgError as error:
                if accepts != "any" and not all(term.A.is_hermitian for term in terms_of(full)[0]):
                    raise np.linalg.LinAlgError(
                        "A is not symmetric, and its symmetric part is refused: use "
                        "chan_preconditioner(A), which takes any Toeplitz matrix, with gmres"
                    ) from error
                error.args = (_add_advice(str(error), full, mask),)
                raise
            except ValueError as error:
                if scale is not None:
                    error.add_note(f"This was the matrix {T!r}, which stands for {full!r}")
                raise
            if scale is None:
                return M
            for extreme in (scale.max(), scale.min()):
                require_range(float(extreme) ** -2, M.dtype)
            return DiagonallyScaled(M, scale)

        if "components" not in parts:
            return cast(F, lifted)
        return _of_each(cast(F, lifted), accept_any if accepts == "any" else check_hermitian)

    return decorate


def _add_advice(message: str, full: LinearOperator, mask: Mask | None) -> str:
    """Return the message of a refusal with additional advice for the given matrix."""
    if isinstance(full, ToeplitzSum):
        solver = "cg without M, and else gmres" if full.is_hermitian else "gmres without M"
        return (
            f"{message}; here A is the Toeplitz matrix that stands for a sum with diagonal "
            f"matrices, and may be indefinite although the sum is not: then use {solver}"
        )
    advice = advise_of_negative(full.diagonal().real.max())
    named = re.search(ADVICE, message)
    if not advice and mask is None and named and (advice := _advise_of_indefinite(full)):
        message = message[: named.start()]
    return message if advice in message else message + advice


def _advise_of_indefinite(A: Any) -> str:
    """Return the advice for a matrix with indefinite 2 x 2 blocks; empty for other matrices.

    It replaces the advice to use a preconditioner for positive definite matrices.
    """
    if not (isinstance(A, ToeplitzOperator) and A.is_hermitian):
        return ""
    lags = np.abs(A.library.to_numpy(A.lags)).ravel()
    middle = len(lags) // 2
    diagonal, others = lags[middle], np.delete(lags, middle)
    if others.max(initial=0.0) < diagonal:
        return ""
    solver = "gmres without M"
    if len(A.grid_shape) == 1:
        solver = f"solve_toeplitz(A.c, b), or {solver}"
    return (
        "; A is not positive definite (a coefficient beside the diagonal is as large): use "
        f"{solver}"
    )


def componentwise(preconditioner: F) -> F:
    """Return a preconditioner function that treats the components of a matrix separately.

    Parameters
    ----------
    preconditioner : callable
        A function of a `ToeplitzOperator` or a `MaskedOperator` of one, such as
        `fft_preconditioner` or `multigrid`.

    Returns
    -------
    callable
        The same function, which also takes a `CoupledOperator` or a `MaskedOperator` of one and
        then returns a block diagonal operator, symmetric positive definite if its blocks are.

    Raises
    ------
    TypeError
        If the argument is not a function, but for example a matrix.

    See Also
    --------
    CoupledOperator : the matrix of several components.
    default_preconditioner : selects a preconditioner for a matrix.

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> xx = tmg.ToeplitzOperator([[2.0, 0.5], [0.5, 0.1]])
    >>> A = tmg.CoupledOperator([[xx, None], [None, xx]])
    >>> M = tmg.componentwise(tmg.fft_preconditioner)(A)
    >>> np.array_equal(M @ np.ones(8), np.tile(tmg.fft_preconditioner(xx) @ np.ones(4), 2))
    True
    """
    # Operators are callable too: calling one multiplies.
    if isinstance(preconditioner, LinearOperator) or not callable(preconditioner):
        raise TypeError(
            f"preconditioner is {preconditioner!r}, but must be a function of a ToeplitzOperator: "
            "for one of each component of A use componentwise(chan_preconditioner)(A)"
        )
    return _of_each(preconditioner, check_hermitian)


def _of_each(function: F, check: Check) -> F:
    """Return a function that treats each component of a `CoupledOperator` separately."""

    @wraps(function)
    def of_each(A: LinearOperator, *args: Any, **kwargs: Any) -> LinearOperator:
        full, mask = unwrap(A)
        if not isinstance(full, CoupledOperator):
            return function(A, *args, **kwargs)
        check(full)
        blocks = []
        for block in components(full, mask):
            try:
                blocks.append(function(block, *args, **kwargs))
            except np.linalg.LinAlgError as error:
                error.add_note(
                    f"This was the matrix of a component, {block!r}: to use what is advised for "
                    "all components, use componentwise, as in componentwise(chan_preconditioner)(A)"
                )
                raise
        return BlockDiagonal(blocks, full.grid_shape)

    return cast(F, of_each)
