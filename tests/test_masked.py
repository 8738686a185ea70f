"""Masks: where they are taken, and what is refused as one."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse.linalg import LinearOperator, aslinearoperator

import toeplitz_mg as tmg
from tests.cases import contact, coupled, half_space_kernel, submatrix
from tests.systems import preconditioners

GRID = (16, 40)


def random_mask(seed):
    mask = np.random.default_rng(seed).random(GRID) < 0.6
    mask.flat[0] = True
    return mask


def whole():
    return tmg.ToeplitzOperator(contact(*GRID))


def of_a_part():
    """Operators that know a grid and act on vectors of some of its points only."""
    A = tmg.MaskedOperator(whole(), random_mask(0))
    C = tmg.MaskedOperator(coupled(half_space_kernel(2, *GRID))(float), [random_mask(0)] * 2)
    for f in (tmg.fft_preconditioner, tmg.fsai_preconditioner, tmg.chan_preconditioner):
        yield f"{f.__name__}", f(A)
        yield f"{f.__name__} of each component", tmg.componentwise(f)(C)
    yield "fsai_preconditioner of coupled components", tmg.fsai_preconditioner(C)
    yield "A", A
    yield "coupled A", C


def test_a_part_of_a_grid_has_no_mask_of_the_grid():
    for name, A in of_a_part():
        assert isinstance(A, LinearOperator), name
        for mask in (np.ones(A.grid_shape, bool), np.eye(*A.grid_shape[-2:], dtype=bool)):
            with pytest.raises(TypeError, match="on a whole grid"):
                tmg.MaskedOperator(A, mask)


def test_operators_of_a_whole_grid_have_masks():
    """On a mask each operator is its dense matrix, in rows and columns of the mask."""
    A, mask = whole(), random_mask(2)
    for M in (A, *(f(A) for f in preconditioners("fft fsai chan cosine"))):
        assert np.prod(M.grid_shape) == M.shape[0]
        B = tmg.MaskedOperator(M, mask)
        dense = submatrix(M @ np.eye(M.shape[0]), mask)
        assert np.abs(B @ np.eye(B.shape[0]) - dense).max() <= 1e-12 * np.abs(dense).max()


def test_an_operator_of_somebody_else_may_be_restricted():
    """Any that says on which grid it acts."""
    matrix = np.random.default_rng(0).standard_normal((12, 12))
    A = aslinearoperator(matrix)
    A.grid_shape = (3, 4)
    mask = np.indices((3, 4)).sum(axis=0) % 3 != 1
    at = np.flatnonzero(mask)
    x = np.arange(1.0, len(at) + 1.0)
    assert_allclose(tmg.MaskedOperator(A, mask) @ x, matrix[np.ix_(at, at)] @ x, rtol=1e-12)


def test_a_part_is_as_symmetric_as_the_whole():
    c, r = 0.5 ** np.arange(9), 0.3 ** np.arange(9)
    for A, symmetric, hermitian in (
        (tmg.ToeplitzOperator(c), True, True),
        (tmg.ToeplitzOperator(c, r), False, False),
        (tmg.ToeplitzOperator(c * 1j ** np.arange(9)), False, True),
    ):
        part = tmg.MaskedOperator(A, np.arange(9) % 4 > 0)
        assert (part.is_symmetric, part.is_hermitian) == (symmetric, hermitian)


def test_a_masked_preconditioner_has_one_precision():
    M = tmg.cosine_preconditioner(tmg.MaskedOperator(whole(), random_mask(0)))
    assert M.astype(np.float64) is M
    with pytest.raises(TypeError, match="fixed precision: give dtype to its function"):
        M.astype(np.float32)
