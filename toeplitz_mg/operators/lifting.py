"""Functions of a Toeplitz matrix, lifted to masks, components, and sums with diagonal matrices."""

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
ADVICE = r"[:;][^:;]*_preconditioner\(A\)"  # The first advice of a message to take another one.


def stand_in(A: LinearOperator) -> LinearOperator:
    """Return the Toeplitz matrix that stands for one of normal equations; others as they are."""
    return ToeplitzOperator.from_lags(A.lags) if isinstance(A, NormalMatrix) else A


def unwrap(A: LinearOperator) -> tuple[LinearOperator, Mask | None]:
    """Return the operator on the whole grid, and the mask, or None where there is none."""
    return (A.full, A.mask) if isinstance(A, MaskedOperator) else (A, None)


def restrict(A: LinearOperator, mask: Mask | None) -> LinearOperator:
    """Return an operator on a mask, or as it is where there is none."""
    return A if mask is None else MaskedOperator(A, mask.reshape(A.grid_shape))


def components(full: CoupledOperator, mask: Mask | None) -> list[LinearOperator]:
    """Return the matrix of each component that has unknowns, on its part of the mask.

    It raises a ValueError where a component has no influence on itself.
    """
    parts = [None] * len(full.blocks) if mask is None else mask
    return [
        restrict(full.component(i), part)
        for i, part in enumerate(parts)
        if part is None or part.any()
    ]


