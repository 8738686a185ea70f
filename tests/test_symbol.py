"""Each preconditioner takes few iterations for the symbols it is for, and refuses the others."""

import numpy as np
import pytest

import toeplitz_mg as tmg
from comparisons.systems.symbols import COLUMNS, column
from tests.budgets import assert_within_budget
from tests.systems import count_iterations

SMOOTH = ("θ⁴ + 1", "|θ|³ + 0.01", "0.9^k", "(1+k)^-1.1", "cos k/(k+1)", "exp(-k/1000)")
ROUGH = ("|θ|", "fGn, H = 0.9", "Gaussian", "Matérn 3/2", "contact")
ZERO = ("θ²", "2 - 2 cos θ", "(2 - 2 cos θ)²")
SUITED = [
    (tmg.spectral_preconditioner, "smooth", SMOOTH),
    (tmg.spectral_preconditioner, "rough", ROUGH),
    (tmg.fft_preconditioner, "smooth", SMOOTH),
    (tmg.fft_preconditioner, "rough", ROUGH),
    (tmg.cosine_preconditioner, "rough", ROUGH),
    (tmg.sine_preconditioner, "zero", ZERO),
]


def iterations(A, M, rtol=1e-7):
    """Iterations of CG to a relative residual."""
    b = np.random.default_rng(0).standard_normal(A.shape[0])
    return count_iterations(tmg.cg, A, b, rtol, M=M, maxiter=200)


@pytest.mark.parametrize(("f", "kind", "names"), SUITED)
def test_iterations(f, kind, names):
    """To 1e-8 the last one turns on rounding, which makes samples of |θ| at 0."""
    for name in names:
        A = tmg.ToeplitzOperator(column(name, 2**14))
        # The condition number of (2 - 2 cos)^2 is 1e17 here: no residual in float64 is small.
        count = iterations(A, f(A), 1e-2 if name == "(2 - 2 cos θ)²" else 1e-7)
        assert_within_budget(f"{f.__name__}, {kind} symbols, n = 2^14", iterations=count)


@pytest.mark.parametrize("n", [64, 211, 500])
@pytest.mark.parametrize("name", COLUMNS)
def test_spectral_is_never_worse_than_m(name, n):
    A = tmg.ToeplitzOperator(column(name, n))
    spectral = tmg.spectral_preconditioner(A)
    dense = spectral @ np.eye(n)
    if np.linalg.cond(A.toarray()) < 1e10:
        assert np.linalg.eigvalsh((dense + dense.T) / 2).min() > 0
        assert_within_budget("spectral, n = 64 to 500", iterations=iterations(A, spectral))
    try:
        M = tmg.fft_preconditioner(A)
    except np.linalg.LinAlgError:
        return
    assert iterations(A, spectral) <= iterations(A, M)


@pytest.mark.parametrize("n", [127, 1009, 4093])
@pytest.mark.parametrize("preconditioner", [tmg.cosine_preconditioner, tmg.sine_preconditioner])
def test_trigonometric_at_a_prime_length_is_cut_from_a_fast_one(preconditioner, n):
    A = tmg.ToeplitzOperator(column("contact", n))
    near = tmg.ToeplitzOperator(column("contact", n + 1))
    M = preconditioner(A)
    with tmg.count_products() as work:
        M @ np.ones(n)
    assert work.units(n) == pytest.approx(0.5, rel=0.01)
    assert iterations(A, M) <= iterations(near, preconditioner(near)) + 2


def test_a_zero_of_the_symbol_is_refused_by_the_one_and_not_by_the_other():
    smooth, rough = (tmg.ToeplitzOperator(column(s, 100)) for s in ("2 - 2 cos θ", "2 + 2 cos θ"))
    with pytest.raises(np.linalg.LinAlgError, match=r"cosine .*use sine_preconditioner"):
        tmg.cosine_preconditioner(smooth)
    with pytest.raises(np.linalg.LinAlgError, match=r"sine .*use cosine_preconditioner"):
        tmg.sine_preconditioner(rough)
    for A, f in ((smooth, tmg.sine_preconditioner), (rough, tmg.cosine_preconditioner)):
        assert_within_budget("a simple zero, n = 100", iterations=iterations(A, f(A)))


def test_what_would_refuse_it_too_is_no_advice():
    x, y = tmg.halfspace.all_offsets((6, 5), (1.0, 1.0))
    A_xy = tmg.ToeplitzOperator.from_lags(
        tmg.halfspace.influence_xy(x, y, (1.0, 1.0), G=1.0, nu=0.3)
    )
    for preconditioner in (tmg.cosine_preconditioner, tmg.sine_preconditioner):
        with pytest.raises(np.linalg.LinAlgError, match=r"above .*: use gmres"):
            preconditioner(A_xy)


@pytest.mark.parametrize("shape", [(24, 24), (13, 31), (6, 5, 7)], ids=str)
def test_trigonometric_along_several_axes(shape):
    A = tmg.ToeplitzOperator(np.exp(-np.indices(shape).sum(axis=0) / 0.8))
    for preconditioner in (tmg.cosine_preconditioner, tmg.sine_preconditioner):
        M = preconditioner(A)
        with tmg.count_products() as work:
            M @ np.ones(A.shape[0])
        assert work.units(A.shape[0]) == 0.5 ** len(shape)
        assert_within_budget("sine and cosine, several axes", iterations=iterations(A, M))


def test_trigonometric_of_a_matrix_that_is_symmetric_only():
    k = np.indices((15, 15)) - 7
    A = tmg.ToeplitzOperator.from_lags(np.exp(-(k[0] ** 2 + k[0] * k[1] + k[1] ** 2) / 1.5))
    assert not A.is_even
    M = tmg.cosine_preconditioner(A)
    assert np.linalg.eigvalsh(M @ np.eye(64)).min() > 0
