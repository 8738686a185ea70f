"""A Toeplitz system of any size, with the quickest product of its matrix."""

from functools import cached_property

import numpy as np
from scipy.linalg.blas import dasum, idamax

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.columns.columns import EPS
from toeplitz_mg.engine.fourier import fft, rfft
from toeplitz_mg.engine.vectors import PART, norm
from toeplitz_mg.engine.work import count_transforms
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.coefficients import ROUNDING, make_hermitian
from toeplitz_mg.operators.positivity import may_be_positive
from toeplitz_mg.preconditioners.circulant import chan_column, smooth_column
from toeplitz_mg.solvers.toeplitz.cosine_form import CosineForm
from toeplitz_mg.solvers.toeplitz.fourier_form import FourierForm, has_fourier_form
from toeplitz_mg.solvers.toeplitz.sizes import FEW_DIAGONALS, PANELS, SHORT

TINY = float(np.finfo(np.float64).tiny)  # In the place of zero: its relative error is then zero.
JUMPS = 0.1  # Largest share of jumps of the phase: of random coefficients it is one half.
WRAPPED = 1e-3  # Largest difference of the lags k and k - n of what is nearly a circulant.
ALIKE = 1.1  # Largest ratio of the eigenvalues in the middle that CG takes for one.
WHITE = 3.0  # The same beside outliers, for which a circulant takes more iterations than CG alone.
OUTLIER = 10.0  # An eigenvalue over the median, from which on it is one.
USUAL = 1e-60, 1e60  # Sizes whose products, quotients and squares neither over- nor underflow.


