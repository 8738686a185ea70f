"""On a whole line the sparse approximate inverse is as good, whatever the length, or refused."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import toeplitz_mg as tmg
from tests.budgets import assert_within_budget
from tests.cases import contact
from tests.systems import seeded
from tests.test_fsai import both_iterations
from toeplitz_mg.covariances import FractionalGaussianNoise


def power(exponent):
    return lambda n: (1.0 + np.arange(n)) ** -exponent


SLOW = {"contact": contact, "1/(1+k)": power(1.0), "1/(1+k)²": power(2.0)}
SLOW["fGn"] = FractionalGaussianNoise(hurst=0.9)


@pytest.mark.parametrize("n", [1, 2, 16, 100])
def test_a_short_line_is_inverted(n):
    A = tmg.ToeplitzOperator(contact(n))
    assert_allclose(tmg.fsai_preconditioner(A) @ A.toarray(), np.eye(n), rtol=0, atol=1e-11)


@pytest.mark.parametrize("n", [129, 200, 500, 521])
@pytest.mark.parametrize("name", SLOW)
def test_symmetric_positive_definite(name, n):
    P = tmg.fsai_preconditioner(tmg.ToeplitzOperator(SLOW[name](n))) @ np.eye(n)
    assert_allclose(P, P.T, rtol=0, atol=1e-13 * abs(P).max())
    assert np.linalg.eigvalsh(P).min() > 0.0


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("name", SLOW)
def test_iterations_hardly_depend_on_n(name, dtype):
    for n in (130, 1000, 4099, 2**14, 2**17 - 1):
        A = tmg.ToeplitzOperator(SLOW[name](n))
        P = tmg.fsai_preconditioner(A, dtype=dtype)
        assert_within_budget("FSAI, a whole line", iterations=max(both_iterations(A, P)))


@pytest.mark.parametrize("shape", [(1, 700), (700, 1), (700, 1, 1)])
def test_a_grid_of_one_line_is_a_line(shape):
    line, grid = (tmg.ToeplitzOperator(c) for c in (contact(700), contact(700).reshape(shape)))
    for mask in (np.ones(700, bool), np.arange(700) % 30 > 1):
        masked = tmg.MaskedOperator(line, mask), tmg.MaskedOperator(grid, mask.reshape(shape))
        P, *others = map(tmg.fsai_preconditioner, [*masked, line, grid] if mask.all() else masked)
        x = seeded(P.shape[0])
        for Q in others:
            assert_array_equal(P @ x, Q @ x)
        assert others[0].grid_shape == shape


@pytest.mark.parametrize(
    "column",
    [
        lambda n: -1.0 / (1.0 + np.arange(n)),
        lambda n: np.exp(-((np.arange(n) / 300.0) ** 2)),
        lambda n: np.r_[1.0, 0.9, np.zeros(n - 2)],
    ],
)
def test_what_is_indefinite_or_too_smooth_is_refused(column):
    A = tmg.ToeplitzOperator(column(1000))
    with pytest.raises(np.linalg.LinAlgError, match="sparse approximate inverse, but must be pos"):
        tmg.fsai_preconditioner(A)
