"""The inverse of a symmetric Toeplitz matrix, from its first column."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from toeplitz_mg.operators.convolution import GohbergSemenculProduct
from toeplitz_mg.operators.rows import RowsOperator
from toeplitz_mg.values import unmasked

Array = NDArray[Any]


class GohbergSemencul(RowsOperator):
    """The inverse of the symmetric Toeplitz matrix A, given x = A⁻¹ e₁.

    With J the reversal, A⁻¹ v = (Re z + J Im z)/(2 x₀) where z = C Sᵀ (v + i J v), C and S the
    circulant and the skew-circulant with the first column x. A product costs four complex
    transforms of length n, two work units; of a slightly longer one where n has a large prime
    factor, and so slow transforms.

    Parameters
    ----------
    x : ndarray of shape (n,), real
        First column of the inverse; x[0] must be positive.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where x[0] is not positive: no positive definite matrix has such an inverse.

    References
    ----------
    I. Gohberg, A. Semencul, On the inversion of finite Toeplitz matrices and their continuous
    analogs, Mat. Issled. 7 (1972); in circulants G. Ammar, P. Gader, A variant of the
    Gohberg-Semencul formula involving circulant matrices, SIAM J. Matrix Anal. Appl. 12 (1991).
    """

    def __init__(self, x: Array) -> None:
        x = unmasked("x", x)
        super().__init__(x.dtype, (len(x), len(x)))
        self.grid_shape = (len(x),)
        if not x[0] > 0.0:
            raise np.linalg.LinAlgError(
                f"the first entry of the inverse is {x[0]:.3g}, but of a positive definite matrix "
                "it is positive"
            )
        self.x = x.copy()
        self.x.flags.writeable = False
        # In the precision of float64 at first: 2 x₀ may over- or underflow a float32.
        column = x.astype(np.float64) / np.sqrt(2.0 * float(x[0]))
        self._product = GohbergSemenculProduct(column, self.dtype)

    def _apply(self, V: Array, out: Array | None = None) -> Array:
        return self._product(V, out)

    def _adjoint(self) -> "GohbergSemencul":
        return self

    def _transpose(self) -> "GohbergSemencul":
        return self

    def __repr__(self) -> str:
        return f"<GohbergSemencul {self.shape[0]}, {self.dtype}>"
