"""Products, Cholesky factors and inverses of small matrices, without the threads of BLAS.

Those of OpenBLAS, once awake, wait for more to do on cores that our own threads need: for a tenth
of a second, by default, after a factorisation that takes a thousandth. A library cannot change how
many it has, and it takes one where there is little to do.
"""

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtri

from toeplitz_mg._typing import Array

BLOCK = 64  # Rows of the blocks of a matrix.
MOST = BLOCK**3  # Multiplications in a product up to which OpenBLAS takes one thread.


def multiply(A: Array, X: Array) -> Array:
    """Return the product A X of a small matrix with one that may have many columns."""
    product = np.empty((len(A), X.shape[1]))
    width = max(1, MOST // A.size)
    for k in range(0, X.shape[1], width):
        np.matmul(A, X[:, k : k + width], out=product[:, k : k + width])
    return product


def factorise(A: Array) -> Array:
    """Return the Cholesky factor U of a symmetric matrix A = Uᵀ U, an upper triangle.

    It raises a LinAlgError where the matrix is not positive definite.
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
    """Return the inverse of a symmetric positive definite matrix of at most `BLOCK` rows.

    It raises a LinAlgError where the matrix is not positive definite.
    """
    factor, fails = dpotrf(A)
    # Of `dpotri` OpenBLAS makes threads.
    inverse, singular = dtrtri(factor, overwrite_c=True)
    if fails or singular:
        raise np.linalg.LinAlgError("the matrix is not positive definite")
    return inverse @ inverse.T
