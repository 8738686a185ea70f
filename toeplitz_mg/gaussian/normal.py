"""The normal distribution of a stationary process on a grid."""

from functools import cached_property
from math import prod
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from toeplitz_mg._typing import Array, Mask, Rows, Series
from toeplitz_mg.columns.schur import schur_column, whiten_rows
from toeplitz_mg.covariances import Covariance
from toeplitz_mg.gaussian.conditional import Conditional, Prediction
from toeplitz_mg.gaussian.elsewhere import ArrayNormal
from toeplitz_mg.gaussian.fitting import NormalFit, fit_normal, spread_mean
from toeplitz_mg.gaussian.labels import fill
from toeplitz_mg.gaussian.observed import (
    INEXACT,
    LOST,
    Few,
    Observed,
    Whole,
    doubt_of_form,
    doubt_of_gaps,
    largest_dense,
    observe,
    warn,
)
from toeplitz_mg.gaussian.sampling import Embedding, Recursion, embed
from toeplitz_mg.gaussian.stochastic import estimate_logdet
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.operators.coefficients import Coefficients
from toeplitz_mg.operators.toeplitz import warn_of_dense
from toeplitz_mg.values import count, generator, is_foreign, is_traced, numbers, refuse_masked

SHOWN = 5  # Number of positions that an error message lists.


