"""Fits are where dense likelihoods are largest, with the errors of dense information."""

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import OptimizeWarning

import toeplitz_mg as tmg
from toeplitz_mg.covariances import ARFIMA, ARMA, Custom, Exponential, Matern, WhiteNoise

fit = tmg.ToeplitzNormal.fit
# Annual discharge at Aswan in 10⁸ m³ (J. Durbin, S. J. Koopman, 2001).
FILE = Path(__file__).parent.parent / "docs" / "start" / "nile.csv"
NILE = np.loadtxt(FILE, delimiter=",", skiprows=1)[:, 1]
NOISY = Exponential(1.0, length=2.0) + WhiteNoise(1.0)
AR2 = 200, "few", ARMA(ar=[0.4, 0.1])
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


def test_long_memory_of_the_nile():
    ml, known = fit(NILE, ARFIMA()), fit(NILE, ARFIMA(), NILE.mean())
    reml = fit(NILE, ARFIMA(), method="reml")
    found = [each.params["d"] for each in (ml, known, reml)]
    assert_allclose(found, [0.3639, 0.3642, 0.4074], rtol=0, atol=6e-5)
    found = [ml.loglikelihood, known.loglikelihood]
    assert_allclose(found, [-636.961, -636.967], rtol=0, atol=6e-4)


@pytest.mark.parametrize("method", ["ml", "reml"])
@pytest.mark.parametrize(
    ("shape", "gaps", "start"),
    [*((200, gaps, NOISY) for gaps in (None, "some", "most")), ((13, 14), "few", NOISY), AR2],
)
def test_likelihood_is_largest_and_errors_are_of_dense_matrices(method, shape, gaps, start):
    k = Exponential(2.0, length=6.0) + WhiteNoise(0.4)
    X = np.random.default_rng(2).standard_normal((*np.atleast_1d(shape), 2))
    y = with_gaps(draw(k, shape, 5.0) + X @ [1.0, -2.0], gaps)
    found = fit(y, start, X=X, method=method)
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
    assert_allclose(found.std_errors["variance"], np.sqrt(2 / (n - less)) * variance, rtol=1e-4)
    assert np.prod(found.intervals()["variance"]) == pytest.approx(variance**2, rel=1e-3)


def test_units_of_a_series_and_of_its_spacing_change_nothing_else():
    y = with_gaps(draw(SMOOTH, 200), "some")
    plain = fit(y, SMOOTH, "linear")
    scaled = fit(1e6 * y, SMOOTH.with_theta([1.0, 0.75, 0.5]), "linear", spacing=0.25)
    expected = [1e12, 0.25, 1e12, 1e6, 4e6] * np.array([*plain.params.values()])
    assert_allclose([*scaled.params.values()], expected, rtol=1e-3)
    for ours, theirs in zip(scaled.predict(3), plain.predict(3), strict=True):
        assert_allclose(ours, 1e6 * theirs, rtol=1e-3, atol=1e3)
    assert "Spacing                           0.25" in scaled.summary()


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


@pytest.mark.parametrize("noise", [0.0, "1.variance"])
@pytest.mark.parametrize(("gaps", "k"), [(None, 3), ("some", 3), ("some", 0), ("most", 3)])
def test_predictions_are_universal_kriging(gaps, k, noise):
    n, m = 120, 126
    T = np.column_stack([np.ones(m), np.arange(m), np.sin(np.arange(m) ** 2)])[:, :k]
    y = with_gaps(draw(Exponential(2.0, length=6.0) + WhiteNoise(0.4), n), gaps)
    found = fit(y, Exponential() + WhiteNoise(), 0.0, T[:n])
    mean, std = found.predict(m - n, T[n:], noise=noise)
    o, A = np.flatnonzero(~np.isnan(y)), tmg.ToeplitzOperator(found.covariance(m)).toarray()
    K = A - found.params.get(noise, 0.0) * np.eye(m)  # Without noise.
    inverse = np.linalg.inv(A[np.ix_(o, o)])
    weights = K[:, o] @ inverse
    of_beta = np.linalg.inv(T[o].T @ inverse @ T[o])
    beta, left = of_beta @ T[o].T @ inverse @ y[o], T - weights @ T[o]
    assert_allclose(mean, T @ beta + weights @ (y[o] - T[o] @ beta), rtol=0, atol=1e-7)
    variance = np.diag(K - weights @ K[o]) + np.diag(left @ of_beta @ left.T)
    assert_allclose(std**2, variance, rtol=0, atol=1e-7)


# Series of pandas, and pictures -------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["numbers", "weeks", "periods", "times without a frequency"])
def test_the_index_of_a_series_comes_out_and_goes_on(kind):
    pd = pytest.importorskip("pandas")
    months = pd.period_range("1950-01", periods=103, freq="M")
    weeks = pd.date_range("1958-03-29", periods=103, freq="W-SAT")
    index = {"numbers": pd.RangeIndex(1871, 1974), "weeks": weeks, "periods": months}.get(
        kind, pd.DatetimeIndex([*months.to_timestamp()])
    )
    y = pd.Series(with_gaps(NILE, "some"), index[:100], name="flow")
    found, plain = fit(y, ARFIMA()), fit(y.to_numpy(), ARFIMA())
    assert found.params == plain.params
    assert "flow" in found.summary()
    for ours, theirs in zip(found.predict(3), plain.predict(3), strict=True):
        assert ours.index.equals(index)
        assert_allclose(ours, theirs)


