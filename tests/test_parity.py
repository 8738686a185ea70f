"""Even and odd parts: what A M is on them, and that GMRES there needs fewer iterations."""

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from toeplitz_mg.preconditioners.circulant import chan_eigenvalues, smooth_inverse
from toeplitz_mg.solvers.attempts import solve_by_gmres, within
from toeplitz_mg.solvers.parity import Halves, TransformedHalves, join, split
from toeplitz_mg.solvers.system import ToeplitzSystem

SIZES = [2, 3, 4, 7, 8, 30, 31, 64]
rng = np.random.default_rng


def make(n):
    """An indefinite matrix, the circulant by T. Chan's eigenvalues, and its inverse, dense."""
    c = rng([n, 5]).standard_normal(n)
    A = tmg.ToeplitzOperator(c)
    eigenvalues = chan_eigenvalues(A)
    return c, A, eigenvalues, smooth_inverse(A, eigenvalues)


@pytest.mark.parametrize("n", SIZES)
def test_both_parts_are_what_their_names_say(n):
    X = rng(n).standard_normal((3, n))
    parts = split(X)
    half = (n + 1) // 2
    assert parts.shape == (3, 2 * half)
    even, odd = parts.copy(), parts.copy()
    even[:, half:] = odd[:, :half] = 0.0
    assert_allclose(join(even, n), (X + X[:, ::-1]) / 2, atol=1e-14)
    assert_allclose(join(odd, n), (X - X[:, ::-1]) / 2, atol=1e-14)
    assert_allclose(join(parts, n), X, atol=1e-14)
    assert_allclose(parts @ parts.T, X @ X.T, atol=1e-13 * n)
    assert_allclose(split(X[0]), parts[0], rtol=0, atol=0)
    into = np.empty_like(parts)
    assert split(X, into) is into
    assert np.array_equal(into, parts)


@pytest.mark.parametrize("n", SIZES)
def test_products_are_those_of_both_matrices(n):
    c, A, eigenvalues, M = make(n)
    product = scipy.linalg.toeplitz(c) @ (M @ np.eye(n))
    forms = [Halves(A, M)] + [TransformedHalves(c, eigenvalues)] * (n % 2 == 0)
    X = rng([n, 1]).standard_normal((2, n))
    size = np.linalg.norm(product) * np.linalg.norm(X) + np.linalg.norm(M @ np.eye(n))
    for form in forms:
        Y = form.transform(X)
        before = Y.copy()
        Z = form.A.apply(Y)
        assert np.array_equal(Y, before)
        # Its way back is M times the vectors: of A M Y it is M A M X.
        assert_allclose(form.transform_back(Y), (M @ X.T).T, atol=1e-13 * size)
        assert_allclose(Z, form.transform(X @ product.T), atol=1e-13 * size)
        assert_allclose(form.A.apply(Y[0]), Z[0], atol=1e-14 * size)
        # Neither part gets anything from the other.
        for part in np.split(np.arange(Y.shape[1]), 2):
            own = np.zeros_like(Y)
            own[:, part] = Y[:, part]
            others = np.delete(form.A.apply(own), part, axis=1)
            assert_allclose(others, 0.0, atol=1e-13 * size)


def test_an_eigenvalue_of_zero_is_refused():
    with pytest.raises(np.linalg.LinAlgError, match="eigenvalue"):
        TransformedHalves(np.ones(4), np.array([1.0, 0.0, 1.0]))


@pytest.mark.parametrize("n", [1024, 1025, 2**15])
def test_gmres_on_both_parts_solves_in_fewer_iterations(n):
    """Than on vectors as they are: the polynomial in A M is then one for both of its parts."""
    c = 1.0 / (1.0 + np.arange(n))
    c[0] -= 0.3
    b = rng(n).standard_normal((2, n))
    system = ToeplitzSystem(c, c, b)
    halves = system.halves(system.samples)
    assert isinstance(halves, TransformedHalves) == (n == 1024)
    M = smooth_inverse(system.A, system.samples)
    X, parted = within(halves, lambda B, rtol: solve_by_gmres(halves.A, None, B, rtol, parts=2))(
        b, 1e-8
    )
    _, whole = solve_by_gmres(system.A, M, b, 1e-8)
    residuals = b - system.A.apply(X)
    assert np.all(np.linalg.norm(residuals, axis=1) <= 1.1e-8 * np.linalg.norm(b, axis=1))
    assert parted < whole