class ToeplitzNormal:
    """A multivariate normal distribution whose covariance matrix is Toeplitz.

    It describes a stationary Gaussian process on a regular grid: a time series or a random field.
    It has `logpdf` and `rvs`, like a frozen distribution of `scipy.stats`, but takes O(n log n)
    instead of the O(n³) of `scipy.stats.multivariate_normal`.

    Parameters
    ----------
    c : array_like of shape (n,) or (n1, n2, ...)
        Covariances at the lags 0, 1, …: the first column of the covariance matrix, real. With
        several axes they are even in the lag along each axis. For arrays of CuPy, torch and JAX,
        the methods accept and return arrays of that library, and `logpdf` can be differentiated by
        `jax.grad`.
    mean : array_like, optional
        A number, or an array that broadcasts to the shape of `c`.
    noise : array_like of the shape of `c`, optional
        Noise variances that differ from point to point; they are added to the diagonal of A. Noise
        with the same variance everywhere belongs in c[0].

    Attributes
    ----------
    A : ToeplitzOperator
        The covariance matrix, without `noise`, in double precision.
    mean, noise : ndarray of the shape of `c`
        `noise` is None without noise.
    shape : tuple of int

    Raises
    ------
    TypeError, ValueError
        If an argument is not real or not finite, or the shapes do not match.
    numpy.linalg.LinAlgError
        If c[0] is not positive; in methods, if the matrix is not positive definite, exactly or in
        float64. A larger c[0] (a nugget) helps.

    See Also
    --------
    NormalFit : the result of `fit`.
    toeplitz_logdet, toeplitz_inverse : the same linear algebra for any Toeplitz matrix.

    References
    ----------
    C. R. Dietrich, G. N. Newsam, Fast and exact simulation of stationary Gaussian processes through
    circulant embedding of the covariance matrix, SIAM J. Sci. Comput. 18 (1997).

    Examples
    --------
    >>> import numpy as np
    >>> import toeplitz_mg as tmg
    >>> process = tmg.ToeplitzNormal(0.5 ** np.arange(1000), mean=3.0)
    >>> y = process.rvs(random_state=0)
    >>> round(float(process.logpdf(y)), 3)
    -1253.44
    """

    def __new__(cls, c: Any = None, mean: Any = 0.0, noise: Any = None) -> Any:
        """Return an `ArrayNormal` if the covariances are an array of another library."""
        return ArrayNormal(cls, c, mean, noise) if is_foreign(c) else super().__new__(cls)

    def __init__(self, c: ArrayLike, mean: ArrayLike = 0.0, noise: ArrayLike | None = None) -> None:
        if isinstance(c, Covariance):
            raise TypeError(f"c is {c!r}, but must be its covariances: use c(n)")
        c = numbers("c", c)
        self.A = ToeplitzOperator(Coefficients.of_column(c))
        warn_of_dense(c, stacklevel=3)
        variance = float(c.flat[0])
        if not variance > 0.0:
            raise np.linalg.LinAlgError(
                f"c[0], the diagonal of the covariance matrix, is {variance:g}, but must be "
                "positive: it is the variance, a nugget included"
            )
        self.shape = self.A.grid_shape
        self.mean = spread_mean(mean, self.shape)
        self.noise = None if noise is None else _check_noise(noise, self.shape)
        self._whole = Whole(self.A)

    @classmethod
    def fit(
        cls,
        y: Any,
        covariance: Covariance,
        mean: Any = "constant",
        X: Any = None,
        *,
        spacing: float | tuple[float, ...] = 1.0,
        method: str = "ml",
        maxiter: int = 100,
    ) -> NormalFit:
        """Estimate the parameters of a covariance and of a mean from a series, also with gaps.

        Parameters
        ----------
        y : array_like of shape (n,) or (n1, n2, ...), masked array, or pandas.Series
            One series or field. Missing values are NaN or masked. An array of two axes is a field,
            also one of shape (n, 2): give several series one after the other. A DataFrame of one
            column is its Series.
        covariance : Covariance
            A covariance from `toeplitz_mg.covariances`; its parameter values are the initial guess.
        mean : {"constant", "linear"} or array_like, optional
            The mean to estimate in addition to X, or the mean itself if it is known.
        X : array_like of shape (n,), (n, k) or (n1, n2, ..., k), optional
            Regressors, one per column. The columns of a DataFrame give their names.
        spacing : float, or tuple of float, optional
            Distance between neighbours, one for all axes or one per axis: the unit of lengths,
            periods and slopes.
        method : {"ml", "reml"}, optional
            Maximum likelihood, or restricted maximum likelihood: that of the contrasts of y that do
            not depend on the mean, whose variance estimates are less biased.
        maxiter : int, optional
            Limit of iterations.

        Returns
        -------
        NormalFit

        Raises
        ------
        ValueError
            If parameters or regressors are not identifiable; if the index of a Series does not have
            equal steps; and as for `logpdf`.
        numpy.linalg.LinAlgError
            If the covariance is not positive definite at the initial guess.

        Warns
        -----
        scipy.optimize.OptimizeWarning
            If the iteration has not converged, a parameter has reached a bound, or parameters are
            not identifiable at the estimate. Otherwise a LinAlgWarning, as for `logpdf`.

        Notes
        -----
        The coefficients of the mean are generalised least squares estimates. The covariance
        parameters are found by `scipy.optimize.minimize` with a trust region and exact gradients;
        those with a bound by their logarithms, several `ar` or `ma` coefficients by their
        reflection coefficients. The curvature is the average information of AI-REML, in long
        searches differences of gradients. Standard errors are from the exact Fisher information.

        Examples
        --------
        >>> import toeplitz_mg as tmg
        >>> from toeplitz_mg.covariances import Exponential, WhiteNoise
        >>> covariance = Exponential(4.0, length=9.0) + WhiteNoise(1.0)
        >>> y = tmg.ToeplitzNormal(covariance(800), mean=5.0).rvs(random_state=0)
        >>> y[300:350] = float("nan")
        >>> tmg.ToeplitzNormal.fit(y, Exponential() + WhiteNoise())
        <NormalFit 0.variance 3.693, 0.length 7.596, 1.variance 0.9778, mean 4.8>
        """
        return fit_normal(cls, y, covariance, mean, X, spacing, method, maxiter)

    def __repr__(self) -> str:
        return f"<ToeplitzNormal {' x '.join(map(str, self.shape))}>"

    @property
    def logdet(self) -> float:
        """The log-determinant of A, including `noise` (see `toeplitz_logdet`)."""
        known = self._observe(np.ones(self.shape, dtype=bool))
        warn(known.doubt, stacklevel=2)
        return known.logdet()

    @property
    def logdet_error(self) -> float:
        """The estimated error of `logdet` (one axis); that of a log-density is half as large."""
        if len(self.shape) > 1 or self.noise is not None:
            what = f"{len(self.shape)} axes" if self.noise is None else "noise that differs"
            raise ValueError(f"c has {what}, but the error is estimated for one axis without noise")
        return self._whole.log_determinant.error

    @overload
    def logpdf(self, y: Series, observed: ArrayLike | None = ...) -> float: ...
    @overload
    def logpdf(self, y: ArrayLike, observed: ArrayLike | None = ...) -> Any: ...
    def logpdf(self, y: ArrayLike, observed: ArrayLike | None = None) -> Any:
        """Return the logarithm of the probability density.

        Parameters
        ----------
        y : array_like of shape (..., n)
            One series, or many with the same gaps, marked by NaN or a mask.
        observed : array_like of bool, of shape (n,), optional
            Where the series are observed; by default where they are not NaN. Values elsewhere are
            ignored. The density is that of the observed values.

        Returns
        -------
        float, or ndarray of shape (...)

        Raises
        ------
        ValueError
            If an observed value of `y` is not finite, or its shape does not match. For fields,
            series with more than 4096 missing points, and noise that differs from point to point:
            if the dense matrix of the observed points would take more than a quarter of the memory.
        numpy.linalg.LinAlgError
            If the covariance is not positive definite.

        Warns
        -----
        scipy.linalg.LinAlgWarning
            If the estimated error of the log-determinant is large (see `toeplitz_logdet`), or the
            rounding error of (y - mean)ᵀ A⁻¹ (y - mean) may be 1e-3 n.

        Examples
        --------
        >>> import toeplitz_mg as tmg
        >>> process = tmg.ToeplitzNormal([2.0, 1.0, 0.5])
        >>> round(float(process.logpdf([0.3, float("nan"), -0.2])), 6)
        -2.541422
        """
        if is_traced(y):
            return ArrayNormal(type(self), self.A.c, self.mean, self.noise).logpdf(y, observed)
        value, _, _ = self._logpdf(y, observed)
        return value[()]

    def logpdf_and_grad(
        self, y: ArrayLike, observed: ArrayLike | None = None
    ) -> tuple[Any, Array, Array]:
        """Return the logarithm of the probability density and its derivatives.

        The arguments are those of `logpdf`. For a long gap in a smooth process the derivatives by c
        lose digits; there is a warning if their relative error may exceed 1e-8.

        Returns
        -------
        value : float, or ndarray of shape (...)
        by_c : ndarray of shape (..., n)
            Derivatives by the covariances c[k]. The derivative by a parameter of c is the inner
            product with the derivatives of c, over all axes.
        by_y : ndarray of shape (..., n)
            Derivatives by the values, zero where they are not observed. The derivatives by the mean
            are the same with the opposite sign.

        Notes
        -----
        With α = A⁻¹ (y - mean), the derivative by c_k is Σ_i α_i α_(i+k) - Σ_i (A⁻¹)_(i,i+k), for
        k = 0 half of that.

        Examples
        --------
        The derivative by the variance s of the covariance s 2⁻ᵏ vanishes at its estimate.

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
        doubt = doubt_of_gaps("the derivatives by c", LOST * known.rounding, INEXACT)
        warn(doubt, stacklevel=2)
        shape = (*value.shape, *self.shape)
        return value[()], by_c.reshape(shape), -X.reshape(shape)

    def logpdf_estimate(
        self,
        y: ArrayLike,
        observed: ArrayLike | None = None,
        probes: int = 32,
        random_state: Any = None,
    ) -> tuple[Any, float]:
        """Estimate `logpdf` with noise that differs from point to point, on one axis of any length.

        Parameters
        ----------
        y, observed
            As for `logpdf`. At most 4096 points may be missing, or observed.
        probes : int
            Number of random vectors, at least 3; each costs some hundred products with A.
        random_state
            As for `rvs`.

        Returns
        -------
        value : float, or ndarray of shape (...)
        error : float
            The standard error of each value, which is that of the log-determinant. It is estimated
            by Lanczos' method on samples of the process with the mean noise.

        Examples
        --------
        >>> import numpy as np
        >>> import toeplitz_mg as tmg
        >>> process = tmg.ToeplitzNormal(0.5 ** np.arange(300), noise=np.linspace(0.1, 0.3, 300))
        >>> value, error = process.logpdf_estimate(np.zeros(300), random_state=0)
        >>> bool(error < 1.0 and abs(value - process.logpdf(np.zeros(300))) < 4.0 * error)
        True
        """
        if self.noise is None or len(self.shape) > 1:
            raise ValueError("logpdf_estimate is for one axis with noise that differs: use logpdf")
        rows, mask, lead = _check_series(y, observed, self.mean)
        least = 1e-3 * self.noise.mean() + 1e-300
        level = float(np.exp(np.log(np.maximum(self.noise, least)).mean()))
        equal = ToeplitzNormal(self.A.c + level * np.eye(1, self.A.shape[0])[0])
        draws = equal.rvs((count("probes", probes, least=3),), random_state)
        known = observe(equal._whole, mask)
        logdet, error = estimate_logdet(equal.A, known, mask, self.noise - level, draws)
        _, squares = observe(self._whole, mask, self.noise).solve(rows)
        value: Array = -0.5 * (squares + logdet + mask.sum() * np.log(2.0 * np.pi))
        return value.reshape(lead)[()], 0.5 * error

    def whiten(self, y: ArrayLike, observed: ArrayLike | None = None) -> Array:
        """Transform a series of this process to independent standard normal numbers.

        The arguments are those of `logpdf`; one axis only.

        Returns
        -------
        ndarray of the shape of `y`
            L⁻¹ (y - mean), where L is the lower Cholesky factor of A: the error of the prediction
            of each number from those before it, divided by its standard deviation. NaN in gaps. The
            cost is O(n log² n); with gaps or noise that differs from point to point, that of a
            dense factorisation.

        Examples
        --------
        >>> import toeplitz_mg as tmg
        >>> tmg.ToeplitzNormal([1.0, 0.8, 0.64]).whiten([1.0, 0.8, 1.24]).round(6) + 0.0
        array([1., 0., 1.])
        """
        rows, mask, lead = _check_series(y, observed, self.mean)
        self._require_line("whiten")
        if mask.all() and self.noise is None:
            return whiten_rows(self.A.c, rows).reshape(*lead, *self.shape)
        return self._factorise(mask).whiten(rows).reshape(*lead, *self.shape)

    def colorize(self, z: ArrayLike) -> Array:
        """Return mean + L z, the series that `whiten` transforms to z, in O(n²).

        If z, array_like of shape (..., n), is standard normal, the series is a sample.

        Examples
        --------
        >>> import toeplitz_mg as tmg
        >>> tmg.ToeplitzNormal([1.0, 0.8, 0.64], mean=5.0).colorize([1.0, 0.0, 0.0]).round(6)
        array([6.  , 5.8 , 5.64])
        """
        everywhere = np.ones(self.shape, dtype=bool)
        rows, _, lead = _check_series(numbers("z", z), everywhere, np.zeros(self.shape))
        self._require_line("colorize")
        if self.noise is None:
            Y = Recursion(self.A.c, schur_column(self.A.c)[1]).colour(rows)
        else:
            Y = self._factorise(everywhere).colorize(rows)
        return Y.reshape(*lead, *self.shape) + self.mean

    def conditional(self, y: ArrayLike, observed: ArrayLike | None = None) -> "Conditional":
        """Return the distribution of all points given the observed ones (kriging).

        The arguments are those of `logpdf`, for one series of any size. If more than 4096 points
        are missing and more than 4096 observed, and for several axes, the systems are solved by CG
        with `default_preconditioner`.

        Returns
        -------
        Conditional
            With the attributes `mean` (the estimate at each point), `variance` and `std`, and the
            methods `interval` and `rvs`. They are of y with its noise: at an observed point `mean`
            is the observed value.

        Examples
        --------
        >>> import toeplitz_mg as tmg
        >>> given = tmg.ToeplitzNormal([2.0, 1.0, 0.5]).conditional([1.0, float("nan"), 1.0])
        >>> given.mean.round(3), given.std.round(3)
        (array([1. , 0.8, 1. ]), array([0.   , 1.095, 0.   ]))
        """
        rows, mask, lead = _check_series(y, observed, self.mean)
        if lead:
            raise ValueError(
                f"y has shape {(*lead, *self.shape)}, but must have that of c, {self.shape}: one "
                "series"
            )
        known = observe(self._whole, mask, self.noise)
        return Conditional(self, known, mask, rows.reshape(self.shape))

    def forecast(self, y: ArrayLike, steps: int) -> Prediction:
        """Return the means and standard deviations of the next values of a series.

        Parameters
        ----------
        y : array_like of shape (m,)
            The series so far; gaps are NaN or masked.
        steps : int
            How many values to forecast. `c` must have at least m + steps covariances.

        Returns
        -------
        Prediction
            Arrays of shape (steps,): `mean`, `std` and the method `interval(confidence)`.

        Examples
        --------
        >>> import toeplitz_mg as tmg
        >>> tmg.ToeplitzNormal([1.0, 0.5, 0.25, 0.125]).forecast([1.0, 2.0], 2).mean
        array([1. , 0.5])
        """
        self._require_line("forecast")
        past = fill(y)
        n = past.size + count("steps", steps)
        if past.ndim != 1 or n > self.shape[0]:
            raise ValueError(
                f"y has shape {past.shape}, but must be one series of at most {self.shape[0]} - "
                f"{steps} numbers: c has {self.shape[0]} covariances"
            )
        noise = None if self.noise is None else self.noise[:n]
        process = ToeplitzNormal(self.A.c[:n], self.mean[:n], noise)
        given = process.conditional(np.append(past, np.full(steps, np.nan)))
        return Prediction(given.mean[-steps:], np.sqrt(given.warned_variance()[-steps:]))

    def leave_one_out(self, y: ArrayLike, observed: ArrayLike | None = None) -> Prediction:
        """Predict each value from all other observed values. The arguments are those of `logpdf`.

        Returns
        -------
        Prediction
            `mean` has the shape of `y`, `std` that of `c`. NaN in gaps.

        Notes
        -----
        With α = A_oo⁻¹ (y - mean) and the diagonal d of A_oo⁻¹, they are y - α/d and 1/√d. With m
        gaps, d takes m products with A⁻¹.

        Examples
        --------
        >>> import toeplitz_mg as tmg
        >>> tmg.ToeplitzNormal([1.0, 0.5, 0.25]).leave_one_out([1.0, 0.5, 1.0]).mean.round(3)
        array([0.25, 0.8 , 0.25])
        """
        rows, mask, lead = _check_series(y, observed, self.mean)
        known = self._observe(mask)
        X, _ = known.solve(rows)
        diagonal = known.inverse_diagonal()
        diagonal[~mask.ravel()] = np.nan
        mean = (rows - X / diagonal).reshape(*lead, *self.shape) + self.mean
        return Prediction(mean, 1.0 / np.sqrt(diagonal).reshape(self.shape))

    def rvs(self, size: int | tuple[int, ...] | None = 1, random_state: Any = None) -> Array:
        """Draw samples.

        Parameters
        ----------
        size : int or tuple of int, optional
            Number of samples. None is 1.
        random_state : int, numpy.random.Generator or RandomState, optional
            A random generator, or the seed of one.

        Returns
        -------
        ndarray of shape ``(*size, n)``
            Without the first axis if `size` is 1. The error of their covariances is
            `sampling_error`, at most 1e-6.

        Raises
        ------
        numpy.linalg.LinAlgError
            If the covariance is not positive definite. For several axes, also if it cannot be
            extended to a periodic field; the message names a grid that is large enough.

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
        if self.noise is not None:
            rows += np.sqrt(self.noise) * random.standard_normal(rows.shape)
        return rows.reshape(self.shape if shape == (1,) else (*shape, *self.shape))

    @property
    def sampling_error(self) -> float:
        """The largest error of a covariance of the samples, relative to the variance."""
        return self._embedding.error

    @cached_property
    def _embedding(self) -> Embedding | Recursion:
        return embed(self.A.c, lambda: self._whole.column.x)

    def _observe(self, mask: Mask) -> Observed:
        """Return the covariance of the observed points, dense if needed and memory allows."""
        return observe(self._whole, mask, self.noise, dense=largest_dense())

    def _factorise(self, mask: Mask) -> Few:
        """Return the dense factorisation for the observed points."""
        if mask.sum() > largest_dense():
            raise ValueError(
                f"{mask.sum()} points are observed, but with gaps or noise a dense matrix is "
                f"factorised, and {largest_dense()} points fill a quarter of the memory"
            )
        return Few(self.A, mask, self.noise)

    def _require_line(self, method: str) -> None:
        """Raise an error if there are several axes."""
        if len(self.shape) > 1:
            raise ValueError(f"c has {len(self.shape)} axes, but {method} is for one")

    def _logpdf(self, y: ArrayLike, observed: ArrayLike | None) -> tuple[Array, Rows, Observed]:
        """Return the log-densities, the rows A⁻¹ (y - mean), and the observed covariance."""
        rows, mask, lead = _check_series(y, observed, self.mean)
        known = self._observe(mask)
        constant = known.logdet() + np.log(2.0 * np.pi) * mask.sum()
        X, squares = known.solve(rows)
        warn(known.doubt, doubt_of_form(self.A, X, squares), stacklevel=3)
        return -0.5 * (squares + constant).reshape(lead), X, known


