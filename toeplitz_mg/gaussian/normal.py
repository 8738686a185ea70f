"""The normal distribution of a stationary process on a grid."""

from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Mask, Rows
from toeplitz_mg.columns.schur import whiten_rows
from toeplitz_mg.gaussian.observed import (
    INEXACT,
    LOST,
    Observed,
    Whole,
    observe,
    warn_of_gaps,
    warn_of_rounding,
)
from toeplitz_mg.gaussian.sampling import Embedding, Recursion, embed
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.solvers.szego import warn_of_error
from toeplitz_mg.values import count, generator, numbers, refuse_masked

SHOWN = 5  # Positions that an error names.


class ToeplitzNormal:
    """A multivariate normal distribution whose covariance is a Toeplitz matrix.

    That is a stationary Gaussian process on a regular grid: a time series, or a random field. It is
    used by `logpdf` and `rvs`, as a frozen distribution of `scipy.stats`, and takes O(n log n)
    where `scipy.stats.multivariate_normal` takes O(n³).

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
        c = numbers("c", c)
        self.A = ToeplitzOperator(c)
        variance = float(c.flat[0])
        if not variance > 0.0:
            raise np.linalg.LinAlgError(
                f"c[0], the diagonal of the covariance matrix, is {variance:g}, but must be "
                "positive: it is the variance, a nugget included"
            )
        self.shape = self.A.grid_shape
        self.mean = _check_mean(mean, self.shape)
        self._whole = Whole(self.A)

    def __repr__(self) -> str:
        return f"<ToeplitzNormal {' x '.join(map(str, self.shape))}>"

    @property
    def logdet(self) -> float:
        """The log-determinant of A (see `toeplitz_logdet`)."""
        known = observe(self._whole, None)
        value = known.logdet()
        self._warn_of_error(known, stacklevel=4)
        return value

    @property
    def logdet_error(self) -> float:
        """An estimate of the error of `logdet`, of one axis.

        Half of it is that of a density, beside that of its quadratic form.
        """
        if len(self.shape) > 1:
            raise ValueError(f"c has {len(self.shape)} axes, but the error is estimated for one")
        return self._whole.log_determinant.error

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

        Warns
        -----
        scipy.linalg.LinAlgWarning
            Where the estimated error of the log-determinant is large (see `toeplitz_logdet`), or
            rounding may be 1e-3 n of (y - mean)ᵀ A⁻¹ (y - mean).

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
        value, _, _ = self._logpdf(y, observed)
        return value[()]

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
            the derivatives of c; of a field, the sum of the products of all entries.
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
        Σ_i α_i α_(i+k) - D_k, for k = 0 half of that. With gaps the derivatives of log det B by
        A⁻¹ e₁ give those by c with one more solve, and all takes two to three times as long as the
        value. Over a long gap of a smooth process their relative error grows as a tenth of
        eps ‖A⁻¹‖ ‖B⁻¹‖, of which there is a warning where that is above 1e-8.

        Examples
        --------
        The derivative by the variance s of the covariance s 2⁻ᵏ is zero at its estimate.

        >>> import numpy as np
        >>> import toeplitz_mg as tmg
        >>> c, y = 0.5 ** np.arange(3), [1.0, 0.5, -0.5]
        >>> s = np.mean(tmg.ToeplitzNormal(c).whiten(y) ** 2)
        >>> value, by_c, by_y = tmg.ToeplitzNormal(s * c).logpdf_and_grad(y)
        >>> bool(abs(by_c @ c) < 1e-12)
        True
        """
        value, X, known = self._logpdf(y, observed)
        by_c = known.by_covariances(X)
        warn_of_gaps("the derivatives by c", LOST * known.rounding, INEXACT, stacklevel=3)
        shape = (*value.shape, *self.shape)
        return value[()], by_c.reshape(shape), -X.reshape(shape)

    def whiten(self, y: ArrayLike) -> Array:
        """Return independent standard normal numbers in the place of a series of this process.

        Parameters
        ----------
        y : array_like of shape (..., n)
            One series, or many.

        Returns
        -------
        ndarray of the shape of `y`
            L⁻¹ (y - mean), with Cholesky's lower factor L of A: the error with which each number is
            predicted from those before it, over its standard deviation.

        Raises
        ------
        ValueError
            As by `logpdf`; or where c has several axes.
        numpy.linalg.LinAlgError
            Where the covariance is not positive definite.

        Notes
        -----
        In O(n log² n), by the superfast Schur algorithm (`toeplitz_mg.columns.schur`).

        Examples
        --------
        >>> import numpy as np
        >>> import toeplitz_mg as tmg
        >>> process = tmg.ToeplitzNormal(0.8 ** np.arange(4))
        >>> process.whiten([1.0, 0.8, 0.64, 1.112]).round(6) + 0.0
        array([1., 0., 0., 1.])
        """
        residual, _ = _check_series(y, None, self.mean, has_gaps=False)
        if len(self.shape) > 1:
            raise ValueError(
                f"c has {len(self.shape)} axes, but whiten is for one: no fast way is known for "
                "several"
            )
        rows = residual.reshape(-1, *self.shape)
        return whiten_rows(self.A.c, rows).reshape(residual.shape)

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
        if np.ma.isMaskedArray(y):
            raise TypeError("y is a masked array, but what is missing must be NaN: y.filled(nan)")
        values = numbers("y", y)
        if values.shape != self.shape:
            raise ValueError(
                f"y has shape {values.shape}, but must have that of c, {self.shape}: one series"
            )
        if observed is None:
            observed = ~np.isnan(values)
        mask = _check_observed(observed, self.shape)
        residual, _ = _check_series(values, mask, self.mean)
        return Conditional(self, observe(self._whole, mask), mask, residual)

    def rvs(self, size: int | tuple[int, ...] | None = 1, random_state: Any = None) -> Array:
        """Draw samples.

        Parameters
        ----------
        size : int or tuple of int, optional
            How many. None is 1.
        random_state : int, numpy.random.Generator or RandomState, optional
            Where the random numbers come from: a generator, or the seed of one.

        Returns
        -------
        ndarray of shape ``(*size, n)``
            Without the first axis where `size` is 1.

        Raises
        ------
        ValueError, TypeError
            For a size that is no count, or a seed that is none.
        numpy.linalg.LinAlgError
            Where the covariance is not positive definite. With several axes also where its mirror
            images do not continue it to that of a periodic field: the message names the size of a
            grid on which it has decayed, as is needed.

        Notes
        -----
        A sample is a part of one of a periodic process on a larger grid, whose covariance has the
        eigenvalues of a circulant. Where the covariance, continued by its mirror image, has no
        negative one, the samples are exact. Else, with one axis, it is continued as that of an
        autoregressive process, whose spectral density is positive; and where its covariance does
        not decay, as of a process that is periodic itself, each number is drawn from those before
        it, in O(n²). What `sampling_error` says was measured, and is at most 1e-6. No eigenvalue
        that is negative beyond rounding is ever set to zero.

        Examples
        --------
        >>> import toeplitz_mg as tmg
        >>> tmg.ToeplitzNormal([1.0, 0.5, 0.25]).rvs((2, 5), random_state=0).shape
        (2, 5, 3)
        """
        size = 1 if size is None else size
        shape = (size,) if np.ndim(size) == 0 else tuple(size)  # type: ignore[arg-type]
        shape = tuple(count("size", k, least=0) for k in shape)
        random = generator("random_state", random_state)
        rows = self._embedding.draw(prod(shape), random) + self.mean
        return rows.reshape(self.shape if shape == (1,) else (*shape, *self.shape))

    @property
    def sampling_error(self) -> float:
        """The largest error of a covariance of the samples, in units of the variance."""
        return self._embedding.error

    @cached_property
    def _embedding(self) -> Embedding | Recursion:
        return embed(self.A.c, lambda: self._whole.column.x)

    def _warn_of_error(self, known: Observed, stacklevel: int) -> None:
        """Warn where a log-determinant rests on one of the whole series that is inexact."""
        if known.log_determinant is not None:
            warn_of_error(known.log_determinant, self.A.shape[0], stacklevel)

    def _logpdf(self, y: ArrayLike, observed: ArrayLike | None) -> tuple[Array, Rows, Observed]:
        """Return the logarithms of the densities, the rows A⁻¹ (y - mean), and what is known."""
        residual, mask = _check_series(y, observed, self.mean)
        known = observe(self._whole, mask)
        rows = residual.reshape(-1, self.A.shape[0])
        X, squares = known.solve(rows)
        size = rows.shape[1] if mask is None else int(np.count_nonzero(mask))
        constant = known.logdet() + size * float(np.log(2.0 * np.pi))
        self._warn_of_error(known, stacklevel=5)
        warn_of_rounding(self.A.norm_bound, X, squares, stacklevel=4)
        value = -0.5 * (squares + constant)
        return value.reshape(residual.shape[: residual.ndim - len(self.shape)]), X, known


