"""toeplitz_inverse is the inverse, at two work units a product, as exactly as it says."""

import gc
import tracemalloc

import numpy as np
import pytest
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from comparisons.systems.symbols import HERMITIAN, NONSYMMETRIC, column
from tests.budgets import assert_within_budget
from tests.systems import refuses

SYMMETRIC = [
    *("θ⁴ + 1", "(1+k)^-1.1", "cos k/(k+1)", "0.9^k", "fGn, H = 0.9", "|θ|", "contact"),
    *("Gaussian", "θ²", "2 - 2 cos θ", "2 + 2 cos θ"),
]
OF_NAME = {name: lambda n, name=name: (column(name, n),) for name in SYMMETRIC}
OF_NAME |= NONSYMMETRIC | HERMITIAN  # First columns, and first rows.


@pytest.mark.parametrize("n", [3, 64, 401])
@pytest.mark.parametrize("name", OF_NAME)
def test_is_the_inverse(name, n):
    A = tmg.ToeplitzOperator(*OF_NAME[name](n))
    A_inverse = tmg.toeplitz_inverse(A)
    assert A_inverse.residual <= 1e-10
    assert (A_inverse.H is A_inverse) == (name not in NONSYMMETRIC)
    assert A_inverse.H.residual <= 1e-10
    dense = np.linalg.inv(A.toarray())
    atol = 1e-14 * np.linalg.cond(A.toarray()) * abs(dense).max()
    assert_allclose(A_inverse @ np.eye(n), dense, atol=atol)
    assert_allclose(A_inverse.H @ np.eye(n), dense.conj().T, atol=atol)
    B = np.random.default_rng(7).standard_normal((n, 5))
    assert np.linalg.norm(B - A @ (A_inverse @ B)) <= 1e-9 * np.linalg.norm(B)


@pytest.mark.parametrize("name", ["convection-diffusion", "three plane waves + noise"])
def test_so_it_is_after_refinement(name):
    A = tmg.ToeplitzOperator(*OF_NAME[name](200))
    refined = tmg.toeplitz_inverse(A).refined
    dense = np.linalg.inv(A.toarray())
    assert_allclose(refined @ np.eye(200), dense, atol=1e-12 * abs(dense).max())
    assert_allclose(refined.H @ np.eye(200), dense.conj().T, atol=1e-12 * abs(dense).max())
    assert refined.work == pytest.approx(5.0)


@pytest.mark.parametrize("name", ["contact", "fGn, H = 0.9"])
def test_a_product_costs_two_work_units_and_the_set_up_some_thirty(name):
    n = 2**16
    A = tmg.ToeplitzOperator(column(name, n))
    with tmg.count_products() as work:
        A_inverse = tmg.toeplitz_inverse(A, rtol=1e-11)
    assert_within_budget("toeplitz_inverse, n = 2^16", work_units=work.units(n))
    with tmg.count_products() as work:
        A_inverse @ np.ones(n)
    assert work.units(n) == 2.0
    assert A_inverse.residual <= 1e-11
    assert repr(A_inverse).startswith(f"<ToeplitzInverse {n}, residual ")


@pytest.mark.parametrize("name", ["fGn, H = 0.9", "convection-diffusion", "|θ - 1|"])
def test_single_precision_has_a_goal_of_its_own(name):
    pair = OF_NAME[name](300)
    single = np.complex64 if pair[0].dtype.kind == "c" else np.float32
    A_inverse = tmg.toeplitz_inverse(tmg.ToeplitzOperator(*(v.astype(single) for v in pair)))
    assert A_inverse.dtype == single
    assert A_inverse.residual <= 1e-3
    assert (A_inverse @ np.ones(300, single)).dtype == single


def test_refuses_bad_arguments_and_says_what_it_cannot_meet():
    A = tmg.ToeplitzOperator([2.0, 1.0])
    refuses(TypeError, "MaskedOperator", tmg.toeplitz_inverse, tmg.MaskedOperator(A, [True, False]))
    refuses(TypeError, "must be a ToeplitzOperator", tmg.toeplitz_inverse, np.eye(2))
    with pytest.raises(ValueError, match="must have one axis"):
        tmg.toeplitz_inverse(tmg.ToeplitzOperator([[2.0, 1.0], [0.5, 0.1]]))
    for rtol in (0.0, -1.0, np.nan):
        refuses(ValueError, "rtol is", tmg.toeplitz_inverse, A, rtol=rtol)
    A = tmg.ToeplitzOperator(column("(2 - 2 cos θ)²", 4096))
    refuses(np.linalg.LinAlgError, r"achieved is .* at most 1.0e-10", tmg.toeplitz_inverse, A)
    for c in ([1.0, 2.0], [1.0, 2.0, 3.0, 4.0], [-1.0], [0.0, 0.0]):
        with pytest.raises(np.linalg.LinAlgError):
            tmg.toeplitz_inverse(tmg.ToeplitzOperator(c))
    for n in (40, 97, 200):
        # Its inverse has entries of up to 1000^n.
        with pytest.raises(np.linalg.LinAlgError):
            tmg.toeplitz_inverse(tmg.ToeplitzOperator(0.001 * np.eye(1, n)[0], np.eye(1, n, 1)[0]))
    for n in (5, 300, 3000):
        c = 0.9 ** np.arange(n)
        for A in (tmg.ToeplitzOperator(size * c) for size in (1e-200, 1e200)):
            refuses(ValueError, "coefficients of A are of size", tmg.toeplitz_inverse, A)
            process = tmg.ToeplitzNormal(A.c)
            refuses(ValueError, "coefficients of A are of size", process.logpdf, c)


@pytest.mark.parametrize("dtype", [np.float32, np.complex64])
@pytest.mark.parametrize("n", [5, 100, 301])
def test_what_an_inverse_in_single_precision_tells_is_in_double(dtype, n):
    c = 0.5 ** np.arange(n)  # Exact in single precision, as far as it goes.
    inverse = tmg.toeplitz_inverse(tmg.ToeplitzOperator(c.astype(dtype)))
    exact = (n - 1) * np.log(0.75)
    assert abs(inverse.logdet - exact) <= 1e-10 * n
    sums = np.r_[2.0 / 0.75 + (n - 2) * 1.25 / 0.75, -(n - 1) * 0.5 / 0.75, np.zeros(n - 2)]
    assert_allclose(inverse.diagonal_sums, sums, rtol=1e-10, atol=1e-10 * n)


def test_inverses_of_many_large_sizes_leave_little_in_memory():
    primes, left = (100003, 100019, 100043, 100049, 100057, 100069), []
    tracemalloc.start()
    try:
        for n in primes:
            A_inverse = tmg.toeplitz_inverse(
                tmg.ToeplitzOperator(0.5 ** np.minimum(np.arange(n), 99))
            )
            A_inverse @ np.ones(n)
            del A_inverse
            gc.collect()
            left.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert left[-1] - left[1] <= 16 * primes[-1]  # One complex vector.
