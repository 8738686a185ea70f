"""Covariances and their derivatives, against 60 digits; their sums, grids and parameters."""

import numpy as np
import pytest
from mpmath import mp, mpf
from numpy.testing import assert_allclose

from toeplitz_mg.covariances import (
    ARFIMA,
    ARMA,
    Custom,
    DampedCosine,
    Exponential,
    FractionalGaussianNoise,
    Matern,
    Periodic,
    SquaredExponential,
    WhiteNoise,
)

N = 10**6
LAGS = [0, 1, 2, 3, 4, 5, 10, 31, 32, 33, 101, 12345, N - 1]
ZERO, ONE = mpf(0), mpf(1)
IN_STEPS = ARFIMA | ARMA | FractionalGaussianNoise

# Definitions, by numbers of many digits ----------------------------------------------------------


def matern(x, variance, length, nu):
    y = mp.sqrt(2 * nu) * x / length
    factor = variance * 2 ** (1 - nu) / mp.gamma(nu)
    return factor * y**nu * mp.besselk(nu, y) if x else variance


def fractional_noise(k, variance, hurst):
    above, at, below = (mpf(t) ** (2 * hurst) if t else ZERO for t in (k + 1, k, abs(k - 1)))
    return variance / 2 * (above - 2 * at + below)


def fractional_difference(k, d):
    correlation = mp.rf(d, k) / mp.rf(1 - d, k)
    return mp.gamma(1 - 2 * d) / mp.gamma(1 - d) ** 2 * correlation


def arfima(k, sigma2, d, phi=ZERO, theta=ZERO):
    """Of order (1, d, 1), by Hosking's hypergeometric functions."""

    def autoregression(k):
        sums = [mp.hyp2f1(1, d + s * k, 1 - d + s * k, phi) for s in (1, -1)] if phi else (1, 0)
        return fractional_difference(k, d) / (1 - phi**2) * (sum(sums) - bool(phi))

    beside = autoregression(abs(k - 1)) + autoregression(k + 1) if theta else ZERO
    return sigma2 * ((1 + theta**2) * autoregression(k) + theta * beside)


def arma(p):
    """Return the covariance for p coefficients φ and others θ: C Pᵏ C' of a state space."""

    def covariance(k, sigma2, *coefficients):
        phi, theta = coefficients[:p], (ONE, *coefficients[p:])
        m = max(p, len(theta))
        move, noise = mp.zeros(m), mp.matrix([*theta, *[ZERO] * (m - len(theta))])
        for i in range(m):
            move[i, 0] = phi[i] if i < p else ZERO
            if i + 1 < m:
                move[i, i + 1] = ONE
        states = noise * noise.T  # Their covariance Σ Mⁱ b bᵀ Mⁱᵀ, by doubling the sum.
        power = move.copy()
        while mp.mnorm(power) > mpf(10) ** -80:
            states, power = states + power * states * power.T, power * power
        return sigma2 * (move**k * states)[0, 0]

    return covariance


