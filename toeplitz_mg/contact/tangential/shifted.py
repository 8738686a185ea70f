"""Approximate inverses of the matrix of steady rolling: a shifted symbol, inverted.

The symbol of the matrix, â(θ)(1 - e^{iθ₁}), has a real part that is not negative, but it is zero
for what is constant along the direction of rolling. With a positive real shift it is nowhere small.
"""

import numpy as np
from scipy import fft
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.operators import CoupledOperator, ToeplitzOperator


def shifted_inverse(K: LinearOperator, shift: float) -> LinearOperator:
    """Return the inverse of K + shift max|symbol|, of a circulant that embeds it, cut to the grid.

    Parameters
    ----------
    K : ToeplitzOperator or CoupledOperator
        The components of a coupled one are inverted each by itself.
    shift : float
        Relative to the largest eigenvalue.

    Returns
    -------
    ToeplitzOperator or CoupledOperator
    """
    if not isinstance(K, CoupledOperator):
        return _inverse(K, shift)
    # The coupling between components is weak: inverted too, it saves no iteration.
    inverses = [_inverse(K.component(i), shift) for i in range(len(K.blocks))]
    return CoupledOperator(
        [[M if i == j else None for j in range(len(inverses))] for i, M in enumerate(inverses)]
    )


def _inverse(K: ToeplitzOperator, shift: float) -> ToeplitzOperator:
    lengths = tuple(fft.next_fast_len(2 * n - 1, real=True) for n in K.grid_shape)
    count_transforms(2, *lengths)
    symbol = fft.rfftn(K.circulant(lengths))
    lags = fft.irfftn(1.0 / (symbol + shift * np.abs(symbol).max()), lengths)
    return ToeplitzOperator.from_lags(lags[np.ix_(*(np.arange(1 - n, n) for n in K.grid_shape))])
