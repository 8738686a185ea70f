"""Levinson's and Trench's recursions solve with every leading block, or name the singular one."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import toeplitz

from toeplitz_mg.solvers.toeplitz.levinson import column_and_row_of_inverse


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


@pytest.mark.parametrize(("c", "r"), [([0.0, 1.0], [0.0, 1.0]), ([1.0, 1.0], [1.0, 1.0])])
def test_a_singular_leading_block_is_refused(c, r):
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        column_and_row_of_inverse(np.array(c), np.array(r))
    with pytest.raises(np.linalg.LinAlgError, match=r"the leading [12] × [12] block is singular"):
        column_and_row_of_inverse(np.array([*c, 1.0]), np.array([*r, 2.0]))
