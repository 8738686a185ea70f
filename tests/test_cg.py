"""cg: SciPy's iterates, its signature and its answers, without its allocations."""

import numpy as np
import pytest
import scipy.sparse.linalg
from numpy.testing import assert_allclose
from scipy.sparse.linalg import aslinearoperator

import toeplitz_mg as tmg
from comparisons.systems.symbols import column
from tests.systems import count_iterations, preconditioners, refuses


def system(n=900):
    A = tmg.ToeplitzOperator(column("contact", n))
    return A, np.random.default_rng(0).standard_normal(n)


def turned(n, turn):
    """A real or Hermitian matrix of condition 9, and a right-hand side."""
    k, b = np.arange(n), np.random.default_rng(0).standard_normal((2, n))
    if not turn:
        return tmg.ToeplitzOperator(0.5**k), b[0]
    return tmg.ToeplitzOperator(0.5**k * np.exp(1j * turn * k)), b[0] + 1j * b[1]


@pytest.mark.parametrize("preconditioner", [None, tmg.fft_preconditioner, tmg.chan_preconditioner])
@pytest.mark.parametrize("with_guess", [False, True])
@pytest.mark.parametrize(("turn", "size"), [(0.0, 1.0), (0.0, 3e-7), (0.0, 3e9), (0.7, 1.0)])
def test_the_iterates_are_those_of_scipy(preconditioner, with_guess, turn, size):
    """The condition number is 9, so that eight iterations do not amplify the rounding of either."""
    A, b = turned(900, turn)
    b, M = size * b, preconditioner and preconditioner(A)
    x0 = size * np.arange(900.0) if with_guess else None
    ours, theirs = [], []
    for cg, iterates in ((tmg.cg, ours), (scipy.sparse.linalg.cg, theirs)):
        x, info = cg(
            A, b, x0, M=M, rtol=0.0, maxiter=8, callback=lambda x, i=iterates: i.append(x.copy())
        )
        iterates.append(x)
        assert info == 8
    assert_allclose(ours, theirs, atol=1e-12 * np.abs(theirs[-1]).max())


@pytest.mark.parametrize("preconditioner", [tmg.fft_preconditioner, tmg.cosine_preconditioner])
@pytest.mark.parametrize("size", [1.0, 1e-25, 1e25])
@pytest.mark.parametrize("with_guess", [False, True])
@pytest.mark.parametrize(("rtol", "more"), [(1e-8, 2), (1e-11, 5)])
def test_an_iteration_in_float32_reaches_the_same_residual(
    preconditioner, size, with_guess, rtol, more
):
    A, b = system()
    options = {"M": preconditioner(A, dtype=np.float32), "rtol": rtol, "maxiter": 40}
    guess, counts = size * np.ones(900) if with_guess else None, []
    for inner in (None, A.astype(np.float32)):
        residuals = []
        x, info = tmg.cg(A, size * b, guess, inner=inner, residuals=residuals, **options)
        assert info == 0
        assert x.dtype == np.float64
        assert np.linalg.norm(b - A @ (x / size)) <= 1.01 * rtol * np.linalg.norm(b)
        counts.append(len(residuals))
    assert counts[1] <= counts[0] + more


@pytest.mark.parametrize("turn", [0.0, 0.7])
@pytest.mark.parametrize("size", [1e-300, 1e-42, 1e39, 1e300])
@pytest.mark.parametrize("with_guess", [False, True])
def test_an_inner_iteration_whatever_the_size_of_b(turn, size, with_guess):
    """Neither b nor the solution is a number of float32."""
    A, b = turned(200, turn)
    guess = size * np.linspace(-1.0, 1.0, 200) if with_guess else None
    inner = A.astype(np.complex64 if turn else np.float32)
    x, info = tmg.cg(A, size * b, guess, rtol=1e-12, inner=inner)
    assert info == 0
    assert np.linalg.norm(b - A @ (x / size)) <= 1.01e-12 * np.linalg.norm(b)


@pytest.mark.parametrize(
    "preconditioner", preconditioners("strang chan fft fft_rsm cosine sine spectral")
)
@pytest.mark.parametrize("n", [900, 40000])
def test_a_preconditioner_in_float32_costs_few_iterations(preconditioner, n):
    A, b = system(n)
    counts = []
    for dtype in (np.float64, np.float32):
        M = preconditioner(A, dtype=dtype)
        assert M.dtype == dtype
        counts.append(count_iterations(tmg.cg, A, b, M=M, rtol=1e-10))
    assert counts[1] <= counts[0] + 6
    refuses(TypeError, "dtype is int64", preconditioner, A, dtype=int)


def test_what_is_not_positive_definite_is_reported():
    A, b = system(50)
    x, info = tmg.cg(-A, b)
    assert info == 1
    assert not x.any()
    x, info = tmg.cg(A, b, M=-np.eye(50))
    assert info == 1
    assert not x.any()


