"""The covariance matrix A_oo of the observed points of a grid; `observe` chooses a class.

E extends a vector of observed values by zeros to the grid.
"""

import os
import warnings
from dataclasses import dataclass
from functools import cached_property
from math import isqrt
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.fft import next_fast_len
from scipy.linalg import LinAlgWarning, cho_factor, cho_solve, solve_triangular
from scipy.linalg.lapack import dlauum, dpotrf, dpotri, dtrtri
from scipy.sparse import diags_array
from scipy.sparse.linalg import LinearOperator

from toeplitz_mg._typing import Array, Mask, Rows
from toeplitz_mg.columns.circle import circle_of
from toeplitz_mg.columns.columns import EPS
from toeplitz_mg.engine import fourier
from toeplitz_mg.engine.vectors import norm
from toeplitz_mg.operators import MaskedOperator, ToeplitzOperator
from toeplitz_mg.preconditioners import default_preconditioner
from toeplitz_mg.solvers.cg import cg
from toeplitz_mg.solvers.inverse import first_columns, require_safe_sizes
from toeplitz_mg.solvers.refined_column import RefinedColumn, refine_column
from toeplitz_mg.solvers.szego import LogDeterminant, log_determinant
from toeplitz_mg.solvers.szego_polynomial import autocorrelations

MOST = 4096  # Largest number of (missing or observed) points for a dense matrix: 134 MB.
PART = 64  # Number of rows that are computed or multiplied at once.
RTOL = 1e-11  # Relative residual of CG.
MOST_ITERATIONS = 1000  # Limit of iterations; beyond it the matrix is too ill-conditioned.
NEAR = 64  # Row by row, this many rows of the inverse take as long as one product.
PANEL = 2**16  # Size of the panels of rows, which fit into the cache.
LOST = 1 / 30  # Relative error of derivatives over that of the covariance of the missing points.
INEXACT = 1e-8  # Relative error of derivatives above which there is a warning.
NOISY = 1e-3  # Rounding error of a quadratic form per unknown, above which there is a warning.


class Known:
    """The covariance of the observed points, in any representation."""

    A: ToeplitzOperator

    @property
    def rounding(self) -> float:
        """The estimated relative error of the covariance of the missing points."""
        return 0.0

    @property
    def doubt(self) -> str:
        """The text of a warning about the log-determinant, or an empty string."""
        return ""

    def solve(self, Y: Rows) -> tuple[Rows, Array]:
        """Return α = A_oo⁻¹ y_o, extended by zeros, for each row y, and yᵀ α."""
        raise NotImplementedError

    def estimate(self, Y: Rows) -> Rows:
        """Return A α, the means of all points; at observed points this is y up to rounding."""
        return self.A.apply(self.solve(Y)[0])


@dataclass(frozen=True)
class Whole(Known):
    """A series without gaps."""

    A: ToeplitzOperator

    @cached_property
    def column(self) -> RefinedColumn:
        """The first column of A⁻¹."""
        return refine_column(first_columns(self.A))

    @cached_property
    def log_determinant(self) -> LogDeterminant:
        """The log-determinant with its error."""
        require_safe_sizes(self.A)
        return log_determinant(self.A, lambda start: self.column)

    def solve(self, Y: Rows) -> tuple[Rows, Array]:
        """Return A⁻¹ y for each row, and yᵀ A⁻¹ y."""
        X = self.column.solve(Y)
        return X, np.vecdot(Y, X)

    @property
    def doubt(self) -> str:
        """The text of a warning about the log-determinant."""
        return self.log_determinant.doubt(self.A.shape[0])

    def logdet(self) -> float:
        """Return log det A."""
        return self.log_determinant.value

    def by_covariances(self, X: Rows) -> Array:
        """Return the derivatives of the log-density by c, for each row α."""
        return _by_lags(X, self.column.polynomial.diagonal_sums)

    def variances(self) -> Array:
        """Return an empty array: no points are missing."""
        return np.empty(0)

    def inverse_diagonal(self) -> Array:
        """Return (A⁻¹)_ii = Σ_(k≤i) (x_k² - x_(n-k)²)/x₀."""
        x = self.column.x
        y = np.append(0.0, x[:0:-1])
        half = (len(x) + 1) // 2  # The diagonal is symmetric; fewer terms have less rounding.
        diagonal = np.cumsum((x - y)[:half] * (x + y)[:half]) / x[0]
        return np.append(diagonal, diagonal[: len(x) - half][::-1])


