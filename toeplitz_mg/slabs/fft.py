"""The FFT preconditioner M on slabs: invert the symbol and transform it back."""

from collections.abc import Sequence
from math import prod
from typing import Any, cast

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.operators.positivity import require_positive
from toeplitz_mg.preconditioners.fft import BLOCK_SUBJECT, SUBJECT, invert_blocks, is_continued
from toeplitz_mg.slabs.coupled import CoupledOperator
from toeplitz_mg.slabs.operators import SlabOperator, ToeplitzOperator
from toeplitz_mg.slabs.structure import ROBUST, restricted
from toeplitz_mg.slabs.symbol import GridSymbol, LineSymbol, Parity


def _invert_coupled(A: CoupledOperator, dtype: np.dtype[Any]) -> CoupledOperator:
    """Return the leading block of the inverse of the block circulant that embeds `A`."""
    lengths = [near_fast_length(2 * n - 1) for n in _grid_of(A)]
    blocks = _invert(A, dtype, _signs(A), lengths, BLOCK_SUBJECT)
    return CoupledOperator(blocks)


def _invert_toeplitz(A: ToeplitzOperator, dtype: np.dtype[Any]) -> SlabOperator:
    """Return M for one component: the inverse of a circulant, cut to the grid."""
    grid = _grid_of(A)
    is_longer = is_continued(grid)
    lengths = [2 * near_fast_length(n) if is_longer else 2 * n - 1 for n in grid]
    ((M,),) = _invert(A, dtype, [A.parity], lengths, SUBJECT, is_longer)
    return cast(SlabOperator, M)


def _grid_of(A: Any) -> tuple[int, ...]:
    """Return the shape of the whole grid, for a line without axes of one element."""
    shape: tuple[int, ...] = A.slab.shape
    return (prod(shape),) if A.slab.is_line else shape


def _invert(
    A: Any,
    dtype: np.dtype[Any],
    signs: Sequence[Parity],
    lengths: Sequence[int],
    subject: str,
    is_longer: bool = False,
) -> list[list[Any]]:
    """Return blocks of the inverse of the circulant with these lengths that embeds `A`.

    Parameters
    ----------
    signs : sequence of tuple of {1, -1}
        The signs of the components; their products are the parities of the blocks.
    """
    slab = A.slab
    symbols = (LineSymbol if slab.is_line else GridSymbol)(slab, lengths)

    def sample(block: ToeplitzOperator) -> Array:
        c = block.c.astype(np.float64, copy=False)
        return symbols.sample(c, block.parity, is_continued=is_longer)

    def parity_of(i: int, j: int) -> Parity:
        return tuple(a * b for a, b in zip(signs[i], signs[j], strict=True))

    def find_lags(symbol: Array, i: int, j: int) -> Array:
        parity = parity_of(i, j)
        c = symbols.lags(symbol, parity).astype(dtype)
        for axis in (axis for axis, sign in enumerate(parity) if sign < 0):
            if axis or slab.rows.start == 0:
                np.moveaxis(c, axis, 0)[0] = 0.0  # Remove the rounding error.
        return c

    def make(c: Array, i: int, j: int) -> tuple[ToeplitzOperator, ToeplitzOperator]:
        parity = parity_of(i, j)
        block = ToeplitzOperator(A.library.from_numpy(c), slab, parity=parity)
        if prod(parity) > 0:
            return block, block
        return block, ToeplitzOperator(A.library.from_numpy(-c), slab, parity=parity)

    def check(pivot: Array) -> None:
        require_positive(np.array(slab.extent(pivot)), dtype, subject, ROBUST)

    return invert_blocks(A.blocks, sample, check, find_lags, make, [2 * n for n in slab.local])


def _signs(A: CoupledOperator) -> list[Parity]:
    """Return signs of the components whose products are the parities of the blocks.

    The blocks of the inverse have the same parities.
    """
    axes = len(A.slab.shape)
    signs: list[Parity] = [(1,) * axes for _ in A.blocks]
    for i, row in enumerate(A.blocks):
        known = next(((block, signs[j]) for j, block in enumerate(row[:i]) if block), None)
        if known is not None:
            signs[i] = tuple(a * b for a, b in zip(known[0].parity, known[1], strict=True))
    for i, row in enumerate(A.blocks):
        for j, block in enumerate(row):
            parity = tuple(a * b for a, b in zip(signs[i], signs[j], strict=True))
            if block is not None and (block.behind is not None or block.parity != parity):
                raise ValueError(
                    f"the block ({i}, {j}) of A is {block!r} of parity {block.parity}, but "
                    "must be even or odd along each axis, as the product of signs of its two "
                    "components: use cosine_preconditioner(A) or fsai_preconditioner(A)"
                )
    return signs


fft_preconditioner = restricted("fft_preconditioner", _invert_toeplitz, _invert_coupled)
