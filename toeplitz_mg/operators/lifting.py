"""Functions of a Toeplitz matrix, lifted to masks, components, and sums with diagonal matrices."""

import re
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.operators.base import require_numpy
from toeplitz_mg.operators.coefficients import require_range
from toeplitz_mg.operators.composed import BlockDiagonal, DiagonallyScaled
from toeplitz_mg.operators.coupled import CoupledOperator
from toeplitz_mg.operators.structure import (
    Check,
    accept_any,
    check_hermitian,
    check_symmetric,
    components,
    restrict,
    unwrap,
    unwrap_toeplitz,
)
from toeplitz_mg.operators.sums import ToeplitzSum, advise_of_negative, average, hermitian_part
from toeplitz_mg.operators.toeplitz import ToeplitzOperator

F = TypeVar("F", bound=Callable[..., LinearOperator])
ADVICE = r"[:;][^:;]*_preconditioner\(A\)"  # The first advice of a message to take another one.


def _itself(A: Any) -> Any:
    return A


def averaged(
    function: F, part: Callable[[Any], Any] = hermitian_part, any_library: bool = False
) -> F:
    """Return the preconditioner that of a `ToeplitzSum` is that of a Toeplitz matrix nearby.

    Parameters
    ----------
    function : callable
        A function of a `ToeplitzOperator` or a `MaskedOperator` of one.
    part : callable
        What it sees of the Toeplitz matrix, the Hermitian part by default.
    any_library : bool
        Whether it takes operators on arrays of other libraries than NumPy.

    Returns
    -------
    callable
        The same function, that takes a `ToeplitzSum` or a `MaskedOperator` of one too. What it
        returns is symmetric positive definite where that of the Toeplitz matrix is.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where an entry of the diagonal of the sum is not positive.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.sparse import diags_array
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator([2.0, 1.0, 0.5])
    >>> S = diags_array([1.0, 10.0, 100.0]) @ A
    >>> tmg.jacobi_preconditioner(S, omega=1.0) @ S.diagonal()
    array([1., 1., 1.])
    """

    @wraps(function)
    def of_average(A: LinearOperator, *args: Any, **kwargs: Any) -> LinearOperator:
        full, mask = unwrap(A)
        if not any_library:
            require_numpy(A, function.__name__.strip("_"))
        if not isinstance(full, ToeplitzSum):
            try:
                return function(A, *args, **kwargs)
            except np.linalg.LinAlgError as error:
                message, advice = str(error), advise_of_negative(full.diagonal().real.max())
                named = re.search(ADVICE, message)
                if not advice and mask is None and named and (advice := _of_indefinite(full)):
                    message = message[: named.start()]
                if advice not in message:
                    message += advice
                error.args = (message,)
                raise
        mean, scale = average(full, mask, part)
        try:
            M = function(restrict(mean, mask), *args, **kwargs)
        except np.linalg.LinAlgError as error:
            if part is hermitian_part and not all(term.A.is_hermitian for term in full.terms):
                raise _of_hermitian_part() from error
            solver = "cg without M, and else gmres" if full.is_hermitian else "gmres without M"
            error.args = (
                f"{error}; here A is the Toeplitz matrix that stands for a sum with diagonal "
                f"matrices, and may be indefinite where the sum is not: then use {solver}",
            )
            raise
        except ValueError as error:
            error.add_note(f"This was the matrix {mean!r}, which stands for {full!r}")
            raise
        for extreme in (scale.max(), scale.min()):
            require_range(float(extreme) ** -2, M.dtype)
        return DiagonallyScaled(M, scale)

    return cast(F, of_average)


def _of_indefinite(A: Any) -> str:
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


def symmetrised(preconditioner: F) -> F:
    """Return the preconditioner that of a matrix that is not symmetric takes the symmetric part."""

    @wraps(preconditioner)
    def of_part(A: LinearOperator, *args: Any, **kwargs: Any) -> LinearOperator:
        full, _ = unwrap(A)
        # What is complex is refused as it is, and not in its part.
        if not isinstance(full, ToeplitzOperator) or full.is_hermitian or full.dtype.kind == "c":
            return preconditioner(A, *args, **kwargs)
        try:
            return preconditioner(hermitian_part(A), *args, **kwargs)
        except np.linalg.LinAlgError as error:
            raise _of_hermitian_part() from error

    return cast(F, of_part)


