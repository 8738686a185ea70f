"""Fits of five series beside those of statsmodels, or of dense matrices where it has no such model.

The mean and the regressors are the same: generalised least squares in both.
"""

from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from scipy.optimize import minimize

import toeplitz_mg as tmg
from comparisons.harness import report
from comparisons.harness.measuring import time_in_turns
from comparisons.harness.report import Row
from toeplitz_mg._typing import Array
from toeplitz_mg.covariances import ARFIMA, ARMA, Covariance, Exponential, Matern, WhiteNoise

FORMATS = {
    **{"series": "", "observed": "d", "missing": "d", "covariance": "", "parameter": ""},
    **{"estimate": ".4f", "standard error": ".4f", "log-likelihood": ".3f", "seconds": ".2f"},
    **{"beside": "", "its estimate": ".4f", "its log-likelihood": ".3f", "its seconds": ".2f"},
}
SEASONS = 3  # Cosines and sines of a year, 1/2 and 1/3 of it.


class Case(NamedTuple):
    """A series, a covariance, and the parameter that is shown."""

    series: str
    column: str
    model: str
    covariance: Covariance
    parameter: str
    order: tuple[int, int, int] | None = None  # That of an ARIMA that is the same, if there is one.
    year: float = 0.0  # Steps in a year, where the mean has seasons.
    trend: bool = False


MATERN = Matern(length=5.0, nu=1.5).fix("nu") + WhiteNoise(0.1)
CASES = (
    Case("nile", "volume", "ARFIMA(0, d, 0)", ARFIMA(d=0.1), "d"),
    Case("sunspots", "SUNACTIVITY", "AR(2)", ARMA(ar=(1.0, -0.5)), "ar.L1", (2, 0, 0)),
    Case("macrodata", "infl", "ARMA(1, 1)", ARMA(ar=0.5, ma=0.1), "ar.L1", (1, 0, 1)),
    Case("co2", "co2", "e^-k/ℓ", Exponential(length=20.0), "length", (1, 0, 0), 365.25 / 7.0, True),
    Case("elnino", "", "Matérn 3/2 + noise", MATERN, "0.length", None, 12.0),
)


def load(case: Case) -> tuple[Array, Array]:
    """Return the series, and regressors in columns."""
    from statsmodels import datasets

    table = getattr(datasets, case.series).load_pandas().data
    if case.column:
        y = table[case.column].to_numpy(float)
    else:  # A row for each year, a column for each month.
        y = table.iloc[:, 1:].to_numpy(float).ravel()
    t = np.arange(float(len(y)))
    angles = 2.0 * np.pi * np.outer(t, np.arange(1, SEASONS + 1)) / (case.year or np.inf)
    seasons = [np.cos(angles), np.sin(angles)] if case.year else []
    trend = [t[:, np.newaxis] / len(t)] if case.trend else []
    return y, np.column_stack([np.empty((len(y), 0)), *trend, *seasons])


def fit_dense(y: Array, X: Array, k: Covariance) -> tuple[dict[str, float], float]:
    """Return the estimates, and the log-likelihood, by Cholesky factors of dense matrices."""
    there = ~np.isnan(y)
    joined = np.column_stack([y, np.ones(len(y)), X])[there]
    free = k.bounds[:, 0] < 0.0  # All others are positive.

    def negative(u: Array) -> float:
        c = k.with_theta(np.where(free, u, np.exp(u)))(len(y))
        L = np.linalg.cholesky(scipy.linalg.toeplitz(c)[np.ix_(there, there)])
        white = scipy.linalg.solve_triangular(L, joined, lower=True)
        _, (square,), _, _ = np.linalg.lstsq(white[:, 1:], white[:, 0])
        return float(0.5 * (square + len(L) * np.log(2.0 * np.pi)) + np.log(L.diagonal()).sum())

    theta = k.theta
    theta[0] = np.nanvar(y)
    start = np.where(free, theta, np.log(np.where(free, 1.0, theta)))
    found = minimize(negative, start, method="Nelder-Mead", options={"xatol": 1e-5, "fatol": 1e-7})
    estimates = np.where(free, found.x, np.exp(found.x))
    return dict(zip(k.names, estimates.tolist(), strict=True)), -float(found.fun)


def fit_arima(y: Array, X: Array, order: tuple[int, int, int]) -> tuple[dict[str, float], float]:
    """Return the same by the Kalman filter of statsmodels."""
    from statsmodels.tsa.arima.model import ARIMA

    found = ARIMA(y, exog=X if X.size else None, order=order, trend="c").fit()
    return dict(zip(found.param_names, found.params, strict=True)), float(found.llf)


def compare() -> Iterator[Row]:
    """Yield a row for each series; none where statsmodels is not installed."""
    for case in CASES if find_spec("statsmodels") else ():
        y, X = load(case)
        ours = partial(tmg.ToeplitzNormal.fit, y, case.covariance, X=X if X.size else None)
        theirs: Callable[[], Any] = partial(fit_dense, y, X, case.covariance)
        if case.order:
            theirs = partial(fit_arima, y, X, case.order)
        times = time_in_turns({"seconds": ours, "its seconds": theirs})
        fit, (estimates, value) = ours(), theirs()
        if case.parameter == "length":  # That of neighbours whose correlation is known.
            estimates["length"] = -1.0 / np.log(estimates["ar.L1"])
        parameter, model = case.parameter, case.model
        row: Row = {"series": case.series, "observed": fit.n_observed}
        row |= {"missing": len(y) - fit.n_observed, "covariance": model, "parameter": parameter}
        row |= {"estimate": fit.params[parameter], "standard error": fit.std_errors[parameter]}
        row |= {"log-likelihood": fit.loglikelihood, "its log-likelihood": value}
        row |= {"beside": "statsmodels" if case.order else "dense"}
        yield row | times | {"its estimate": estimates[parameter]}


arrange = partial(report.format_rows, FORMATS)
