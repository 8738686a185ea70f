"""Densities, gradients, gaps and samples of a stationary process are those of its dense matrix."""

import pickle
import re
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
from numpy.testing import assert_allclose
from scipy.stats import multivariate_normal

import toeplitz_mg as tmg
from tests.test_determinant import covariance

NAMES = ["fGn, H = 0.3", "fGn, H = 0.99", "(1+k)^-1.1", "exp(-k/1000)", "Matérn 3/2, ℓ = 5"]
each_name = pytest.mark.parametrize("name", NAMES)


def dense_of(c, mean, observed):
    """The distribution of SciPy of what is observed."""
    A = scipy.linalg.toeplitz(c)
    return multivariate_normal(np.full(observed.sum(), mean), A[np.ix_(observed, observed)])


def masks(n):
    """Gaps of several kinds: one, several of different lengths and at the ends, at random."""
    one, several = np.ones((2, n), dtype=bool)
    one[n // 3 : n // 3 + n // 10 + 1] = False
    several[[0, n // 2, n - 2, n - 1]] = False
    several[n // 4 : n // 4 + 3] = False
    random = np.random.default_rng(3).random(n) < 0.8
    few = np.random.default_rng(4).random(n) < 0.2
    few[0] = random[0] = True
    everywhere = np.ones(n, dtype=bool)
    return {None: everywhere, "one": one, "several": several, "random": random, "few": few}


@each_name
@pytest.mark.parametrize(
    ("n", "gaps"),
    [
        *((n, None) for n in (1, 2, 3)),
        *product((40, 700), [None, "one", "several", "random", "few"]),
    ],
)
def test_density_is_that_of_what_is_observed(name, n, gaps):
    c, observed = covariance(name, n), masks(n)[gaps]
    y = np.random.default_rng(n).standard_normal((2, 3, n))
    expected = np.reshape(dense_of(c, 0.5, observed).logpdf(y[..., observed]), (2, 3))
    y[..., ~observed] = np.nan
    process, mask = tmg.ToeplitzNormal(c, 0.5), None if gaps is None else observed
    assert_allclose(process.logpdf(y, mask), expected, rtol=1e-10)
    assert process.logpdf(y[0, 0], mask) == pytest.approx(expected[0, 0], rel=1e-10)
    assert np.ndim(process.logpdf(y[0, 0], mask)) == 0


@each_name
@pytest.mark.parametrize(
    ("n", "gaps"), [*product([150], [None, "one", "several", "random", "few"]), (900, "one")]
)
def test_gradients_are_those_of_the_dense_density(name, n, gaps):
    c = covariance(name, n)
    observed = masks(n)[gaps]
    y = np.random.default_rng(0).standard_normal(n)
    process = tmg.ToeplitzNormal(c, 0.5)
    value, by_c, by_y = process.logpdf_and_grad(y, observed)
    assert value == process.logpdf(y, observed)
    A = scipy.linalg.toeplitz(c)[np.ix_(observed, observed)]
    inverse, alpha = np.zeros((n, n)), np.zeros(n)
    inverse[np.ix_(observed, observed)] = np.linalg.inv(A)
    alpha[observed] = np.linalg.solve(A, y[observed] - 0.5)
    exact = np.array([alpha[: n - k] @ alpha[k:] - np.trace(inverse, k) for k in range(n)])
    exact[0] /= 2
    assert_allclose(by_c, exact, rtol=0, atol=1e-9 * abs(exact).max())
    assert_allclose(by_y, -alpha, rtol=0, atol=1e-9 * abs(alpha).max())


@pytest.mark.parametrize(("nugget", "said"), [(1e-4, False), (1e-8, True)])
def test_a_gradient_over_a_long_smooth_gap_warns_of_its_error(nugget, said, recwarn):
    k = np.arange(300)
    c = np.exp(-0.5 * (k / 10) ** 2) + nugget * (k == 0)
    observed, y = (k < 100) | (k >= 160), np.sin(k / 30)
    _, by_c, _ = tmg.ToeplitzNormal(c).logpdf_and_grad(y, observed)
    # Euler's theorem: of the process s c the derivative by s is that of the quadratic form and n.
    form = y[observed] @ np.linalg.solve(
        scipy.linalg.toeplitz(c)[np.ix_(observed, observed)], y[observed]
    )
    assert by_c @ c == pytest.approx((form - 240) / 2, rel=1e-6)
    told = [w for w in recwarn if "derivatives by c may have a relative error" in str(w.message)]
    assert bool(told) is said
    assert all(w.filename == __file__ for w in told)


# What is observed ----------------------------------------------------------------------------


def test_gaps_are_nan_or_masked_or_what_is_not_observed():
    c, observed = covariance("Matérn 3/2, ℓ = 5", 300), masks(300)["several"]
    y = np.random.default_rng(0).standard_normal(300)
    process = tmg.ToeplitzNormal(c, 0.5)
    with_nan = np.where(observed, y, np.nan)
    for ask in (
        *(process.logpdf_and_grad, process.whiten, process.leave_one_out),
        lambda y, *mask: [process.logpdf(y, *mask)],
        lambda y, *mask: process.conditional(y, *mask).mean,
        lambda y, *mask: process.conditional(y, *mask).interval(),
    ):
        expected = ask(y, observed)
        for found in (ask(with_nan), ask(np.ma.array(y, mask=~observed)), ask(with_nan, observed)):
            for a, b in zip([*found], [*expected], strict=True):
                np.testing.assert_array_equal(a, b)
    whole = np.ma.array(y)
    assert process.logpdf(whole) == process.logpdf(y)


@pytest.mark.parametrize("noisy", [False, True])
@pytest.mark.parametrize("gaps", [None, "one", "several", "random", "few"])
def test_all_that_is_told_of_the_observed_is_that_of_the_dense_matrix(gaps, noisy):
    n = 301
    rng = np.random.default_rng(5)
    c, o = covariance("(1+k)^-1.1", n), masks(n)[gaps]
    noise = rng.random(n) if noisy else None
    A = scipy.linalg.toeplitz(c) + np.diag(np.zeros(n) if noise is None else noise)
    y = rng.standard_normal((2, n))
    known, m = A[np.ix_(o, o)], ~o
    process = tmg.ToeplitzNormal(c, 0.5, noise)
    density = multivariate_normal(np.full(o.sum(), 0.5), known).logpdf(y[:, o])
    assert_allclose(process.logpdf(y, o), density, rtol=1e-11)
    factor, inverse = np.linalg.cholesky(known), np.linalg.inv(known)
    z = process.whiten(y, o)
    assert_allclose(z[:, o] @ factor.T, y[:, o] - 0.5, rtol=0, atol=1e-12)
    assert np.isnan(z[:, m]).all()
    given = process.conditional(y[0], o)
    weights = A[np.ix_(m, o)] @ inverse
    assert_allclose(given.mean[m], 0.5 + weights @ (y[0, o] - 0.5), rtol=0, atol=1e-10)
    assert_allclose(given.mean[o], y[0, o], rtol=0, atol=1e-14)
    variance = np.diag(A)[m] - np.vecdot(weights, A[np.ix_(m, o)])
    assert_allclose(given.variance[m], variance, rtol=1e-10)
    assert (given.variance[o] == 0.0).all()
    low, high = given.interval(0.6827)
    assert_allclose((high - low)[m], 2 * np.sqrt(variance), rtol=1e-4)
    assert_allclose((high + low) / 2, given.mean, rtol=1e-12)
    out = process.leave_one_out(y, o)
    alpha = (y[:, o] - 0.5) @ inverse
    assert_allclose(out.mean[:, o], y[:, o] - alpha / np.diag(inverse), rtol=0, atol=1e-10)
    assert_allclose(out.std[o], np.diag(inverse) ** -0.5, rtol=1e-10)
    assert np.isnan(out.mean[:, m]).all()
    assert np.isnan(out.std[m]).all()


@pytest.mark.parametrize("noisy", [False, True])
def test_a_forecast_continues_the_series(noisy):
    n, steps = 200, 30
    rng = np.random.default_rng(5)
    mean, noise = rng.standard_normal(n + 50), rng.random(n + 50) if noisy else None
    c, y = covariance("Matérn 3/2, ℓ = 5", n + 50), rng.standard_normal(n)
    y[[3, 150, 151]] = np.nan
    ahead = tmg.ToeplitzNormal(c, mean, noise).forecast(y, steps)
    o = np.flatnonzero(~np.isnan(y))
    A = scipy.linalg.toeplitz(c) + np.diag(np.zeros(n + 50) if noise is None else noise)
    weights = np.linalg.solve(A[np.ix_(o, o)], A[np.ix_(o, range(n, n + steps))]).T
    assert_allclose(ahead.mean, mean[n : n + steps] + weights @ (y[o] - mean[o]), atol=1e-9)
    variance = np.diag(A)[n : n + steps] - np.vecdot(weights, A[n : n + steps, o])
    assert_allclose(ahead.std, np.sqrt(variance), rtol=1e-9)
    low, high = ahead.interval()
    assert_allclose(high - low, 2 * 1.959964 * ahead.std, rtol=1e-6)


@pytest.mark.parametrize("n", [1, 2, 50, 700])
def test_coloring_is_what_whitening_undoes(n):
    rng = np.random.default_rng(0)
    c, z = covariance("fGn, H = 0.3", n), rng.standard_normal((2, 3, n))
    for noise in (None, rng.random(n)):
        process = tmg.ToeplitzNormal(c, 2.0, noise)
        A = scipy.linalg.toeplitz(c) + np.diag(np.zeros(n) if noise is None else noise)
        assert_allclose(process.colorize(z), 2.0 + z @ np.linalg.cholesky(A).T, atol=1e-11)
        assert_allclose(process.whiten(process.colorize(z)), z, atol=1e-9)


def test_beyond_the_dense_sizes_noise_is_by_iteration_and_its_density_dense_or_estimated():
    n, rng = 4200, np.random.default_rng(2)
    c, noise = covariance("exp(-k/1000)", n), 0.1 * np.exp(rng.standard_normal(n))
    process = tmg.ToeplitzNormal(c, noise=noise)
    y = process.rvs(random_state=1)
    y[[5, 2000, 2001]] = np.nan
    o = ~np.isnan(y)
    A = scipy.linalg.toeplitz(c) + np.diag(noise)
    factor = scipy.linalg.cho_factor(A[np.ix_(o, o)])
    weights = scipy.linalg.cho_solve(factor, A[np.ix_(o, ~o)]).T
    given = process.conditional(y)
    assert_allclose(given.mean[~o], weights @ y[o], rtol=0, atol=1e-8)
    variance = np.diag(A)[~o] - np.vecdot(weights, A[np.ix_(~o, o)])
    assert_allclose(given.variance[~o], variance, rtol=1e-8)
    form = y[o] @ scipy.linalg.cho_solve(factor, y[o])
    logdet = 2.0 * np.log(np.diag(factor[0])).sum()
    exact = -0.5 * (form + logdet + o.sum() * np.log(2 * np.pi))
    assert process.logpdf(y) == pytest.approx(exact, rel=1e-11)
    value, error = process.logpdf_estimate(y, probes=8, random_state=0)
    assert 0.0 < error < 1e-2 * abs(exact)
    assert abs(value - exact) <= 5 * error


def test_variances_of_many_gaps_are_those_of_draws_and_say_so():
    """Of a Markov process each depends on its neighbours only."""
    n, rho = 8400, 0.8
    y = np.where(np.arange(n) % 2, np.nan, 1.0)
    given = tmg.ToeplitzNormal(rho ** np.arange(n)).conditional(y)
    with pytest.warns(UserWarning, match="4200 points are missing: .* 256 draws, .* of 9%") as told:
        variance = given.variance
    assert told[0].filename == __file__
    exact = (1 - rho**2) / (1 + rho**2)
    # 256 squares of independent numbers have a relative standard deviation of √(2/256) = 0.088.
    assert_allclose(variance[1:-1:2], exact, rtol=6 * 0.0884)
    assert variance[1:-1:2].mean() == pytest.approx(exact, rel=0.01)
    assert (variance[::2] == 0.0).all()


def test_a_variance_over_a_long_smooth_gap_warns_of_its_error():
    k = np.arange(600)
    process = tmg.ToeplitzNormal(np.exp(-0.5 * (k / 30) ** 2) + 1e-11 * (k == 0))
    given = process.conditional(np.where((k < 100) | (k >= 350), 1.0, np.nan))
    for ask in (lambda: given.variance, lambda: given.std, given.interval):
        with pytest.warns(scipy.linalg.LinAlgWarning, match="the variances may have") as told:
            ask()
        assert told[-1].filename == __file__


def test_the_density_of_a_field_is_exact_as_far_as_the_memory_goes():
    """Of a product of two covariances it is known: log det (A ⊗ B) = n log det A + m log det B."""
    shape = m, n = 66, 64
    a, b = 0.9 ** np.arange(m), 0.7 ** np.arange(n)
    A, B = scipy.linalg.toeplitz(a), scipy.linalg.toeplitz(b)
    y = np.random.default_rng(0).standard_normal(shape)
    logdet = n * np.linalg.slogdet(A)[1] + m * np.linalg.slogdet(B)[1]
    form = np.vdot(y, np.linalg.solve(A, np.linalg.solve(B, y.T).T))
    exact = -0.5 * (form + logdet + m * n * np.log(2 * np.pi))
    assert tmg.ToeplitzNormal(np.outer(a, b)).logpdf(y) == pytest.approx(exact, rel=1e-11)


@each_name
@pytest.mark.parametrize("n", [1, 2, 3, 40, 301, 1200])
def test_whitening_divides_by_the_factor_of_cholesky(name, n):
    c = covariance(name, n)
    y = np.random.default_rng(n).standard_normal((2, 3, n))
    A = scipy.linalg.toeplitz(c)
    factor = np.linalg.cholesky(A)
    expected = scipy.linalg.solve_triangular(factor, (y - 0.5).reshape(6, n).T, lower=True).T
    process = tmg.ToeplitzNormal(c, 0.5)
    eigenvalues = np.linalg.eigvalsh(A)
    atol = 1e-14 * eigenvalues[-1] / eigenvalues[0] * abs(expected).max()
    assert_allclose(process.whiten(y), expected.reshape(y.shape), rtol=0, atol=atol)
    assert_allclose(process.whiten(y[1, 2]), expected[5], rtol=0, atol=atol)


@pytest.mark.parametrize("gaps", [None, "one", "several", "random", "few"])
def test_draws_have_the_conditional_mean_and_variance(gaps):
    n, observed = 200, masks(200)[gaps]
    y = np.where(observed, np.random.default_rng(0).standard_normal(n), np.nan)
    given = tmg.ToeplitzNormal(covariance("Matérn 3/2, ℓ = 5", n), 0.5).conditional(y)
    draws = given.rvs(4000, random_state=1)
    assert draws.shape == (4000, n)
    assert_allclose(draws[:, observed], np.tile(y[observed], (4000, 1)), rtol=1e-12)
    # The variance of 4000 draws has a relative standard deviation of √(2/4000) = 0.022.
    missing = draws[:, ~observed]
    assert_allclose(missing.var(axis=0), given.variance[~observed], rtol=6 * 0.0224)
    spread = given.std[~observed] / 4000**0.5
    assert (abs(missing.mean(axis=0) - given.mean[~observed]) <= 6 * spread).all()


def field_covariance(shape, length):
    distance = np.hypot(*np.meshgrid(*map(np.arange, shape), indexing="ij"))
    return np.exp(-distance / length) + 0.1 * (distance == 0)


@pytest.mark.parametrize("share", [0.1, 0.7])
def test_a_field_with_gaps_is_kriged_as_by_the_dense_matrix(share):
    shape = (13, 9)
    c = field_covariance(shape, 3.0)
    rng = np.random.default_rng(6)
    observed, y = rng.random(shape) < share, rng.standard_normal(shape)
    A, inside = tmg.ToeplitzOperator(c).toarray(), observed.ravel()
    weights = np.linalg.solve(A[np.ix_(inside, inside)], A[inside]).T
    expected = (weights @ y[observed]).reshape(shape)
    density = multivariate_normal(np.zeros(inside.sum()), A[np.ix_(inside, inside)])
    process = tmg.ToeplitzNormal(c)
    assert process.logpdf(y, observed) == pytest.approx(density.logpdf(y[observed]), rel=1e-11)
    given = process.conditional(y, observed)
    assert_allclose(given.mean, expected, rtol=0, atol=1e-10)
    variance = np.diag(A - weights @ A[inside]).reshape(shape)
    assert_allclose(given.variance[~observed], variance[~observed], rtol=1e-10)
    out = process.leave_one_out(y, observed)
    deviations = np.diag(np.linalg.inv(A[np.ix_(inside, inside)])) ** -0.5
    assert_allclose(out.std[observed], deviations, rtol=1e-10)


@pytest.mark.parametrize(
    ("shape", "reason"),
    [
        ((600, 500), "the log-determinant is known exactly only for up to .*Whittle"),
        ((300_000,), r"known exactly only for up to \d+ .*at most \d+ are missing"),
    ],
)
def test_of_more_than_the_memory_holds_there_is_all_but_a_density(shape, reason):
    """Sums of the covariances with observed points are what the conditional mean continues."""
    c = field_covariance((*shape, 1)[:2], 3.0).reshape(shape)
    rng = np.random.default_rng(0)
    observed = rng.random(shape) < 0.7
    process, weights = tmg.ToeplitzNormal(c), observed * rng.standard_normal(shape)
    values = (tmg.ToeplitzOperator(c) @ weights.ravel()).reshape(shape)
    given = process.conditional(np.where(observed, values, np.nan))
    assert_allclose(given.mean, values, rtol=0, atol=1e-8 * abs(values).max())
    for density in (process.logpdf, process.logpdf_and_grad):
        with pytest.raises(ValueError, match=reason):
            density(values, observed)


@pytest.mark.parametrize("shape", [(12,), (3, 4), (5, 1), (2, 3, 2)])
@pytest.mark.parametrize("share", [1.0, 0.7])
@pytest.mark.parametrize("noisy", [False, True])
def test_gradients_are_derivatives(shape, share, noisy):
    distance = np.sqrt((np.indices(shape) ** 2).sum(axis=0))
    c = np.exp(-distance / 3.0) + 0.1 * (distance == 0.0)
    rng = np.random.default_rng(0)
    y, observed = rng.standard_normal((2, 3, *shape)), rng.random(shape) < share
    observed.flat[0] = True
    options = {"noise": rng.random(shape)} if noisy else {}
    value, by_c, by_y = tmg.ToeplitzNormal(c, **options).logpdf_and_grad(y, observed)
    assert (value.shape, by_c.shape, by_y.shape) == ((2, 3), y.shape, y.shape)
    h = 1e-5
    for index in np.ndindex(shape):
        step = np.zeros(shape)
        step[index] = h
        ahead, back = (
            tmg.ToeplitzNormal(c + t, **options).logpdf(y, observed) for t in (step, -step)
        )
        assert_allclose(by_c[..., *index], (ahead - back) / (2 * h), rtol=0, atol=1e-6)
        process = tmg.ToeplitzNormal(c, **options)
        ahead, back = (process.logpdf(y + t, observed) for t in (step, -step))
        assert_allclose(by_y[..., *index], (ahead - back) / (2 * h), rtol=0, atol=1e-6)


# Errors --------------------------------------------------------------------------------------


def test_an_error_of_the_determinant_is_said_where_it_is_asked_for():
    k = np.arange(2000)
    process = tmg.ToeplitzNormal(np.exp(-((k / 50) ** 2)) + 1e-12 * (k == 0))
    for ask in (process.logpdf, process.logpdf_and_grad, lambda y: process.logdet):
        with pytest.warns(
            scipy.linalg.LinAlgWarning, match=r"error of up to .*larger c\[0\]"
        ) as caught:
            ask(np.zeros(2000))
        assert caught[0].filename == __file__
    assert process.logdet_error > 1e-7
    assert tmg.ToeplitzNormal(0.5**k).logdet_error < 1e-9
    with pytest.raises(ValueError, match="c has 2 axes"):
        _ = tmg.ToeplitzNormal([[2.0, 1.0], [1.0, 0.5]]).logdet_error


# Samples -------------------------------------------------------------------------------------


class Units(np.random.Generator):
    """Draws unit vectors in the place of noise, of which the samples are linear functions."""

    def standard_normal(self, size):
        self.number = int(np.prod(size[1:]))
        return np.eye(size[0], self.number).reshape(size)


def covariance_of_samples(process):
    units = Units(np.random.PCG64(0))
    process.rvs(random_state=units)
    rows = process.rvs(units.number, random_state=units).reshape(units.number, -1)
    return rows.T @ rows


@pytest.mark.parametrize("name", ["fGn, H = 0.3", "fGn, H = 0.99", "0.9^k", "exp(-k/1000)"])
@pytest.mark.parametrize("n", [2, 3, 50])
def test_samples_have_the_covariance(name, n):
    c = covariance(name, n)
    process = tmg.ToeplitzNormal(c)
    assert_allclose(covariance_of_samples(process), scipy.linalg.toeplitz(c), rtol=0, atol=1e-13)
    assert process.sampling_error <= 1e-14


@pytest.mark.parametrize("length", [0.3, 1.0])
def test_samples_of_wide_covariances_have_them_up_to_the_error_they_say(length):
    c = tmg.covariances.Matern(length=length * 30, nu=1.5)(30)
    process = tmg.ToeplitzNormal(c)
    error = abs(covariance_of_samples(process) - scipy.linalg.toeplitz(c)).max()
    assert error == pytest.approx(process.sampling_error, rel=1e-3, abs=1e-13)
    assert process.sampling_error <= 1e-6


@pytest.mark.parametrize("n", [3, 9, 60])
def test_samples_of_a_process_that_is_periodic_itself_are_what_whitening_undoes(n):
    k = np.arange(n)
    c = np.cos(0.5 * k) + 0.01 * (k == 0)
    process = tmg.ToeplitzNormal(c)
    assert_allclose(covariance_of_samples(process), scipy.linalg.toeplitz(c), rtol=0, atol=1e-12)
    assert process.sampling_error <= 1e-12
    samples = process.rvs(5, random_state=0)
    noise = np.random.default_rng(0).standard_normal((5, n))
    assert_allclose(process.whiten(samples), noise, atol=1e-9)


def test_what_no_embedding_reaches_is_drawn_point_by_point():
    n = 1000
    k = np.arange(n) / n
    process = tmg.ToeplitzNormal(np.exp(-(k**2) / 2) + 1e-6 * (k == 0))
    assert process.rvs(2, random_state=0).shape == (2, n)
    assert process.sampling_error <= 1e-6
    y = np.full(n, np.nan)
    y[::7] = 1.0
    given = process.conditional(y)
    assert_allclose(given.rvs(random_state=0)[::7], 1.0)
    with pytest.raises(ValueError, match="read-only"):
        given.mean[0] = 0.0


def test_samples_of_fields_have_the_covariance():
    c = field_covariance((6, 5), 0.3)
    dense = tmg.ToeplitzOperator(c).toarray()
    assert_allclose(covariance_of_samples(tmg.ToeplitzNormal(c)), dense, rtol=0, atol=1e-13)
    samples = tmg.ToeplitzNormal(c, mean=np.full(5, 2.0)).rvs((2, 3), random_state=0)
    assert samples.shape == (2, 3, 6, 5)


@pytest.mark.parametrize("length", [10.0, 30.0])
def test_a_field_that_needs_a_larger_grid_says_which_and_that_is_enough(length):
    with pytest.raises(np.linalg.LinAlgError, match=r"give c on a grid of some \(") as error:
        tmg.ToeplitzNormal(field_covariance((20, 25), length)).rvs()
    shape = [int(n) for n in re.search(r"of some \((\d+), (\d+)\)", str(error.value)).groups()]
    assert tmg.ToeplitzNormal(field_covariance(shape, length)).sampling_error <= 1e-12


def test_a_field_that_has_decayed_and_is_none_needs_a_nugget():
    distance = np.hypot(*np.indices((70, 70)))
    c = np.where(distance < 1.5, 1.0, 0.0)
    process = tmg.ToeplitzNormal(c)
    with pytest.raises(np.linalg.LinAlgError, match=r"add to c\[0\] \(a nugget\)"):
        process.rvs()
    for radius in (10.0, 95.0):  # Of few points, and of many.
        with pytest.raises(np.linalg.LinAlgError, match=r"observed points is not.*nugget"):
            _ = process.conditional(np.where(distance < radius, c, np.nan)).mean
    c[0, 0] += 9.0  # More than all others together.
    assert tmg.ToeplitzNormal(c).rvs(random_state=0).shape == (70, 70)


@pytest.mark.parametrize("shape", [(12,), (4, 3)])
def test_no_samples_have_the_shape_of_none(shape):
    process = tmg.ToeplitzNormal(np.exp(-np.hypot(*np.indices((*shape, 1)[:2]))).reshape(shape))
    y = np.full(shape, np.nan)
    y.flat[5] = 1.0
    for given in (process, process.conditional(y), process.conditional(np.nan_to_num(y))):
        assert given.rvs(0).shape == (0, *shape)
        assert given.rvs((3, 0)).shape == (3, 0, *shape)


def test_a_field_that_does_not_decay_has_no_size():
    k, j = np.indices((20, 25))
    with pytest.raises(np.linalg.LinAlgError, match="no size can be told"):
        tmg.ToeplitzNormal(np.exp(-(k**2 + j**2) / 2e4)).rvs()


def test_random_states():
    process = tmg.ToeplitzNormal(0.5 ** np.arange(6), mean=1.0)
    first = process.rvs(3, random_state=7)
    assert_allclose(process.rvs(3, random_state=np.random.default_rng(7)), first)
    assert process.rvs().shape == process.rvs(None).shape == (6,)
    assert process.rvs((2, 0)).shape == (2, 0, 6)
    assert process.rvs((1,), random_state=np.random.RandomState(1)).shape == (6,)
    assert not np.allclose(process.rvs(), process.rvs())


# Arguments -----------------------------------------------------------------------------------


def test_what_is_infinite_or_observed_and_nan_is_refused_with_its_positions():
    process = tmg.ToeplitzNormal(0.5 ** np.arange(20))
    y = np.zeros(20)
    y[[3, 7]] = np.nan
    with pytest.raises(ValueError, match=r"not finite at 3, 7, but must be where it is observed"):
        process.logpdf(y, np.ones(20, dtype=bool))
    y[10:] = np.inf
    with pytest.raises(ValueError, match=r"at 10, 11, 12, 13, 14 and 5 more"):
        process.logpdf_and_grad(y)
    with pytest.raises(ValueError, match=r"not finite at \(1, 10\)"):
        process.logpdf([np.zeros(20), y], np.arange(20) == 10)
    with pytest.raises(ValueError, match="not finite at 10"):
        process.conditional(y)
    with pytest.raises(ValueError, match="different gaps"):
        process.logpdf([np.zeros(20), np.where(np.arange(20) < 5, np.nan, 0.0)])


NONE = np.zeros(20)


@pytest.mark.parametrize(
    ("ask", "error", "message"),
    [
        *((lambda p, y=y: p.logpdf(y), ValueError, "last axes must be")
          for y in (np.zeros(19), 0.0, np.zeros((20, 3)))),
        (lambda p: p.logpdf(NONE, np.ones(20)), TypeError, "observed has dtype float64, but"),
        (lambda p: p.conditional(NONE, [True, False]), ValueError, r"observed has shape \(2,\)"),
        (lambda p: p.logpdf(NONE, np.zeros(20, bool)), ValueError, "y is observed nowhere"),
        (lambda p: p.conditional(np.full(20, np.nan)), ValueError, "y is observed nowhere"),
        (lambda p: p.forecast(NONE, 1), ValueError, "c has 20 covariances"),
        (lambda p: p.forecast(NONE[:9], 0), ValueError, "steps is 0"),
        (lambda p: p.conditional(NONE).interval(1.0), ValueError, "confidence is 1.0, but must"),
        (lambda p: p.logpdf_estimate(NONE), ValueError, "use logpdf"),
        (lambda p: tmg.ToeplitzNormal(p.A.c, noise=0.1), ValueError, r"added to c\[0\]"),
        (lambda p: tmg.ToeplitzNormal(p.A.c, noise=-p.A.c), ValueError, "noise is negative"),
        (lambda p: tmg.ToeplitzNormal(p.A.c, noise=p.A.c).logdet_error, ValueError, "c has noise"),
        (lambda p: p.conditional(np.ones((2, 20))), ValueError, r"that of c, \(20,\): one series"),
        (lambda p: p.whiten(np.full(20, np.nan)), ValueError, "observed nowhere"),
        (lambda p: tmg.ToeplitzNormal(np.ones(3), mean=np.zeros(2)), ValueError, "must broadcast"),
        (lambda p: tmg.ToeplitzNormal(np.ones(3), mean=np.nan), ValueError, "mean is not finite"),
        (lambda p: tmg.ToeplitzNormal(np.ones(3, dtype=complex)), TypeError, "real numbers"),
        (lambda p: tmg.ToeplitzNormal(tmg.covariances.Exponential()), TypeError, r"use c\(n\)"),
        (lambda p: tmg.ToeplitzNormal(np.eye(3, 4)).whiten(np.zeros((3, 4))), ValueError, "whiten"),
        (lambda p: p.rvs(-1), ValueError, "size is -1"),
        (lambda p: p.rvs(1.5), TypeError, "must be an integer"),
        (lambda p: p.rvs(random_state=-1), ValueError, "random_state is -1, but must"),
        (lambda p: p.conditional(NONE).rvs(random_state="a"), TypeError, "random_state is 'a'"),
    ],
)  # fmt: skip
def test_bad_arguments(ask, error, message):
    with pytest.raises(error, match=message):
        ask(tmg.ToeplitzNormal(0.5 ** np.arange(20)))


@pytest.mark.filterwarnings("error")
def test_what_is_not_so_in_float64_is_refused_without_a_warning():
    """Though numbers overflow on the way."""
    process = tmg.ToeplitzNormal(np.exp(-((np.arange(3000) / 200) ** 2)))
    with pytest.raises(np.linalg.LinAlgError, match=r"leading \d+ x \d+ block .* nugget"):
        process.logpdf(np.zeros(3000))
    with pytest.raises(np.linalg.LinAlgError, match=r"c\[0\], the diagonal .* is 0, .*nugget"):
        tmg.ToeplitzNormal([0.0, 0.0])


@pytest.mark.parametrize("method", ["logpdf", "logpdf_and_grad"])
def test_what_is_not_positive_definite_is_refused(method):
    process = tmg.ToeplitzNormal(np.r_[1.0, 0.5, 0.9, -0.9, np.zeros(6)])
    with pytest.raises(np.linalg.LinAlgError, match=r"leading 4 x 4 block .*nugget"):
        getattr(process, method)(np.zeros(10))
    with pytest.raises(np.linalg.LinAlgError, match="nugget"):
        getattr(process, method)(np.zeros(10), np.arange(10) < 4)
    with pytest.raises(np.linalg.LinAlgError, match="nugget"):
        _ = process.conditional(np.zeros(10)).mean
    for name, arguments in (("rvs", ()), ("whiten", (np.zeros(10),))):
        with pytest.raises(np.linalg.LinAlgError, match="leading 4 x 4 block"):
            getattr(process, name)(*arguments)


def test_it_pickles_and_says_what_it_is():
    process = tmg.ToeplitzNormal(0.5 ** np.arange(20), mean=2.0)
    y = process.rvs(random_state=0)
    assert pickle.loads(pickle.dumps(process)).logpdf(y) == process.logpdf(y)
    assert repr(process) == "<ToeplitzNormal 20>"
    conditional = process.conditional(y, np.arange(20) < 5)
    assert repr(conditional) == "<Conditional <ToeplitzNormal 20>, 5 observed>"
    assert repr(tmg.ToeplitzNormal(np.eye(3, 4))) == "<ToeplitzNormal 3 x 4>"
    dense = np.linalg.slogdet(scipy.linalg.toeplitz(0.5 ** np.arange(20)))[1]
    assert process.logdet == pytest.approx(dense, rel=1e-12)


def test_the_mask_of_the_user_stays_his():
    observed, y = np.arange(20) < 5, np.linspace(-1.0, 1.0, 20)
    process = tmg.ToeplitzNormal(0.5 ** np.arange(20))
    first, second = (process.conditional(y, mask) for mask in (observed, observed.copy()))
    observed[:] = True
    np.testing.assert_array_equal(first.mean, second.mean)
    np.testing.assert_array_equal(first.rvs(random_state=0), second.rvs(random_state=0))
    assert repr(first) == repr(second)


@pytest.mark.parametrize(("n", "nugget"), [(257, 1e-8), (257, 1e-10), (1000, 1e-9), (2000, 1e-9)])
@pytest.mark.filterwarnings("ignore::scipy.linalg.LinAlgWarning")
def test_gaps_of_what_is_nearly_constant(n, nugget):
    """The matrix of ones and a nugget on the diagonal: its inverse is known, and ill-conditioned.

    What is missing is the sum of what is not over its number, but for the nugget.
    """
    c = np.ones(n)
    c[0] += nugget
    nugget = float(Fraction(float(c[0])) - 1)
    y = 0.1 + nugget**0.5 * np.random.default_rng(0).standard_normal(n)
    missing = np.arange(n // 3, n // 3 + 20)
    y[missing] = np.nan
    known = ~np.isnan(y)
    m = n - 20
    process = tmg.ToeplitzNormal(c)
    expected = y[known].sum() / (m + nugget)
    assert_allclose(process.conditional(y).mean[missing], expected, rtol=1e-9)
    values, v = [Fraction(value) for value in y[known].tolist()], Fraction(nugget)
    form = float((sum(x * x for x in values) - sum(values) ** 2 / (m + v)) / v)
    exact = -0.5 * (form + (m - 1) * np.log(nugget) + np.log(nugget + m) + m * np.log(2 * np.pi))
    assert abs(process.logpdf(y, observed=known) - exact) <= max(1e-5, 1e-15 * n / nugget)


def test_rounding_of_a_quadratic_form_is_said():
    c = np.ones(1000) + 1e-9 * np.eye(1, 1000)[0]
    y = np.random.default_rng(0).standard_normal(1000) * 1e-3
    with pytest.warns(scipy.linalg.LinAlgWarning) as told:
        tmg.ToeplitzNormal(c).logpdf(y)
    with pytest.warns(UserWarning, match="dense Toeplitz matrix") as of_dense:
        tmg.ToeplitzNormal([[2.0, 1.0], [1.0, 2.0]])
    assert any("with an error of up to" in str(w.message) and "A⁻¹" in str(w.message) for w in told)
    assert {w.filename for w in [*told, *of_dense]} == {__file__}


def test_a_gradient_with_gaps_does_not_depend_on_what_the_memory_held(monkeypatch):
    """New arrays of NumPy hold NaN here, as they may."""
    observed = ~np.isin(np.arange(200), [20, 21, 90])
    y = tmg.ToeplitzNormal(0.9 ** np.arange(200)).rvs(random_state=1)
    value, by_c, _ = tmg.ToeplitzNormal(0.9 ** np.arange(200)).logpdf_and_grad(y, observed=observed)
    empty = np.empty

    def full_of_nan(*shape, **options):
        array = empty(*shape, **options)
        if array.dtype.kind in "fc":
            array.fill(np.nan)
        return array

    monkeypatch.setattr(np, "empty", full_of_nan)
    process = tmg.ToeplitzNormal(0.9 ** np.arange(200))
    again, by_c_again, _ = process.logpdf_and_grad(y, observed=observed)
    assert again == value
    assert np.array_equal(by_c_again, by_c)
