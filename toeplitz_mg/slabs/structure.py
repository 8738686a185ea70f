"""Masks and components on slabs: preconditioners of the parts alone (see `operators.lifting`)."""

from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from toeplitz_mg import operators, preconditioners
from toeplitz_mg.operators.positivity import precision
from toeplitz_mg.slabs.coupled import CoupledOperator
from toeplitz_mg.slabs.operators import MaskedOperator, SlabOperator, ToeplitzOperator

Make = Callable[[ToeplitzOperator, np.dtype[Any]], SlabOperator]
NAMES = "__module__", "__name__", "__qualname__"
ROBUST = "fsai_preconditioner(A), or cg without M"


def unwrap(A: Any) -> Any:
    """Return the operator on the whole grid, or say that it is none of slabs."""
    full = A.full if isinstance(A, MaskedOperator) else A
    if not isinstance(full, ToeplitzOperator | CoupledOperator):
        raise TypeError(
            f"A is a {type(full).__name__}, but must be a ToeplitzOperator or a CoupledOperator of "
            "toeplitz_mg.slabs, or a MaskedOperator of one"
        )
    return full


def restricted(make: Make, of_coupled: Any = None) -> Callable[..., SlabOperator]:
    """Return the preconditioner that takes masks and components too.

    Parameters
    ----------
    make : callable
        A function of an even `ToeplitzOperator` and of the precision of the result. On a mask the
        preconditioner is the restriction of that of the whole grid; of coupled components it
        treats each by itself.
    of_coupled : callable, optional
        The function of a `CoupledOperator` in the place of that.
    """

    @wraps(make, (*NAMES, "__doc__"))
    def preconditioner(A: SlabOperator, *, dtype: DTypeLike | None = None) -> SlabOperator:
        full = unwrap(A)
        with full.slab.agree() as same:
            same["the preconditioner"], same["A"] = make.__name__, A.kind
        if isinstance(full, CoupledOperator):
            full.check_symmetric()
        M: SlabOperator
        if of_coupled is not None and isinstance(full, CoupledOperator):
            M = of_coupled(full, precision(full, dtype))
        else:
            parts = [_make(make, row[i], dtype) for i, row in enumerate(full.blocks)]
            M = BlockDiagonal(parts) if isinstance(full, CoupledOperator) else parts[0]
        M.made_by = make.__name__
        return MaskedOperator(M, A.mask) if isinstance(A, MaskedOperator) else M

    del preconditioner.__wrapped__  # Its signature is another one.
    return preconditioner


def _make(make: Make, A: ToeplitzOperator | None, dtype: DTypeLike | None) -> SlabOperator:
    if A is None or not A.is_even:
        raise ValueError(f"A, or a component's block on itself, is {A!r}, but must be even")
    dtype = precision(A, dtype)
    if not (A.slab.is_line and A.slab.comm.size == 1):
        return make(A, dtype)
    M = SlabOperator(A.slab, dtype, A.slab.local, library=A.library)
    M.product = getattr(preconditioners, make.__name__)(A.product, dtype=dtype)
    return M


class BlockDiagonal(SlabOperator):
    """Matrices of the components of a field, each of which acts on its own component."""

    def __init__(self, blocks: list[SlabOperator]) -> None:
        slab, dtype = blocks[0].slab, np.result_type(*(block.dtype for block in blocks))
        super().__init__(slab, dtype, (len(blocks), *slab.local), library=blocks[0].library)
        self.blocks = blocks

    apply = operators.BlockDiagonal.apply
