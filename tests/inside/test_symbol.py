"""What coefficients say of their matrix.

The samples of a symbol are those of all its lags where their decay tells how they go on; the
certificate that M̄ is positive definite never certifies what is not; Lanczos's method finds the
smallest eigenvalue.
"""

from functools import reduce

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from tests.cases import contact, submatrix
from toeplitz_mg.operators.positivity import ritz_values
from toeplitz_mg.operators.symbol import sample_symbol
from toeplitz_mg.preconditioners.row_sum import is_certainly_positive


def with_row_sums(M, gamma):
    return M - np.diag(M.sum(axis=1) - gamma)


@settings(deadline=None, max_examples=100)
@given(st.data())
def test_what_is_certain_is_true(data):
    shape = data.draw(st.sampled_from([(2,), (5,), (12,), (3, 4), (6, 1), (5, 6), (2, 3, 3)]))
    rng = np.random.default_rng(data.draw(st.integers(0, 10**6)))
    distance = np.indices(shape).sum(axis=0)
    m = -rng.random(shape) * 4.0 ** (-distance.astype(float))
    # A few positive coefficients, as large as may just be outweighed.
    flips = rng.random(shape) < 0.4
    m[flips] *= -data.draw(st.sampled_from([0.01, 0.1, 0.3, 1.0]))
    M = tmg.ToeplitzOperator(m)
    mask = None
    dense = M.toarray()
    if data.draw(st.booleans()):
        mask = rng.random(shape) < 0.7
        mask.flat[0] = True
        dense = submatrix(dense, mask)
    gamma = data.draw(st.sampled_from([1e-3, 0.05, 1.0]))
    if is_certainly_positive(M, mask, gamma):
        assert np.linalg.eigvalsh(with_row_sums(dense, gamma)).min() > 0


def test_a_hole_breaks_the_path():
    """Two elements two apart with a positive m_2 between them, and nothing to outweigh it."""
    M = tmg.ToeplitzOperator([5.0, -4.0, 0.9, 0.0])
    assert is_certainly_positive(M, None, 0.1)
    assert not is_certainly_positive(M, np.array([True, False, True, False]), 0.1)


@pytest.mark.parametrize("n", [1, 2, 5, 60])
def test_lanczos_finds_the_smallest_eigenvalue(n):
    A = tmg.ToeplitzOperator(contact(n))
    M_bar = tmg.fft_rsm_preconditioner(A)
    exact = np.linalg.eigvals(M_bar @ A.toarray()).real.min()
    assert ritz_values(A, M_bar, 40)[0] == pytest.approx(exact, rel=0.05)


@pytest.mark.parametrize("n", [100, 101, 1024])
def test_a_wide_covariance_has_the_samples_of_all_its_lags(n):
    theta = np.pi * np.arange(n + 1) / n
    rho = np.exp(-4 / n)
    samples = sample_symbol(tmg.ToeplitzOperator(rho ** np.arange(n)), (n,))
    assert_allclose(samples, (1 - rho**2) / (1 - 2 * rho * np.cos(theta) + rho**2), rtol=1e-3)
    for covariance in (lambda k: (1 + 9 * k / n) ** -3.0, lambda k: np.exp(-((2 * k / n) ** 2))):
        k = np.arange(1.0, 400.0 * n)
        sums = [1.0 + 2.0 * covariance(k) @ np.cos(t * k) for t in theta[:5]]
        A = tmg.ToeplitzOperator(covariance(np.arange(n)))
        assert_allclose(sample_symbol(A, (n,))[:5], sums, rtol=1e-3)


@pytest.mark.parametrize(
    ("shape", "lengths"), [((67,), (72,)), ((20, 13), (20, 15)), ((5, 7, 6), (5, 8, 6))], ids=str
)
@pytest.mark.parametrize("end", [1, 2])
def test_a_spike_is_not_continued(shape, lengths, end):
    """The samples are those of the trigonometric polynomial with the coefficients there are."""
    c = np.zeros(shape)
    c[tuple(n - end for n in shape)] = -1.0
    c.flat[0] = 9.0
    waves = [
        2.0 * np.cos(np.pi * np.arange(m + 1) * (n - end) / m)
        for n, m in zip(shape, lengths, strict=True)
    ]
    samples = sample_symbol(tmg.ToeplitzOperator(c), lengths)
    assert_allclose(samples, 9.0 - reduce(np.multiply, np.ix_(*waves)), rtol=0, atol=1e-12)
