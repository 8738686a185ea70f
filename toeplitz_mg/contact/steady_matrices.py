"""The matrix of steady rolling, and an approximate inverse of it."""

from typing import Any

import numpy as np
from scipy import fft
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.operators import CoupledOperator, ToeplitzOperator


def subtract_operators(A: Any, S: Any) -> Any:
    """Return A - S, of Toeplitz operators or coupled ones; None is zero, as in their blocks."""
    if S is None:
        return A
    if isinstance(S, CoupledOperator):
        pairs = (zip(*rows, strict=True) for rows in zip(A.blocks, S.blocks, strict=True))
        return CoupledOperator([[subtract_operators(a, s) for a, s in row] for row in pairs])
    # On a single row of elements S couples the components, and A does not.
    return ToeplitzOperator.from_lags(-S.lags if A is None else A.lags - S.lags)


def invert_shifted(K: LinearOperator, shift: float) -> LinearOperator:
    """Return the inverse of K + shift max|symbol|, of a circulant that embeds it, cut to the grid.

    Parameters
    ----------
    K : ToeplitzOperator or CoupledOperator
        The matrix of steady rolling. The components of a coupled one are inverted each by itself.
    shift : float
        The shift of the symbol, relative to its largest value.

    Returns
    -------
    ToeplitzOperator or CoupledOperator
    """
    if not isinstance(K, CoupledOperator):
        return _invert(K, shift)
    # The coupling between components is weak: inverted too, it saves no iteration.
    inverses = [_invert(K.component(i), shift) for i in range(len(K.blocks))]
    return CoupledOperator(
        [[M if i == j else None for j in range(len(inverses))] for i, M in enumerate(inverses)]
    )


def _invert(K: ToeplitzOperator, shift: float) -> ToeplitzOperator:
    lengths = tuple(fft.next_fast_len(2 * n - 1, real=True) for n in K.grid_shape)
    count_transforms(2, *lengths)
    symbol = fft.rfftn(K.circulant(lengths))
    kernel = fft.irfftn(1.0 / (symbol + shift * np.abs(symbol).max()), lengths)
    return ToeplitzOperator.from_lags(kernel[np.ix_(*(np.arange(1 - n, n) for n in K.grid_shape))])
