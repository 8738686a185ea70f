"""What a matrix is made of: a grid and a mask, components; and functions of the parts alone."""

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array, Mask
from toeplitz_mg.operators.block_diagonal import BlockDiagonal
from toeplitz_mg.operators.coupled import CoupledOperator
from toeplitz_mg.operators.diagonally_scaled import DiagonallyScaled
from toeplitz_mg.operators.masked import MaskedOperator
from toeplitz_mg.operators.toeplitz import ToeplitzOperator
from toeplitz_mg.operators.toeplitz_sum import ToeplitzSum

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
        advice = ""
        if isinstance(full, CoupledOperator):
            advice = (
                "; a preconditioner of each of its components gives componentwise, as in "
                "componentwise(multigrid)(A)"
            )
        elif isinstance(full, LinearOperator):
            advice = "; diagonal matrices in it are understood as scipy.sparse.diags_array(d)"
        raise TypeError(
            f"A is a {type(full).__name__}, but must be a ToeplitzOperator or a MaskedOperator "
            f"of one{advice}"
        )
    check_symmetric(full)
    return full, mask


def check_symmetric(A: ToeplitzOperator | CoupledOperator) -> None:
    """Raise a ValueError where a matrix is not symmetric."""
    if not A.is_symmetric:
        raise ValueError(
            f"A is {A!r}, but must be symmetric: for GMRES use its symmetric part, (A + A.T) / 2"
        )


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


def averaged(function: F) -> F:
    """Return the preconditioner that of a `ToeplitzSum` is that of the matrix of `average`.

    Parameters
    ----------
    function : callable
        A function of a symmetric `ToeplitzOperator` or a `MaskedOperator` of one.

    Returns
    -------
    callable
        The same function, that takes a `ToeplitzSum` or a `MaskedOperator` of one too. It is
        symmetric positive definite where that of the symmetric matrix is.

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
        if not isinstance(full, ToeplitzSum):
            return function(A, *args, **kwargs)
        mean, scale = average(full, mask)
        return DiagonallyScaled(function(restrict(mean, mask), *args, **kwargs), scale)

    return cast(F, of_average)


def average(A: ToeplitzSum, mask: Mask | None = None) -> tuple[ToeplitzOperator, Array]:
    """Return a symmetric Toeplitz matrix T and the entries of a diagonal one, D T⁻¹ D ≈ A⁻¹.

    D² is the inverse of the diagonal of A. In D A D, whose diagonal is all ones, each diagonal
    matrix is replaced by its mean, and each Toeplitz matrix by its symmetric part. For A + D with a
    D that is small against the diagonal of A this is A and the mean of D, for D A that of A between
    two diagonal matrices, and it goes from one to the other as the diagonal of the sum does.

    Parameters
    ----------
    A : ToeplitzSum
    mask : ndarray of bool, optional
        The unknowns, over which the means are taken.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where the diagonal is not positive.

    References
    ----------
    X. Huang, X.-L. Lin, M. K. Ng, H.-W. Sun, Spectral analysis for preconditioning of
    multi-dimensional Riesz fractional diffusion equations, Numer. Math. Theor. Meth. Appl. 15
    (2022). X.-L. Lin, X. Huang, M. K. Ng, H.-W. Sun, A τ-preconditioner for a non-symmetric linear
    system arising from multi-dimensional Riemann-Liouville fractional diffusion equation, Numer.
    Algorithms 92 (2023), for the symmetric part.
    """
    unknowns = slice(None) if mask is None else mask.ravel()
    diagonal = A.diagonal()[unknowns].astype(np.float64)
    if not diagonal.min() > 0.0:
        raise np.linalg.LinAlgError(
            f"the diagonal of A has the entry {diagonal.min():.3g}, but a preconditioner needs "
            "all positive: use GMRES without one"
        )
    mean: Any = 0
    for left, T, right in A.terms:
        weights = 1.0 / diagonal
        for factor in (left, right):
            weights = weights if factor is None else weights * factor[unknowns]
        mean = mean + weights.mean() * symmetric_part(T)
    if A.offset is not None:
        mean = mean.plus_unit(np.mean(A.offset[unknowns] / diagonal))
    return mean.astype(A.dtype), 1.0 / np.sqrt(diagonal)


def symmetric_part(A: Any) -> Any:
    """Return (A + Aᵀ)/2, A itself where it is symmetric."""
    return A if A.H is A else (A + A.H) / 2


def symmetrised(preconditioner: F) -> F:
    """Return the preconditioner that of a matrix that is not symmetric takes the symmetric part."""

    @wraps(preconditioner)
    def of_part(A: LinearOperator, *args: Any, **kwargs: Any) -> LinearOperator:
        if isinstance(unwrap(A)[0], ToeplitzOperator):
            A = symmetric_part(A)
        return preconditioner(A, *args, **kwargs)

    return cast(F, of_part)


def restricted(preconditioner: F) -> F:
    """Return the preconditioner that on a mask is the restriction of that of the whole grid.

    Parameters
    ----------
    preconditioner : callable
        A function of a symmetric `ToeplitzOperator`, and of other arguments.

    Returns
    -------
    callable
        The same function, that takes a `MaskedOperator` of one too, and a `ToeplitzSum` as
        `averaged` does, and refuses what is none of these, or not symmetric.

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

    @averaged
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
