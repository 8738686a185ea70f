"""Fits of a covariance and a mean to a series: estimates, standard errors, predictions."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
from scipy.special import ndtr

from toeplitz_mg._typing import Array, Rows
from toeplitz_mg.covariances import Covariance
from toeplitz_mg.covariances.base import Lags
from toeplitz_mg.gaussian.conditional import Prediction, quantile
from toeplitz_mg.gaussian.labels import Labels
from toeplitz_mg.gaussian.observed import doubt_of_form, warn
from toeplitz_mg.gaussian.scoring import Data, Point, Search, Transform, find_dependent
from toeplitz_mg.operators import ToeplitzOperator
from toeplitz_mg.values import count, in_range, numbers, real

METHODS = "ml", "reml"
TRENDS = "constant", "linear"
RANK = 1e-10  # A regressor is linearly dependent if a smaller part of it is independent.
ROUNDING = 1e-9  # Negative variances down to this, relative to the variance, are rounding errors.
WIDTH = 78  # Line width of a summary, characters.
EDGES = {"ar": "stationarity", "ma": "invertibility"}  # What the bounds of coefficients mean.
UNKNOWN = "the parameters cannot be told apart at the estimate"


@dataclass(frozen=True)
class Mean:
    """The mean of a fit: a known offset plus regressors."""

    trend: str  # One of `TRENDS`, or empty.
    offset: Array  # Broadcasts to the shape of the grid.
    X: Array  # The given regressors, of shape (n, k), or for fields (n1, n2, ..., k).
    names: tuple[str, ...]  # Names of all coefficients.
    spacing: tuple[float, ...]

    @classmethod
    def of(cls, mean: Any, X: Any, shape: tuple[int, ...], spacing: tuple[float, ...]) -> "Mean":
        """Check the user's arguments."""
        trend = mean if isinstance(mean, str) else ""
        offset = np.zeros(()) if trend else numbers("mean", mean)
        if trend and trend not in TRENDS:
            raise ValueError(f"mean is {mean!r}, but must be one of {TRENDS}, or numbers")
        columns = np.empty((*shape, 0)) if X is None else _columns(X, shape)
        given = getattr(X, "columns", [f"x{k + 1}" for k in range(columns.shape[-1])])
        slopes = ["slope"] if len(shape) == 1 else [f"slope.{k}" for k in range(len(shape))]
        names = ["mean"] * bool(trend) + slopes * (trend == "linear") + [*map(str, given)]
        spread_mean(offset, shape)
        return cls(trend, offset, columns, tuple(names), spacing)

    def rows(self, shape: tuple[int, ...], more: Any = None) -> Rows:
        """Return the regressors on a grid as rows; `more` are those of the forecast steps."""
        trend = np.ones((int(bool(self.trend)), *shape))
        if self.trend == "linear":
            points = np.indices(shape, dtype=np.float64)
            trend = np.concatenate([trend, (points.T * self.spacing).T])
        steps, X = shape[0] - len(self.X), self.X
        if X.shape[-1] and steps:
            if more is None:
                raise ValueError(f"X is not given for the {steps} steps that follow, but must be")
            X = np.concatenate([X, _columns(more, (steps,), X.shape[-1])])
        return np.concatenate(
            [trend.reshape(len(trend), prod(shape)), X.reshape(prod(shape), -1).T]
        )