def _of_hermitian_part() -> np.linalg.LinAlgError:
    """Return the refusal of a matrix that is not Hermitian, where that of its part is the cause."""
    return np.linalg.LinAlgError(
        "A is not symmetric, and its symmetric part is refused: use chan_preconditioner(A), which "
        "takes any Toeplitz matrix, with gmres"
    )


def restricted(preconditioner: F) -> F:
    """Return the preconditioner that on a mask is the restriction of that of the whole grid.

    Parameters
    ----------
    preconditioner : callable
        A function of a real, symmetric `ToeplitzOperator`, and of other arguments.

    Returns
    -------
    callable
        The same function, that takes a `MaskedOperator` of one too, and a `ToeplitzSum` as
        `averaged` does, and refuses what is none of these, or not real and
        symmetric.

    See Also
    --------
    restricted_hermitian : for functions that take complex Hermitian matrices too.
    of_any_matrix : for functions that take all.

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> @restricted
    ... def nothing(A):
    ...     return tmg.ToeplitzOperator(np.eye(1, A.shape[0])[0])
    >>> A = tmg.ToeplitzOperator([2.0, 1.0, 0.5])
    >>> nothing(tmg.MaskedOperator(A, [True, False, True])).shape
    (2, 2)
    """
    return _restricted(preconditioner, check_symmetric)


def restricted_hermitian(preconditioner: F) -> F:
    """Return what `restricted` does, of a function that takes complex Hermitian matrices too."""
    return _restricted(preconditioner, check_hermitian)


def of_any_matrix(preconditioner: F) -> F:
    """Return the preconditioner of a mask and of components, whatever the matrix.

    Parameters
    ----------
    preconditioner : callable
        A function of a `ToeplitzOperator`, real or complex, symmetric or not, and of other
        arguments.

    Returns
    -------
    callable
        The same function, that takes a `MaskedOperator` of one too, and a `CoupledOperator`, whose
        components it treats each by itself.
    """
    return _of_each(_restricted(preconditioner, accept_any), accept_any)


def _restricted(preconditioner: F, check: Check) -> F:
    part = _itself if check is accept_any else hermitian_part

    @wraps(preconditioner)
    def of_mask(A: LinearOperator, *args: Any, **kwargs: Any) -> LinearOperator:
        full, mask = unwrap_toeplitz(A, check)
        return restrict(preconditioner(full, *args, **kwargs), mask)

    return averaged(cast(F, of_mask), part, any_library=True)


def componentwise(preconditioner: F) -> F:
    """Return the preconditioner that treats each component of a `CoupledOperator` by itself.

    Parameters
    ----------
    preconditioner : callable
        A function of a `ToeplitzOperator` or a `MaskedOperator` of one, such as
        `fft_preconditioner`. The others of this package take a `CoupledOperator` as they are.

    Returns
    -------
    callable
        The same function, that takes a `CoupledOperator` or a `MaskedOperator` of one too: the
        result is block diagonal. It is symmetric positive definite where its blocks are.

    Raises
    ------
    TypeError
        For what is no function, as a matrix is none.

    See Also
    --------
    CoupledOperator : the matrix of several components.
    default_preconditioner : chooses.

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


def _of_each(preconditioner: F, check: Check) -> F:
    @wraps(preconditioner)
    def of_each(A: LinearOperator, *args: Any, **kwargs: Any) -> LinearOperator:
        full, mask = unwrap(A)
        if not isinstance(full, CoupledOperator):
            return preconditioner(A, *args, **kwargs)
        check(full)
        blocks = []
        for block in components(full, mask):
            try:
                blocks.append(preconditioner(block, *args, **kwargs))
            except np.linalg.LinAlgError as error:
                error.add_note(
                    f"This was the matrix of a component, {block!r}: what is advised for it takes "
                    "all of them by componentwise, as in componentwise(chan_preconditioner)(A)"
                )
                raise
        return BlockDiagonal(blocks, full.grid_shape)

    return cast(F, of_each)