@dataclass(frozen=True)
class Gaps(Known):
    """A series with few missing points, at positions m.

    With B = (A⁻¹)_mm, E A_oo⁻¹ Eᵀ = A⁻¹ - A⁻¹_:m B⁻¹ A⁻¹_m: and det A_oo = det A det B.
    """

    whole: Whole
    missing: Array

    @cached_property
    def _factor(self) -> Array:
        """The lower Cholesky factor of B; the entries above the diagonal are arbitrary."""
        # LAPACK stores by columns, so the transpose has the known triangle of B.
        B = inverse_block(self.whole.column, self.missing).T
        factor: Array = cho_factor(B, lower=True, overwrite_a=True, check_finite=False)[0]
        return factor

    def solve(self, Y: Rows) -> tuple[Rows, Array]:
        """Return A⁻¹ v and vᵀ A⁻¹ v, where v extends y into the gaps so that A⁻¹ v is zero there.

        This v minimises vᵀ A⁻¹ v, so rounding errors of v have a quadratic effect only.
        """
        V, X = self._continue(Y)
        self.whole.column.refine(V, X)
        squares = np.vecdot(V, X)
        X[:, self.missing] = 0.0
        return X, squares

    def estimate(self, Y: Rows) -> Rows:
        """Return v, which is accurate even if A is so ill-conditioned that α is not."""
        return self._continue(Y)[0]

    def _continue(self, Y: Rows) -> tuple[Rows, Rows]:
        """Return v, the best extension of y into the gaps, and A⁻¹ v.

        The second step corrects the rounding errors of the first, where y falls to zero in the
        gaps.
        """
        V, m = Y.copy(), self.missing
        for _ in range(2):
            X = self.whole.column.inverse.apply(V)
            V[:, m] -= cho_solve((self._factor, True), X[:, m].T, check_finite=False).T
        return V, X

    def logdet(self) -> float:
        """Return log det A + log det B."""
        return self.whole.logdet() + 2.0 * float(np.log(self._factor.diagonal()).sum())

    @cached_property
    def _root(self) -> Array:
        """L⁻¹, where B⁻¹ = L⁻ᵀ L⁻¹ is the covariance of the missing points given the rest."""
        return np.triu(dtrtri(self._factor, lower=1)[0].T).T

    @cached_property
    def _upper(self) -> Array:
        """B⁻¹ on and above its diagonal; the entries below are arbitrary."""
        return dlauum(self._root, lower=1)[0].T

    def inverse(self) -> Array:
        """Return B⁻¹."""
        upper = np.triu(self._upper)
        return upper + np.triu(upper, 1).T

    def variances(self) -> Array:
        """Return the variances of the missing points given the observed ones."""
        return np.vecdot(self._root.T, self._root.T)

    def inverse_diagonal(self) -> Array:
        """Return the diagonal of A⁻¹ minus that of W Wᵀ, W = A⁻¹_:m L⁻ᵀ."""
        diagonal = self.whole.inverse_diagonal()
        for first in range(0, len(self.missing), PART):
            part = self._root[first : first + PART]
            rows = np.zeros((len(part), len(diagonal)))
            rows[:, self.missing] = part
            diagonal -= (self.whole.column.inverse.apply(rows) ** 2).sum(axis=0)
        diagonal[self.missing] = 0.0
        return diagonal

    @property
    def doubt(self) -> str:
        """The warning for the whole series, whose log-determinant is part of this one."""
        return self.whole.doubt

    @property
    def rounding(self) -> float:
        """The error of B⁻¹, which is large for a long gap in a smooth process."""
        polynomial = self.whole.column.polynomial
        size = polynomial.x[0] * np.abs(polynomial.values).max() ** 2  # At least ‖A⁻¹‖.
        return 3.0 * EPS * float(size * self.variances().sum())

    def by_covariances(self, X: Rows) -> Array:
        """Return the derivatives of the log-density by c, for each row α.

        One more solve converts the derivatives of log det B by x = A⁻¹ e₁ to those by c, as
        dx = -A⁻¹ dA x.
        """
        x = self.whole.column.x
        by_x = by_column(x, self.missing, self._upper)
        circle = circle_of(2 * len(x) - 1, x.dtype)
        p, q = circle.values(x), circle.values(self.whole.column.solve(by_x[np.newaxis])[0])
        lost = circle.coefficients(p.real * q.real + p.imag * q.imag, len(x))
        return _by_lags(X, self.whole.column.polynomial.diagonal_sums - lost)