@pytest.mark.parametrize("shape", [(300,), (900,), (40000,), (9, 8), (60, 70)])
def test_less_precision_is_that_of_the_coefficients(shape):
    c = np.exp(-np.sqrt(np.indices(shape).sum(axis=0)))
    A = tmg.ToeplitzOperator(c)
    x = np.random.default_rng(0).standard_normal(c.size).astype(np.float32)
    anew = tmg.ToeplitzOperator(c.astype(np.float32))
    mask = np.arange(c.size).reshape(shape) % 3 > 0
    for one, other in ((A, anew), [tmg.CoupledOperator([[B]]) for B in (A, anew)]):
        less = one.astype(np.float32)
        assert less.dtype == np.float32
        assert_allclose(less @ x, other @ x, atol=1e-6 * np.abs(c).sum())
        assert less.astype(np.float32) is less
        more = less.astype(np.float64)  # It has the digits of float32, and their products.
        assert_allclose(more @ x, other.astype(np.float64) @ x, atol=1e-13 * np.abs(c).sum())
    small = tmg.MaskedOperator(A, mask).astype(np.float32)
    assert_allclose(
        small @ x[mask.ravel()], tmg.MaskedOperator(anew, mask) @ x[mask.ravel()], atol=1e-5
    )


def test_what_is_refused_as_inner():
    A, b = system()
    with pytest.raises(ValueError, match=r"inner has shape \(3, 3\), but A has \(900, 900\)"):
        tmg.cg(A, b, inner=np.eye(3))
    refuses(TypeError, "inner is True, but must be A in lower precision", tmg.cg, A, b, inner=True)
    refuses(TypeError, "inner has dtype complex128", tmg.cg, A, b, inner=np.eye(900) + 0j)
    # Too coarse an approximation of A is not a solution, and not an endless loop.
    x, info = tmg.cg(A, b, inner=tmg.ToeplitzOperator(1.5 * A.c), rtol=1e-8, maxiter=30)
    assert info == 30
    assert np.isfinite(x).all()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("name", ["θ²", "θ⁴", "wide Gaussian", "sinc", "contact"])
@pytest.mark.parametrize("with_guess", [False, True])
def test_info_is_zero_only_at_the_goal(dtype, name, with_guess):
    """The recurrence reaches any goal, in float32 or where A is ill-conditioned; x does not."""
    n = 300
    A = tmg.ToeplitzOperator(column(name, n).astype(dtype))
    dense = A.toarray().astype(np.float64)
    M = tmg.default_preconditioner(tmg.ToeplitzOperator(column(name, n)))
    rng = np.random.default_rng(0)
    refused = 0
    for rtol in (1e-5, 1e-8, 1e-11):
        b, x0 = rng.standard_normal((2, n)).astype(dtype)
        steps = []
        x, info = tmg.cg(
            A, b, x0 if with_guess else None, M=M, rtol=rtol, maxiter=500, callback=steps.append
        )
        residual = np.linalg.norm(b - dense @ x.astype(np.float64)) / np.linalg.norm(b)
        assert info in (0, max(len(steps), 1))
        # 3: the residual that is computed has a rounding of its own.
        assert info > 0 or residual <= 3 * rtol
        refused += info > 0
    if dtype == np.float32:  # In float32 nothing is solved to 1e-11.
        assert refused > 0


def test_a_residual_that_has_drifted_is_iterated_upon_once():
    """An operator whose first products are rough, as in a system where rounding is large."""
    n = 100
    A = tmg.ToeplitzOperator(0.5 ** np.arange(n))
    b = np.random.default_rng(0).standard_normal(n)
    for rough_products, expected in ((5, 0), (10**6, 1)):
        calls = []

        def rough(x, calls=calls, most=rough_products):
            calls.append(1)
            return A @ x * (1.0 + 1e-4 * (len(calls) <= most) * np.sin(1e3 * len(calls)))

        operator = scipy.sparse.linalg.LinearOperator((n, n), rough, dtype=np.float64)
        steps = []
        x, info = tmg.cg(operator, b, rtol=1e-10, callback=steps.append)
        assert min(info, 1) == expected
        assert info in (0, len(steps))
        if info == 0:
            assert np.linalg.norm(b - A @ x) <= 2e-10 * np.linalg.norm(b)


def test_one_product_an_iteration_and_one_to_look_at_the_result():
    A = tmg.ToeplitzOperator(0.5 ** np.arange(500))
    b = np.random.default_rng(0).standard_normal(500)
    for guess, extra in ((None, 1), (np.ones(500), 2)):
        steps = []
        with tmg.count_products() as work:
            _, info = tmg.cg(A, b, guess, rtol=1e-6, callback=steps.append)
        assert info == 0
        assert work.products == len(steps) + extra
    with tmg.count_products() as work:  # The first residual is the true one.
        _, info = tmg.cg(A, A @ np.ones(500), np.ones(500), rtol=1e-6)
    assert (info, work.products) == (0, 2)  # One of the two made b.


