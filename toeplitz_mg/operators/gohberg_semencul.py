"""The inverse of a Toeplitz matrix, from its first column and its first row."""

from dataclasses import dataclass
from math import pi, tan

import numpy as np

from toeplitz_mg._typing import Array
from toeplitz_mg.engine.circle import Circle, circle_of
from toeplitz_mg.engine.gohberg_semencul import GohbergSemenculProduct
from toeplitz_mg.operators.base import GridOperator
from toeplitz_mg.values import refuse_masked

OVERSAMPLING = 4  # Samples for each coefficient: the phase may turn 3π/4 between two.


class GohbergSemencul(GridOperator):
    """The inverse of a Toeplitz matrix A, given its first column and its first row.

    A product costs two work units; somewhat more where n has a large prime factor, and so slow
    transforms.

    Parameters
    ----------
    x : ndarray of shape (n,), real or complex
        First column of the inverse, A⁻¹ e₁, whose first entry must not be zero.
    y : ndarray of shape (n,), optional
        First row of the inverse, A⁻ᵀ e₁; its first entry is ignored, as it is x[0]. Without it the
        inverse is that of a symmetric positive definite matrix, or of a Hermitian one: its row is
        x̄, and x[0] must be positive.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where x[0] is zero, or, without `y`, not positive: no such matrix has this inverse.
    ValueError
        Where `x` and `y` have different lengths.

    References
    ----------
    I. Gohberg, A. Semencul, On the inversion of finite Toeplitz matrices and their continuous
    analogs, Mat. Issled. 7 (1972); in circulants see `toeplitz_mg.engine.gohberg_semencul`.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.linalg import toeplitz
    >>> A = toeplitz([2.0, 1.0, 0.0], [2.0, -1.0, 3.0])
    >>> inverse = np.linalg.inv(A)
    >>> G = GohbergSemencul(inverse[:, 0], inverse[0])
    >>> bool(np.allclose(G @ np.eye(3), inverse))
    True
    """

    def __init__(
        self, x: Array, y: Array | None = None, *, product: GohbergSemenculProduct | None = None
    ) -> None:
        x = refuse_masked("x", x)
        self.is_hermitian = y is None
        if y is None:
            if not (x[0].real > 0.0 and x[0].imag == 0.0):
                raise np.linalg.LinAlgError(
                    f"the first entry of the inverse is {x[0]:.3g}, but of a positive definite "
                    "matrix it is positive"
                )
            y = x.conj() if x.dtype.kind == "c" else x
        y = refuse_masked("y", y)
        if y.shape != x.shape:
            raise ValueError(f"x has shape {x.shape} and y has {y.shape}, but must have the same")
        if x[0] == 0.0:
            raise np.linalg.LinAlgError(
                "the first entry of the inverse is 0, but the formula divides by it: A without its "
                "last row and column is singular; solve_toeplitz((c, r), b) needs no inverse"
            )
        dtype = np.result_type(x, y)
        self.x = x.astype(dtype)
        self.y = self.x if y is x else y.astype(dtype)
        self.y[0] = self.x[0]
        self.x.flags.writeable = self.y.flags.writeable = False
        if product is None:
            column, row = (a.astype(np.result_type(dtype, np.float64)) for a in (self.x, self.y))
            product = GohbergSemenculProduct.of(column, None if self.is_hermitian else row, dtype)
        self._product = product
        super().__init__(dtype, product.grid_shape, product.points / len(x))

    def apply(self, V: Array, out: Array | None = None) -> Array:
        """Multiply each row of `V` (see `GridOperator.apply`)."""
        return self._product(V, out)

    def _adjoint(self) -> "GohbergSemencul":
        if self.is_hermitian:
            return self
        return GohbergSemencul(self.y.conj(), self.x.conj(), product=self._product.adjoint())

    def __repr__(self) -> str:
        return f"<GohbergSemencul {self.shape[0]}, {self.dtype}>"


@dataclass(frozen=True)
class Certificate:
    """What the polynomial x(z) = Σ xₖ zᵏ on the unit circle says of the formula from the column x.

    The formula is the Schur-Cohn form of that polynomial: positive definite exactly if x(z) has
    no zero in the closed unit disc. Then it is a leading block of the inverse of a matrix whose
    symbol is x₀/|x|², and its condition is at most that of this symbol.

    Attributes
    ----------
    positive : bool
        Whether it is positive definite for certain. Where it is not, it still may be.
    condition : float
        max|x|²/min|x|² of the samples.
    resolved : bool
        Whether it is known: that it is positive, or that the formula is not.

    Notes
    -----
    Of N samples x is known to have no such zero where the phase turns by less than π (1 - n/N)
    from each sample to the next, and by 0 in all. For let Z > 0 zeros lie in the disc, so that in
    truth the phase turns by 2πZ. From a sample to the next it turns by less than π n/N, and more
    by π times the share of that arc in the harmonic measures of these zeros, which are Z in all.
    Where it is seen to turn by more than -π (1 - n/N), and in truth turns by 2πk more than seen,
    these shares are above 2k - 1 ≥ k. The sum of k over all arcs is Z, so that those of the
    positive k have shares above Z, which there are not.
    """

    positive: bool
    condition: float
    resolved: bool

    @classmethod
    def of(cls, x: Array, oversampling: int = OVERSAMPLING) -> "Certificate":
        """Sample the polynomial, at the cost of one work unit; with more samples more."""
        x = x.astype(np.result_type(x, np.float64))
        circle = circle_of(oversampling * len(x), x.dtype)
        x = x / (np.abs(x).max() or 1.0)  # Then no square overflows.
        return cls.of_values(x, circle, circle.values(x))

    @classmethod
    def of_values(cls, x: Array, circle: Circle, values: Array) -> "Certificate":
        """Look at the values of the polynomial on a circle."""
        z = circle.path(x, values)
        squares = z.real**2 + z.imag**2
        smallest, largest = float(squares.min()), float(squares.max())
        if not smallest > 0.0:
            return cls(False, np.inf, True)
        if len(x) == 1:  # A constant does not turn.
            return cls(bool(x[0].real > 0.0), 1.0, True)
        # Of a real x the turns are those on the upper half of the circle, which the lower half
        # mirrors.
        turn = z[1:] * z[:-1].conj()
        # The cotangent of a turn is above that of a larger one.
        farthest = 1.0 / tan(pi * (1.0 - len(x) / circle.points))
        resolved = bool((turn.real > farthest * np.abs(turn.imag)).all())
        positive = x[0].real > 0.0 and resolved and _count_turns(z, turn.imag > 0.0) == 0
        return cls(bool(positive), largest / smallest, resolved)


def _count_turns(z: Array, is_left: Array) -> int:
    """Return how often a path goes around zero, in half turns where it ends opposite its start.

    It crosses the negative real axis where the imaginary part changes its sign while it turns from
    above to the left, or from below to the right; each turn is less than half of one.
    """
    above = z.imag >= 0.0
    leaves = above[:-1] & ~above[1:] & is_left
    enters = ~above[:-1] & above[1:] & ~is_left
    crossings = int(np.count_nonzero(leaves)) - int(np.count_nonzero(enters))
    return round((np.angle(z[-1]) - np.angle(z[0])) / np.pi) + 2 * crossings
