"""The backend ducc0 gives what SciPy gives; all that is tested elsewhere holds with it."""

import numpy as np
import pytest
import scipy.fft
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from comparisons.systems.symbols import column

ducc0_backend = pytest.importorskip("toeplitz_mg.ducc0_backend", exc_type=ImportError)

X = np.random.default_rng(0).standard_normal((3, 5, 8))
Z = X + 1j * X[::-1]
NORMS = (None, "ortho", "forward")
ONE_AXIS = [
    {"n": n, "axis": axis, "norm": norm} for n in (None, 4, 9) for axis in (-1, 1) for norm in NORMS
]
AXES = [
    {"s": s, "axes": axes, "norm": norm}
    for s, axes in ((None, None), ((4, 9), None), ((9, 4), (-1, -2)), ((6, 7), (1, 2)))
    for norm in NORMS
]


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize(
    ("name", "array", "calls"),
    [
        ("fft", X, ONE_AXIS),
        ("fft", Z, ONE_AXIS),
        ("ifft", Z, ONE_AXIS),
        ("rfft", X, ONE_AXIS),
        ("irfft", Z, ONE_AXIS),
        ("rfftn", X, AXES),
        ("irfftn", Z, AXES),
        *((name, X, AXES) for name in ("dctn", "idctn", "dstn", "idstn")),
    ],
)
def test_transforms(name, array, calls, dtype):
    array = array.astype(np.result_type(dtype, np.complex64) if np.iscomplexobj(array) else dtype)
    for arguments in calls:
        assert_is_that_of_scipy(getattr(scipy.fft, name), array, arguments)


def assert_is_that_of_scipy(function, array, arguments):
    kept = array.copy()
    expected = function(array, **arguments)
    with scipy.fft.set_backend(ducc0_backend, only=True):
        result = function(array, **arguments)
        overwriting = function(array.copy(), overwrite_x=True, **arguments)
    tolerance = 100 * np.finfo(array.dtype).eps * np.abs(expected).max()
    assert result.dtype == expected.dtype
    assert_allclose(result, expected, rtol=0, atol=tolerance)
    assert_allclose(overwriting, expected, rtol=0, atol=tolerance)
    assert np.array_equal(array, kept)


def test_what_it_has_not_scipy_does():
    expected = scipy.fft.dst(X), scipy.fft.hfft(Z), scipy.fft.dctn(Z)
    with scipy.fft.set_backend(ducc0_backend, only=True):  # So is a global backend set.
        for result, exact in zip(
            (scipy.fft.dst(X), scipy.fft.hfft(Z), scipy.fft.dctn(Z)), expected, strict=True
        ):
            assert_allclose(result, exact, atol=1e-13)


@pytest.mark.parametrize("n", [100, 1000, 4099, 40000, 2**16])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_products_are_the_same(n, dtype):
    A = tmg.ToeplitzOperator(column("contact", n).astype(dtype))
    x = np.random.default_rng(0).standard_normal(n).astype(dtype)
    functions = (
        tmg.spectral_preconditioner,
        tmg.fft_preconditioner,
        tmg.fft_rsm_preconditioner,
        tmg.chan_preconditioner,
        tmg.cosine_preconditioner,
        tmg.sine_preconditioner,
        tmg.multigrid,
    )
    operators = [A, *(f(A) for f in functions)]
    expected = [B @ x for B in operators]
    with scipy.fft.set_backend(ducc0_backend, only=True):
        results = [B @ x for B in operators]
        A = tmg.ToeplitzOperator(A.c)
        anew = [A @ x, tmg.spectral_preconditioner(A) @ x, tmg.sine_preconditioner(A) @ x]
    for result, exact in zip(anew, (expected[0], expected[1], expected[6]), strict=True):
        tolerance = (1e-11 if dtype == np.float64 else 1e-3) * np.abs(exact).max()
        assert_allclose(result, exact, rtol=0, atol=tolerance)
    for result, exact in zip(results, expected, strict=True):
        tolerance = (1e-14 if dtype == np.float64 else 1e-5) * np.abs(exact).max()
        assert_allclose(result, exact, rtol=0, atol=10 * tolerance)


def test_iterations_are_the_same():
    A = tmg.ToeplitzOperator(column("contact", 2**15))
    b = np.random.default_rng(0).standard_normal(2**15)
    counts = []
    for backend in ("scipy", ducc0_backend):
        with scipy.fft.set_backend(backend):
            steps = []
            tmg.cg(A, b, M=tmg.fft_preconditioner(A), rtol=1e-8, callback=steps.append)
            _, info = tmg.solve_toeplitz(A.c, b, full_output=True)
            counts.append((len(steps), info.iterations))
    assert counts[0] == counts[1]
