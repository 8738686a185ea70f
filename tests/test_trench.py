import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import toeplitz

from toeplitz_mg.engine.row_sums import PART
from toeplitz_mg.operators.gohberg_semencul import GohbergSemencul
from toeplitz_mg.solvers.trench import column_and_row_of_inverse


def coefficients(kind, n):
    rng = np.random.default_rng(n)
    c, r = rng.standard_normal((2, n))
    if kind in ("complex", "Hermitian"):
        c, r = c + 1j * rng.standard_normal(n), r - 1j * rng.standard_normal(n)
    c[0] = 2.0 * n**0.5  # So no leading block is nearly singular.
    if kind == "symmetric":
        return c, c
    return (c, c.conj()) if kind == "Hermitian" else (c, r)


@pytest.mark.parametrize("kind", ["nonsymmetric", "symmetric", "Hermitian", "complex"])
@pytest.mark.parametrize("n", [1, 2, 3, 17, 200])
def test_column_and_row_are_those_of_the_dense_inverse(kind, n):
    c, r = coefficients(kind, n)
    x, y = column_and_row_of_inverse(c, r)
    inverse = np.linalg.inv(toeplitz(c, r))
    assert_allclose(x, inverse[:, 0], rtol=1e-9, atol=1e-12)
    assert_allclose(y, inverse[0], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("kind", ["nonsymmetric", "complex"])
def test_pieces_of_long_vectors_are_the_whole(kind, monkeypatch):
    c, r = coefficients(kind, 100)
    whole = column_and_row_of_inverse(c, r)
    monkeypatch.setattr("toeplitz_mg.solvers.trench.PART", 7)
    for a, b in zip(column_and_row_of_inverse(c, r), whole, strict=True):
        assert_allclose(a, b, rtol=1e-12, atol=1e-14)


@pytest.mark.slow
def test_a_column_longer_than_one_piece_is_solved_for():
    n = PART + 100
    c, r = coefficients("nonsymmetric", n)
    x, y = column_and_row_of_inverse(c, r)
    b = np.random.default_rng(0).standard_normal(n)
    solution = GohbergSemencul(x, y) @ b
    rows = np.arange(0, n, 1000)
    lags = np.concatenate([r[:0:-1], c])
    for i in rows:  # Row i of A has the lags i, i - 1, …, i - n + 1.
        assert_allclose(lags[i : i + n][::-1] @ solution, b[i], rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize(("c", "r"), [([0.0, 1.0], [0.0, 1.0]), ([1.0, 1.0], [1.0, 1.0])])
def test_a_singular_leading_block_is_refused(c, r):
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        column_and_row_of_inverse(np.array(c), np.array(r))
    with pytest.raises(np.linalg.LinAlgError, match=r"the leading [12] × [12] block is singular"):
        column_and_row_of_inverse(np.array([*c, 1.0]), np.array([*r, 2.0]))
