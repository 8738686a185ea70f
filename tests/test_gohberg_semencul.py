"""The certificate that the inverse from a column is positive definite, and its condition."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from comparisons.systems.symbols import column
from toeplitz_mg.operators.gohberg_semencul import Certificate, GohbergSemencul
from toeplitz_mg.preconditioners.schur import schur_column


def spectrum(x):
    dense = GohbergSemencul(x) @ np.eye(len(x))
    return np.linalg.eigvalsh((dense + dense.T) / 2)


@settings(deadline=None, max_examples=300)
@given(st.integers(1, 60), st.integers(0, 10**6), st.sampled_from([0.3, 0.03, 0.003]))
def test_what_is_certified_is_true(n, seed, near):
    """The zeros are on both sides of the unit circle, at all distances, in clusters too."""
    rng = np.random.default_rng(seed)
    zeros = np.exp(near * rng.standard_normal(n)) * np.exp(1j * rng.choice([0.0, 0.3, 3.1], n))
    zeros *= np.exp(1j * near * rng.standard_normal(n))
    zeros[rng.random(n) < 0.5] = 1.5
    if rng.random() < 0.7:
        zeros = np.where(abs(zeros) < 1.0, 1.0 / zeros.conj(), zeros)
    if rng.random() < 0.3:
        zeros[0] = rng.uniform(0.5, 1.01)
    x = np.poly(np.concatenate([zeros, zeros.conj()]))[::-1].real
    x *= np.copysign(1.0, x[0])
    certificate = Certificate.of(x)
    # Far from where the rounding of the eigenvalues would be as large as the smallest of them.
    if certificate.positive and certificate.condition < 1e10:
        assert spectrum(x)[0] > 0.0


@pytest.mark.parametrize("n", [2, 64, 211])
@pytest.mark.parametrize("name", ["θ⁴ + 1", "contact", "Gaussian", "θ²", "(2 - 2 cos θ)²"])
def test_certifies_the_inverse_of_usual_matrices(name, n):
    """So it is not always in doubt; and the condition is not that of some other matrix."""
    c = column(name, n) if n > 2 else np.array([2.0, 1.0])
    x, _ = schur_column(c)
    certificate = Certificate.of(x)
    assert certificate.positive
    eigenvalues = spectrum(x)
    condition = eigenvalues[-1] / eigenvalues[0]
    assert 0.9 * condition <= certificate.condition <= 10.0 * condition


@pytest.mark.parametrize("x", [[1.0, 2.0], [1.0, -1.0], [1.0, 0.0, 0.0, 1.0], [-1.0, 0.0]])
def test_a_zero_within_or_on_the_circle_is_never_certified(x):
    assert not Certificate.of(np.array(x)).positive


def test_one_transform_at_four_points_a_coefficient_is_no_limit_of_certainty():
    """Two zeros between two samples, one of them within, turn the phase by nothing there."""
    n = 64
    for shift in np.linspace(0.0, 0.5, 11):
        pair = np.exp(2j * np.pi * (5 + shift) / (4 * n)) * np.array([0.999, 1.001])
        x = np.poly(np.concatenate([pair, pair.conj(), np.full(n - 5, 3.0)]))[::-1].real
        x *= np.copysign(1.0, x[0])
        assert not Certificate.of(x).positive
