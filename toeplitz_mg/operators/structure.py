"""What a matrix is made of: a grid and a mask, components; and functions of the parts alone."""

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Mask
from toeplitz_mg.operators.block_diagonal import BlockDiagonal
from toeplitz_mg.operators.coupled import CoupledOperator
from toeplitz_mg.operators.masked import MaskedOperator
from toeplitz_mg.operators.toeplitz import ToeplitzOperator

F = TypeVar("F", bound=Callable[..., LinearOperator])


def unwrap(A: LinearOperator) -> tuple[LinearOperator, Mask | None]:
    """Return the operator on the whole grid, and the mask, or None where there is none."""
    return (A.full, A.mask) if isinstance(A, MaskedOperator) else (A, None)


def restrict(A: LinearOperator, mask: Mask | None) -> LinearOperator:
    """Return an operator on a mask, or as it is where there is none."""
    return A if mask is None else MaskedOperator(A, mask.reshape(A.grid_shape))


def unwrap_toeplitz(A: LinearOperator) -> tuple[ToeplitzOperator, Mask | None]:
    """Return the symmetric Toeplitz matrix on the whole grid, and the mask, or None.

    Raises
    ------
    TypeError
        Where `A` is neither a `ToeplitzOperator` nor a `MaskedOperator` of one.
    ValueError
        Where it is not symmetric.
    """
    full, mask = unwrap(A)
    if not isinstance(full, ToeplitzOperator):
        advice = (
            "; a preconditioner of each of its components gives componentwise, as in "
            "componentwise(multigrid)(A)"
        )
        raise TypeError(
            f"A is a {type(full).__name__}, but must be a ToeplitzOperator or a MaskedOperator "
            f"of one{advice if isinstance(full, CoupledOperator) else ''}"
        )
    check_symmetric(full)
    return full, mask


def check_symmetric(A: ToeplitzOperator | CoupledOperator) -> None:
    """Raise a ValueError where a matrix is not symmetric."""
    if not A.is_symmetric:
        raise ValueError(f"A is {A!r}, but must be symmetric")


def squeeze_line(A: ToeplitzOperator) -> ToeplitzOperator:
    """Return the matrix on the one axis of its grid that has more than one element.

    Raises
    ------
    ValueError
        Where there are several.
    """
    line = A.squeezed
    if len(line.grid_shape) != 1:
        raise ValueError(
            f"A lives on the grid {A.grid_shape}, but must have one axis (with more than one "
            "element)"
        )
    return line


def restricted(preconditioner: F) -> F:
    """Return the preconditioner that on a mask is the restriction of that of the whole grid.

    Parameters
    ----------
    preconditioner : callable
        A function of a symmetric `ToeplitzOperator`, and of other arguments.

    Returns
    -------
    callable
        The same function, that takes a `MaskedOperator` of one too, and refuses what is neither,
        or not symmetric.

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

    @wraps(preconditioner)
    def of_mask(A: LinearOperator, *args: Any, **kwargs: Any) -> LinearOperator:
        full, mask = unwrap_toeplitz(A)
        return restrict(preconditioner(full, *args, **kwargs), mask)

    return cast(F, of_mask)


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

    @wraps(preconditioner)
    def of_each(A: LinearOperator, *args: Any, **kwargs: Any) -> LinearOperator:
        full, mask = unwrap(A)
        if not isinstance(full, CoupledOperator):
            return preconditioner(A, *args, **kwargs)
        blocks = [preconditioner(block, *args, **kwargs) for block in components(full, mask)]
        return BlockDiagonal(blocks, full.grid_shape)

    return cast(F, of_each)


def components(full: CoupledOperator, mask: Mask | None) -> list[LinearOperator]:
    """Return the matrix of each component that has unknowns, on its part of the mask.

    Raises
    ------
    ValueError
        Where the matrix is not symmetric, or a component has no influence on itself.
    """
    check_symmetric(full)
    parts = [None] * len(full.blocks) if mask is None else mask
    return [
        restrict(full.component(i), part)
        for i, part in enumerate(parts)
        if part is None or part.any()
    ]