@dataclass(frozen=True)
class Scattered(Known):
    """Any observed points on a grid with any number of axes, with noise that may differ."""

    A: ToeplitzOperator
    mask: Mask
    noise: Array | None = None

    def variances(self) -> Array:
        """Return the diagonal of A_mm - A_mo A_oo⁻¹ A_om, including the noise of missing points."""
        inside = self.mask.ravel()
        missing = np.flatnonzero(~inside)
        variances = np.full(len(missing), float(self.A.c.flat[0]))
        if self.noise is not None:
            variances += self.noise[~self.mask]
        for first in range(0, len(missing), PART):
            rows = slice(first, first + PART)
            Y = self.A.entries(missing[rows], np.arange(len(inside))) * inside
            variances[rows] -= self.squares(Y)
        return np.maximum(variances, 0.0)

    def squares(self, Y: Rows) -> Array:
        """Return yᵀ A_oo⁻¹ y for each row y."""
        return self.solve(Y)[1]


@dataclass(frozen=True)
class Few(Scattered):
    """Few observed points on a grid: a dense matrix."""

    @cached_property
    def index(self) -> Array:
        """The positions of the observed points."""
        return np.flatnonzero(self.mask)

    @cached_property
    def _factor(self) -> Array:
        """The lower Cholesky factor L of A_oo; zeros above the diagonal."""
        matrix = np.empty((len(self.index), len(self.index)))
        for first in range(0, len(matrix), PART):
            rows = slice(first, first + PART)
            matrix[rows] = self.A.entries(self.index[rows], self.index)
        if self.noise is not None:
            np.einsum("ii->i", matrix)[:] += self.noise.ravel()[self.index]
        factor, info = dpotrf(matrix.T, lower=1, clean=1, overwrite_a=1)
        if info:
            raise np.linalg.LinAlgError(
                f"the covariance of the {len(self.index)} observed points is not positive "
                "definite, or so ill-conditioned that float64 cannot tell: add to c[0] (a nugget)"
            )
        return np.asarray(factor)

    def solve(self, Y: Rows) -> tuple[Rows, Array]:
        """Return α = A_oo⁻¹ y_o, extended by zeros, for each row, and yᵀ α."""
        X = np.zeros_like(Y)
        X[:, self.index] = cho_solve((self._factor, True), Y[:, self.index].T).T
        return X, np.vecdot(Y, X)

    def divide(self, B: Array) -> Array:
        """Return A_oo⁻¹ B."""
        quotient: Array = cho_solve((self._factor, True), B)
        return quotient

    def logdet(self) -> float:
        """Return log det A_oo."""
        return 2.0 * float(np.log(self._factor.diagonal()).sum())

    def whiten(self, Y: Rows) -> Rows:
        """Return L⁻¹ y_o for each row, NaN at missing points."""
        X = np.full_like(Y, np.nan)
        X[:, self.index] = solve_triangular(self._factor, Y[:, self.index].T, lower=True).T
        return X

    def colorize(self, Z: Rows) -> Rows:
        """Return L z for each row z, at all points."""
        return Z @ self._factor.T

    def by_covariances(self, X: Rows) -> Array:
        """Return half of the sums of α αᵀ - A_oo⁻¹ over the pairs of points with the same lag.

        Lags that differ only in the signs of their components count as the same.
        """
        inverse = dpotri(self._factor, lower=1)[0]  # Only its lower triangle is set.
        alphas, points = X[:, self.index], np.unravel_index(self.index, self.A.grid_shape)
        sums = np.zeros_like(X)
        for first in range(0, len(inverse), PART):
            rows, stop = slice(first, first + PART), first + PART
            distances = tuple(np.abs(np.subtract.outer(i[rows], i[:stop])) for i in points)
            lags = np.ravel_multi_index(distances, self.A.grid_shape).ravel()
            for alpha, total in zip(alphas, sums, strict=True):
                part = np.tril(np.outer(alpha[rows], alpha[:stop]), first) - inverse[rows, :stop]
                total += np.bincount(lags, part.ravel(), len(total))
        sums[:, 0] -= 0.5 * (np.vecdot(alphas, alphas) - inverse.trace())
        return sums

    def squares(self, Y: Rows) -> Array:
        """Return |L⁻¹ y_o|² for each row y, at half the cost of a solve."""
        X = self.whiten(Y)[:, self.index]
        return np.vecdot(X, X)

    def inverse_diagonal(self) -> Array:
        """Return the diagonal of A_oo⁻¹, extended by zeros."""
        diagonal = np.zeros(self.A.shape[0])
        diagonal[self.index] = dpotri(self._factor, lower=1)[0].diagonal()
        return diagonal


