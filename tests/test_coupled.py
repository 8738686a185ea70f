"""Coupled components: what is special about them; that they are their dense matrix is in cases."""

import numpy as np
import pytest
import scipy.signal
from numpy.testing import assert_allclose
from scipy.sparse import diags_array, eye_array

import toeplitz_mg as tmg
from tests.budgets import assert_within_budget
from tests.cases import coupled, coupled_kernel
from tests.systems import count_iterations, refuses
from toeplitz_mg import halfspace


def tangential(n, nu=0.28):
    """The coupled tangential problem on [-1, 1]², n x n elements."""
    material = halfspace.Material.from_shear(1.0, nu)
    return halfspace.influence_matrix("xy", (n, n), (2.0 / n, 2.0 / n), material)


@pytest.mark.parametrize(
    ("name", "preconditioner"),
    [
        ("M", tmg.fft_preconditioner),
        ("M of each component", tmg.componentwise(tmg.fft_preconditioner)),
        ("cosines", tmg.cosine_preconditioner),
    ],
)
def test_iterations_do_not_grow_with_the_grid(name, preconditioner):
    rng, counts = np.random.default_rng(0), []
    for n in (64, 129, 256):
        A = tangential(n)
        M = preconditioner(A)
        sides = np.ones(A.shape[0]), rng.standard_normal(A.shape[0])
        counts.append([count_iterations(tmg.cg, A, b, M=M) for b in sides])
    assert_within_budget(f"tangential, {name}, constant side", iterations=np.max(counts, axis=0)[0])
    assert_within_budget(f"tangential, {name}, random side", iterations=np.max(counts, axis=0)[1])
    assert np.ptp(counts, axis=0).max() <= 3


def test_a_product_transforms_each_component_once():
    A = tangential(32)
    x = np.ones(A.shape[0])
    with tmg.count_products() as work:
        A @ x
    assert work.units(A.shape[0]) == 1.0
    assert work.products == 1


def test_a_mask_is_that_of_each_component():
    A = tangential(8)
    mask = np.indices((8, 8)).sum(axis=0) > 5
    one = tmg.MaskedOperator(A, mask)
    two = tmg.MaskedOperator(A, np.stack([mask, mask]))
    assert one.shape == two.shape == (2 * mask.sum(),) * 2
    assert_allclose(one.toarray(), two.toarray())
    assert_allclose(one @ np.eye(len(one.toarray())), one.toarray(), atol=1e-12)


def test_a_component_without_unknowns_has_no_block():
    A = tangential(6)
    mask = np.zeros((2, 6, 6), dtype=bool)
    mask[1, 2:4] = True
    B = tmg.MaskedOperator(A, mask)
    M = tmg.cosine_preconditioner(B)
    expected = tmg.cosine_preconditioner(tmg.MaskedOperator(A.component(1), mask[1]))
    b = np.random.default_rng(1).standard_normal(12)
    assert np.array_equal(M @ b, expected @ b)


@pytest.mark.parametrize("is_complex", [False, True])
def test_multiples_and_sums_are_coupled_operators(is_complex):
    a, b = (tmg.ToeplitzOperator(np.array([[4.0, 1.0], [1.0, 0.5]]) * k) for k in (1.0, 0.3))
    A = tmg.CoupledOperator([[a, b], [b, None]])
    B = tmg.CoupledOperator([[b, None], [None, a]])
    dense, other, unit = A.toarray(), B.toarray(), eye_array(8)
    s = 2.0 + 1j if is_complex else 2.0
    for result, expected in (
        (s * A, s * dense),
        (A / s, dense / s),
        (-A, -dense),
        (s * unit @ A @ unit, s * dense),
        (A + B, dense + other),
        (A - B, dense - other),
        (A + s * unit, dense + s * np.eye(8)),
        (s * unit - A, s * np.eye(8) - dense),
    ):
        assert isinstance(result, tmg.CoupledOperator)
        assert_allclose(result.toarray(), expected)
        assert_allclose(result @ np.eye(8), expected, atol=1e-14)
    D = diags_array(np.arange(1.0, 9.0))
    for result, expected in ((D @ A, D @ dense), (A @ D, dense @ D.toarray()), (A + D, dense + D)):
        assert_allclose(result @ np.eye(8), expected, atol=1e-13)


ONE, TWO = tmg.ToeplitzOperator([[2.0, 1.0]]), tmg.ToeplitzOperator([[2.0, 1.0, 0.5]])


