"""Approximate inverses with eigenvalues of both signs, for GMRES with an indefinite matrix."""

import numpy as np

from toeplitz_mg.engine.lengths import near_fast_length
from toeplitz_mg.engine.products import COSINE, DiagonalisedProduct
from toeplitz_mg.operators import DiagonalisedOperator, ToeplitzOperator
from toeplitz_mg.preconditioners.positivity import require_nonzero
from toeplitz_mg.preconditioners.symbol import sample_symbol


def signed_cosine_inverse(A: ToeplitzOperator) -> DiagonalisedOperator:
    """Return the inverse of the DCT-II matrix whose eigenvalues are samples of the symbol of A.

    It is `cosine_preconditioner` for a matrix that is not positive definite, with the signs that
    the samples have. So it is none for conjugate gradients.

    Parameters
    ----------
    A : ToeplitzOperator
        Real and symmetric, of any number of axes.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where a sample is zero.

    Examples
    --------
    >>> import toeplitz_mg as tmg
    >>> A = tmg.ToeplitzOperator(np.r_[1.0, -1.0, np.zeros(998)])  # The symbol is 1 - 2 cos θ.
    >>> x, info = tmg.gmres(A, np.ones(1000), M=signed_cosine_inverse(A), rtol=1e-8)
    >>> info
    0
    """
    samples = sample_symbol(A, tuple(near_fast_length(n) for n in A.grid_shape))
    shape = tuple(m - 1 for m in samples.shape)
    samples = samples[tuple(slice(m) for m in shape)]
    subject = "the symbol of A, which the cosine preconditioner samples, has the value"
    require_nonzero(samples, np.dtype(np.float64), subject, "gmres without M")
    product = DiagonalisedProduct(1.0 / samples, shape, A.grid_shape, A.dtype, COSINE)
    return DiagonalisedOperator(product, "cosine transform")
