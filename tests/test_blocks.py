"""Block Toeplitz systems of several channels, against dense definitions."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import LinAlgWarning

import toeplitz_mg as tmg
from tests.systems import seeded


def covariance(n, k, is_complex=False, nugget=0.01):
    """Return the covariances of k channels that are mixed noise, positive definite."""
    length = 4 * n
    y = seeded(k, length) + (1j * seeded(k, length, seed=1) if is_complex else 0.0)
    for lag in range(1, 9):
        y = y + 0.6**lag * seeded(k, k, seed=2 + lag) @ np.roll(y, lag, axis=1)
    f = np.fft.fft(y, 2 * length)
    c = np.fft.ifft(f[:, np.newaxis] * f.conj())[..., :n].transpose(2, 0, 1) / length
    c = c if is_complex else c.real
    c[0] = (c[0] + c[0].conj().T) / 2 + nugget * np.trace(c[0]).real / k * np.eye(k)
    return c


def dense_of(c):
    n, k, _ = c.shape
    A = np.empty((n, k, n, k), c.dtype)
    for i in range(n):
        for j in range(n):
            A[i, :, j] = c[i - j] if i >= j else c[j - i].conj().T
    return A.reshape(n * k, n * k)


CHANNELS = [(1, 1), (5, 1), (7, 2), (40, 3), (250, 4), (120, 8)]


@pytest.mark.parametrize(("n", "k"), CHANNELS)
@pytest.mark.parametrize("is_complex", [False, True])
def test_solutions_and_determinants_are_those_of_the_dense_matrix(n, k, is_complex):
    c = covariance(n, k, is_complex)
    A, b = dense_of(c), seeded(n, k, 2, seed=9)
    x, info = tmg.solve_block_toeplitz(c, b, full_output=True)
    expected = np.linalg.solve(A, b.reshape(n * k, 2)).reshape(b.shape)
    assert_allclose(x, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    assert info.residual <= 1e-11
    assert_allclose(tmg.solve_block_toeplitz(c, b[:, :, 0]), x[:, :, 0], rtol=0, atol=1e-10)
    logdet = tmg.block_toeplitz_logdet(c)
    assert_allclose(logdet, np.linalg.slogdet(A)[1], rtol=1e-9, atol=1e-9)


def test_long_systems_are_solved_by_iterations_and_hard_ones_all_the_same():
    c, b = covariance(1000, 2, nugget=0.1), seeded(1000, 2)
    x, easy = tmg.solve_block_toeplitz(c, b, full_output=True)
    assert easy.residual <= 1e-11
    assert 1 < easy.iterations <= 100
    # One channel and nearly the same again, of a frequency that sweeps, as in echo cancellation.
    t = np.arange(4000) / 4000
    sweep = np.cos(2 * np.pi * (5 * t + 800 * t**2))
    f = np.fft.fft(np.stack([sweep, sweep + 1e-3 * seeded(4000)]), 8000)
    c = np.fft.ifft(f[:, np.newaxis] * f.conj()).real[..., :600].transpose(2, 0, 1) / 4000
    c[0] = (c[0] + c[0].T) / 2
    x, hard = tmg.solve_block_toeplitz(c, b[:600], full_output=True)
    assert hard.backward_error <= 1e-14
    r = dense_of(c) @ x.ravel() - b[:600].ravel()
    assert np.linalg.norm(r) <= 2 * hard.residual * np.linalg.norm(b[:600])


def test_indefinite_and_wrong_input_is_refused():
    c = covariance(5, 2)
    for n in (5, 400):
        indefinite = np.concatenate([c, np.zeros((n - 5, 2, 2))])
        indefinite[1] = 3 * c[0]
        for call in (tmg.block_toeplitz_logdet, lambda c: tmg.solve_block_toeplitz(c, c[:, 0])):
            with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
                call(indefinite)
    for wrong, b, message in (
        (c[:, 0], c[:, 0], r"must have \(n, k, k\)"),
        (c, c[:4, 0], r"must have \(5, 2\)"),
        (np.triu(c), c[:, 0], r"c\[0\] is not Hermitian"),
        (c, np.full((5, 2), np.nan), "not finite"),
    ):
        with pytest.raises(ValueError, match=message):
            tmg.solve_block_toeplitz(wrong, b)


def test_a_large_residual_is_warned_of():
    c = np.full((3, 2, 2), 1.0)
    c[0] += 1e-13 * np.eye(2)
    with pytest.warns(LinAlgWarning, match="ill-conditioned"):
        tmg.solve_block_toeplitz(c, seeded(3, 2))