@pytest.mark.parametrize(("dtype", "rtol"), [(np.complex64, 1e-4), (np.complex128, 1e-11)])
@pytest.mark.parametrize("preconditioner", [lambda A: None, tmg.chan_preconditioner])
@pytest.mark.parametrize("with_guess", [False, True])
def test_hermitian_matrices(dtype, rtol, preconditioner, with_guess):
    A, b = turned(200, 0.7)
    A, b, x0 = A.astype(dtype), b.astype(dtype), b[::-1].astype(dtype) if with_guess else None
    assert count_iterations(tmg.cg, A, b, rtol, x0=x0, M=preconditioner(A)) <= 40


@pytest.mark.parametrize("inner", [None, np.float32])
def test_a_real_matrix_takes_a_complex_right_hand_side(inner):
    """The answer is that of the real and the imaginary parts side by side."""
    A = tmg.ToeplitzOperator(0.5 ** np.arange(900))
    M = tmg.chan_preconditioner(A)
    b = np.random.default_rng(0).standard_normal((2, 900))
    inside = None if inner is None else A.astype(inner)
    z, info = tmg.cg(A, b[0] + 1j * b[1], M=M, rtol=1e-11, inner=inside)
    assert info == 0
    assert z.dtype == np.complex128
    parts = [tmg.cg(A, part, M=M, rtol=1e-12)[0] for part in b]
    assert_allclose([z.real, z.imag], parts, atol=1e-9)


def test_what_is_complex_and_not_hermitian_is_reported():
    rng = np.random.default_rng(0)
    A = np.eye(40) + 0.1 * (rng.standard_normal((40, 40)) + 1j * rng.standard_normal((40, 40)))
    b = rng.standard_normal(40) + 0j
    x, info = tmg.cg(A, b, rtol=1e-10)
    assert info > 0 or np.linalg.norm(b - A @ x) <= 1e-9 * np.linalg.norm(b)
    x, info = tmg.cg(1j * np.eye(40), b)
    assert info == 1
    assert not x.any()


def test_preconditioners_of_a_part_of_a_grid_are_operators_too():
    """Some have fewer unknowns than their grid has elements, and do not know the mask."""
    shape = 37, 41
    rng = np.random.default_rng(0)
    mask = rng.random(shape) < 0.5
    full = tmg.ToeplitzOperator(1.0 / (1.0 + np.hypot(*np.indices(shape))))
    A = tmg.MaskedOperator(full, mask)
    coupled = tmg.MaskedOperator(tmg.CoupledOperator([[full, None], [None, full]]), [mask] * 2)
    d = scipy.sparse.diags_array(np.linspace(0.5, 1.5, full.shape[0]))
    shifted = tmg.MaskedOperator(full + d, mask)
    for B in (A, coupled, shifted):
        P = tmg.default_preconditioner(B)
        b = rng.standard_normal(P.shape[0])
        x, info = tmg.cg(P, b, rtol=1e-10)
        assert info == 0
        assert_allclose(P @ x, b, atol=1e-8)


def test_a_preconditioner_that_cannot_be_symmetric_is_warned_of():
    A, b = system(600)
    S, C = tmg.fft_preconditioner(A), tmg.cosine_preconditioner(A)
    before, after = tmg.multigrid(A, post=0), tmg.multigrid(A, pre=0)
    for M in (before, after, 2 * after, S + after, tmg.fft_sd_preconditioner(A), S @ C, S @ A):
        with pytest.warns(UserWarning, match="not symmetric, but cg needs that"):
            tmg.cg(A, b, M=M, maxiter=3)
        tmg.richardson(A, b, M=M, maxiter=3)
        tmg.gmres(A, b, M=M, maxiter=3)
    # Symmetric, by what they are made of; and what does not tell.
    own = tmg.multigrid(A, smoother=lambda A: aslinearoperator(np.eye(A.shape[0]) / A.norm_bound))
    symmetric = tmg.multigrid(A), S, C @ S @ C, 2 * S - S @ A @ S, S**2
    for M in (*symmetric, before @ after, own, after @ np.eye(600)):
        tmg.cg(A, b, M=M, maxiter=3)


def test_what_a_callback_does_is_its_own():
    A = tmg.ToeplitzOperator(0.5 ** np.arange(50))
    with np.errstate(over="raise"), pytest.raises(FloatingPointError):
        tmg.cg(A, np.ones(50), callback=lambda x: np.float64(1e308) * np.float64(10.0))
