"""GMRES and CG step by step.

A space of GMRES has an orthonormal basis, and the least residual of all its vectors; the directions
of CG are conjugate, and solve in as many steps as there are distinct eigenvalues.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from toeplitz_mg.engine.conjugate_gradients import ConjugateGradients
from toeplitz_mg.engine.krylov_space import Basis, KrylovSpace

DTYPES = [np.float32, np.float64, np.complex64, np.complex128]


def system(shape, dtype):
    """A field, and products with a matrix that has no symmetry."""
    rng = np.random.default_rng(0)
    n = int(np.prod(shape))
    A, r = np.eye(n) + 0.1 * rng.standard_normal((n, n)), rng.standard_normal(shape)
    if np.dtype(dtype).kind == "c":
        A = A + 0.1j * rng.standard_normal((n, n))
        r = r + 1j * rng.standard_normal(shape)
    A, r = A.astype(dtype), r.astype(dtype)
    return A, r, lambda v, out: (A @ v.ravel()).reshape(v.shape)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("shape", [(30,), (2, 3, 5)])
def test_the_residual_is_the_least_of_the_space(dtype, shape):
    A, r, multiply = system(shape, dtype)
    rounding = 1e4 * np.finfo(dtype).eps
    space = KrylovSpace(multiply, Basis(shape, dtype, 12))
    space.begin(r)
    powers = [r.ravel() / np.linalg.norm(r)]
    for k in range(1, 13):
        least = space.extend()
        assert space.dimension == k
        V = space.basis.vectors[:k].reshape(k, -1)
        assert_allclose(V.conj() @ V.T, np.eye(k), atol=rounding)
        # The space is that of r, A r, A² r, ...
        powers[-1] -= V.T @ (V.conj() @ powers[-1])
        assert np.linalg.norm(powers[-1]) <= rounding
        powers.append(A @ V[-1])
        # The least residual is that of a dense least-squares problem.
        y = np.linalg.lstsq(A @ V.T, r.ravel())[0]
        expected = np.linalg.norm(r.ravel() - A @ (V.T @ y))
        x = space.solution()
        assert_allclose(np.linalg.norm(r - multiply(x, x)), expected, atol=rounding)
        assert_allclose(least, expected, atol=rounding)


def test_a_basis_is_orthogonal_where_products_cancel():
    """A matrix that is nearly the unit matrix: a product is the last vector but for 1e-8."""
    rng = np.random.default_rng(0)
    E = rng.standard_normal((40, 40))
    space = KrylovSpace(lambda v, out: v + 1e-8 * (E @ v), Basis((40,), np.float64, 10))
    space.begin(rng.standard_normal(40))
    for _ in range(10):
        space.extend()
    V = space.basis.vectors[:10]
    assert_allclose(V @ V.T, np.eye(10), atol=1e-12)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("size", [1e-15, 1.0, 1e15])
def test_directions_are_conjugate_and_end_with_the_distinct_eigenvalues(dtype, size):
    """Whatever the size of the preconditioner."""
    rounding, size = 1e4 * np.finfo(dtype).eps, np.finfo(dtype).dtype.type(size)
    rng = np.random.default_rng(0)
    X = rng.standard_normal((20, 20)) + 1j * rng.standard_normal((20, 20))
    Q = np.linalg.qr(X if np.dtype(dtype).kind == "c" else X.real)[0]
    A = ((Q * np.repeat([1.0, 2.0, 3.0, 5.0], 5)) @ Q.conj().T).astype(dtype)
    b = rng.standard_normal(20).astype(dtype)
    x, r, directions = np.zeros_like(b), b.copy(), []
    iteration = ConjugateGradients(lambda d, out: A @ d, lambda r, out: r * size)
    for _ in range(4):
        length = iteration.step(r)
        assert iteration.rho > 0.0 < iteration.curvature
        x += length * iteration.direction
        r -= length * iteration.product
        directions.append(iteration.direction / np.linalg.norm(iteration.direction))
    assert_allclose(A @ x, b, atol=rounding)
    D = np.array(directions)
    products = D.conj() @ A @ D.T
    assert_allclose(products, np.diag(products.diagonal()), atol=rounding)