@dataclass(frozen=True, repr=False)
class NormalFit:
    """A fitted covariance and mean: the result of `ToeplitzNormal.fit`.

    Attributes
    ----------
    process : ToeplitzNormal
    covariance : Covariance
        The distribution and the covariance with the estimated parameters.
    params : dict of str to float
        The estimates: the parameters of the covariance, then the coefficients of the mean.
    params_covariance : ndarray
        Their covariance matrix in this order, the inverse of the Fisher information. NaN for
        parameters at a bound, and for parameters that are not identifiable at the estimate.
    loglikelihood : float
        The logarithm of the (restricted) likelihood.
    method : str
        "ml" or "reml".
    spacing : tuple of float
        Distance between neighbours along each axis.
    n_observed : int
        The number of observed values.
    converged : bool
    iterations : int
        Whether the maximum of the likelihood was found, and the number of iterations.
    at_bounds : tuple of str
        Parameters whose estimate is at a bound: all coefficients of an `ar` or `ma` part whose
        estimate is at the edge of stationarity or invertibility.

    See Also
    --------
    ToeplitzNormal : the distribution; its `fit` returns this.
    """

    process: Any
    covariance: Any
    params: dict[str, float]
    params_covariance: Array
    loglikelihood: float
    method: str
    spacing: tuple[float, ...]
    n_observed: int
    converged: bool
    iterations: int
    at_bounds: tuple[str, ...]
    _mean: Mean
    _labels: Labels

    def __repr__(self) -> str:
        return f"<NormalFit {', '.join(f'{name} {x:.4g}' for name, x in self.params.items())}>"

    @property
    def std_errors(self) -> dict[str, float]:
        """The standard errors of the estimates."""
        errors = np.sqrt(self.params_covariance.diagonal())
        return dict(zip(self.params, errors.tolist(), strict=True))

    @property
    def aic(self) -> float:
        """Akaike's information criterion; with "reml", coefficients do not count as parameters."""
        return 2.0 * self._sizes[0] - 2.0 * self.loglikelihood

    @property
    def bic(self) -> float:
        """The Bayesian information criterion; with "reml", coefficients do not count."""
        return float(np.log(self._sizes[1])) * self._sizes[0] - 2.0 * self.loglikelihood

    @property
    def _sizes(self) -> tuple[int, int]:
        less = len(self._mean.names) if self.method == "reml" else 0
        return len(self.params) - less, self.n_observed - less

    def intervals(self, confidence: float = 0.95) -> dict[str, tuple[float, float]]:
        """Return confidence intervals of the estimates.

        For the covariance they are computed for transformed parameters (logarithms with one bound,
        logits with two), so that no interval leaves the bounds.
        """
        z, errors = quantile(confidence), np.array([*self.std_errors.values()])
        estimates, p = np.array([*self.params.values()]), len(self.covariance.theta)
        low, high = estimates - z * errors, estimates + z * errors
        transform = Transform.of(self.covariance)
        u = transform.forward(estimates[:p])
        margin = z * errors[:p] / transform.slopes(u).diagonal()
        low[:p], high[:p] = transform.back(u - margin), transform.back(u + margin)
        ends = zip(low.tolist(), high.tolist(), strict=True)
        return dict(zip(self.params, ends, strict=True))

    def predict(self, steps: int = 0, X: Any = None, *, noise: float | str = 0.0) -> Prediction:
        """Return the mean at each point given the observations, and forecasts after the last one.

        Parameters
        ----------
        steps : int, optional
            For a series, the number of points to forecast after the last one.
        X : array_like of shape (steps,) or (steps, k), optional
            The regressors at these points.
        noise : float or str, optional
            The variance of white noise in the covariance, or the name of that parameter: the
            prediction is then of the curve without noise.

        Returns
        -------
        Prediction
            With `mean`, `std` and `interval(confidence)`, for n + `steps` points. If `y` is a
            Series, they are Series with a continued index. Without `noise`, the mean at observed
            points is the observed value. Standard deviations include the uncertainty of the
            coefficients of the mean (universal kriging), but not that of the covariance parameters.

        Raises
        ------
        ValueError
            If the covariance has no such noise, or regressors for the steps are missing.

        Examples
        --------
        >>> import toeplitz_mg as tmg
        >>> from toeplitz_mg.covariances import Exponential
        >>> y = [0.0, 1.5, float("nan"), 2.0, 1.0, -0.5]
        >>> fit = tmg.ToeplitzNormal.fit(y, Exponential(length=2.0).fix("length"), mean=0.0)
        >>> fit.predict(steps=2).mean.round(3)
        array([ 0.   ,  1.5  ,  1.552,  2.   ,  1.   , -0.5  , -0.303, -0.184])
        """
        y, steps = self._labels.values, count("steps", steps, least=0)
        if steps and y.ndim > 1:
            raise ValueError(f"y has {y.ndim} axes, but only a series is forecast")
        y = np.append(y, np.full(steps, np.nan)) if steps else y
        if isinstance(noise, str) and noise not in self.params:
            raise ValueError(f"noise is {noise!r}, but must be one of {', '.join(self.params)}")
        sigma2 = self.params[noise] if isinstance(noise, str) else real("noise", noise)
        rows = self._mean.rows(y.shape, X)
        c = self.covariance(y.shape, spacing=self.spacing)
        p, there = len(self.params) - len(rows), ~np.isnan(y).ravel()
        trend = (np.array([*self.params.values()])[p:] @ rows).reshape(y.shape)
        process = type(self.process)(c, spread_mean(self._mean.offset, y.shape) + trend)
        given = process.conditional(y)
        known, observed = given.known, rows * there
        mean, variance = given.mean.ravel(), given.warned_variance().ravel()
        left = rows - known.estimate(observed) if len(rows) else rows
        left[:, there] = 0.0
        if sigma2:
            solved, _ = known.solve(np.vstack([given.residual.ravel(), observed]))
            mean, variance = mean - sigma2 * solved[0], variance - sigma2
            left[:, there] = sigma2 * solved[1:, there]
            variance[there] += sigma2 * (2.0 - sigma2 * known.inverse_diagonal()[there])
            if not (sigma2 > 0.0 and variance.min() > -ROUNDING * c.flat[0]):
                raise ValueError(f"noise is {sigma2:g}, but the covariance has no such white noise")
        variance = variance + np.einsum("in,ij,jn->n", left, self.params_covariance[p:, p:], left)
        std = np.sqrt(np.maximum(variance, 0.0))
        return Prediction(*(self._labels.wrap(x.reshape(y.shape)) for x in (mean, std)))

    def summary(self, confidence: float = 0.95) -> str:
        """Return a table of the estimates in the layout of statsmodels."""
        missing = self._labels.values.size - self.n_observed
        head = (
            ("Dep. Variable:", self._labels.name, "No. Observations:", self.n_observed),
            ("Model:", "ToeplitzNormal", "Log Likelihood", f"{self.loglikelihood:.3f}"),
            ("Method:", self.method.upper(), "AIC", f"{self.aic:.3f}"),
            ("Converged:", str(self.converged), "BIC", f"{self.bic:.3f}"),
            ("Missing:", missing, "Spacing", ", ".join(f"{each:g}" for each in self.spacing)),
        )
        lines = [f"{'Gaussian Process Results':^{WIDTH}}".rstrip(), "=" * WIDTH]
        lines += [f"{a:<16}{b:>22}  {c:<20}{d:>18}" for a, b, c, d in head]
        tail = f"[{0.5 - confidence / 2.0:.3g}", f"{0.5 + confidence / 2.0:.3g}]"
        heads = ("coef", "std err", "z", "P>|z|", *tail)
        wide = max(18, *map(len, self.params))
        lines += ["=" * WIDTH, " " * wide + "".join(f"{h:>10}" for h in heads), "-" * WIDTH]
        errors, intervals = self.std_errors, self.intervals(confidence)
        for name, x in self.params.items():
            z = x / errors[name] if errors[name] else np.nan
            row = _cell(x, 4), _cell(errors[name]), f"{z:.3f}", f"{2.0 * ndtr(-abs(z)):.3f}"
            cells = (*row, *map(_cell, intervals[name]))
            lines.append(f"{name:<{wide}}" + "".join(f"{cell:>10}" for cell in cells))
        lines.append("=" * WIDTH)
        lines += [f"{name} is at a bound: it has no standard error." for name in self.at_bounds]
        if {name for name, error in errors.items() if np.isnan(error)} - {*self.at_bounds}:
            lines.append(f"{UNKNOWN}: they have no standard errors.")
        return "\n".join(lines)

    def plot(
        self,
        ax: Any = None,
        *,
        steps: int = 0,
        X: Any = None,
        noise: float | str = 0.0,
        confidence: float = 0.95,
    ) -> Any:
        """Plot the observations, and the result of `predict` with its intervals.

        Returns the matplotlib.axes.Axes, which are `ax` or those of a new figure. Raises an
        ImportError if matplotlib is not installed (``pip install 'toeplitz-mg[plot]'``), and a
        ValueError for fields.
        """
        try:
            from matplotlib import pyplot as plt  # Optional, and slow to import.
        except ImportError as error:
            raise ImportError("plot() needs matplotlib: pip install 'toeplitz-mg[plot]'") from error
        y = self._labels.values
        if y.ndim > 1:
            raise ValueError(f"y has {y.ndim} axes, but plot draws a series")
        found = self.predict(steps, X, noise=noise)
        ax = plt.subplots(layout="compressed")[1] if ax is None else ax
        index = self._labels.index(steps, self.spacing[0])
        index = index.to_timestamp() if hasattr(index, "to_timestamp") else index
        label = f"{confidence:.0%} interval"
        ax.fill_between(index, *found.interval(confidence), alpha=0.3, label=label)
        ax.plot(index, found.mean, linewidth=1.0, label="mean")
        ax.plot(index[: len(y)], y, "k.", markersize=3.0, label="observed")
        ax.set_ylabel(self._labels.name)
        ax.legend()
        return ax