def _check_noise(noise: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return noise variances of this shape."""
    array = numbers("noise", noise)
    if array.shape != shape:
        raise ValueError(
            f"noise has shape {array.shape}, but must have that of c, {shape}: what is the same "
            "everywhere is added to c[0]"
        )
    if not (np.isfinite(array) & (array >= 0.0)).all():
        raise ValueError("noise is negative or not finite somewhere, but must be variances")
    return array


def _check_series(
    y: ArrayLike, observed: ArrayLike | None, mean: Array
) -> tuple[Rows, Mask, tuple[int, ...]]:
    """Return the rows y - mean (zero where not observed), the mask, and the batch shape."""
    residual, shape = fill(y), mean.shape
    lead = residual.shape[: max(residual.ndim - len(shape), 0)]
    if residual.shape != (*lead, *shape):
        raise ValueError(
            f"y has shape {residual.shape}, but its last axes must be those of c, {shape}"
        )
    missing = np.isnan(residual)
    if observed is None and missing.any():
        observed = ~missing.reshape(-1, *shape)[0]
        if (missing == observed).any():
            raise ValueError(
                "y has series with different gaps, but those of one call must have the same: give "
                "one after the other"
            )
    everywhere = np.ones(shape, dtype=bool)
    mask = refuse_masked("observed", everywhere if observed is None else observed).copy()
    if mask.dtype != np.bool_:
        raise TypeError(f"observed has dtype {mask.dtype}, but must be of booleans")
    if mask.shape != shape:
        raise ValueError(f"observed has shape {mask.shape}, but must have that of c, {shape}")
    if not mask.any():
        raise ValueError("y is observed nowhere, but must be somewhere")
    mask.flags.writeable = False
    residual -= mean
    residual[..., ~mask] = 0.0
    wrong = np.argwhere(~np.isfinite(residual)).tolist()
    if wrong:
        named = ", ".join(str(tuple(p) if len(p) > 1 else p[0]) for p in wrong[:SHOWN])
        more = f" and {len(wrong) - SHOWN} more positions" if len(wrong) > SHOWN else ""
        raise ValueError(f"y is not finite at {named}{more}, but must be where it is observed")
    return residual.reshape(-1, mean.size), mask, lead
