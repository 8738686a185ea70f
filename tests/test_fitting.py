"""Fits are where dense likelihoods are largest, with the errors of dense information."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import OptimizeWarning

import toeplitz_mg as tmg
from toeplitz_mg.covariances import ARFIMA, Custom, Exponential, Matern, WhiteNoise

fit = tmg.ToeplitzNormal.fit
# Annual discharge at Aswan in 10⁸ m³ (J. Durbin, S. J. Koopman, 2001).
FILE = Path(__file__).parent.parent / "docs" / "start" / "nile.csv"
NILE = np.loadtxt(FILE, delimiter=",", skiprows=1)[:, 1]
SMOOTH = Matern(1.0, length=3.0, nu=1.5).fix("nu") + WhiteNoise(0.5)


def draw(k, shape, mean=0.0):
    A = tmg.ToeplitzOperator(k(shape)).toarray()
    noise = np.random.default_rng(0).standard_normal(len(A))
    return mean + (np.linalg.cholesky(A) @ noise).reshape(shape)


def with_gaps(y, gaps):
    y, n = y.copy(), len(y)
    if gaps == "some":
        y[n // 3 : n // 2] = y[::7] = np.nan
    elif gaps:
        y[np.random.default_rng(1).random(y.shape) < {"few": 0.2, "most": 0.7}[gaps]] = np.nan
    return y


@pytest.mark.parametrize(
    ("options", "d", "value"),
    [
        ({}, 0.3639, -636.961),
        ({"mean": NILE.mean()}, 0.3642, -636.967),
        ({"method": "reml"}, 0.4074, None),
    ],
)
def test_long_memory_of_the_nile(options, d, value):
    found = fit(NILE, ARFIMA(d=0.1), **options)
    assert found.converged
    assert found.params["d"] == pytest.approx(d, abs=6e-5)
    assert value is None or found.loglikelihood == pytest.approx(value, abs=6e-4)


@pytest.mark.parametrize("method", ["ml", "reml"])
@pytest.mark.parametrize(
    ("shape", "gaps"), [((200,), None), ((200,), "some"), ((200,), "most"), ((13, 14), "few")]
)
def test_likelihood_is_the_largest_and_errors_are_those_of_dense_matrices(method, shape, gaps):
    k = Exponential(2.0, length=6.0) + WhiteNoise(0.4)
    X = np.random.default_rng(2).standard_normal((*shape, 2))
    y = with_gaps(draw(k, shape, 5.0) + X @ [1.0, -2.0], gaps)
    found = fit(y, Exponential(1.0, length=2.0) + WhiteNoise(1.0), X=X, method=method)
    o = np.flatnonzero(~np.isnan(y))
    c, derivatives = found.covariance.values_and_gradient(shape)
    A, *by = (tmg.ToeplitzOperator(z).toarray()[np.ix_(o, o)] for z in (c, *derivatives))
    T = np.column_stack([np.ones(len(o)), X.reshape(-1, 2)[o]])
    inverse, size = np.linalg.inv(A), len(o)
    beta_covariance = np.linalg.inv(T.T @ inverse @ T)
    P = inverse - inverse @ T @ beta_covariance @ T.T @ inverse
    alpha, expected = P @ y.flat[o], np.linalg.slogdet(A)[1]
    Q = inverse
    if method == "reml":
        expected -= np.linalg.slogdet(beta_covariance)[1] + np.linalg.slogdet(T.T @ T)[1]
        Q, size = P, size - 3
    expected += alpha @ A @ alpha + size * np.log(2.0 * np.pi)
    slope = np.array([alpha @ B @ alpha - np.trace(Q @ B) for B in by]) / 2.0
    errors = np.linalg.inv([[np.trace(Q @ B @ Q @ C) / 2.0 for C in by] for B in by])
    assert found.converged
    assert found.loglikelihood == pytest.approx(-0.5 * expected, rel=1e-10)
    assert slope @ errors @ slope < 1e-4  # A step of a hundredth of a standard error.
    assert_allclose(found.params_covariance[:3, :3], errors, rtol=1e-6)
    assert_allclose(found.params_covariance[3:, 3:], beta_covariance, rtol=1e-6)
    assert not found.params_covariance[3:, :3].any()
    beta = beta_covariance @ T.T @ inverse @ y.flat[o]
    assert_allclose([found.params[name] for name in ("mean", "x1", "x2")], beta, rtol=1e-6)
    number = 6 if method == "ml" else 3
    assert found.aic == pytest.approx(2.0 * number - 2.0 * found.loglikelihood)
    assert found.bic == pytest.approx(np.log(size) * number - 2.0 * found.loglikelihood)


@pytest.mark.parametrize(("method", "less"), [("ml", 0), ("reml", 3)])
def test_white_noise_is_ordinary_least_squares(method, less):
    n, t = 60, np.arange(60.0)
    y = np.random.default_rng(0).standard_normal(n) + 0.1 * t
    found = fit(y, WhiteNoise(1e-3), "linear", np.cos(t), method=method)
    T = np.column_stack([np.ones(n), t, np.cos(t)])
    beta, (squares,), _, _ = np.linalg.lstsq(T, y)
    variance = squares / (n - less)
    assert_allclose([*found.params.values()], [variance, *beta], rtol=1e-4)
    assert found.std_errors["variance"] == pytest.approx(
        np.sqrt(2 / (n - less)) * variance, rel=1e-4
    )
    low, high = found.intervals()["variance"]
    assert 0.0 < low < variance < high
    assert low * high == pytest.approx(variance**2, rel=1e-3)


def test_units_of_a_series_change_nothing_else():
    y = draw(Matern(2.0, length=6.0, nu=1.5) + WhiteNoise(0.3), 500)
    ours, theirs = fit(y, SMOOTH), fit(1e6 * y, SMOOTH)
    factors = [1e12, 1.0, 1e12, 1e6]
    assert_allclose(
        [*theirs.params.values()], factors * np.array([*ours.params.values()]), rtol=1e-3
    )


def test_masked_arrays_and_nan_are_the_same_gaps():
    y = with_gaps(draw(SMOOTH, 150), "some")
    found = fit(np.ma.masked_invalid(y), SMOOTH)
    assert found.params == fit(y, SMOOTH).params
    assert found.n_observed == np.count_nonzero(~np.isnan(y))


def test_all_that_is_held_leaves_generalised_least_squares():
    y = draw(SMOOTH, 100, 3.0)
    found = fit(y, SMOOTH.fix(*SMOOTH.names))
    G = np.linalg.inv(tmg.ToeplitzOperator(SMOOTH(100)).toarray())
    assert found.params == pytest.approx({"mean": G.sum(axis=0) @ y / G.sum()})
    assert found.loglikelihood == pytest.approx(found.process.logpdf(y))
    assert found.converged


# What cannot be estimated ------------------------------------------------------------------------


def double(lags, a, b):
    return a * b * np.exp(-lags)


BOTH = Custom(double, ["a", "b"], [1.0, 2.0], [(0.0, np.inf), (0.0, np.inf)])
FREE = Custom(lambda lags, a, b: a * np.exp(-lags), ["a", "b"], [1.0, 1.0], [(0.0, np.inf)] * 2)


@pytest.mark.parametrize(
    ("y", "k", "options", "message"),
    [
        (NILE, WhiteNoise(1.0) + WhiteNoise(2.0), {}, "0.variance, 1.variance cannot be told"),
        (NILE, BOTH, {}, "a, b cannot be told apart"),
        (NILE, FREE, {}, "does not depend on the parameter b"),
        (NILE, SMOOTH, {"X": np.ones(100)}, "x1 is a combination of those before it"),
        (NILE[:4], SMOOTH, {}, "4 observed values, but must have more"),
        (np.ones(9), WhiteNoise(), {}, "no variance to estimate"),
        (NILE, SMOOTH, {"mean": "cubic"}, "mean is 'cubic'"),
        (NILE, SMOOTH, {"mean": np.ones(3)}, r"mean has shape \(3,\)"),
        (NILE, SMOOTH, {"X": np.ones((3, 2))}, r"X has shape \(3, 2\), but must have \(100, k\)"),
        (NILE, SMOOTH, {"method": "mle"}, "method is 'mle'"),
        (np.append(NILE, np.inf), SMOOTH, {}, "finite numbers"),
    ],
)
def test_refusals(y, k, options, message):
    with pytest.raises(ValueError, match=message):
        fit(y, k, **options)


def test_no_convergence_is_told():
    y = draw(SMOOTH, 200)
    with pytest.warns(OptimizeWarning, match="not converged in 1 steps"):
        found = fit(y, Matern(1.0, length=99.0, nu=1.5).fix("nu") + WhiteNoise(1e-3), maxiter=1)
    assert not found.converged
    assert "Converged:                       False" in found.summary()


def test_a_parameter_at_its_bound_is_told():
    y = draw(Exponential(1.0, length=9.0), 1000)
    with pytest.warns(OptimizeWarning, match=r"largest where 1\.variance is at a bound"):
        found = fit(y, Exponential(1.0, length=3.0) + WhiteNoise(1.0))
    assert found.at_bounds == ("1.variance",)
    assert np.isnan(found.std_errors["1.variance"])
    without = fit(y, Exponential(1.0, length=3.0))
    assert found.loglikelihood == pytest.approx(without.loglikelihood, abs=1e-3)
    assert found.std_errors["0.length"] == pytest.approx(without.std_errors["length"], rel=1e-2)