@dataclass(frozen=True, repr=False)
class Conditional:
    """The distribution of all points of a process, given those that are observed: kriging.

    Attributes
    ----------
    process : ToeplitzNormal
    known : Observed
        What is known of the covariance of the observed points.
    mask : ndarray of bool
        Where it is observed.
    residual : ndarray of the shape of `process`
        What was observed less the mean of the process, zero elsewhere.
    """

    process: ToeplitzNormal
    known: Observed
    mask: Mask
    residual: Array

    @cached_property
    def mean(self) -> Array:
        """The mean at each point: where it is observed, the value itself."""
        mean: Array = self._estimate(self.residual[np.newaxis])[0] + self.process.mean
        mean.flags.writeable = False
        return mean

    def rvs(self, size: int | tuple[int, ...] | None = 1, random_state: Any = None) -> Array:
        """Draw samples, as `ToeplitzNormal.rvs` does; each costs a solve."""
        process = self.process
        X = process.rvs(size, random_state) - process.mean
        fields = X.reshape(prod(X.shape[: -len(process.shape)]), *process.shape)
        return X + self._estimate(self.residual - fields).reshape(X.shape) + process.mean

    def __repr__(self) -> str:
        return f"<Conditional {self.process!r}, {np.count_nonzero(self.mask)} observed>"

    def _estimate(self, fields: Array) -> Array:
        """Return the means of the points, given fields at those that are observed."""
        inside = self.mask.ravel()
        Y: Rows = np.where(inside, fields.reshape(len(fields), inside.size), 0.0)
        X = self.known.estimate(Y)
        X[:, inside] = Y[:, inside]
        return X.reshape(fields.shape)