FUNCTIONS = {
    WhiteNoise: lambda x, s: ZERO if x else s,
    Exponential: lambda x, s, r: s * mp.exp(-x / r),
    SquaredExponential: lambda x, s, r: s * mp.exp(-((x / r) ** 2) / 2),
    Matern: matern,
    Periodic: lambda x, s, r, T: s * mp.exp(-2 * (mp.sin(mp.pi * x / T) / r) ** 2),
    DampedCosine: lambda x, s, r, T: s * mp.exp(-x / r) * mp.cos(2 * mp.pi * x / T),
    FractionalGaussianNoise: fractional_noise,
    ARFIMA: arfima,
}
CASES = [
    WhiteNoise(0.3),
    *(kind(2.0, r) for kind in (Exponential, SquaredExponential) for r in (1e-9, 3.0, 3e5)),
    *(Matern(1.5, 3.0, nu) for nu in (1e-3, 0.3, 0.5, 1.0, 1.5, 2.5, 7.1, 99.0)),
    *(Matern(1.5, 3e5, nu) for nu in (0.3, 1.5, 99.0)),
    *(Periodic(2.0, r, T) for r in (0.05, 20.0) for T in (2.3, 365.2425)),
    *(DampedCosine(2.0, r, T) for r in (10.0, 1e7) for T in (2.3, 365.2425)),
    *(FractionalGaussianNoise(1.7, H) for H in (1e-6, 0.2, 0.3, 0.5, 0.5001, 0.8, 1.0 - 1e-6)),
    *(ARFIMA(1.3, d) for d in (-0.9999, -0.5, -1e-9, 0.0, 0.05, 0.3, 0.4999999)),
    *(ARFIMA(1.3, d, phi) for d, phi in ((-0.45, 0.7), (0.3, 0.7), (0.3, 1.0 - 1e-7))),
    ARFIMA(1.3, 0.3, -0.95, 0.4),
    ARMA(0.5, ma=[0.5, 0.3, 0.2]),
    *(ARMA(0.5, phi) for phi in (0.9, -0.9, 1.0 - 1e-8)),
    ARMA(0.5, [1.2, -0.5], 0.4),
    ARMA(0.5, [0.5, 0.2, -0.1], [0.9, 0.3, -0.2, 0.1]),
    ARMA(0.5, [2.39, -1.916, 0.5247]),
    ARMA(0.5, [1.9087623, -0.998001]),
]


@pytest.mark.slow
@pytest.mark.parametrize("k", CASES, ids=repr)
def test_values_and_derivatives_are_right_to_rounding(k):
    function = FUNCTIONS.get(type(k)) or arma(sum(name.startswith("ar") for name in k.names))
    spacing = 1.0 if isinstance(k, IN_STEPS) else 0.1
    values, gradient = k.values_and_gradient(N, spacing=spacing)
    theta = [mpf(float(t)) for t in k.theta]
    with mp.workdps(60):
        lags = [m if isinstance(k, IN_STEPS) else m * mpf(spacing) for m in LAGS]
        expected = np.array([function(x, *theta) for x in lags])
        variance = expected[0]
        assert max(abs(values[LAGS] - expected)) < 1e-12 * variance
        for i, name in enumerate(k.names):
            step = mpf(10) ** -18
            ends = [[*theta[:i], theta[i] + s * step, *theta[i + 1 :]] for s in (1, -1)]
            above, below = (np.array([function(x, *end) for x in lags]) for end in ends)
            slopes = (above - below) / (2 * step)
            is_series = name == "nu" or (isinstance(k, ARFIMA) and "." in name)
            size = max(variance, *abs(slopes))
            assert max(abs(gradient[i, LAGS] - slopes)) < (1e-8 if is_series else 1e-12) * size


# Grids, sums, parameters -------------------------------------------------------------------------

COMPOSED = {
    "sum": Exponential(2.0, 5.0) + 3.0 * Matern(length=7.0, nu=1.3) + WhiteNoise(0.1),
    "product": 0.5 * Periodic(period=6.3) * SquaredExponential(length=9.0).fix("variance"),
    "nested": (Exponential(length=4.0) + WhiteNoise(0.2)) * DampedCosine(length=3.0, period=5.5),
    "by axis": Matern(1.2, (3.0, 5.0), 0.8) + DampedCosine(0.5, (9.0, 4.0), (6.0, 7.0)),
    "one for all axes": Periodic(2.0, 0.9, 4.5) * DampedCosine(1.0, 8.0, 7.0) + Exponential(),
    "process": ARFIMA(0.7, -0.2, [0.5, -0.3], 0.4) + ARMA(1.0, 0.6, [0.3, 0.2]).fix("ma"),
    "custom": Custom(lambda x, a, b: a / (1.0 + abs(x) / b), ["a", "b"], [2.0, 3.0]) * Matern(),
}


