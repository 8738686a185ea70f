"""Systems whose coefficients, or whose unknowns, are of very different sizes."""

import warnings

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose, assert_array_equal
from scipy.signal import lfilter

import toeplitz_mg as tmg

SIZES = 5, 50, 300, 1000, 3000


def unit(n, k=0, value=1.0):
    return value * np.eye(1, n, k, dtype=type(value))[0]


def large_lags(n):
    one = unit(n)
    return {
        "beyond the middle": (one + unit(n, n // 2 + 1, 1e7),) * 2,
        "in both corners": (one + unit(n, n - 1, 1e12),) * 2,
        "in one corner": (one + unit(n, n - 1, 1e7), one),
        "in one corner, with a neighbour": (one + unit(n, n - 1, 1e8), one + unit(n, 1, 0.5)),
    }


def backward_error(c, r, x, b):
    """Return the error of each row, over the sizes of its own terms."""
    A = scipy.linalg.toeplitz(c, r)
    residual = np.abs(b - A @ x)
    return float((residual / (np.abs(A) @ np.abs(x) + np.abs(b))).max())


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("name", large_lags(5))
def test_large_lags_that_meet_small_unknowns_lose_no_digits(name, n):
    """Their rounding is that of the terms of the sums, not of the largest number times another."""
    c, r = large_lags(n)[name]
    b = np.random.default_rng(n).standard_normal(n)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        x = tmg.solve_toeplitz((c, r), b)
    A = scipy.linalg.toeplitz(c, r)
    terms = np.linalg.norm(np.abs(A) @ np.abs(x))
    assert np.linalg.norm(b - A @ x) <= 1e-12 * np.linalg.norm(b) + 1e-14 * terms


@pytest.mark.parametrize("n", [2, 60, 1000, 3000])
@pytest.mark.parametrize("pole", [0.5, 1.05, 2.0])
def test_the_impulse_response_of_a_filter(pole, n):
    """It may grow beyond any residual: each row holds to rounding, and no digits are lost."""
    n = n if pole == 1.05 else min(n, 400)
    taps = np.array([1.0, -pole])
    c, r = np.pad(taps, (0, n - 2)), unit(n)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        x = tmg.solve_toeplitz((c, r), r)
        upper = tmg.solve_toeplitz((r, c), r[::-1])
        several = tmg.solve_toeplitz((c, r), np.stack([r, 2.0 * r], axis=1))
    assert_allclose(x, lfilter([1.0], taps, r), rtol=1e-11)
    assert_array_equal(upper, x[::-1])
    assert_allclose(several, np.stack([x, 2.0 * x], axis=1), rtol=1e-14)


def test_a_signal_that_a_recursion_loses_is_warned_of():
    """What the errors make grows as 2^k, and x does not."""
    taps, x = np.array([1.0, -2.5, 1.0]), np.random.default_rng(0).random(300)
    c, b = np.pad(taps, (0, 297)), np.convolve(taps, x)[:300]
    with pytest.warns(scipy.linalg.LinAlgWarning, match="A is ill-conditioned"):
        tmg.solve_toeplitz((c, unit(300)), b)


@pytest.mark.parametrize("dtype", [float, complex])
@pytest.mark.parametrize("band", [1, 3, 64, 65, 300])
def test_triangular_matrices(band, dtype):
    n, rng = 400, np.random.default_rng(band)
    c = np.pad(rng.standard_normal(band).astype(dtype), (0, n - band))
    c[0] = 3.0 * band
    diagonal = np.zeros(n, dtype)
    diagonal[0] = c[0]
    b = rng.standard_normal(n)
    assert backward_error(c, diagonal, tmg.solve_toeplitz((c, diagonal), b), b) <= 1e-13
    for ignored in (c[0], 0.0, 7.0):
        x = tmg.solve_toeplitz((diagonal, np.append(ignored, c[1:])), b)
        assert backward_error(diagonal, c, x, b) <= 1e-13


def test_systems_without_a_solution_are_errors():
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        tmg.solve_toeplitz((unit(6, 1), np.zeros(6)), np.ones(6))
    with pytest.raises(np.linalg.LinAlgError, match="beyond the largest number"):
        tmg.solve_toeplitz((np.pad([1.0, -3.0], (0, 648)), unit(650)), np.ones(650))
    c = np.stack([unit(5, 0, 2.0), np.ones(5), unit(5, 0, 3.0)])
    with pytest.raises(np.linalg.LinAlgError, match=r"system \(1,\)"):
        tmg.solve_toeplitz(c, np.arange(5.0))


def test_each_system_of_a_batch_is_warned_of():
    """One that is worse, or that is no number, does not hide another."""
    good, ill = unit(300, 0, 2.0), np.ones(300) + unit(300, 0, 1e-10)
    b = np.random.default_rng(0).standard_normal(300)
    for others in ([good], [good, np.full(300, np.nan)]):
        with pytest.warns(scipy.linalg.LinAlgWarning, match="ill-conditioned"):
            tmg.solve_toeplitz(np.stack([*others, ill]), b, check_finite=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", scipy.linalg.LinAlgWarning)
        _, alone = tmg.solve_toeplitz(ill, b, full_output=True)
        _, both = tmg.solve_toeplitz(np.stack([good, ill]), b, full_output=True)
    assert both.residual[1] == alone.residual
    assert both.backward_error[1] == alone.backward_error


def test_shapes_are_named_as_they_are_given():
    a = np.array([4.0, 1.0, 0.5, 0.25])
    for c, b in ((a, np.ones((4, 3, 2))), (a[:, None], np.ones(4)), (np.stack([a, a]), np.ones(3))):
        with pytest.raises(ValueError, match="shape") as error:
            tmg.solve_toeplitz(c, b)
        assert str(c.shape) in str(error.value)
        assert str(b.shape) in str(error.value)


def test_numbers_that_are_not_finite_stay_in_their_columns():
    c = np.array([4.0, 1.0, 0.5, 0.25])
    B = np.ones((4, 3))
    B[1, 1] = np.nan
    x = tmg.solve_toeplitz(c, B, check_finite=False)
    assert np.isnan(x[:, 1]).all()
    assert_allclose(x[:, 0], tmg.solve_toeplitz(c, np.ones(4)), rtol=1e-14)
    assert_array_equal(x[:, 0], x[:, 2])
    assert x.flags.c_contiguous