@dataclass(frozen=True)
class Many(Scattered):
    """Many observed points on a grid: CG, which gives no determinant."""

    @cached_property
    def _operators(self) -> tuple[LinearOperator, LinearOperator]:
        A = self.A if self.mask.all() else MaskedOperator(self.A, self.mask)
        if self.noise is not None:
            A = A + diags_array(self.noise[self.mask])
        try:
            return A, default_preconditioner(A)
        except np.linalg.LinAlgError:
            raise np.linalg.LinAlgError(
                "the covariance of the observed points is not positive definite, or too "
                "ill-conditioned: add to c[0] (a nugget)"
            ) from None

    def solve(self, Y: Rows) -> tuple[Rows, Array]:
        """Return α by CG for each row, and yᵀ α."""
        A, M = self._operators
        X = np.zeros_like(Y)
        inside = self.mask.ravel()
        for x, y in zip(X, Y, strict=True):
            x[inside], info = cg(A, y[inside], M=M, rtol=RTOL, maxiter=MOST_ITERATIONS)
            if info:
                r = y[inside] - A @ x[inside]
                raise np.linalg.LinAlgError(
                    f"CG reached the relative residual {norm(r) / norm(y):.1e} in {info} "
                    f"iterations, but {RTOL:g} is needed: the covariance is not positive definite, "
                    "or too ill-conditioned, as a smooth one is that is wide beside an element: "
                    f"add to c[0] (a nugget), or take fewer points, of which {MOST} are solved "
                    "directly"
                )
        return X, np.vecdot(Y, X)

    def logdet(self, *_: Rows) -> Any:
        """Raise the ValueError that explains why the determinant is not available."""
        observed = np.count_nonzero(self.mask)
        if self.noise is not None:
            beyond = "logpdf_estimate estimates it, of one axis"
        elif self.mask.ndim > 1:
            beyond = "what is approximate, as Whittle's likelihood, is not in this package"
        else:
            beyond = f"or where at most {MOST} are missing, and not {self.mask.size - observed}"
        raise ValueError(
            f"{observed} of {self.mask.size} points are observed, but the log-determinant is known "
            f"exactly only for up to {largest_dense()} on this machine, whose dense matrix takes a "
            f"quarter of its memory; {beyond}; conditional needs none"
        )

    by_covariances = inverse_diagonal = logdet


Observed = Whole | Gaps | Few | Many


