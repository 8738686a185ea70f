"""Levinson's recursion, SciPy's own or its public function; and the ratio that chooses it."""

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose

import toeplitz_mg as tmg
from toeplitz_mg.solvers import levinson as module
from toeplitz_mg.solvers import machine
from toeplitz_mg.solvers.levinson import levinson


@pytest.fixture
def forget():
    """Have the recursion looked for anew, in the test and after it."""
    module._recursion.cache_clear()
    yield
    module._recursion.cache_clear()


@pytest.mark.parametrize("kind", ["as it is", "another result", "another signature"])
@pytest.mark.parametrize("dtype", [np.float64, np.complex128])
@pytest.mark.parametrize("n", [1, 2, 7])
def test_whatever_scipy_has_a_system_is_solved(kind, dtype, n, monkeypatch, forget):
    private = pytest.importorskip("scipy.linalg._solve_toeplitz")
    if kind == "another result":
        monkeypatch.setattr(private, "levinson", lambda a, b: (2.0 * b, None))
    elif kind == "another signature":
        monkeypatch.setattr(private, "levinson", lambda a: a)
    rng = np.random.default_rng([n, 8])
    lags = rng.standard_normal(2 * n - 1).astype(dtype)
    if dtype is np.complex128:
        lags += 1j * rng.standard_normal(2 * n - 1)
    lags[n - 1] += 5.0
    B = rng.standard_normal((3, n)).astype(dtype)
    A = scipy.linalg.toeplitz(lags[n - 1 :], lags[n - 1 :: -1])
    assert_allclose(levinson(lags, B) @ A.T, B, atol=1e-12)
    assert_allclose(A @ levinson(lags, B[0]), B[0], atol=1e-12)


@pytest.mark.parametrize("ratio", ["0", "-1", "inf", "nan", "fast", " "])
def test_a_ratio_that_is_none_is_refused(ratio, monkeypatch):
    monkeypatch.setenv(machine.VARIABLE, ratio)
    with pytest.raises(ValueError, match=f"{machine.VARIABLE} is '{ratio}', but must be"):
        tmg.solve_toeplitz(1.0 / np.arange(1.0, 501.0), np.ones(500))


def test_an_empty_ratio_is_none_that_is_given(monkeypatch):
    monkeypatch.setenv(machine.VARIABLE, "")
    assert machine.cosine_over_levinson() == machine._measure()


def test_the_ratio_decides_between_316_and_2048_alone(monkeypatch):
    def methods(n):
        for ratio in ("1e-9", "1e9"):
            monkeypatch.setenv(machine.VARIABLE, ratio)
            c = 1.0 / np.arange(1.0, n + 1.0)
            yield tmg.solve_toeplitz(c, np.ones(n), full_output=True)[1].method

    cosine, recursion = "cg in the DCT domain", "scipy.linalg.solve_toeplitz"
    assert [*methods(316)] == [recursion, recursion]
    assert [*methods(317)] == [cosine, recursion]
    assert [*methods(2047)] == [cosine, recursion]
    assert [*methods(2048)] == [cosine, cosine]


def test_the_ratio_is_measured_once_and_positive(monkeypatch):
    monkeypatch.delenv(machine.VARIABLE, raising=False)
    first = machine.cosine_over_levinson()
    assert 0.0 < first < np.inf
    assert machine.cosine_over_levinson() == first
