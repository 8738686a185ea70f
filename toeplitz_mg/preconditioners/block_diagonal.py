"""Preconditioners of coupled components: one for each component, and none for the coupling."""

from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any, TypeVar, cast

import numpy as np
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array
from toeplitz_mg.operators import CoupledOperator, GridOperator, MaskedOperator, apply_to_rows
from toeplitz_mg.operators.base import work_of

F = TypeVar("F", bound=Callable[..., LinearOperator])


class BlockDiagonal(GridOperator):
    """Operators on consecutive parts of a vector.

    Parameters
    ----------
    blocks : sequence of LinearOperator
        Square.
    grid_shape : tuple of int
        That of the whole grid, also where the blocks are those of a part of it.
    """

    def __init__(self, blocks: Sequence[LinearOperator], grid_shape: tuple[int, ...]) -> None:
        size = sum(block.shape[0] for block in blocks)
        # Each block works on the grid of one component.
        work = sum(map(work_of, blocks)) / grid_shape[0]
        super().__init__(np.result_type(*(block.dtype for block in blocks)), grid_shape, work, size)
        self.blocks = tuple(blocks)

    def apply(self, X: Array, out: Array | None = None) -> Array:
        """As `GridOperator.apply`."""
        if out is None:
            out = np.empty(X.shape, np.result_type(X, self.dtype))
        start = 0
        for block in self.blocks:
            part = (..., slice(start, start + block.shape[0]))
            out[part] = apply_to_rows(block, np.ascontiguousarray(X[part]))
            start += block.shape[0]
        return out

    def _adjoint(self) -> "BlockDiagonal":
        blocks = [block.H for block in self.blocks]
        unchanged = all(a is b for a, b in zip(blocks, self.blocks, strict=True))
        return self if unchanged else BlockDiagonal(blocks, self.grid_shape)

    def __repr__(self) -> str:
        return f"<BlockDiagonal of {', '.join(map(repr, self.blocks))}>"


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
        full, mask = (A.full, A.mask) if isinstance(A, MaskedOperator) else (A, None)
        if not isinstance(full, CoupledOperator):
            return preconditioner(A, *args, **kwargs)
        if not full.is_symmetric:
            raise ValueError(f"A is {full!r}, but must be symmetric")
        components = []
        for i in range(len(full.blocks)):
            component: LinearOperator = full.component(i)
            if mask is not None:
                if not mask[i].any():
                    continue
                component = MaskedOperator(component, mask[i])
            components.append(preconditioner(component, *args, **kwargs))
        return BlockDiagonal(components, full.grid_shape)

    return cast(F, of_each)
