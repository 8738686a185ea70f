"""What an operator says of its work is what is counted."""

from math import prod

import numpy as np
import pytest
from scipy.sparse.linalg import aslinearoperator

import toeplitz_mg as tmg
from tests.cases import PAIRS, checkered, contact, waves
from tests.systems import preconditioners
from toeplitz_mg.paper import problems


def assert_says_what_is_counted(A):
    """Check the work of one application, of its adjoint, and of several vectors at once."""
    points = prod(A.grid_shape)
    for B, columns in ((A, 1), (A.H, 1), (A, 3)):
        with tmg.count_products() as work:
            B @ np.ones((B.shape[1], columns))
        assert work.units(points) == pytest.approx(columns * B.work, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("case", PAIRS)
def test_work_is_what_is_counted(case):
    A = case.operator(np.float64)
    assert A.work >= 0.0
    assert_says_what_is_counted(A)


@pytest.mark.parametrize("shape", [(5000,), (70, 70), (20, 20, 20)])
def test_so_it_is_where_products_are_transforms(shape):
    """The cases are so small that a Toeplitz matrix multiplies as a dense one."""
    rng = np.random.default_rng(0)
    c = contact(*shape) if len(shape) < 3 else np.exp(-np.indices(shape).sum(axis=0))
    A = tmg.ToeplitzOperator(c)
    masked = tmg.MaskedOperator(A, rng.random(shape) < 0.9)
    for B in (A, masked):
        for preconditioner in preconditioners("fft fft_sd cosine chan jacobi"):
            assert_says_what_is_counted(preconditioner(B))
        if len(shape) < 3:
            assert_says_what_is_counted(tmg.fsai_preconditioner(B))
    if len(shape) == 1:
        assert_says_what_is_counted(tmg.spectral_preconditioner(A))
        assert_says_what_is_counted(tmg.toeplitz_inverse(A))


@pytest.mark.parametrize("shape", [(5000,), (70, 70), (20, 20, 20)])
def test_so_it_is_of_complex_and_of_general_ones(shape):
    rng = np.random.default_rng(0)
    hermitian = tmg.ToeplitzOperator.from_lags(waves(*shape))
    general = tmg.ToeplitzOperator.from_lags(rng.uniform(1.0, 2.0, waves(*shape).shape))
    assert_says_what_is_counted(tmg.chan_preconditioner(general))
    for B in (hermitian, tmg.MaskedOperator(hermitian, rng.random(shape) < 0.9)):
        assert_says_what_is_counted(B)
        assert_says_what_is_counted(B.T)
        for preconditioner in preconditioners("fft chan jacobi"):
            assert_says_what_is_counted(preconditioner(B))
            assert_says_what_is_counted(preconditioner(B).T)


@pytest.mark.parametrize(
    "options", [{}, {"pre": 0}, {"post": 0}, {"pre": 2}, {"gamma": 2}], ids=str
)
def test_so_it_is_of_cycles(options):
    """The cycles have borders, masks, coarse grids by area, components, or a user's smoothers."""
    square = tmg.ToeplitzOperator(contact(33, 40))
    matrices = [
        problems.test1(2**12).A,
        problems.test1(3001).A,  # It has borders.
        problems.test3(3001).A,
        square,
        tmg.MaskedOperator(square, checkered(33, 40) | (np.arange(40) > 2)),
    ]
    for A in matrices:
        M = tmg.multigrid(A, coarsest=64, **options)
        assert len(M.levels) >= 2
        assert_says_what_is_counted(M)
        assert f"{M.work:.1f} work units" in repr(M)
    assert any(level.border for level in tmg.multigrid(matrices[1], coarsest=64).levels)
    coupled = tmg.CoupledOperator([[square, None], [None, square]])
    assert_says_what_is_counted(tmg.componentwise(tmg.multigrid)(coupled, coarsest=64, **options))

    def dense(A):
        return aslinearoperator(np.linalg.inv(A.toarray()))

    def nested(A):
        return tmg.multigrid(A, coarsest=64)

    for smoother in (dense, nested, tmg.jacobi_preconditioner, tmg.cosine_preconditioner):
        assert_says_what_is_counted(
            tmg.multigrid(problems.test1(600).A, coarsest=200, smoother=smoother, **options)
        )
