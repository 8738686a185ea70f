"""Many small systems at once: each is solved as it would be alone, or not at all."""

import warnings

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from toeplitz_mg.solvers.batch import LARGEST, NUMBERS, is_faster_at_once, solve_at_once
from toeplitz_mg.solvers.levinson import levinson, levinson_of_batch

AT_ONCE = "levinson for all at once"


def frames(systems, n, seed=5):
    """Autocorrelations of random signals: the systems of linear prediction."""
    signals = np.random.default_rng(seed).standard_normal((systems, 8 * n)).cumsum(axis=1)
    spectrum = np.fft.rfft(signals, 16 * n)
    lags = np.fft.irfft(abs(spectrum) ** 2)[:, : n + 1]
    return lags[:, :n], lags[:, 1:]


@pytest.mark.parametrize("columns", [1, 3])
@pytest.mark.parametrize(("systems", "n"), [(60, 1), (200, 12), (NUMBERS // 9 + 3, 9), (150, 64)])
def test_every_system_is_solved(systems, n, columns):
    c, b = frames(systems, n)
    b = b[..., np.newaxis] * (1.0 + np.arange(columns))
    x, info = tmg.solve_toeplitz(c, b, full_output=True)
    assert info.method == AT_ONCE
    assert info.residual <= 1e-12
    A = np.stack([scipy.linalg.toeplitz(column) for column in c])
    residuals = np.linalg.norm(A @ x - b, axis=1) / np.linalg.norm(b, axis=1)
    assert residuals.max() <= 1e-12


def test_leading_axes_and_one_right_hand_side_for_all():
    c, b = frames(120, 5)
    x = tmg.solve_toeplitz(c.reshape(4, 30, 5), b.reshape(4, 30, 5, 1))
    assert_allclose(x.reshape(120, 5), tmg.solve_toeplitz(c, b[..., np.newaxis])[..., 0])
    of_one = tmg.solve_toeplitz((c, c), b[0])
    assert of_one.shape == (120, 5)
    assert_allclose(of_one[7], tmg.solve_toeplitz(c[7], b[0]), rtol=1e-9)


def test_what_the_recursion_does_not_solve_is_solved_alone():
    c, b = frames(100, 3)
    b = b[..., np.newaxis].copy()
    c[1] = 1e-300, 0.0, 0.0  # Squares underflow.
    c[2] = 1e-13, 1.0, 0.5  # The recursion loses 13 digits.
    c[3] = 0.0, 1.0, 0.5  # It divides by zero.
    c[4] *= -1.0
    b[5] = 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        x, info = tmg.solve_toeplitz(c, b, full_output=True)
    assert info.residual <= 1e-12
    for k in range(10):
        exact = np.linalg.solve(scipy.linalg.toeplitz(c[k]), b[k])
        assert_allclose(x[k], exact, rtol=1e-9)


def test_one_bad_system_is_an_error_as_it_is_alone():
    c, b = frames(100, 4)
    b = b[..., np.newaxis]
    singular = c.copy()
    singular[40] = 1.0
    with pytest.raises(np.linalg.LinAlgError, match="A is singular"):
        tmg.solve_toeplitz(singular, b)
    bad = c.copy()
    bad[40, 2] = np.nan
    with pytest.raises(ValueError, match="c has entries that are not finite"):
        tmg.solve_toeplitz(bad, b)
    x = tmg.solve_toeplitz(bad, b, check_finite=False)
    assert np.isnan(x[40]).all()
    assert np.isfinite(np.delete(x, 40, axis=0)).all()


def test_the_errors_reported_are_true():
    c, b = frames(80, 6)
    found = solve_at_once(c, b[..., np.newaxis])
    A = np.stack([scipy.linalg.toeplitz(column) for column in c])
    r = np.linalg.norm(b - (A @ found.x)[..., 0], axis=1)
    assert_allclose(found.residuals, r / np.linalg.norm(b, axis=1), atol=1e-14)
    assert (found.backward_errors <= found.residuals).all()


def test_few_or_large_systems_are_solved_one_by_one():
    assert is_faster_at_once(1000, 12)
    assert not is_faster_at_once(10, 12)
    assert not is_faster_at_once(10**6, LARGEST + 1)


def test_the_recursion_for_all_is_that_for_each():
    rng = np.random.default_rng(2)
    c, b = rng.standard_normal((7, 30)), rng.standard_normal((7, 2, 30))
    c[0] = 5.0
    x = levinson_of_batch(c, b)
    for k in range(30):
        lags = np.concatenate([c[:0:-1, k], c[:, k]])
        assert_allclose(x[..., k].T, levinson(lags, b[..., k].T.copy()), rtol=1e-9)


def test_what_is_no_batch_is_refused():
    with pytest.raises(ValueError, match=r"c has shape \(2, 4\), .* and b \(3, 4, 1\), but"):
        tmg.solve_toeplitz(np.ones((2, 4)), np.ones((3, 4, 1)))