@pytest.mark.parametrize("k", COMPOSED.values(), ids=COMPOSED)
def test_gradients_are_the_slopes_of_the_values(k):
    is_wavy = any("[1]" in name or "period" in name for name in k.names)
    n, spacing = ((7, 9), (0.5, 2.0)) if is_wavy else (60, 0.8)
    values, gradient = k.values_and_gradient(n, spacing=spacing)
    assert_allclose(values, k(n, spacing=spacing), rtol=1e-14)
    assert_allclose(gradient, k.gradient(n, spacing=spacing))
    for i, theta in enumerate(k.theta):
        step = 1e-5 * abs(theta) * np.eye(len(k.theta))[i]
        above, below = (k.with_theta(k.theta + s * step)(n, spacing=spacing) for s in (1, -1))
        assert_allclose(gradient[i], (above - below) / (2.0 * step[i]), atol=1e-7 * values.max())


def test_sums_products_and_multiples_are_those_of_the_values():
    a, b, c = Exponential(2.0, 5.0), Matern(length=3.0), WhiteNoise(0.1)
    assert_allclose((a + b + 2.0 * c)(9), a(9) + b(9) + 2.0 * c(9))
    assert_allclose((a * (np.float64(3.0) * b) * c)(9), 3.0 * a(9) * b(9) * c(9))
    assert (a + b + c).names == (a + (b + c)).names
    assert (a + 2.0 * c).names == ("0.variance", "0.length", "1.variance")
    assert ((a + c) * b).names[:3] == ("0.0.variance", "0.0.length", "0.1.variance")
    with pytest.raises(TypeError):
        a + 1.0
    with pytest.raises(ValueError, match="factor is -1, but must be positive"):
        -1 * a


def test_parameters_are_held_and_replaced_without_a_change_of_the_covariance():
    k = Matern(2.0, (3.0, 4.0), 1.5) + ARMA(ar=[0.5, 0.2])
    assert k.names[:4] == ("0.variance", "0.length[0]", "0.length[1]", "0.nu")
    held = k.fix("0.length", "1.ar.L1")
    assert held.names == ("0.variance", "0.nu", "1.sigma2", "1.ar.L2")
    other = held.with_theta([5.0, 0.7, 1.2, 0.1])
    assert_allclose(other.theta, [5.0, 0.7, 1.2, 0.1])
    assert_allclose(k.theta, [2.0, 3.0, 4.0, 1.5, 1.0, 0.5, 0.2])
    assert eval(repr(other.fix("0.nu"))).names == other.fix("0.nu").names
    assert (k.bounds.T[0] < k.theta).all()
    assert (k.theta < k.bounds.T[1]).all()
    assert Periodic().fix("variance", "length", "period").gradient(5).shape == (0, 5)


def test_covariances_on_grids_are_of_the_distances():
    x, y = 0.5 * np.arange(7.0)[:, np.newaxis], 2.0 * np.arange(9.0)
    n, spacing = (7, 9), (0.5, 2.0)
    assert_allclose(Exponential(length=3.0)(n, spacing=spacing), np.exp(-np.hypot(x, y) / 3.0))
    by_axis = SquaredExponential(length=(3.0, 4.0))(n, spacing=spacing)
    assert_allclose(by_axis, np.exp(-(x**2) / 18.0) * np.exp(-(y**2) / 32.0))
    waves = DampedCosine(length=1e9, period=(5.0, 6.0))(n, spacing=spacing)
    assert_allclose(waves, np.cos(2 * np.pi * x / 5.0) * np.cos(2 * np.pi * y / 6.0), atol=1e-7)
    assert_allclose(Exponential(length=3.0)((1, 9)), Exponential(length=(1.0, 3.0))((1, 9)))
    lags = Custom(lambda lags, a: a * np.exp(-lags.sum(axis=0)), ["a"], [2.0])(n, spacing=spacing)
    assert_allclose(lags, 2.0 * np.exp(-x - y))


