"""The FFT preconditioner M of coupled components: the inverse of a matrix-valued symbol."""

from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy import fft

from toeplitz_mg.engine.transforms import near_fast_length
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.operators import CoupledOperator, ToeplitzOperator
from toeplitz_mg.operators.structure import check_symmetric
from toeplitz_mg.preconditioners.positivity import require_positive


def coupled_inverse(A: CoupledOperator, dtype: DTypeLike) -> CoupledOperator:
    """Return the leading block of the inverse of the block circulant that embeds `A`.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where that is not positive definite.
    ValueError
        Where A is not symmetric, or the block of a component on itself is zero.
    """
    check_symmetric(A)
    components, *grid = A.grid_shape
    for i in range(components):
        A.component(i)  # or it says that it is zero
    lengths = tuple(near_fast_length(2 * n - 1) for n in grid)
    symbol: list[list[Any]] = [[_symbol(block, lengths) for block in row] for row in A.blocks]
    _invert(symbol, np.result_type(A.dtype, dtype))
    inside = np.ix_(*(np.arange(1 - n, n) for n in grid))
    blocks: list[list[ToeplitzOperator | None]] = [[None] * components for _ in range(components)]
    for i in range(components):
        for j in range(i + 1):
            if np.ndim(symbol[i][j]) == 0:
                continue  # zero
            count_transforms(1, *lengths)
            lags = fft.irfftn(symbol[i][j], lengths)[inside]
            symbol[i][j] = symbol[j][i] = 0.0  # of no more use
            if i == j:
                lags = (lags + np.flip(lags)) / 2  # symmetric to the last bit
            lags = lags.astype(dtype)
            blocks[i][j] = ToeplitzOperator.from_lags(lags)
            if i != j:
                is_symmetric = np.array_equal(lags, np.flip(lags))
                blocks[j][i] = (
                    blocks[i][j] if is_symmetric else ToeplitzOperator.from_lags(np.flip(lags))
                )
    return CoupledOperator(blocks)


def _symbol(block: ToeplitzOperator | None, lengths: tuple[int, ...]) -> Any:
    """The eigenvalues of the circulant that embeds a block; 0 for none."""
    if block is None:
        return 0.0
    column = block.lags.astype(np.float64)
    for level, (n, length) in enumerate(zip(block.grid_shape, lengths, strict=True)):
        positive = np.take(column, np.arange(n - 1, 2 * n - 1), axis=level)
        negative = np.take(column, np.arange(n - 1), axis=level)
        # What is between the lags n - 1 and 1 - n goes straight from one to the other, so that an
        # odd block stays odd, as an even one even.
        ahead = length - (2 * n - 1)
        t = np.arange(1.0, ahead + 1.0) / (ahead + 1.0)
        t = t.reshape([-1 if k == level else 1 for k in range(column.ndim)])
        first = np.take(column, [-1], axis=level)
        between = first + t * (np.take(column, [0], axis=level) - first)
        column = np.concatenate([positive, between, negative], axis=level)
    count_transforms(1, *lengths)
    symbol = fft.rfftn(column)
    return symbol.real if block.is_symmetric else symbol


def _invert(S: list[list[Any]], dtype: Any) -> None:
    """Invert a Hermitian matrix at each frequency, in place, by Gauss and Jordan's elimination.

    It is positive definite where all pivots are positive.
    """
    for k in range(len(S)):
        pivot = S[k][k].real
        require_positive(
            pivot,
            dtype,
            "the embedding of A in a block circulant, which M inverts, has the pivot",
            "componentwise(chan_preconditioner)(A), which needs the components only",
        )
        others = [j for j in range(len(S)) if j != k and np.ndim(S[k][j]) > 0]  # not zero
        row = {j: S[k][j] / pivot for j in others}
        for i in others:
            factor = S[i][k]
            for j in others:
                S[i][j] = S[i][j] - factor * row[j]
            S[i][k] = -factor / pivot
        for j in others:
            S[k][j] = row[j]
        S[k][k] = 1.0 / pivot
