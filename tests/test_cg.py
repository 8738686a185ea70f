"""cg: SciPy's iterates, its signature and its answers, without its allocations."""

import numpy as np
import pytest
import scipy.sparse.linalg
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from comparisons.symbols import column


def system(n=900):
    A = tmg.ToeplitzOperator(column("contact", n))
    return A, np.random.default_rng(0).standard_normal(n)


@pytest.mark.parametrize("preconditioner", [None, tmg.fft_preconditioner, tmg.chan_preconditioner])
@pytest.mark.parametrize("with_guess", [False, True])
def test_the_iterates_are_those_of_scipy(preconditioner, with_guess):
    A, b = system()
    M = preconditioner and preconditioner(A)
    x0 = np.arange(900.0) if with_guess else None
    ours, theirs = [], []
    for cg, iterates in ((tmg.cg, ours), (scipy.sparse.linalg.cg, theirs)):
        x, info = cg(
            A, b, x0, M=M, rtol=1e-10, maxiter=8, callback=lambda x, i=iterates: i.append(x.copy())
        )
        iterates.append(x)
        if M is None or with_guess:
            assert info == 8
    assert_allclose(ours, theirs, atol=1e-7 * np.abs(theirs[-1]).max())


def test_plain_arrays_and_sparse_matrices():
    A = np.diag(np.arange(1.0, 6.0))
    x, info = tmg.cg(A, np.ones((5, 1)), M=np.eye(5), rtol=1e-12)
    assert info == 0
    assert_allclose(x, 1 / np.arange(1.0, 6.0))
    x, info = tmg.cg(scipy.sparse.csr_array(A), [1, 1, 1, 1, 1], rtol=1e-12)
    assert info == 0
    assert_allclose(x, 1 / np.arange(1.0, 6.0))


@pytest.mark.parametrize(
    "preconditioner",
    [
        tmg.strang_preconditioner,
        tmg.chan_preconditioner,
        tmg.fft_preconditioner,
        tmg.fft_rsm_preconditioner,
        tmg.cosine_preconditioner,
        tmg.sine_preconditioner,
        tmg.spectral_preconditioner,
    ],
)
@pytest.mark.parametrize("n", [900, 40000])
def test_a_preconditioner_in_float32_costs_few_iterations(preconditioner, n):
    A, b = system(n)
    counts = []
    for dtype in (np.float64, np.float32):
        steps = []
        M = preconditioner(A, dtype=dtype)
        assert M.dtype == dtype
        x, info = tmg.cg(A, b, M=M, rtol=1e-10, callback=lambda x, s=steps: s.append(1))
        assert info == 0
        assert np.linalg.norm(b - A @ x) <= 2e-10 * np.linalg.norm(b)
        counts.append(len(steps))
    assert counts[1] <= counts[0] + 6
    with pytest.raises(TypeError, match="dtype is int64"):
        preconditioner(A, dtype=int)


def test_what_is_not_positive_definite_is_reported():
    A, b = system(50)
    x, info = tmg.cg(-A, b)
    assert info == 1
    assert not x.any()
    x, info = tmg.cg(A, b, M=-np.eye(50))
    assert info == 1
    assert not x.any()
    x, info = tmg.cg(A, np.zeros(50))
    assert info == 0
    assert not x.any()


def test_refuses_bad_arguments():
    A, b = system(50)
    for arguments, error, match in (
        ({"b": b[:40]}, ValueError, "b has shape"),
        ({"b": b * np.nan}, ValueError, "b has entries"),
        ({"b": b * 1j}, TypeError, "real numbers"),
        ({"b": b, "x0": b[:40]}, ValueError, "x0 has shape"),
        ({"b": b, "M": np.eye(40)}, ValueError, "M has shape"),
        ({"b": b, "rtol": -1.0}, ValueError, "rtol is -1"),
        ({"b": b, "maxiter": 0}, ValueError, "maxiter is 0"),
        ({"b": b, "rtol": "a"}, TypeError, "rtol is 'a', but must be a real number"),
        ({"b": b, "maxiter": 1.5}, TypeError, "maxiter is 1.5, but must be an integer"),
    ):
        with pytest.raises(error, match=match):
            tmg.cg(A, **arguments)
    with pytest.raises(ValueError, match="must be square"):
        tmg.cg(np.ones((2, 3)), b)


@pytest.mark.parametrize("preconditioner", [tmg.fft_preconditioner, tmg.cosine_preconditioner])
@pytest.mark.parametrize("size", [1.0, 1e-25, 1e25])
@pytest.mark.parametrize("with_guess", [False, True])
@pytest.mark.parametrize(("rtol", "more"), [(1e-8, 2), (1e-11, 5)])
def test_an_iteration_in_float32_reaches_the_same_residual(
    preconditioner, size, with_guess, rtol, more
):
    A, b = system()
    b = size * b
    M = preconditioner(A, dtype=np.float32)
    guess = size * np.ones(900) if with_guess else None
    counts = []
    for inner in (None, A.astype(np.float32)):
        iterates = []
        x, info = tmg.cg(
            A,
            b,
            guess,
            M=M,
            rtol=rtol,
            inner=inner,
            maxiter=40,
            callback=lambda x, i=iterates: i.append(x.copy()),
        )
        assert info == 0
        assert x.dtype == np.float64
        assert np.linalg.norm(b - A @ x) <= 1.01 * rtol * np.linalg.norm(b)
        assert_allclose(iterates[-1], x, rtol=1e-6)
        counts.append(len(iterates))
    assert counts[1] <= counts[0] + more


@pytest.mark.parametrize("shape", [(300,), (900,), (40000,), (9, 8), (60, 70)])
def test_less_precision_is_that_of_the_coefficients(shape):
    c = np.exp(-np.sqrt(np.indices(shape).sum(axis=0)))
    A = tmg.ToeplitzOperator(c)
    x = np.random.default_rng(0).standard_normal(c.size).astype(np.float32)
    anew = tmg.ToeplitzOperator(c.astype(np.float32))
    mask = np.arange(c.size).reshape(shape) % 3 > 0
    for one, other in (
        (A, anew),
        (tmg.CoupledOperator([[A]]), tmg.CoupledOperator([[anew]])),
    ):
        less = one.astype(np.float32)
        assert less.dtype == np.float32
        assert_allclose(less @ x, other @ x, atol=1e-6 * np.abs(c).sum())
        assert less.astype(np.float32) is less
        more = less.astype(np.float64)  # it has the digits of float32, and their products
        assert_allclose(more @ x, other.astype(np.float64) @ x, atol=1e-13 * np.abs(c).sum())
    small = tmg.MaskedOperator(A, mask).astype(np.float32)
    assert_allclose(
        small @ x[mask.ravel()], tmg.MaskedOperator(anew, mask) @ x[mask.ravel()], atol=1e-5
    )


def test_what_is_refused_as_inner():
    A, b = system()
    with pytest.raises(ValueError, match=r"inner has shape \(3, 3\), but A has \(900, 900\)"):
        tmg.cg(A, b, inner=np.eye(3))
    with pytest.raises(TypeError, match="inner is True, but must be A in less precision"):
        tmg.cg(A, b, inner=True)
    with pytest.raises(TypeError, match="inner has dtype complex128"):
        tmg.cg(A, b, inner=np.eye(900) + 0j)
    # Too coarse an approximation of A is not a solution, and not an endless loop.
    x, info = tmg.cg(A, b, inner=tmg.ToeplitzOperator(1.5 * A.c), rtol=1e-8, maxiter=30)
    assert info == 30
    assert np.isfinite(x).all()
