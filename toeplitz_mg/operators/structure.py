"""What a matrix is made of: a grid and a mask, components; and which of these a function takes."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, cast

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Mask
from toeplitz_mg.operators.base import require_serial
from toeplitz_mg.operators.coupled import CoupledOperator
from toeplitz_mg.operators.masked import MaskedOperator
from toeplitz_mg.operators.sums import ToeplitzSum
from toeplitz_mg.operators.toeplitz import ToeplitzOperator

Check = Callable[[ToeplitzOperator | CoupledOperator], None]


def unwrap(A: LinearOperator) -> tuple[LinearOperator, Mask | None]:
    """Return the operator on the whole grid, and the mask, or None where there is none."""
    return (A.full, A.mask) if isinstance(A, MaskedOperator) else (A, None)


def restrict(A: LinearOperator, mask: Mask | None) -> LinearOperator:
    """Return an operator on a mask, or as it is where there is none."""
    return A if mask is None else MaskedOperator(A, mask.reshape(A.grid_shape))


def components(full: CoupledOperator, mask: Mask | None) -> list[LinearOperator]:
    """Return the matrix of each component that has unknowns, on its part of the mask.

    Raises
    ------
    ValueError
        Where a component has no influence on itself.
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


def check_hermitian(A: ToeplitzOperator | CoupledOperator) -> None:
    """Raise a ValueError where a matrix is neither real and symmetric nor complex and Hermitian."""
    if not A.is_hermitian:
        rule = "Hermitian" if A.dtype.kind == "c" else "symmetric"
        difference = ""
        if isinstance(A, ToeplitzOperator):
            mirror = "the conjugate of a[-k]" if A.dtype.kind == "c" else "a[-k]"
            difference = (
                f"; a[k] and {mirror} differ by up to {A.coefficients.asymmetry:.2g} of the "
                "largest coefficient: where that is rounding, average them"
            )
        raise ValueError(
            f"A is {A!r}, but must be {rule}: use chan_preconditioner(A), which takes any Toeplitz "
            f"matrix, with gmres{difference}"
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

    Parameters
    ----------
    A : LinearOperator
    check : callable
        Raises a ValueError for a matrix of another kind than is wanted; `check_symmetric`,
        `check_hermitian` or `accept_any`.

    Raises
    ------
    TypeError
        Where `A` is neither a `ToeplitzOperator` nor a `MaskedOperator` of one.
    ValueError
        Where `check` does.
    """
    full, mask = unwrap(A)
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
            "element): use chan_preconditioner(A), which takes any number"
        )
    return line