def coefficients_on_numpy(A: LinearOperator) -> LinearOperator:
    """Return an operator as one with NumPy's coefficients, that does not multiply.

    It is for those who need the coefficients alone.
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
    """Return a Toeplitz matrix of any library on NumPy's arrays; one of NumPy's as it is."""
    if A.library is NUMPY:
        return A
    return ToeplitzOperator(cast(ToeplitzOperator, coefficients_on_numpy(A)).coefficients)


def check_hermitian(A: ToeplitzOperator | CoupledOperator) -> None:
    """Raise a ValueError where a matrix is neither real and symmetric nor complex and Hermitian."""
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
        f"up to {share:.2g} of the largest coefficient: where that is rounding, average them"
    )


def check_symmetric(A: ToeplitzOperator | CoupledOperator) -> None:
    """Raise a ValueError where a matrix is not real and symmetric."""
    if A.dtype.kind == "c":
        solver = "gmres"
        if A.is_hermitian:
            solver = (
                "cg, or gmres without M if A is indefinite, or gmres where A stands for a sum that "
                "is not Hermitian"
            )
        raise ValueError(
            f"A is {A!r}, but must be real: use chan_preconditioner(A), which takes complex "
            f"matrices too, with {solver}"
        )
    check_hermitian(A)


def accept_any(A: ToeplitzOperator | CoupledOperator) -> None:
    """Raise nothing: the check of what takes any matrix."""


def unwrap_toeplitz(
    A: LinearOperator, check: Check = check_symmetric
) -> tuple[ToeplitzOperator, Mask | None]:
    """Return the Toeplitz matrix on the whole grid, and the mask, or None.

    It raises a TypeError where `A` is neither a `ToeplitzOperator` nor a `MaskedOperator` of one,
    and the ValueError of `check` (`check_symmetric`, `check_hermitian` or `accept_any`).
    """
    full, mask = unwrap(stand_in(A))
    if not isinstance(full, ToeplitzOperator):
        require_serial("A", A)
        if isinstance(full, CoupledOperator):
            check(full)
        raise TypeError(
            f"A is a {type(full).__name__}, but must be a ToeplitzOperator or a MaskedOperator "
            f"of one{_advise(full)}"
        )
    check(full)
    return full, mask


def _advise(other: Any) -> str:
    """Return the end of the message that refuses what is no Toeplitz operator: what to write."""
    if isinstance(other, CoupledOperator):
        return (
            "; to treat each of its components by itself write componentwise(f)(A) for the "
            "function f that was called, as componentwise(multigrid)(A)"
        )
    if isinstance(other, ToeplitzSum):
        return (
            ": use cg with default_preconditioner(A), or gmres with chan_preconditioner(A), "
            "which take sums"
        )
    if isinstance(other, LinearOperator):
        return (
            "; sums of Toeplitz matrices, and products of each with diagonal ones, as "
            "scipy.sparse.diags_array(d), are understood; for others, as C + D with a "
            "CoupledOperator C, use cg or gmres with default_preconditioner(C)"
        )
    if isinstance(other, np.ndarray | list | tuple):
        return ": write ToeplitzOperator(c) for the matrix with the first column c"
    return ""


def squeeze_line(A: ToeplitzOperator) -> ToeplitzOperator:
    """Return the matrix on the one axis with more than one element, or raise a ValueError."""
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
    """Return a decorator of preconditioners, which take masks, components and sums with it.

    Parameters
    ----------
    accepts : {"symmetric", "symmetric part", "Hermitian", "any"}
        The Toeplitz matrices that the function takes: real symmetric ones; of any real ones the
        symmetric part; real symmetric and complex Hermitian ones; or any. Others are refused,
        by the function itself where it sees the mask.
    parts : tuple of {"components", "mask"}
        What is taken apart. With "components" the function sees the matrix of each component of a
        `CoupledOperator` by itself, and the result is block diagonal. With "mask" it sees the
        `ToeplitzOperator` on the whole grid only, and the result is restricted to the mask. What
        is not taken apart the function sees as it is.
    numpy_only : bool
        Whether operators on arrays of other libraries than NumPy are refused.

    Returns
    -------
    callable
        The decorator. Of a `ToeplitzSum` the function sees the Toeplitz matrix that stands for it
        (see `toeplitz_mg.operators.sums.average`), and the result is that between two diagonal
        matrices, symmetric positive definite where that of the Toeplitz matrix is.

    Raises
    ------
    numpy.linalg.LinAlgError
        By the decorated function, where an entry of the diagonal of a sum is not positive.

    See Also
    --------
    componentwise : for functions that are there already.

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
                # What is complex is refused as it is, and not in its part.
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
    """Return the message of a refusal with what else is known of the matrix that was given."""
    if isinstance(full, ToeplitzSum):
        solver = "cg without M, and else gmres" if full.is_hermitian else "gmres without M"
        return (
            f"{message}; here A is the Toeplitz matrix that stands for a sum with diagonal "
            f"matrices, and may be indefinite where the sum is not: then use {solver}"
        )
    advice = advise_of_negative(full.diagonal().real.max())
    named = re.search(ADVICE, message)
    if not advice and mask is None and named and (advice := _advise_of_indefinite(full)):
        message = message[: named.start()]
    return message if advice in message else message + advice


def _advise_of_indefinite(A: Any) -> str:
    """Return the end of the message that refuses a matrix whose 2 x 2 blocks are indefinite.

    It stands in place of preconditioners for positive definite matrices. Of others it is empty.
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
        "; A is not positive definite, as a coefficient beside the diagonal is as large: use "
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
    # An operator can be called too: it multiplies.
    if isinstance(preconditioner, LinearOperator) or not callable(preconditioner):
        raise TypeError(
            f"preconditioner is {preconditioner!r}, but must be a function of a ToeplitzOperator: "
            "for one of each component of A write componentwise(chan_preconditioner)(A)"
        )
    return _of_each(preconditioner, check_hermitian)


def _of_each(function: F, check: Check) -> F:
    """Return the function that treats each component of a `CoupledOperator` by itself."""

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
                    f"This was the matrix of a component, {block!r}: what is advised for it takes "
                    "all of them by componentwise, as in componentwise(chan_preconditioner)(A)"
                )
                raise
        return BlockDiagonal(blocks, full.grid_shape)

    return cast(F, of_each)
