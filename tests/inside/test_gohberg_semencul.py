"""The inverse of a Toeplitz matrix has only as many numbers as its first column and row.

It is positive definite exactly if the polynomial of its column has no zero in the closed unit disc,
which samples on the circle can prove.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import toeplitz

import toeplitz_mg as tmg
from comparisons.systems.symbols import column
from tests.systems import seeded
from toeplitz_mg.columns.circle import Certificate
from toeplitz_mg.columns.gohberg_semencul import GohbergSemencul
from toeplitz_mg.columns.schur import schur_column


def matrix(n, dtype):
    """A matrix far from singular, whose column and row differ in size by a factor of 100."""
    decay = (1.0 + np.arange(n)) ** -1.5
    c, r = seeded(2, n, dtype=dtype) * decay
    return toeplitz(np.r_[8.0, 3.0 * c[1:]], np.r_[8.0, 0.03 * r[1:]])


@pytest.mark.parametrize("dtype", [np.float64, np.complex128])
def test_long_ones_invert_a_bidiagonal_matrix_and_a_factor(dtype):
    """Of (1 - a z)(1 - b/z) and of a matrix with one diagonal below, the inverses are known."""
    n = 40000
    a = dtype(0.5) if dtype is np.float64 else 0.4 + 0.3j
    x, y = a ** np.arange(n), np.eye(1, n)[0].astype(dtype)
    V = seeded(2, n, dtype=dtype)
    expected = V.copy()  # The sums over j ≤ i of aⁱ⁻ʲ vⱼ: what is 60 apart is of no account.
    for k in range(1, 120):
        expected[:, k:] += a**k * V[:, :-k]
    assert_allclose(GohbergSemencul(x, y).apply(V), expected, atol=1e-12)
    backward = V.copy()
    for k in range(1, 120):
        backward[:, :-k] += a.conjugate() ** k * V[:, k:]
    assert_allclose(GohbergSemencul(x, y).H.apply(V), backward, atol=1e-12)


@pytest.mark.parametrize("dtype", [np.float32, np.complex64])
def test_single_precision_takes_what_is_out_of_its_range_inside(dtype):
    """2 x₀ would overflow, or its square be zero."""
    for scale in (2e38, 1e-30):
        dense = np.linalg.inv(matrix(300, np.result_type(dtype, np.float64)))
        G = GohbergSemencul(*(v.astype(dtype) for v in (dense[:, 0] * scale, dense[0] * scale)))
        v = seeded(300, dtype=dtype) * dtype(1e-3)
        product = G @ v
        assert product.dtype == dtype
        assert_allclose(product / scale, dense @ v, atol=1e-8)


def test_says_what_no_inverse_has():
    with pytest.raises(np.linalg.LinAlgError, match="first entry of the inverse is 0"):
        GohbergSemencul(np.array([0.0, 1.0]), np.array([0.0, 1.0]))
    with pytest.raises(np.linalg.LinAlgError, match=r"first entry of the inverse is 1\+1j"):
        GohbergSemencul(np.array([1.0 + 1.0j, 1.0]))
    with pytest.raises(ValueError, match=r"x has shape \(2,\) and y has \(3,\)"):
        GohbergSemencul(np.ones(2), np.ones(3))
    with pytest.raises(TypeError, match="y is a masked array"):
        GohbergSemencul(np.ones(2), np.ma.masked_array([1.0, 2.0], [False, True]))


def test_a_step_of_refinement_makes_an_inverse_of_a_poor_column():
    n = 500
    A = tmg.ToeplitzOperator(column("contact", n))
    x = np.linalg.inv(A.toarray())[:, 0]
    noisy = x * (1 + 1e-7 * np.random.default_rng(0).standard_normal(n))
    poor = tmg.ToeplitzInverse(A, GohbergSemencul(noisy), 0)
    assert 1e-12 < poor.residual < 1e-3
    assert poor.refined.residual < 1e-3 * poor.residual
    dense = poor.refined @ np.eye(n)
    assert_allclose(dense, dense.T, atol=1e-9 * abs(dense).max())


def spectrum(x):
    dense = GohbergSemencul(x) @ np.eye(len(x))
    return np.linalg.eigvalsh((dense + dense.conj().T) / 2)


@settings(deadline=None, max_examples=100)
@given(
    st.integers(1, 60), st.integers(0, 10**6), st.sampled_from([0.3, 0.03, 0.003]), st.booleans()
)
def test_what_is_certified_is_true(n, seed, near, is_complex):
    """The zeros are on both sides of the unit circle, at all distances, in clusters too."""
    rng = np.random.default_rng(seed)
    zeros = np.exp(near * rng.standard_normal(n)) * np.exp(1j * rng.choice([0.0, 0.3, 3.1], n))
    zeros *= np.exp(1j * near * rng.standard_normal(n))
    zeros[rng.random(n) < 0.5] = 1.5
    if rng.random() < 0.7:
        zeros = np.where(abs(zeros) < 1.0, 1.0 / zeros.conj(), zeros)
    if rng.random() < 0.3:
        zeros[0] = rng.uniform(0.5, 1.01)
    if is_complex:
        x = np.poly(zeros)[::-1]
        x = x * (x[0].conj() / abs(x[0]))
        x[0] = x[0].real
    else:
        x = np.poly(np.concatenate([zeros, zeros.conj()]))[::-1].real
        x *= np.copysign(1.0, x[0])
    certificate = Certificate.of(x)
    # Far from where the rounding of the eigenvalues would be as large as the smallest of them.
    if certificate.positive and certificate.condition < 1e10:
        assert spectrum(x)[0] > 0.0


@pytest.mark.parametrize("n", [2, 64, 211])
@pytest.mark.parametrize("turn", [0.0, 1.0])
@pytest.mark.parametrize("name", ["θ⁴ + 1", "contact", "Gaussian", "θ²", "(2 - 2 cos θ)²"])
def test_certifies_the_inverse_of_usual_matrices(name, turn, n):
    """So it is not always in doubt; and the condition is not that of some other matrix."""
    c = column(name, n) if n > 2 else np.array([2.0, 1.0])
    c = c * np.exp(1j * turn * np.arange(n)) if turn else c
    x, _ = schur_column(c)
    certificate = Certificate.of(x)
    assert certificate.positive
    eigenvalues = spectrum(x)
    condition = eigenvalues[-1] / eigenvalues[0]
    assert 0.9 * condition <= certificate.condition <= 10.0 * condition


@pytest.mark.parametrize(
    "x",
    [
        *([1.0, 2.0], [1.0, -1.0], [1.0, 0.0, 0.0, 1.0], [-1.0, 0.0]),
        *([1.0, 2.0j], [1.0, -1.0j], [1.0, 0.0, 0.0, 1.0j], [-1.0 + 0j, 0.0]),
    ],
)
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