def test_a_function_of_ones_own_may_have_derivatives():
    given = ["a", "b"], [2.0, 3.0], [(0.0, np.inf), (0.0, np.inf)]
    k = Custom(lambda x, a, b: a * np.exp(-x / b), *given)
    gradient = lambda x, a, b: [np.exp(-x / b), a * x / b**2 * np.exp(-x / b)]  # noqa: E731
    exact = Custom(lambda x, a, b: a * np.exp(-x / b), *given, gradient=gradient)
    assert_allclose(exact.gradient(50), Exponential(2.0, 3.0).gradient(50), rtol=1e-14)
    assert_allclose(k.gradient(50), exact.gradient(50), atol=1e-9)
    assert_allclose(k.fix("a").gradient(50), exact.gradient(50)[1:], atol=1e-9)


@pytest.mark.parametrize("k", [*COMPOSED.values(), FractionalGaussianNoise(), ARFIMA()], ids=repr)
def test_fewer_points_have_the_first_of_the_values(k):
    axes = 2 if any("[1]" in name for name in k.names) else 1
    values, gradient = k.values_and_gradient((40,) * axes)
    for n in (1, 2, 5):
        first, slopes = k.values_and_gradient((n,) * axes)
        assert_allclose(first, values[(slice(n),) * axes], atol=1e-13 * values.max())
        assert_allclose(slopes, gradient[(..., *(slice(n),) * axes)], atol=1e-12 * values.max())


def test_arfima_without_integration_is_arma():
    ar, ma = [1.2, -0.5], [0.4, 0.2]
    values, gradient = ARFIMA(1.0, 0.0, ar, ma).values_and_gradient(300)
    expected, slopes = ARMA(1.0, ar, ma).values_and_gradient(300)
    assert_allclose(values, expected, atol=1e-13 * expected[0])
    assert_allclose(np.delete(gradient, 1, axis=0), slopes, atol=1e-12 * abs(slopes).max())


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Exponential(-1.0), "variance is -1.0, but must be positive"),
        (lambda: Exponential(1.0, [2.0, 0.0]), r"length\[1\] is 0.0, but must be positive"),
        (lambda: Exponential([1.0, 2.0]), r"variance is \[1.0, 2.0\], but must be a number"),
        (lambda: Exponential(1e-50), "variance is of size 1e-50, but must"),
        (lambda: Matern(nu=np.nan), "nu is nan, but must be finite"),
        (lambda: Matern(nu=100.0), "nu is 100.0, but must lie between 0 and 100"),
        (lambda: FractionalGaussianNoise(hurst=1.0), "hurst is 1.0, but must lie between 0 and 1"),
        (lambda: ARFIMA(d=0.5), "d is 0.5, but must lie between -1 and 0.5"),
        (lambda: ARMA(ar=1.0), "ar.L1 is 1.0, but must lie between -1 and 1"),
        (lambda: ARMA(ar=[0.6, 0.4]), "ar is .*, but must be stationary"),
        (lambda: ARMA(ma=[0.5, 0.3]).with_theta([1.0, 1.5, 0.3]), "ma is .*must be invertible"),
        (lambda: ARMA()((3, 4)), "ARMA is a process of one axis, but the grid has"),
        (lambda: Exponential(length=(1.0, 2.0))(5), "length has 2 values, but the grid has 1"),
        (lambda: Exponential()(0), "n is 0, but must be at least 1"),
        (lambda: Exponential()(()), r"n is \(\), but must be"),
        (lambda: Exponential()(5, spacing=-1.0), "spacing is -1.0, but must be positive"),
        (lambda: Exponential()((5, 6), spacing=(1.0,)), "spacing is .*one for each axis"),
        (lambda: Exponential().fix("l"), "'l' is no parameter, but must be one of variance, leng"),
        (lambda: Exponential().with_theta([1.0]), r"theta has shape \(1,\), but must have \(2,\)"),
        (lambda: Custom(np.multiply, ["a"], [1.0, 2.0]), "theta has shape"),
        (lambda: Custom(np.multiply, ["a", "a"], [1.0, 2.0]), "names are .*but must differ"),
        (lambda: Custom(np.multiply, ["a"], [1.0], [(2.0, 3.0)]), "a is 1.0, but must lie between"),
        (lambda: Custom(lambda x, a: a, ["a"], [1.0])(3), "function returns an array of shape"),
    ],
)
def test_what_is_no_covariance_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