def fit_normal(
    kind: Callable[[Array, Array], Any],
    y: Any,
    covariance: Covariance,
    mean: Any,
    X: Any,
    spacing: Any,
    method: str,
    maxiter: int,
) -> NormalFit:
    """Return the result of `ToeplitzNormal.fit`; `kind` is this class."""
    if method not in METHODS:
        raise ValueError(f"method is {method!r}, but must be one of {METHODS}")
    if not isinstance(covariance, Covariance):
        what, use = f"of type {type(covariance).__name__}", "Custom is for a function of lags"
        if isinstance(covariance, type) and issubclass(covariance, Covariance):
            what, use = f"the class {covariance.__name__}", f"use {covariance.__name__}()"
        raise TypeError(
            f"covariance is {what}, but must be an object of toeplitz_mg.covariances: {use}"
        )
    labels = Labels.of(y)
    shape = labels.values.shape
    if not shape or not prod(shape) or np.isinf(labels.values).any():
        raise ValueError("y must be a series, or a field, of finite numbers, or NaN where missing")
    in_range("y", float(np.nanmax(np.abs(labels.values), initial=0.0)))
    model = Mean.of(mean, X, shape, Lags(shape, spacing).spacing)
    names = (*covariance.names, *model.names)
    if len({*names}) < len(names):
        raise ValueError(f"the parameters have the names {names}, but each must have its own")
    p = len(covariance.theta)
    data, R, start = _arrange(labels.values, model, p, method == "reml")
    search = Search(data, covariance, model.spacing, count("maxiter", maxiter))
    best = search.best
    params = np.append(search.theta, start + np.linalg.solve(R, best.coefficients))
    errors, is_known = _errors(search, best, R)
    at_bounds = tuple(np.asarray(covariance.names, dtype=object)[search.at_bound])
    _warn(search, best, at_bounds, is_known)
    trend = params[p:] @ model.rows(shape)
    fitted = covariance.with_theta(search.theta)
    return NormalFit(
        process=kind(best.c, spread_mean(model.offset, shape) + trend.reshape(shape)),
        covariance=fitted,
        params=dict(zip(names, params.tolist(), strict=True)),
        params_covariance=errors,
        loglikelihood=best.value,
        method=method,
        spacing=model.spacing,
        n_observed=int(np.count_nonzero(data.mask)),
        converged=search.converged,
        iterations=search.iterations,
        at_bounds=at_bounds,
        _mean=model,
        _labels=labels,
    )