def largest_dense() -> int:
    """Return the size of the dense matrix that takes a quarter of this machine's memory."""
    try:
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # Not available on Windows.
        memory = 2**33
    return max(MOST, isqrt(memory // (4 * 8)))


def _by_lags(X: Rows, diagonal_sums: Array) -> Array:
    """Return the derivatives on one axis: correlations of α minus the sums of diagonals."""
    by_c = np.array([*map(autocorrelations, X)]).reshape(X.shape) - diagonal_sums
    by_c[:, 0] *= 0.5
    return by_c


def observe(whole: Whole, mask: Mask, noise: Array | None = None, *, dense: int = MOST) -> Observed:
    """Return the covariance of the points in a mask: a `Whole`, `Gaps`, `Few` or `Many`.

    If neither `Whole` nor `Gaps` fits, a dense matrix is used for at most `dense` points. For more,
    CG is used, which gives no log-determinant.
    """
    observed = int(np.count_nonzero(mask))
    missing = mask.size - observed
    if mask.ndim == 1 and noise is None and missing <= MOST and missing < observed:
        return Gaps(whole, np.flatnonzero(~mask)) if missing else whole
    if observed <= dense:
        return Few(whole.A, mask, noise)
    return Many(whole.A, mask, noise)


def inverse_block(column: RefinedColumn, index: Array) -> Array:
    """Return the block of A⁻¹ for given positions, in ascending order.

    Entries below the diagonal are not set. By the Gohberg-Semencul formula each row follows from
    the previous one: with x = A⁻¹ e₁ and xₙ = 0

        (A⁻¹)_ij = (A⁻¹)_(i-1,j-1) + (x_i x_j - x_(n-i) x_(n-j))/x₀.

    The next position is reached row by row if it is near, and by a product if it is far.
    """
    x = column.x
    n, m, last = len(x), len(index), int(index[-1])
    pairs = np.stack([x, np.append(0.0, x[:0:-1])])
    weights = np.array([[1.0], [-1.0]]) / x[0]
    near = np.append(np.diff(index) <= NEAR, False)
    B = np.empty((m, m))
    row, i, k = x[: last + 1], 0, 0  # The entries (i, i), (i, i + 1) … of A⁻¹.
    while k < m:
        if index[k] - i > NEAR:
            i = int(index[k])
            unit = np.zeros((1, n))
            unit[0, i] = 1.0
            row = column.inverse.apply(unit)[0, i : last + 1]
        # The rows from i to the last position that is near to its predecessor.
        rows = max(2, PANEL // len(row))
        stop = int(np.searchsorted(index, i + rows))
        if not near[k:stop].all():
            stop = k + int(np.argmin(near[k:stop])) + 1
            rows = int(index[stop - 1]) + 1 - i
        D = (weights * pairs[:, i : i + rows]).T @ pairs[:, i : last + 1]
        D[0] = row
        for above, below in enumerate(D[1:]):
            below[above + 1 :] += D[above, above:-1]
        # All indices are valid; mode="clip" avoids a buffer, which takes five times as long.
        D[index[k:stop] - i].take(index[k:] - i, axis=1, out=B[k:stop, k:], mode="clip")
        row, i, k = D[-1, len(D) - 1 :], i + len(D) - 1, stop
    return B


def by_column(x: Array, index: Array, inverse: Array) -> Array:
    """Return the derivatives of log det B by x, where B = (A⁻¹)_mm at the positions `index`.

    The Gohberg-Semencul formula is B = E (Σ_s (Zˢ x) (Zˢ x)ᵀ - (Zˢ y) (Zˢ y)ᵀ) Eᵀ/x₀, where
    y = [0 x_(n-1) … x₁], Z shifts down and E selects the positions m. So the derivative is

        2 (S x - reversed S y)/x₀ - m e₁/x₀,    S = Σ_s (Zᵀ)ˢ Eᵀ B⁻¹ E Zˢ.

    S_(p,p+t) is the sum of the entries of B⁻¹ for pairs of positions at distance t, from p on. It
    is constant between two neighbouring positions, so these rows are multiplied at once. Positions
    ascend; entries of `inverse` = B⁻¹ below the diagonal are not used.
    """
    last = int(index[-1])
    pair = np.stack([x, np.append(0.0, x[:0:-1])])
    products = np.zeros_like(pair)
    padded = np.zeros(NEAR + last + 1)
    sums = padded[NEAR:]  # S_(p,p+t) for t = 0, 1 …
    ends = [-1, *index.tolist()]
    for k in reversed(range(len(index))):
        first, stop = ends[k] + 1, ends[k + 1] + 1
        sums[index[k:] - index[k]] += inverse[k, k:]
        part, below = pair[:, first:stop], pair[:, first : last + 1]
        here, there = products[:, first:stop], products[:, first : last + 1]
        length = below.shape[1]
        if stop - first > NEAR:
            N = next_fast_len(length, real=True)
            hat = fourier.rfft(sums[: last + 2 - stop], N)
            here += fourier.irfft(hat.conj() * fourier.rfft(below, N), N)[:, : stop - first]
            there += fourier.irfft(hat * fourier.rfft(part, N), N)[:, :length]
        else:
            window = padded[NEAR + 1 - (stop - first) : NEAR + length]
            rows = sliding_window_view(window, length)[::-1].copy()  # S above its diagonal.
            here += below @ rows.T
            there += part @ rows
        here -= sums[0] * part  # The diagonal was counted twice.
    by_x = products[0]
    by_x[1:] -= products[1, :0:-1]
    by_x *= 2.0
    by_x[0] -= len(index)
    return by_x / x[0]


def doubt_of_form(A: ToeplitzOperator, X: Rows, squares: Array) -> str:
    """Return the warning if yᵀ α is dominated by rounding errors, for rows α = A⁻¹ y."""
    noise = EPS * A.norm_bound * np.vecdot(X, X)
    worst = int(noise.argmax()) if len(noise) else 0
    if not len(noise) or noise[worst] <= NOISY * X.shape[1]:
        return ""
    return (
        f"(y - mean)ᵀ A⁻¹ (y - mean) is {squares[worst]:.6g} with an error of up to "
        f"{noise[worst]:.1e}: A is ill-conditioned, for which a larger c[0] would help"
    )


def doubt_of_gaps(what: str, error: float, most: float) -> str:
    """Return the warning if the covariance of the gaps has a large relative error."""
    if error <= most:
        return ""
    return (
        f"{what} may have a relative error of {error:.1e}: what is missing is so smooth over a "
        "long gap that its covariance is ill-conditioned, for which a larger c[0] would help"
    )


def warn(*doubts: str, stacklevel: int) -> None:
    """Issue the warnings that are not empty."""
    for doubt in filter(None, doubts):
        warnings.warn(doubt, LinAlgWarning, stacklevel=stacklevel + 1)
