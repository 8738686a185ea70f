"""The certificate that M̄ is positive definite never certifies what is not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import toeplitz_mg as tmg
from tests.cases import contact, submatrix
from toeplitz_mg.paper.problems import test1, test2, test3
from toeplitz_mg.preconditioners.positivity import ritz_values
from toeplitz_mg.preconditioners.row_sum_certificate import is_certainly_positive


def with_row_sums(M, gamma):
    return M - np.diag(M.sum(axis=1) - gamma)


@settings(deadline=None, max_examples=300)
@given(st.data())
def test_what_is_certain_is_true(data):
    shape = data.draw(st.sampled_from([(2,), (5,), (12,), (3, 4), (6, 1), (5, 6), (2, 3, 3)]))
    rng = np.random.default_rng(data.draw(st.integers(0, 10**6)))
    distance = np.indices(shape).sum(axis=0)
    m = -rng.random(shape) * 4.0 ** (-distance.astype(float))
    # A few positive coefficients, as large as may just be outweighed.
    flips = rng.random(shape) < 0.4
    m[flips] *= -data.draw(st.sampled_from([0.01, 0.1, 0.3, 1.0]))
    M = tmg.ToeplitzOperator(m)
    mask = None
    dense = M.toarray()
    if data.draw(st.booleans()):
        mask = rng.random(shape) < 0.7
        mask.flat[0] = True
        dense = submatrix(dense, mask)
    gamma = data.draw(st.sampled_from([1e-3, 0.05, 1.0]))
    if is_certainly_positive(M, mask, gamma):
        assert np.linalg.eigvalsh(with_row_sums(dense, gamma)).min() > 0


@pytest.mark.parametrize("test", [test1, test2, test3])
@pytest.mark.parametrize("n", [64, 1000, 4096])
def test_the_papers_problems_are_certain_on_every_grid(test, n):
    A = test(n).A
    while A.shape[0] > 32:
        full, mask = (A.full, A.mask) if isinstance(A, tmg.MaskedOperator) else (A, None)
        M = tmg.fft_preconditioner(full)
        assert is_certainly_positive(M, mask, tmg.fft_rsm_preconditioner(A).gamma)
        A = tmg.galerkin(A)


@pytest.mark.parametrize("shape", [(16, 16), (20, 9)], ids=str)
def test_half_space_problems_on_two_axes_are_certain(shape):
    A = tmg.ToeplitzOperator(contact(*shape))
    for B in (A, tmg.galerkin(A)):
        gamma = tmg.fft_rsm_preconditioner(B).gamma
        assert is_certainly_positive(tmg.fft_preconditioner(B), None, gamma)


def test_a_hole_breaks_the_path():
    """Two elements two apart with a positive m_2 between them, and nothing to outweigh it."""
    M = tmg.ToeplitzOperator([5.0, -4.0, 0.9, 0.0])
    assert is_certainly_positive(M, None, 0.1)
    assert not is_certainly_positive(M, np.array([True, False, True, False]), 0.1)


@pytest.mark.parametrize("n", [1, 2, 5, 60])
def test_lanczos_finds_the_smallest_eigenvalue(n):
    A = tmg.ToeplitzOperator(contact(n))
    M_bar = tmg.fft_rsm_preconditioner(A)
    exact = np.linalg.eigvals(M_bar @ A.toarray()).real.min()
    assert ritz_values(A, M_bar, 40)[0] == pytest.approx(exact, rel=0.05)