def spread_mean(mean: Any, shape: tuple[int, ...]) -> Array:
    """Broadcast the mean to the grid."""
    array = _finite("mean", mean)
    try:
        return np.broadcast_to(array, shape)
    except ValueError:
        raise ValueError(
            f"mean has shape {array.shape}, but must broadcast to that of the grid, {shape}: "
            "regressors of a fit stand in X"
        ) from None


def _arrange(
    values: Array, model: Mean, parameters: int, restricted: bool
) -> tuple[Data, Array, Array]:
    """Return the observations, orthonormal regressors R⁻ᵀ X, R, and the least squares fit of X."""
    mask = ~np.isnan(values)
    inside, X = mask.ravel(), model.rows(values.shape)
    y = (values - spread_mean(model.offset, values.shape)).ravel()[inside]
    if len(y) <= len(X) + parameters:
        raise ValueError(
            f"y has {len(y)} observed values, but must have more than there are parameters, "
            f"{parameters} of the covariance and {len(X)} of the mean"
        )
    sizes = np.linalg.norm(X[:, inside], axis=1)
    Q, R = np.linalg.qr((X[:, inside] / np.where(sizes, sizes, 1.0)[:, np.newaxis]).T)
    wrong = np.abs(R.diagonal()) <= RANK
    if wrong.any():
        raise ValueError(
            f"the regressor {model.names[int(wrong.argmax())]} is a combination of those before it "
            f"where y is observed, but must not be: {', '.join(model.names)}; mean=0.0 leaves the "
            "constant out"
        )
    rows, residual = np.zeros(X.shape), np.zeros(inside.shape)
    rows[:, inside] = Q.T
    start = Q.T @ y
    residual[inside] = y - Q @ start
    if not np.linalg.norm(residual) > RANK * np.linalg.norm(y):
        raise ValueError("y is a combination of the regressors, and has no variance to estimate")
    R = R * sizes
    return Data(residual, rows, mask, restricted), R, np.linalg.solve(R, start)


