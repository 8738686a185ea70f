"""A Toeplitz system of any size, with the fastest product for its matrix."""

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

TINY = float(np.finfo(np.float64).tiny)  # Replaces the norm zero: the relative error is then zero.
JUMPS = 0.1  # Largest share of jumps of the phase; for random coefficients it is one half.
WRAPPED = 1e-3  # Largest relative difference of the lags k and k - n of a near-circulant.
ALIKE = 1.1  # Largest ratio of the middle eigenvalues for which CG needs few iterations.
WHITE = 3.0  # The same if there are outliers, which CG alone resolves in fewer iterations.
OUTLIER = 10.0  # An eigenvalue is an outlier if it exceeds the median by this factor.
USUAL = 1e-60, 1e60  # Sizes whose products, quotients and squares neither overflow nor underflow.


class ToeplitzSystem:
    """The system A X = B with a Toeplitz matrix A.

    Parameters
    ----------
    c, r : ndarray of shape (n,), float64 or complex128
        First column and first row of A; the same array if A is known to be symmetric.
    B : ndarray of shape (n,) or (columns, n)
        One right-hand side, or several as rows.
    parts : {1, 2}, optional
        2 if the second half of the rows are the imaginary parts of the first.
    weights : ndarray of shape (columns,), optional
        The scales by which the rows were divided, if they differ between both parts.

    Attributes
    ----------
    n : int
        The number of unknowns.
    is_complex : bool
    columns : int
        The number of right-hand sides.
    lags : ndarray of shape (2 n - 1,)
        The coefficients a[i - j], with lag zero in the centre.
    size : float
        An upper bound of ‖A‖₁: the sum of the absolute values of all coefficients.
    sizes : ndarray of shape (columns,), or float
        The norms of the right-hand sides (see `measure`), plus a tiny number to divide by.
    is_of_usual_size : bool
        Whether all numbers are finite and need no scaling.
    is_hermitian, is_symmetric : bool
        Whether A is Hermitian, and whether it is also real. If that holds up to rounding, as in
        `ToeplitzOperator`, A is made exactly Hermitian.
    may_be_definite : bool
        Whether A is symmetric and no coefficient exceeds that of the diagonal.
    widths : tuple of int
        The numbers of diagonals below and above the main one, up to the last nonzero diagonal.
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
        is_short = 2 * self.n <= PART and not self.is_complex  # BLAS uses one thread then.
        self.size = dasum(self.lags) if is_short else float(np.abs(self.lags).sum())
        self.sizes = self.measure(B) + TINY
        low, high = USUAL
        self.is_of_usual_size = bool(low < self.size < high) and (
            low < self.sizes < high
            if isinstance(self.sizes, float)
            else bool(low < self.sizes.min() and self.sizes.max() < high)
        )
        self.is_hermitian, asymmetry = r is c and not self.is_complex, 0.0
        # The last numbers show that most matrices are not Hermitian; this test is fast.
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
        # The last numbers of most matrices are not zero; this test is fast.
        below = self.n - 1 if c[-1] else _last_nonzero(c)
        above = below if r is c else self.n - 1 if r[-1] else _last_nonzero(r)
        self.widths = below, above
        # The rounding error by transforms is hardly twice as large as by definition.
        self._rounding = EPS * norm(self.lags) * (1.0 if self.n <= SHORT else 2.0) + asymmetry

    @property
    def band(self) -> Array:
        """The coefficients of the diagonals within `widths`, starting with the highest one."""
        below, above = self.widths
        return self.lags[self.n - 1 - above : self.n + below]

    @cached_property
    def wraps_around(self) -> bool:
        """Whether A is a circulant up to a small part.

        Then the circulant with its own numbers is nearly the inverse, even if the lags resolve no
        symbol, as for a permutation.
        """
        return bool(norm(self.c[1:] - self.r[:0:-1]) <= WRAPPED * norm(self.c))

    @cached_property
    def has_symbol(self) -> bool:
        """Whether the samples resolve a function of the frequency.

        Then the phase turns by less than a right angle between nearly all samples. For coefficients
        that do not decay, such as random ones, it turns by any angle.
        """
        turned = (self.samples[1:] * self.samples[:-1].conj()).real < 0.0
        return bool(np.count_nonzero(turned) <= JUMPS * len(self.samples))

    @cached_property
    def has_positive_means(self) -> bool:
        """Whether the Rayleigh quotients `means` allow a Hermitian positive definite A."""
        return (
            self.is_hermitian
            and self.c[0].real > 0.0
            and may_be_positive(self.means, self.means.dtype)
        )

    @property
    def has_flat_means(self) -> bool:
        """Whether CG without a preconditioner takes few iterations, judged by `means`.

        The middle ones must be nearly equal, or differ little if there are outliers, which CG
        resolves one by one, as for plane waves in noise.
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
        return ToeplitzOperator.from_lags(self.lags)  # r[0] may have any value.

    @cached_property
    def cosine_form(self) -> CosineForm:
        """A by cosine transforms, if A is symmetric."""
        return CosineForm(self.c)

    @cached_property
    def fourier_form(self) -> FourierForm | None:
        """A by Fourier transforms, or None if these are slow, or slower than other products."""
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
        """Return the eigenvalues of a circulant in the format of `chan_eigenvalues`."""
        count_transforms(1, self.n)
        eigenvalues = fft(column) if self.is_complex else rfft(column)
        return eigenvalues.real if self.is_hermitian else eigenvalues

    def multiply(self, X: Rows) -> Rows:
        """Multiply rows by A, in the fastest way for its size."""
        has_cosine_form = "cosine_form" in self.__dict__
        if self.n <= SHORT and not has_cosine_form:
            return self.multiply_directly(X) if X.ndim == 1 else X @ self._dense.T
        if sum(self.widths) <= FEW_DIAGONALS and not has_cosine_form:
            if X.ndim > 1:
                return np.stack([self.multiply(x) for x in X])
            above = self.widths[1]
            return np.convolve(X, self.band)[above : above + self.n]
        if self.is_symmetric and (self.n < PANELS or has_cosine_form):
            return self.cosine_form.multiply(X)
        return self.A.apply(X) if self.fourier_form is None else self.fourier_form.multiply(X)

    def multiply_directly(self, X: Rows) -> Rows:
        """Multiply rows by A by definition: rounding errors are relative to the terms of each sum.

        By transforms it would be relative to the largest coefficient times the largest number.
        """
        if X.ndim == 1:
            # Like `numpy.convolve`, which takes twice as long for some lengths.
            return np.correlate(self.lags, X[::-1].conj(), "valid")
        return np.stack([self.multiply_directly(x) for x in X])

    def measure(self, X: Rows) -> Array | float:
        """Return the 2-norms of rows; for split complex rows the joint norm of both parts."""
        # Python floats are faster than NumPy arrays if n is small.
        return norm(X) if X.ndim == 1 else self._join(np.sqrt(np.vecdot(X, X).real))

    def sizes_of_terms(self, X: Rows) -> Array | float:
        """Return a bound of ‖|A| |x|‖ for each row: Σ |a| times the norm of the part of x it meets.

        It is far below ‖a‖₁ ‖x‖ if the largest coefficients meet only small numbers.
        """
        squares = np.square(np.abs(X))
        heads, tails = np.sqrt(squares.cumsum(-1)), np.sqrt(squares[..., ::-1].cumsum(-1))
        of_lags, n = np.abs(self.lags), self.n
        sizes = heads @ of_lags[n - 1 :][::-1] + tails[..., : n - 1] @ of_lags[: n - 1]
        return float(sizes) if X.ndim == 1 else self._join(sizes)

    def rounding_of(self, terms: Array | float) -> Array | float:
        """Return the rounding error of b - A x for terms of these sizes.

        The squares of the errors of the terms add up. The change that makes A Hermitian counts as
        an error too.
        """
        return self._rounding / self.size * terms + 0.5 * EPS * (self.sizes - TINY)

    def _join(self, sizes: Array) -> Array:
        """Return the joint sizes of rows, as in `measure`, from the sizes of each part."""
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
        # A[i, j] has the lag i - j.
        A = np.ndarray((n, n), self.c.dtype, self.lags, (n - 1) * step, (step, -step))
        return A.copy()


def _last_nonzero(a: Array) -> int:
    """Return the index of the last nonzero number, or 0."""
    is_nonzero = a[::-1] != 0.0
    behind = int(is_nonzero.argmax())
    return len(a) - 1 - behind if is_nonzero[behind] else 0