@pytest.mark.parametrize(
    ("blocks", "error", "message"),
    [
        ([[ONE, ONE], [ONE]], ValueError, r"rows of lengths \[2, 1\], but must be a square"),
        ([[ONE, None], [None, TWO]], ValueError, r"blocks\[1\]\[1\] lives on the grid \(1, 3\)"),
        ([[ONE, np.eye(2)], [None, ONE]], TypeError, r"blocks\[0\]\[1\] is of type ndarray, but"),
        ([ONE, ONE], TypeError, r"blocks is \[<Toeplitz.*>\], but must have rows, such as \[\["),
        (ONE, TypeError, r"blocks is <Toeplitz.*>, but must have rows"),
        ([[ONE, None], [None, None]], ValueError, "row 1 of the blocks is zero"),
        ([[None, ONE], [None, ONE]], ValueError, "column 0 of the blocks is zero"),
    ],
)
def test_what_makes_no_operator(blocks, error, message):
    refuses(error, message, tmg.CoupledOperator, blocks)


def test_what_is_refused():
    for i in (-1, 2):
        with pytest.raises(IndexError, match=rf"i is {i}, but must be one of the .* 0 \.\.\. 1"):
            tmg.CoupledOperator([[ONE, None], [None, ONE]]).component(i)
    without = tmg.CoupledOperator([[None, ONE], [ONE, None]])
    strong, general = coupled_kernel(2, 4, 4), coupled_kernel(2, 4, 4)
    strong[0][1], strong[1][0] = (40.0 * lags for lags in (strong[0][1], strong[1][0]))
    general[1][0] = 2.0 * general[1][0]
    strong, general = (coupled(kernel)(np.float64) for kernel in (strong, general))
    with pytest.raises(np.linalg.LinAlgError, match="which M inverts, has the pivot -"):
        tmg.fft_preconditioner(strong)
    for of_all in (tmg.fft_preconditioner, tmg.cosine_preconditioner, lambda A: A.component(0)):
        refuses(ValueError, "diagonal block of component 0 is zero", of_all, without)
    for of_all in (tmg.fft_preconditioner, tmg.cosine_preconditioner):
        refuses(ValueError, r"2 components, 4 x 4, general.*must be symmetric", of_all, general)
    for of_one in (tmg.multigrid, tmg.jacobi_preconditioner, tmg.toeplitz_inverse):
        with pytest.raises(
            TypeError, match=r"of type CoupledOperator, .*componentwise\(multigrid\)\(A"
        ):
            of_one(tangential(8))
    for given in (tangential(8), 3, "fft"):
        refuses(TypeError, r"preconditioner is .* must be a function", tmg.componentwise, given)


@pytest.mark.parametrize("dtype", ["f", "d", "F", "D"])
def test_blocks_that_are_transposes_but_for_rounding_are_averaged(dtype):
    """As correlations by FFT of two fields of different units that are hardly correlated."""
    rng, shape = np.random.default_rng(0), (2, 20, 30)
    fields = rng.standard_normal(shape) + 1j * rng.standard_normal(shape)
    x, y = (fields if dtype in "FD" else fields.real).astype(dtype)
    y *= np.array(1e-5, dtype)
    lags = [[scipy.signal.correlate(a, b, method="fft") for b in (x, y)] for a in (x, y)]
    assert not np.array_equal(lags[0][1], np.flip(lags[1][0]).conj())
    A = tmg.CoupledOperator([[tmg.ToeplitzOperator.from_lags(a) for a in row] for row in lags])
    dense = A.toarray()
    assert A.is_hermitian
    assert np.array_equal(dense, dense.T.conj())
    lags[0][1][3, 4] *= 1.01
    B = tmg.CoupledOperator([[tmg.ToeplitzOperator.from_lags(a) for a in row] for row in lags])
    assert not B.is_hermitian
    assert np.array_equal(B.blocks[1][0].lags, lags[1][0])
    with pytest.raises(ValueError, match=r"blocks\[1\]\[0\] and the .*transpose.* by up to .*e-0"):
        tmg.fft_preconditioner(B)


def test_preconditioners_have_the_precision_of_all_blocks():
    x, y = halfspace.offsets((20, 21), (1.0, 1.0))
    c = halfspace.influence_zz(x, y, (1.0, 1.0), G=1.0, nu=0.28).astype(np.float32)
    single, double = tmg.ToeplitzOperator(c), tmg.ToeplitzOperator(c.astype(np.float64))
    mixed = tmg.CoupledOperator([[single, None], [None, double]])
    exact = tmg.CoupledOperator([[double, None], [None, double]])
    v = np.random.default_rng(0).standard_normal(mixed.shape[0])
    cosine = tmg.componentwise(tmg.cosine_preconditioner)
    for make in (lambda A: A, cosine, tmg.fsai_preconditioner, tmg.fft_preconditioner):
        expected = make(exact) @ v
        assert_allclose(make(mixed) @ v, expected, atol=1e-12 * np.abs(expected).max())