def _errors(search: Search, best: Point, R: Array) -> tuple[Array, bool]:
    """Return the covariance matrix of the estimates, and whether they are identifiable."""
    p, inverse = len(search.u), np.linalg.inv(best.factor.T @ R)
    errors = np.full((p + len(R), p + len(R)), np.nan)
    errors[:p, p:] = errors[p:, :p] = 0.0
    errors[p:, p:] = inverse @ inverse.T
    if search.flat.all():
        return errors, True
    slopes = search.slopes[:, ~search.flat]  # By what is not at a bound.
    information = slopes.T @ best.information @ slopes
    if find_dependent(information).any():
        return errors, False
    inside = np.ix_(*2 * [np.flatnonzero(~search.at_bound)])
    errors[inside] = (slopes @ np.linalg.inv(information) @ slopes.T)[inside]
    return errors, True


def _warn(search: Search, best: Point, at_bounds: tuple[str, ...], is_known: bool) -> None:
    """Issue one warning that lists everything doubtful about a fit."""
    from scipy.optimize import OptimizeWarning  # Slow to import.

    doubts = []
    if not search.converged:
        doubts.append(
            f"the fit has not converged in {search.iterations} steps: start from other "
            "values, as of covariance.with_theta(…), or raise maxiter"
        )
    if at_bounds:
        groups = {name.rpartition(".L")[0].rpartition(".")[2] for name in at_bounds}
        edges = [EDGES[group] for group in EDGES if group in groups]
        doubts.append(
            f"the likelihood is largest where {', '.join(at_bounds)} is at a bound"
            + f", the edge of {' and of '.join(edges)}" * bool(edges)
            + ": no standard error is known; leave the term out, or hold the parameter"
        )
    if not is_known:
        doubts.append(f"{UNKNOWN}: no standard errors")
    inexact = [best.known.doubt or doubt_of_form(ToeplitzOperator(best.c), *best.residual)]
    if doubts:
        doubts += filter(None, inexact)
        warnings.warn("; and ".join(doubts), OptimizeWarning, stacklevel=4)
    else:
        warn(*inexact, stacklevel=4)


def _finite(name: str, values: Any) -> Array:
    """Return numbers after checking that they are finite."""
    array = numbers(name, values)
    if not np.isfinite(array).all():
        raise ValueError(f"{name} is not finite somewhere")
    return array


def _columns(X: Any, shape: tuple[int, ...], columns: int | None = None) -> Array:
    """Return regressors on a grid; the last axis is that of the columns."""
    array = _finite("X", X)
    array = array[..., np.newaxis] if array.shape == shape else array
    if array.shape[:-1] != shape or columns not in (None, array.shape[-1]):
        number = "k" if columns is None else columns
        raise ValueError(
            f"X has shape {np.shape(X)}, but must have ({', '.join(map(str, shape))}, {number}): a "
            "column for each regressor"
        )
    return array


def _cell(x: float, digits: int = 3) -> str:
    """Return a number formatted as in a table of statsmodels."""
    return f"{x:.{digits}g}" if x and not 1e-4 <= abs(x) < 1e4 else f"{x:.{digits}f}"
