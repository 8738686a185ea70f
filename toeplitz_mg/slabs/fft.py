"""The FFT preconditioner M on slabs: the symbol is inverted, and transformed back."""

from collections.abc import Sequence
from functools import partial
from math import prod
from typing import Any

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.engine.transforms import LONG
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.operators.positivity import require_positive
from toeplitz_mg.preconditioners.fft import BLOCK_SUBJECT, invert_matrices
from toeplitz_mg.slabs.coupled import CoupledOperator
from toeplitz_mg.slabs.operators import SlabOperator, ToeplitzOperator
from toeplitz_mg.slabs.structure import ROBUST, restricted
from toeplitz_mg.slabs.symbol import GridSymbol, LineSymbol, Parity

SUBJECT = "the embedding of A in a circulant, which M inverts, has the eigenvalue"


def _invert_coupled(A: CoupledOperator, dtype: np.dtype[Any]) -> CoupledOperator:
    """Return the leading block of the inverse of the block circulant that embeds `A`."""
    A.check_symmetric()
    lengths = [near_fast_length(2 * n - 1) for n in _grid_of(A)]
    blocks = _invert(A, dtype, _signs(A), lengths, BLOCK_SUBJECT)
    return CoupledOperator(blocks)


@partial(restricted, of_coupled=_invert_coupled)
def fft_preconditioner(A: ToeplitzOperator, dtype: np.dtype[Any]) -> SlabOperator:
    """Return M, the paper's FFT preconditioner (see `toeplitz_mg.fft_preconditioner`).

    Parameters
    ----------
    A : ToeplitzOperator or CoupledOperator of this package, or MaskedOperator of one
        Even along each axis; of coupled components symmetric, its blocks even or odd. Cosine and
        sine transforms treat each component by itself.
    dtype : float32 or float64, optional
        The precision in which it is kept and applied, that of `A` by default.

    Returns
    -------
    SlabOperator
        Of this rank's rows, symmetric positive definite, for `toeplitz_mg.cg`.

    Raises
    ------
    numpy.linalg.LinAlgError, ValueError, TypeError
        What `toeplitz_mg.fft_preconditioner` refuses on one machine, on all ranks.

    See Also
    --------
    toeplitz_mg.fft_preconditioner : on one machine.
    fsai_preconditioner : moves far fewer bytes.
    """
    lengths = [2 * n - 1 for n in _grid_of(A)]
    is_fast = all(near_fast_length(m) == m for m in lengths)
    if is_continued := not is_fast and prod(A.slab.shape) >= LONG:
        lengths = [2 * near_fast_length(n) for n in _grid_of(A)]
    ((M,),) = _invert(A, dtype, [A.parity], lengths, SUBJECT, is_continued)
    assert M is not None
    return M


def _grid_of(A: Any) -> tuple[int, ...]:
    """Return the shape of the whole grid, of a line without axes of one element."""
    shape: tuple[int, ...] = A.slab.shape
    return (prod(shape),) if A.slab.is_line else shape


def _invert(
    A: Any,
    dtype: np.dtype[Any],
    signs: Sequence[Parity],
    lengths: Sequence[int],
    subject: str,
    is_continued: bool = False,
) -> list[list[ToeplitzOperator | None]]:
    """Return blocks of the inverse of the circulant of these lengths that embeds `A`.

    Parameters
    ----------
    signs : sequence of tuple of {1, -1}
        Those of the components, by which the blocks are even or odd along each axis.
    """
    slab, components = A.slab, range(len(A.blocks))
    symbol = (LineSymbol if slab.is_line else GridSymbol)(slab, lengths)
    S: list[list[Any]] = [[0.0 for _ in components] for _ in components]
    for i in components:
        for j in range(i + 1):
            if (block := A.blocks[i][j]) is not None:
                count_transforms(1, *(2 * n for n in slab.local))
                c = block.c.astype(np.float64, copy=False)
                S[i][j] = symbol.sample(c, block.parity, is_continued=is_continued)
                S[j][i] = S[i][j].conj()
    extents: list[Array] = []
    with np.errstate(divide="ignore", invalid="ignore"):  # Refused when all pivots are known.
        invert_matrices(S, lambda pivot: extents.append(np.array(slab.extent(pivot))))
    for extent in extents:
        require_positive(extent, dtype, subject, ROBUST)
    blocks: list[list[ToeplitzOperator | None]] = [[None for _ in components] for _ in components]
    for i in components:
        for j in range(i + 1):
            if np.ndim(S[i][j]) == 0:
                continue  # The block is zero.
            count_transforms(1, *(2 * n for n in slab.local))
            parity = tuple(a * b for a, b in zip(signs[i], signs[j], strict=True))
            c = symbol.lags(S[i][j], parity).astype(dtype)
            S[i][j] = S[j][i] = 0.0  # It is of no more use, and large.
            for axis in (axis for axis, sign in enumerate(parity) if sign < 0):
                if axis or slab.rows.start == 0:
                    np.moveaxis(c, axis, 0)[0] = 0.0  # But for rounding it is.
            make = A.library.from_numpy
            blocks[i][j] = blocks[j][i] = ToeplitzOperator(make(c), slab, parity=parity)
            if prod(parity) < 0:
                blocks[j][i] = ToeplitzOperator(make(-c), slab, parity=parity)
    return blocks


def _signs(A: CoupledOperator) -> list[Parity]:
    """Return signs of the components, of which the products are the parities of the blocks.

    Then the blocks of the inverse have these parities.
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
                    f"the block ({i}, {j}) of A is {block!r} of parity {block.parity}, but for M "
                    "the blocks must be even or odd along each axis, as products of signs of "
                    "their components: use cosine_preconditioner(A) or fsai_preconditioner(A)"
                )
    return signs