class ToeplitzSystem:
    """The system A X = B of a Toeplitz matrix A.

    Parameters
    ----------
    c, r : ndarray of shape (n,), float64 or complex128
        First column and first row of A; the same array where A is known to be symmetric.
    B : ndarray of shape (n,) or (columns, n)
        One right-hand side, or some, as rows.
    parts : {1, 2}, optional
        2 where the second half of the rows are the imaginary parts of the first.
    weights : ndarray of shape (columns,), optional
        By what the rows have been divided, where that is not the same for both parts.

    Attributes
    ----------
    n : int
        The number of unknowns.
    is_complex : bool
    columns : int
        The number of right-hand sides.
    lags : ndarray of shape (2 n - 1,)
        The coefficients a[i - j], lag zero in the centre.
    size : float
        A bound of ‖A‖₁: the sum of all coefficients without their signs.
    sizes : ndarray of shape (columns,), or float
        The norms of the right-hand sides (see `measure`); that of zero is tiny, as it is to be
        divided by.
    is_of_usual_size : bool
        Whether all numbers are finite, and it can be solved as it is, without scaling.
    is_hermitian, is_symmetric : bool
        Whether A is Hermitian, and whether it is real too. Where its lags differ by rounding from
        those of such a matrix, as `ToeplitzOperator` takes it, it is made so.
    may_be_definite : bool
        Whether A is symmetric, and no coefficient larger than that of the diagonal.
    widths : tuple of int
        How many diagonals there are below the main one, and above, up to the last nonzero.
    """

    def __init__(
        self,
        c: Array,
        r: Array,
        B: Rows,
        parts: int = 1,
        weights: Array | None = None,
    ) -> None:
        self.B, self.parts, self._weights = B, parts, weights
        self.n, self.is_complex = len(c), c.dtype.kind == "c"
        self.columns = 1 if B.ndim == 1 else len(B)
        self.lags = np.concatenate([r[:0:-1], c])
        is_short = 2 * self.n <= PART and not self.is_complex  # BLAS then takes one thread.
        self.size = dasum(self.lags) if is_short else float(np.abs(self.lags).sum())
        self.sizes = self.measure(B) + TINY
        low, high = USUAL
        self.is_of_usual_size = bool(low < self.size < high) and (
            low < self.sizes < high
            if isinstance(self.sizes, float)
            else bool(low < self.sizes.min() and self.sizes.max() < high)
        )
        self.is_hermitian, asymmetry = r is c and not self.is_complex, 0.0
        # The last numbers of most matrices that are not Hermitian tell of it, and are soon seen.
        if not self.is_hermitian and self.is_of_usual_size:
            last = c[-1] - r[-1].conjugate() if self.n > 1 else 0.0
            if abs(last) <= ROUNDING * EPS * self.size:
                lags, self.is_hermitian = make_hermitian(self.lags)
            if self.is_hermitian:
                asymmetry = float(np.abs(lags - self.lags).sum())
                self.lags, c = lags, lags[self.n - 1 :]
                r = c.conj() if self.is_complex else c
        self.is_symmetric = self.is_hermitian and not self.is_complex
        self.may_be_definite = self.is_symmetric and idamax(c) == 0
        self.c, self.r = c, r
        # The last numbers of most matrices are no zeros, and soon looked at.
        below = self.n - 1 if c[-1] else _last_nonzero(c)
        above = below if r is c else self.n - 1 if r[-1] else _last_nonzero(r)
        self.widths = below, above
        # Of the product by transforms rounding is hardly twice as large as of that by definition.
        self._rounding = EPS * norm(self.lags) * (1.0 if self.n <= SHORT else 2.0) + asymmetry

    @property
    def band(self) -> Array:
        """The coefficients of the diagonals within `widths`, from the last one above."""
        below, above = self.widths
        return self.lags[self.n - 1 - above : self.n + below]

    @cached_property
    def wraps_around(self) -> bool:
        """Whether A is a circulant, but for a small part.

        Then its own circulant inverts it, of whatever numbers: a permutation has no symbol that its
        lags resolve.
        """
        return bool(norm(self.c[1:] - self.r[:0:-1]) <= WRAPPED * norm(self.c))

    @cached_property
    def has_symbol(self) -> bool:
        """Whether the samples are those of a function of the frequency that they resolve.

        Its phase turns by less than a right angle from nearly each sample to the next. Those of
        coefficients that do not decay, as of random ones, turn by any angle.
        """
        turned = (self.samples[1:] * self.samples[:-1].conj()).real < 0.0
        return bool(np.count_nonzero(turned) <= JUMPS * len(self.samples))

    @cached_property
    def has_positive_means(self) -> bool:
        """Whether A may be Hermitian positive definite, by the Rayleigh quotients `means`."""
        return (
            self.is_hermitian
            and self.c[0].real > 0.0
            and may_be_positive(self.means, self.means.dtype)
        )

    @property
    def has_flat_means(self) -> bool:
        """Whether CG is done in few iterations without a preconditioner, by the same numbers.

        Those in the middle are all but equal, or differ little beside outliers, which CG finds by
        itself, as those of plane waves in noise.
        """
        n, ascending = len(self.means), np.sort(self.means)
        low, middle, high = ascending[[n // 10, n // 2, (9 * n) // 10]]
        has_outliers = ascending[-1] > OUTLIER * middle
        return bool(high <= (WHITE if has_outliers else ALIKE) * low)

    @cached_property
    def A(self) -> ToeplitzOperator:
        """The operator of A."""
        if self.is_symmetric:
            return ToeplitzOperator(self.c)
        return ToeplitzOperator.from_lags(self.lags)  # The first number of r may be anything.

    @cached_property
    def cosine_form(self) -> CosineForm:
        """A by cosine transforms, where A is symmetric."""
        return CosineForm(self.c)

    @cached_property
    def fourier_form(self) -> FourierForm | None:
        """A by Fourier transforms, or None where they are slow, or slower than other products."""
        return FourierForm(self.c, self.r) if has_fourier_form(self.n) else None

    @cached_property
    def samples(self) -> Array:
        """The eigenvalues of the circulant that `smooth_column` returns."""
        return self._eigenvalues(smooth_column(self.c, self.r))

    @cached_property
    def means(self) -> Array:
        """The eigenvalues of T. Chan's circulant."""
        return self._eigenvalues(chan_column(self.c, self.r))

    def _eigenvalues(self, column: Array) -> Array:
        """Return those of a circulant, of a real one up to the middle, as `chan_eigenvalues`."""
        count_transforms(1, self.n)
        eigenvalues = fft(column) if self.is_complex else rfft(column)
        return eigenvalues.real if self.is_hermitian else eigenvalues

    def multiply(self, X: Rows) -> Rows:
        """Multiply rows by A, as cheaply as can be for its size."""
        has_cosine_form = "cosine_form" in self.__dict__
        if self.n <= SHORT and not has_cosine_form:
            return self.multiply_sharply(X) if X.ndim == 1 else X @ self._dense.T
        if sum(self.widths) <= FEW_DIAGONALS and not has_cosine_form:
            if X.ndim > 1:
                return np.stack([self.multiply(x) for x in X])
            above = self.widths[1]
            return np.convolve(X, self.band)[above : above + self.n]
        if self.is_symmetric and (self.n < PANELS or has_cosine_form):
            return self.cosine_form.multiply(X)
        return self.A.apply(X) if self.fourier_form is None else self.fourier_form.multiply(X)

    def multiply_sharply(self, X: Rows) -> Rows:
        """Multiply rows by A, by its definition: rounding is that of the terms of each sum alone.

        By transforms it is that of the largest coefficient times the largest number.
        """
        if X.ndim == 1:
            # This is `numpy.convolve`, which for some unknowns takes twice as long.
            return np.correlate(self.lags, X[::-1].conj(), "valid")
        return np.stack([self.multiply_sharply(x) for x in X])

    def measure(self, X: Rows) -> Array | float:
        """Return the 2-norms of rows, those of the parts of complex ones for both."""
        # Python's own numbers are quicker than NumPy's, which matters where n is small.
        return norm(X) if X.ndim == 1 else self._join(np.sqrt(np.vecdot(X, X).real))

    def sizes_of_terms(self, X: Rows) -> Array | float:
        """Return a bound of ‖|A| |x|‖ for each row: the sum of |a| times what meets it of x.

        Where the largest coefficients meet small numbers only, it is far below ‖a‖₁ ‖x‖.
        """
        squares = np.square(np.abs(X))
        heads, tails = np.sqrt(squares.cumsum(-1)), np.sqrt(squares[..., ::-1].cumsum(-1))
        of_lags, n = np.abs(self.lags), self.n
        sizes = heads @ of_lags[n - 1 :][::-1] + tails[..., : n - 1] @ of_lags[: n - 1]
        return float(sizes) if X.ndim == 1 else self._join(sizes)

    def rounding_of(self, terms: Array | float) -> Array | float:
        """Return the rounding of b - A x, whose terms have these sizes.

        The errors of the terms of a sum add up as their squares do. What has been changed to make A
        Hermitian is an error too.
        """
        return self._rounding / self.size * terms + 0.5 * EPS * (self.sizes - TINY)

    def _join(self, sizes: Array) -> Array:
        """Return the sizes of rows, as `measure` does, from those of each."""
        if self.parts == 1:
            return sizes
        sizes, half = sizes if self._weights is None else sizes * self._weights, len(sizes) // 2
        joint = np.hypot(sizes[:half], sizes[half:])
        return np.concatenate((joint, joint))

    @cached_property
    def _dense(self) -> Array:
        return self.fill()

    def fill(self) -> Array:
        """Return the matrix as a new array of shape (n, n)."""
        n, (step,) = self.n, self.lags.strides
        # A[i, j] is the lag i - j.
        A = np.ndarray((n, n), self.c.dtype, self.lags, (n - 1) * step, (step, -step))
        return A.copy()


def _last_nonzero(a: Array) -> int:
    """Return the index of the last number that is not zero, or 0."""
    is_nonzero = a[::-1] != 0.0
    behind = int(is_nonzero.argmax())
    return len(a) - 1 - behind if is_nonzero[behind] else 0
