"""The normal distribution of a stationary process on a grid."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Mask, Rows
from toeplitz_mg.gaussian.observed import Observed, Whole, observe
from toeplitz_mg.gaussian.sampling import (
    Embedding,
    embed_by_column,
    embed_field,
    embed_in_circulant,
)
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.masked import check_mask
from toeplitz_mg.preconditioners.positivity import require_positive_diagonal
from toeplitz_mg.solvers.szego import correlations
from toeplitz_mg.values import count, refuse_masked

SHOWN = 5  # Positions that an error names.


class ToeplitzNormal:
    """A multivariate normal distribution whose covariance is a Toeplitz matrix.

    That is a stationary Gaussian process on a regular grid: a time series, or a random field. It is
    used as a frozen distribution of `scipy.stats`, and takes O(n log n) where
    `scipy.stats.multivariate_normal` takes O(n³).

    Parameters
    ----------
    c : array_like of shape (n,) or (n1, n2, ...)
        Covariances at the lags 0, 1, …: the first column of the covariance matrix, real. With
        several axes they are the same in both directions along each axis.
    mean : array_like, optional
        A number, or an array that broadcasts to the shape of `c`.

    Attributes
    ----------
    A : ToeplitzOperator
        The covariance matrix, in double precision.
    mean : ndarray of the shape of `c`
    shape : tuple of int
        That of `c`, and of one sample.

    Raises
    ------
    TypeError
        For covariances, or means, that are not real numbers.
    ValueError
        For those that are not finite, or shapes that do not match.
    numpy.linalg.LinAlgError
        Where c[0] is not positive. Whether the whole matrix is positive definite is found out by
        the methods: they raise it where it is not, exactly or in the arithmetic of float64, and the
        message says which leading block is not. A larger c[0], a nugget, helps.

    See Also
    --------
    toeplitz_logdet, toeplitz_inverse

    Notes
    -----
    All follows from one column of the inverse, x = A⁻¹ e₁: solutions by the Gohberg-Semencul
    formula, log det A as `toeplitz_logdet` says, and the derivatives of log det A by all
    covariances from two correlations of x.

    References
    ----------
    C. R. Dietrich, G. N. Newsam, Fast and exact simulation of stationary Gaussian processes through
    circulant embedding of the covariance matrix, SIAM J. Sci. Comput. 18 (1997).

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> c = 0.5 ** np.arange(1000)
    >>> process = tmg.ToeplitzNormal(c, mean=3.0)
    >>> y = process.rvs(random_state=0)
    >>> y.shape
    (1000,)
    >>> value, by_c, by_y = process.logpdf_and_grad(y)
    >>> bool(value == process.logpdf(y)), by_c.shape, by_y.shape
    (True, (1000,), (1000,))
    """

    def __init__(self, c: ArrayLike, mean: ArrayLike = 0.0) -> None:
        c = _real("c", c)
        self.A = ToeplitzOperator(c)
        require_positive_diagonal(float(c.flat[0]))
        self.shape = self.A.grid_shape
        mean = _real("mean", mean)
        try:
            self.mean = np.broadcast_to(mean, self.shape)
        except ValueError:
            raise ValueError(
                f"mean has shape {mean.shape}, but must broadcast to that of c, {self.shape}"
            ) from None
        if not np.isfinite(mean).all():
            raise ValueError("mean is not finite somewhere")
        self._whole = Whole(self.A)

    def __repr__(self) -> str:
        return f"<ToeplitzNormal {' x '.join(map(str, self.shape))}>"

    @property
    def logdet(self) -> float:
        """The log-determinant of A, of one axis (see `toeplitz_logdet`)."""
        return observe(self._whole, None).logdet()

    def logpdf(self, y: ArrayLike, observed: ArrayLike | None = None) -> Any:
        """Return the logarithm of the probability density.

        Parameters
        ----------
        y : array_like of shape (..., n)
            One series, or many. Where it is not observed anything may stand, NaN too.
        observed : array_like of bool, of shape (n,), optional
            Where the series are observed, by default everywhere. The density is that of the
            observed values.

        Returns
        -------
        float, or ndarray of shape (...)

        Raises
        ------
        ValueError
            Where `y` is not finite at points that are observed, or has another shape. Where both
            more than 4096 points are missing and more than 4096 observed, and for fields of more
            than 4096 observed points: no exact way to the log-determinant is known that is fast.
        numpy.linalg.LinAlgError
            Where the covariance is not positive definite.

        Notes
        -----
        With gaps it is exact: with B the rows and columns of A⁻¹ at the m missing points,
        log det A_oo = log det A + log det B, at the cost of O(m² + m³/3) operations and of a
        product with A⁻¹ for each gap.

        Examples
        --------
        >>> import numpy as np
        >>> import toeplitz_mg as tmg
        >>> process = tmg.ToeplitzNormal([2.0, 1.0, 0.5])
        >>> y = [0.3, np.nan, -0.2]
        >>> round(float(process.logpdf(y, observed=~np.isnan(y))), 6)
        -2.541422
        """
        rows, mask, series = self._residuals(y, observed)
        known = observe(self._whole, mask)
        return self._logpdf(known, rows, known.solve(rows), mask).reshape(series)[()]

    def logpdf_and_grad(
        self, y: ArrayLike, observed: ArrayLike | None = None
    ) -> tuple[Any, Array, Array]:
        """Return the logarithm of the probability density and its derivatives.

        Parameters
        ----------
        y, observed
            As in `logpdf`.

        Returns
        -------
        value : float, or ndarray of shape (...)
            As of `logpdf`.
        by_c : ndarray of shape (..., n)
            Derivatives by the covariances c[k]. That by a parameter of c is the inner product with
            the derivatives of c.
        by_y : ndarray of shape (..., n)
            Derivatives by the values, zero where they are not observed. Those by the means are the
            same with the other sign.

        Raises
        ------
        ValueError, numpy.linalg.LinAlgError
            As by `logpdf`.

        Notes
        -----
        With α = A⁻¹ (y - mean) and the sums D_k = Σ_i (A⁻¹)_(i,i+k), the derivative by c_k is
        Σ_i α_i α_(i+k) - D_k, for k = 0 half of that. With m missing points it costs m products
        with A⁻¹ more.
        """
        rows, mask, series = self._residuals(y, observed)
        known = observe(self._whole, mask)
        value = self._logpdf(known, rows, X := known.solve(rows), mask)
        by_c = np.concatenate([correlations(x, x)[np.newaxis] for x in X]) - known.diagonal_sums()
        by_c[:, 0] *= 0.5
        shape = (*series, *self.shape)
        return value.reshape(series)[()], by_c.reshape(shape), -X.reshape(shape)

    def conditional(self, y: ArrayLike, observed: ArrayLike | None = None) -> "Conditional":
        """Return the distribution of all points, given those that are observed (kriging).

        Parameters
        ----------
        y : array_like of the shape of `c`
            Where it is not observed anything may stand, NaN too.
        observed : array_like of bool, of the shape of `c`, optional
            Where it is observed, by default where it is not NaN.

        Returns
        -------
        Conditional
            With an attribute `mean`, the estimate at each point, and a method `rvs`.

        Raises
        ------
        ValueError
            Where `y` is not finite at a point that is observed, or has another shape.
        numpy.linalg.LinAlgError
            Where the covariance is not positive definite.

        Notes
        -----
        Where more than 4096 points are missing, and observed, and with several axes, the systems
        are solved by CG with `default_preconditioner`. A draw is a sample x of the process plus
        the estimate of what is missing from y - x.

        Examples
        --------
        >>> import numpy as np
        >>> import toeplitz_mg as tmg
        >>> process = tmg.ToeplitzNormal(np.exp(-np.arange(5.0)))
        >>> given = process.conditional([1.0, np.nan, np.nan, np.nan, 1.0])
        >>> given.mean.round(3)
        array([1.   , 0.41 , 0.266, 0.41 , 1.   ])
        >>> given.rvs(3, random_state=0).shape
        (3, 5)
        """
        values = _real("y", y)
        if values.shape != self.shape:
            raise ValueError(f"y has shape {values.shape}, but must be of that of c, {self.shape}")
        if observed is None:
            observed = ~np.isnan(values)
        rows, mask, _ = self._residuals(values, observed)
        return Conditional(self, observe(self._whole, mask), mask, rows[0])

    def rvs(self, size: int | tuple[int, ...] = 1, random_state: Any = None) -> Array:
        """Draw samples.

        Parameters
        ----------
        size : int or tuple of int, optional
            How many.
        random_state : int, numpy.random.Generator or RandomState, optional
            Where the random numbers come from: a generator, or the seed of one.

        Returns
        -------
        ndarray of shape ``(*size, n)``
            Without the first axis where `size` is 1.

        Raises
        ------
        numpy.linalg.LinAlgError
            Where the covariance is not positive definite. With several axes also where its mirror
            images do not continue it to that of a periodic field: the message names the size of a
            grid on which it has decayed, as is needed.

        Notes
        -----
        A sample is a part of one of a periodic process on a larger grid, whose covariance has the
        eigenvalues of a circulant. Where the covariance, continued by its mirror image, has no
        negative one, the samples are exact. Else, with one axis, it is continued as that of an
        autoregressive process, whose spectral density is positive. What `sampling_error` says was
        measured, and is at most 1e-6. No eigenvalue that is negative beyond rounding
        is ever set to zero.
        """
        shape = (size,) if np.ndim(size) == 0 else tuple(size)  # type: ignore[arg-type]
        shape = tuple(count("size", k, least=0) for k in shape)
        rows = self._embedding.draw(int(np.prod(shape)), _generator(random_state)) + self.mean
        return rows.reshape(self.shape if shape == (1,) else (*shape, *self.shape))

    @property
    def sampling_error(self) -> float:
        """The largest error of a covariance of the samples, in units of the variance."""
        return self._embedding.error

    @cached_property
    def _embedding(self) -> Embedding:
        if len(self.shape) > 1:
            return embed_field(self.A.c)
        embedding = embed_in_circulant(self.A.c)
        return embedding or embed_by_column(self.A.c, self._whole.columns.x)

    def _logpdf(self, known: Observed, Y: Rows, X: Rows, mask: Mask | None) -> Array:
        """Return the logarithms of the densities of rows y, with X the rows A⁻¹ y."""
        size = Y.shape[1] if mask is None else int(np.count_nonzero(mask))
        constant = known.logdet() + size * float(np.log(2.0 * np.pi))
        return -0.5 * (np.vecdot(Y, X) + constant)

    def _residuals(
        self, y: ArrayLike, observed: ArrayLike | None
    ) -> tuple[Rows, Mask | None, tuple[int, ...]]:
        """Return y - mean as rows, zero where not observed; the mask; the shape of the series."""
        values = _real("y", y)
        axes = len(self.shape)
        if values.shape[max(values.ndim - axes, 0) :] != self.shape:
            raise ValueError(
                f"y has shape {values.shape}, but its last axes must be those of c, {self.shape}"
            )
        mask = None if observed is None else check_mask(observed, self.shape)
        wrong = ~np.isfinite(values)
        if mask is not None:
            wrong &= mask
        if wrong.any():
            _refuse_positions(wrong, observed is None)
        rows = values - self.mean
        if mask is not None:
            rows[..., ~mask] = 0.0
        return rows.reshape(-1, self.A.shape[0]), mask, values.shape[: values.ndim - axes]


@dataclass(frozen=True)
class Conditional:
    """The distribution of all points of a process, given those that are observed."""

    process: ToeplitzNormal
    known: Observed
    mask: Mask | None
    residual: Array

    @cached_property
    def mean(self) -> Array:
        """The mean at each point: where it is observed, the value itself."""
        return self._estimate(self.residual[np.newaxis])[0] + self.process.mean

    def rvs(self, size: int | tuple[int, ...] = 1, random_state: Any = None) -> Array:
        """Draw samples, as `ToeplitzNormal.rvs` does; each costs a solve."""
        process = self.process
        X = process.rvs(size, random_state) - process.mean
        rows = X.reshape(-1, self.residual.size)
        return X + self._estimate(self.residual - rows).reshape(X.shape) + process.mean

    def _estimate(self, Y: Rows) -> Array:
        """Return the means of the points, given rows at those that are observed."""
        if self.mask is None:
            return Y.reshape(-1, *self.process.shape)
        inside = self.mask.ravel()
        Y = np.where(inside, Y, 0.0)
        X = self.process.A.apply(self.known.solve(Y))
        X[:, inside] = Y[:, inside]
        return X.reshape(-1, *self.process.shape)


def _real(name: str, values: ArrayLike) -> Array:
    """Return an array of real numbers in double precision."""
    array = refuse_masked(name, values)
    if array.dtype.kind not in "buif":
        raise TypeError(f"{name} has dtype {array.dtype}, but must be of real numbers")
    return array.astype(np.float64)


def _generator(random_state: Any) -> Any:
    if hasattr(random_state, "standard_normal"):
        return random_state
    return np.random.default_rng(random_state)


def _refuse_positions(wrong: Array, everywhere: bool) -> None:
    """Raise the ValueError that says where y is not finite."""
    positions = [tuple(map(int, p)) if len(p) > 1 else int(p[0]) for p in np.argwhere(wrong)]
    named = ", ".join(map(str, positions[:SHOWN]))
    more = f" and {len(positions) - SHOWN} more positions" if len(positions) > SHOWN else ""
    advice = ": say what is observed, as by observed=~np.isnan(y)" if everywhere else ""
    raise ValueError(f"y is not finite at {named}{more}, but must be where it is observed{advice}")