def test_rows_that_are_missing_from_an_index_are_refused():
    pd = pytest.importorskip("pandas")
    weeks = pd.Series(NILE, pd.date_range("1958-03-29", periods=100, freq="W-SAT"))
    rows = [*range(99), 105], [0, *range(99)]
    for y in (weeks.drop(weeks.index[7]), *map(weeks.set_axis, rows)):
        with pytest.raises(ValueError, match="does not have equal steps"):
            fit(y, WhiteNoise())
    assert fit(weeks.to_frame(), WhiteNoise()).params == fit(weeks, WhiteNoise()).params
    two = pd.concat([weeks, weeks], axis=1)
    for y, k, message in ((two, WhiteNoise(), "2 columns"), (NILE, WhiteNoise, "use WhiteNoise()")):
        with pytest.raises(TypeError, match=re.escape(message)):
            fit(y, k)


def test_a_picture_has_the_series_and_the_means():
    plt = pytest.importorskip("matplotlib.pyplot")
    found = fit(with_gaps(NILE, "some"), ARFIMA())
    mean, observed = found.plot(plt.figure().add_subplot(), steps=3).get_lines()
    assert_allclose(mean.get_ydata(), found.predict(3).mean)
    assert len(mean.get_xdata()) == len(observed.get_xdata()) + 3
    plt.close("all")


# What cannot be estimated ------------------------------------------------------------------------


def custom(function):
    return Custom(function, ["a", "b"], [1.0, 2.0], [(0.0, np.inf)] * 2)


BOTH = custom(lambda lags, a, b: a * b * np.exp(-lags))
FREE = custom(lambda lags, a, b: a * np.exp(-lags))


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
        (1e150 * NILE, WhiteNoise(), {}, "y is of size"),
    ],
)
def test_refusals(y, k, options, message):
    with pytest.raises(ValueError, match=message):
        fit(y, k, **options)


def test_predictions_refuse_what_they_cannot_tell():
    found = fit(NILE, SMOOTH, X=np.arange(100.0))
    for arguments, message in (
        ({"steps": 2}, "X is not given for the 2 steps"),
        ({"steps": 2, "X": np.ones(3)}, r"X has shape \(3,\)"),
        ({"noise": 1e9}, "no such white noise"),
    ):
        with pytest.raises(ValueError, match=message):
            found.predict(**arguments)
    with pytest.raises(ValueError, match="confidence is 95"):
        found.intervals(95)


def test_no_convergence_is_told():
    y = draw(SMOOTH, 200)
    with pytest.warns(OptimizeWarning, match="not converged in 1 steps"):
        found = fit(y, Matern(1.0, length=99.0, nu=1.5).fix("nu") + WhiteNoise(1e-3), maxiter=1)
    assert "Converged:                       False" in found.summary()


def test_what_cannot_be_told_apart_at_the_estimate_has_no_errors_though_the_search_converged():
    """White noise: a length of zero fits best, and then either variance is that of white noise."""
    y = np.random.default_rng(4).standard_normal(200)
    with pytest.warns(OptimizeWarning, match="at a bound.* cannot be told apart") as told:
        found = fit(y, Exponential() + WhiteNoise())
    assert (found.converged, len(told)) == (True, 1)
    assert np.isnan(found.std_errors["1.variance"])
    assert "told apart at the estimate: they have no standard errors." in found.summary()


def test_a_parameter_at_its_bound_is_told():
    y = draw(Exponential(1.0, length=9.0), 1000)
    with pytest.warns(OptimizeWarning, match=r"largest where 1\.variance is at a bound"):
        found = fit(y, Exponential(1.0, length=3.0) + WhiteNoise(1.0))
    assert found.at_bounds == ("1.variance",)
    assert np.isnan(found.std_errors["1.variance"])
    without = fit(y, Exponential(1.0, length=3.0))
    assert found.loglikelihood == pytest.approx(without.loglikelihood, abs=1e-3)
    assert found.std_errors["0.length"] == pytest.approx(without.std_errors["length"], rel=1e-2)


def test_the_edge_of_invertibility_is_told():
    """Second differences of white noise have θ(z) = (1 - z)²."""
    y = np.diff(np.random.default_rng(0).standard_normal(150), 2)
    with pytest.warns(OptimizeWarning, match=r"ma\.L1, ma\.L2 is at a bound, the edge of invert"):
        found = fit(y, ARMA(ma=[0.1, 0.1]), 0.0)
    assert (found.converged, found.at_bounds) == (True, ("ma.L1", "ma.L2"))
    assert np.isnan([*found.std_errors.values()]).tolist() == [False, True, True]
    limit = tmg.ToeplitzNormal(y.var() / 6.0 * np.array([6.0, -4.0, 1.0, *[0.0] * 145]))
    assert found.loglikelihood > limit.logpdf(y)