def _check_mean(mean: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return means of this shape."""
    array = numbers("mean", mean)
    if not np.isfinite(array).all():
        raise ValueError("mean is not finite somewhere")
    try:
        return np.broadcast_to(array, shape)
    except ValueError:
        raise ValueError(
            f"mean has shape {array.shape}, but must broadcast to that of c, {shape}"
        ) from None


def _check_series(
    y: ArrayLike, observed: ArrayLike | None, mean: Array, *, has_gaps: bool = True
) -> tuple[Array, Mask | None]:
    """Return y - mean, zero where it is not observed, of one or many series; and the mask."""
    residual = numbers("y", y)
    shape = mean.shape
    if residual.shape[max(residual.ndim - len(shape), 0) :] != shape:
        raise ValueError(
            f"y has shape {residual.shape}, but its last axes must be those of c, {shape}"
        )
    mask = None if observed is None else _check_observed(observed, shape)
    residual -= mean
    if mask is not None:
        residual[..., ~mask] = 0.0
    wrong = ~np.isfinite(residual)
    if wrong.any():
        _refuse_positions(wrong, has_gaps and mask is None)
    return residual, mask


def _check_observed(observed: ArrayLike, shape: tuple[int, ...]) -> Mask:
    """Return a copy, that cannot be changed, of the mask of what is observed."""
    mask = refuse_masked("observed", observed)
    if mask.dtype != np.bool_:
        raise TypeError(f"observed has dtype {mask.dtype}, but must be of booleans")
    if mask.shape != shape:
        raise ValueError(f"observed has shape {mask.shape}, but must have that of c, {shape}")
    if not mask.any():
        raise ValueError("y is observed nowhere, but must be somewhere")
    mask = mask.copy()
    mask.flags.writeable = False
    return mask


def _refuse_positions(wrong: Array, everywhere: bool) -> None:
    """Raise the ValueError that says where y is not finite."""
    positions = [tuple(map(int, p)) if len(p) > 1 else int(p[0]) for p in np.argwhere(wrong)]
    named = ", ".join(map(str, positions[:SHOWN]))
    more = f" and {len(positions) - SHOWN} more positions" if len(positions) > SHOWN else ""
    advice = ": say what is observed, as by observed=~np.isnan(y)" if everywhere else ""
    raise ValueError(f"y is not finite at {named}{more}, but must be where it is observed{advice}")
