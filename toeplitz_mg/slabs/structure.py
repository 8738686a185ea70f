"""Preconditioners on slabs for masks and coupled components (see `operators.lifting`)."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg import operators, preconditioners
from toeplitz_mg.operators.positivity import precision
from toeplitz_mg.slabs.coupled import CoupledOperator
from toeplitz_mg.slabs.operators import MaskedOperator, SlabOperator, ToeplitzOperator

Make = Callable[[ToeplitzOperator, np.dtype[Any]], SlabOperator]
ROBUST = "fsai_preconditioner(A), or cg without M"
DOC = """{summary}, on slabs (see `toeplitz_mg.{name}`).

Parameters
----------
A : ToeplitzOperator or CoupledOperator of this package, or MaskedOperator of one
    Even along each axis. Components must be coupled symmetrically. M requires blocks that are
    even or odd along each axis; cosine and sine transforms treat each component separately.
dtype : float32 or float64, optional
    Precision in which it is stored and applied; by default that of `A`.

Returns
-------
SlabOperator
    This rank's rows of a symmetric positive definite operator, for `toeplitz_mg.cg`. Cosine and
    sine transforms move half as many bytes as M.

Raises
------
numpy.linalg.LinAlgError, ValueError, TypeError
    On all ranks, as for `toeplitz_mg.{name}`.

See Also
--------
toeplitz_mg.{name} : the function for one process.
fsai_preconditioner : moves far fewer bytes.
"""


def unwrap(A: Any) -> Any:
    """Return the operator on the whole grid; raise an error if it is not one on slabs."""
    full = A.full if isinstance(A, MaskedOperator) else A
    if not isinstance(full, ToeplitzOperator | CoupledOperator):
        raise TypeError(
            f"A is of type {type(full).__name__}, but must be a ToeplitzOperator or a "
            "CoupledOperator of toeplitz_mg.slabs, or a MaskedOperator of one"
        )
    return full


def restricted(name: str, make: Make, of_coupled: Any = None) -> Callable[..., SlabOperator]:
    """Return a preconditioner function that also accepts masks and components.

    Parameters
    ----------
    name : str
        The name of the function for one process.
    make : callable
        A function of an even `ToeplitzOperator` and of the precision of the result. On a mask its
        result for the whole grid is restricted; coupled components are treated separately.
    of_coupled : callable, optional
        A function of a `CoupledOperator` that treats its components together instead.
    """
    serial = getattr(preconditioners, name)

    def of_block(A: ToeplitzOperator | None, dtype: DTypeLike | None) -> SlabOperator:
        if A is None or not A.is_even:
            raise ValueError(f"A, or a component's block on itself, is {A!r}, but must be even")
        dtype = precision(A, dtype)
        if not (A.slab.is_line and A.slab.comm.size == 1):
            return make(A, dtype)
        M = SlabOperator(A.slab, dtype, A.slab.local, library=A.library)
        M.product = serial(A.product, dtype=dtype)
        return M

    def preconditioner(A: SlabOperator, *, dtype: DTypeLike | None = None) -> SlabOperator:
        full = unwrap(A)
        with full.slab.agree() as same:
            same["the preconditioner"], same["A"] = name, A.kind
        M: SlabOperator
        if isinstance(full, ToeplitzOperator):
            M = of_block(full, dtype)
        else:
            full.check_symmetric()
            if of_coupled is not None:
                M = of_coupled(full, precision(full, dtype))
            else:
                M = BlockDiagonal([of_block(row[i], dtype) for i, row in enumerate(full.blocks)])
        M.made_by = name
        return MaskedOperator(M, A.mask) if isinstance(A, MaskedOperator) else M

    summary = (serial.__doc__ or "").split("\n")[0].split(",")[0].split(" whose")[0].rstrip(".")
    preconditioner.__doc__ = DOC.format(summary=summary, name=name)
    preconditioner.__name__ = preconditioner.__qualname__ = name
    preconditioner.__module__ = "toeplitz_mg.slabs"
    return preconditioner


class BlockDiagonal(SlabOperator):
    """Matrices that each act on one component of a field."""

    def __init__(self, blocks: list[SlabOperator]) -> None:
        slab, dtype = blocks[0].slab, np.result_type(*(block.dtype for block in blocks))
        super().__init__(slab, dtype, (len(blocks), *slab.local), library=blocks[0].library)
        self.blocks = blocks

    apply = operators.BlockDiagonal.apply
