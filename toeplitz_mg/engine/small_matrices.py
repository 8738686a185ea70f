"""Products, Cholesky factors and inverses of small matrices, without the threads of BLAS.

After a call the threads of OpenBLAS spin on their cores, by default for a tenth of a second, even
if the call took a millisecond. They then slow down the threads of this package. A library should
not change their number for its users; but OpenBLAS takes one thread if a call is small.
"""

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtri

from toeplitz_mg._typing import Array

BLOCK = 64  # Rows and columns of a block of the matrix in `factorise`.
MOST = BLOCK**3  # Most multiplications in a matrix product that OpenBLAS does on one thread.


def multiply(A: Array, X: Array) -> Array:
    """Return A X for a small matrix A and an X that may have many columns."""
    product = np.empty((len(A), X.shape[1]))
    width = max(1, MOST // A.size)
    for k in range(0, X.shape[1], width):
        np.matmul(A, X[:, k : k + width], out=product[:, k : k + width])
    return product


def factorise(A: Array) -> Array:
    """Return the upper Cholesky factor U of a symmetric matrix A = Uᵀ U.

    It raises a LinAlgError if the matrix is not positive definite.
    """
    U = np.triu(A)
    starts = range(0, len(A), BLOCK)
    for m, start in enumerate(starts):
        rows, *rest = (slice(k, k + BLOCK) for k in starts[m:])
        U[rows, rows], fails = dpotrf(U[rows, rows])
        if fails:
            raise np.linalg.LinAlgError(f"the pivot {start + fails - 1} is not positive")
        inverse, _ = dtrtri(U[rows, rows])
        for k, columns in enumerate(rest):
            U[rows, columns] = inverse.T @ U[rows, columns]
            for above in rest[: k + 1]:
                U[above, columns] -= U[rows, above].T @ U[rows, columns]
    return U


def invert(A: Array) -> Array:
    """Return the inverse of a symmetric positive definite matrix with at most `BLOCK` rows.

    It raises a LinAlgError if the matrix is not positive definite.
    """
    factor, fails = dpotrf(A)
    # `dpotri` would start threads of OpenBLAS.
    inverse, singular = dtrtri(factor, overwrite_c=True)
    if fails or singular:
        raise np.linalg.LinAlgError("the matrix is not positive definite")
    return inverse @ inverse.T
