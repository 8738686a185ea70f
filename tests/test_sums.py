"""Sums of Toeplitz and diagonal matrices: what stays Toeplitz, and what preconditions the rest."""

from fractions import Fraction

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, aslinearoperator

import toeplitz_mg as tmg
from tests.cases import checkered, contact, diagonals, exponential, random_lags
from tests.systems import PRECONDITIONERS, count_iterations, refuses

SYMMETRIC = [f for f in PRECONDITIONERS if f is not tmg.fft_sd_preconditioner]
# They need no symmetric part.
OF_ANY = (tmg.chan_preconditioner, tmg.strang_preconditioner, tmg.spectral_preconditioner)
OF_SYMMETRIC = [f for f in SYMMETRIC if f not in OF_ANY]
each = pytest.mark.parametrize("preconditioner", SYMMETRIC, ids=lambda f: f.__name__)


def covariance(n):
    """A matrix of which each preconditioner exists."""
    return tmg.ToeplitzOperator(0.5 ** np.arange(n))


def diags(d):
    return sparse.diags_array(d, dtype=d.dtype)


# What stays Toeplitz ----------------------------------------------------------------------------

FORMS = {
    "2 A": lambda A, one: 2 * A,
    "A 2": lambda A, one: A * 2,
    "-A": lambda A, one: -A,
    "A / 2": lambda A, one: A / 2,
    "A + 3 I": lambda A, one: A + 3 * one,
    "3 I + A": lambda A, one: 3 * one + A,
    "A - 3 I": lambda A, one: A - 3 * one,
    "3 I - A": lambda A, one: 3 * one - A,
    "A + A.T": lambda A, one: A + A.T,
    "A - A.T / 2": lambda A, one: A - A.T / 2,
    "(3 I) A": lambda A, one: (3 * one) @ A,
    "A (3 I)": lambda A, one: A @ (3 * one),
    "sum": lambda A, one: sum([A, A.T, one]),
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("grid_shape", [(1,), (7,), (3, 4), (2, 1, 3)])
@pytest.mark.parametrize("is_even", [True, False])
def test_what_stays_toeplitz_is_a_toeplitz_operator(form, grid_shape, is_even):
    A = tmg.ToeplitzOperator.from_lags(random_lags(*grid_shape))
    if is_even:
        A = tmg.ToeplitzOperator(A.c)
    n = A.shape[0]
    for one in (sparse.eye_array(n), sparse.identity(n), sparse.eye_array(n, format="csr")):
        result = FORMS[form](A, one)
        assert isinstance(result, tmg.ToeplitzOperator)
        assert result.grid_shape == grid_shape
        expected = FORMS[form](A.toarray(), one.toarray())
        assert_allclose(result.toarray(), expected, rtol=1e-14, atol=1e-14)


def test_a_sum_whose_diagonals_cancel_is_a_toeplitz_operator_again():
    A, d = covariance(9), diagonals(9)[0]
    assert isinstance(A + diags(d) - diags(d), tmg.ToeplitzOperator)
    product = diags(d) @ A @ diags(1 / d)
    assert isinstance(product, tmg.ToeplitzSum)
    back = diags(1 / d) @ product @ diags(d)
    assert_allclose(back.toarray(), A.toarray(), rtol=1e-14)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(
    "factor", [2, 2.5, True, np.float32(2), np.float64(2), np.int64(3), np.float16(3)]
)
def test_the_precision_is_that_of_numpy(dtype, factor):
    A = covariance(5).astype(dtype)
    for of in (lambda A, x: A * x, lambda A, x: x * A, lambda A, x: A / x):
        result, expected = of(A, factor), of(A.toarray(), factor)
        assert result.dtype == expected.dtype
        assert_allclose(result.toarray(), expected, rtol=4 * np.finfo(expected.dtype).eps)
    for d in (diagonals(5)[0].astype(np.float32), diagonals(5)[0], np.arange(5), np.ones(5)):
        for of in (lambda A, D: A + D, lambda A, D: D @ A, lambda A, D: A @ D):
            expected = of(A.toarray(), np.diag(d))
            assert of(A, diags(d)).dtype == expected.dtype


def test_complex_numbers_and_diagonals_make_complex_matrices():
    A = tmg.ToeplitzOperator(0.5 ** np.arange(6.0), 0.3 ** np.arange(6.0))
    d, e = diagonals(6)
    z = d + 1j * e
    assert isinstance(2j * A, tmg.ToeplitzOperator)
    for sum_of in (
        lambda A, D, one: (1 + 2j) * A - 1j * one,
        lambda A, D, one: D @ A + A @ D,
        lambda A, D, one: D @ A @ D.conj() + (1 + 1j) * one,
        lambda A, D, one: (D @ A / 1j + D).T,
        lambda A, D, one: D @ (2j * A + one),
    ):
        S, dense = (
            sum_of(A, diags(z), sparse.eye_array(6)),
            sum_of(A.toarray(), np.diag(z), np.eye(6)),
        )
        for matrix, expected in ((S, dense), (S.T, dense.T), (S.H, dense.conj().T)):
            assert matrix.dtype == np.complex128
            assert_allclose(matrix.toarray(), expected, atol=1e-14)
            assert_allclose(matrix @ np.eye(6), expected, atol=1e-14)
        assert_allclose(S.astype(np.complex64).toarray(), dense, rtol=1e-6, atol=1e-6)
    H = tmg.ToeplitzOperator(0.5 ** np.arange(6) * np.exp(1j * np.arange(6)))
    S = diags(z) @ H @ diags(z.conj()) + diags(d)
    assert S.H is S
    assert "Hermitian" in repr(S)
    assert not (S + diags(z)).is_hermitian


@pytest.mark.parametrize("number", [Fraction(1, 3), np.array(2.0)])
def test_rational_numbers_and_arrays_without_an_axis_are_numbers(number):
    A = covariance(4)
    for result, expected in ((number * A, number), (A * number, number), (A / number, 1 / number)):
        assert isinstance(result, tmg.ToeplitzOperator)
        assert_allclose(result.toarray(), float(expected) * A.toarray())


def test_nothing_that_is_given_changes_a_sum():
    A, d, K = covariance(4), np.arange(1.0, 5.0), np.diag(np.arange(1.0, 5.0))
    sums = [tmg.ToeplitzSum([(x, A, None)], x) for x in (d, K.diagonal())] + [A + diags(d)]
    expected = [S.toarray() for S in sums]
    d[:], K[:] = 7.0, 7.0
    assert np.array_equal([S.toarray() for S in sums], expected)
    for entries in (sums[0].offset, sums[0].terms[0].left, sums[2].offset):
        with pytest.raises(ValueError, match="read-only"):
            entries[0] = 1.0


def test_what_it_is_not_for():
    A = covariance(4)
    for other in (covariance(5), sparse.eye_array(5), diags(np.arange(5.0)) @ covariance(5)):
        for total in (lambda x: A + x, lambda x: A - x, lambda x: x + A, lambda x: x - A):
            refuses(ValueError, "shape mismatch", total, other)
    with pytest.raises(ValueError, match="shape mismatch"):
        A @ sparse.eye_array(5)
    for number in (1, 0.5, np.float64(2)):
        with pytest.raises(TypeError, match=r"use s \* .*eye_array\(n\), which has it on the diag"):
            A + number
    for array in (np.ones(4), np.ones(2), np.array(1.0), A.toarray()):
        for total in (lambda x: A + x, lambda x: A - x, lambda x: x + A, lambda x: x - A):
            refuses(TypeError, r"differences of A and an? .* on the diagonal", total, array)
    with pytest.raises(ZeroDivisionError, match="is divided by 0"):
        A / 0
    for number in (np.inf, np.nan, np.float64(np.nan), complex(0.0, np.inf)):
        with pytest.raises(ValueError, match="must be finite"):
            number * A
    with pytest.raises(ValueError, match="add up to"):
        1e308 * A
    with pytest.raises(ValueError, match="a diagonal has nan at 2, but all entries must be finite"):
        A + diags(np.array([1.0, 2.0, np.nan, 3.0]))
    with pytest.raises(TypeError, match="is of type ToeplitzSum, but must be a ToeplitzOperator"):
        tmg.toeplitz_inverse(covariance(5) + diags(diagonals(5)[0]))
    A = covariance(3)
    with pytest.raises(TypeError, match="as 3"):
        A - np.uint8(3)
    with pytest.raises(ValueError, match="1/1e-320 is beyond its precision"):
        A / 1e-320
    with pytest.raises(
        ValueError, match=r"by, or added to, 1000.*\.\.\..*000, but it must be finite"
    ):
        10**400 * A
    # It is refused for what the Toeplitz matrix nearby is refused for.
    A = tmg.ToeplitzOperator(contact(16))
    D = diags(np.linspace(1.0, 2.0, 16))
    for S, solver in ((D @ A @ D, "cg"), (D @ A, "gmres")):
        refuses(np.linalg.LinAlgError, f"then use {solver} without M", tmg.tau_preconditioner, S)
    for wrong in (5.0, ["a", "b", "c"], [None] * 3, [1.0, 2.0]):
        with pytest.raises((TypeError, ValueError), match="diagonal has"):
            tmg.ToeplitzSum([(None, covariance(3), None)], wrong)


@pytest.mark.parametrize(
    "dtype", [np.int8, np.uint8, np.int32, bool, np.float16, np.float32, np.longdouble]
)
def test_diagonals_of_any_numbers_neither_overflow_nor_saturate(dtype):
    A, entries = covariance(4), np.array([100, 50, 0, 90]).astype(dtype)
    dense, d = A.toarray(), np.diag(entries.astype(np.float64))
    S = tmg.ToeplitzSum([(None, A, None)], entries)
    assert_allclose((S + S).toarray(), 2.0 * (dense + d))
    if dtype is np.float16:  # SciPy has no sparse arrays of it.
        return
    D = sparse.dia_array((entries[np.newaxis], [0]), shape=(4, 4))
    for result, expected in (
        ((A + D) + D, dense + 2 * d),
        (D @ (D @ A), d @ d @ dense),
        (D @ (A + D), d @ (dense + d)),
        (A - D, dense - d),
        (D - A, d - dense),
        (3.3 * (A + D), 3.3 * (dense + d)),
        (D @ A @ D + D, d @ dense @ d + d),
    ):
        assert result.dtype == np.float64
        assert_allclose(result.toarray(), expected, rtol=1e-14)


def test_what_is_no_diagonal_matrix_is_composed_by_scipy():
    A = covariance(4)
    B = sparse.csr_array(np.arange(16.0).reshape(4, 4))
    grid = tmg.ToeplitzOperator(exponential(2, 2))
    for result, expected in (
        (A + B, A.toarray() + B.toarray()),
        (B - A, B.toarray() - A.toarray()),
        (A + aslinearoperator(B), A.toarray() + B.toarray()),
        (A + grid, A.toarray() + grid.toarray()),
        (A @ A, A.toarray() @ A.toarray()),
        (A @ B, A.toarray() @ B.toarray()),
        (B @ A, B.toarray() @ A.toarray()),
    ):
        assert isinstance(result, LinearOperator)
        assert_allclose(result @ np.eye(4), expected)
    with pytest.raises(TypeError, match=r"of type _SumLinearOperator, .*diags_array\(d\)"):
        tmg.chan_preconditioner(aslinearoperator(sparse.eye_array(4)) + A)


@pytest.mark.parametrize("format", ["dia", "csr", "csc", "coo", "lil"])
def test_a_diagonal_matrix_may_have_any_format(format):
    A, d = covariance(6), diagonals(6)[0]
    for D in (diags(d).asformat(format), sparse.diags(d).asformat(format)):
        assert_allclose((D @ A + D).toarray(), np.diag(d) @ A.toarray() + np.diag(d))
    zero_beside = sparse.dia_array((np.array([d, 0 * d]), [0, 1]), shape=(6, 6))
    assert isinstance(A + zero_beside, tmg.ToeplitzSum)


def test_a_constant_diagonal_costs_nothing():
    A = covariance(300)
    D = diags(np.full(300, 2.0))
    for S in (A, A + D, D @ A, D @ A @ D + A.T @ D + D):
        with tmg.count_products() as work:
            S @ np.ones(300)
        assert work.units(300) == 1.0


def test_terms_between_the_same_diagonals_are_one_product():
    A, B = covariance(8), tmg.ToeplitzOperator(contact(8))
    D = diags(diagonals(8)[0])
    assert len((D @ A + D @ B - D @ A.T).terms) == 1
    assert len((D @ A + B @ D).terms) == 2
    assert (-(D @ A @ D)).is_symmetric


# Masks ------------------------------------------------------------------------------------------


def test_a_sum_on_a_mask_is_the_mask_of_a_sum():
    mask = checkered(5, 7)
    full, general = (tmg.ToeplitzOperator(exponential(5, 7)), random_lags(5, 7))
    B = tmg.ToeplitzOperator.from_lags(general)
    d, e = diagonals(35)
    on_mask = [tmg.MaskedOperator(A, mask) for A in (full, B)]
    D, E, D_m, E_m = diags(d), diags(e), diags(d[mask.ravel()]), diags(e[mask.ravel()])
    whole = tmg.MaskedOperator(D @ full + B @ E - 2 * B + E, mask)
    part = D_m @ on_mask[0] + on_mask[1] @ E_m - 2 * on_mask[1] + E_m
    assert isinstance(part, tmg.MaskedOperator)
    assert_allclose(part.toarray(), whole.toarray(), rtol=1e-14, atol=1e-14)
    assert isinstance((on_mask[0] + sparse.eye_array(mask.sum())).full, tmg.ToeplitzOperator)
    other = tmg.MaskedOperator(full, np.roll(mask, 1))
    assert not isinstance(on_mask[0] + other, tmg.MaskedOperator)


def test_means_are_taken_on_the_mask():
    A, mask = covariance(40), checkered(40)
    d = np.where(mask, 1.0, 1e6) * (2.0 + np.sin(np.arange(40)))
    x = np.ones(np.count_nonzero(mask))
    of_whole = tmg.chan_preconditioner(tmg.MaskedOperator(A + diags(d), mask)) @ x
    of_part = tmg.chan_preconditioner(tmg.MaskedOperator(A, mask) + diags(d[mask])) @ x
    assert_allclose(of_whole, of_part, rtol=1e-12)


# Preconditioners --------------------------------------------------------------------------------


def solved(iterate, S, M):
    b = np.random.default_rng(0).standard_normal(S.shape[0])
    x, info = iterate(S, b, M=M, rtol=1e-10)
    return info == 0 and np.linalg.norm(b - S @ x) <= 1e-8 * np.linalg.norm(b)


@each
@pytest.mark.parametrize("is_masked", [False, True])
def test_every_preconditioner_takes_sums(preconditioner, is_masked):
    n = 700
    A = covariance(n)
    if is_masked:
        A = tmg.MaskedOperator(A, checkered(n))
    x = np.linspace(0.0, 1.0, A.shape[0])
    D, E = diags(1.0 + x), diags(2.0 + np.cos(9.0 * x))
    for S in (A + D, D @ A @ D, D @ A + A @ D, A / 2 + E):
        M = preconditioner(S)
        assert solved(tmg.cg, S, M)
        np.linalg.cholesky(M @ np.eye(len(x)))  # It raises where M is not positive definite.
    for S in (D @ A, A @ D, D @ A + E @ A.T + sparse.eye_array(len(x))):
        assert solved(tmg.gmres, S, preconditioner(S))


@pytest.mark.parametrize("preconditioner", OF_SYMMETRIC, ids=lambda f: f.__name__)
def test_the_symmetric_part_is_preconditioned(preconditioner):
    """A sum that is not symmetric has the preconditioner of its symmetric part."""
    G = tmg.ToeplitzOperator(0.5 ** np.arange(300.0), 0.3 ** np.arange(300.0))
    D, E = map(diags, diagonals(300))
    S = D @ G + G.T @ E + D
    M = preconditioner(S)
    assert M.H is M
    assert_allclose(M @ np.ones(300), preconditioner((S + S.T) / 2) @ np.ones(300), rtol=1e-9)
    assert np.linalg.eigvalsh(M @ np.eye(300)).min() > 0.0


@each
def test_between_diagonals_a_matrix_is_preconditioned_as_by_itself(preconditioner):
    """So it is beside a diagonal that is of no account."""
    A, d, x = covariance(50), diagonals(50)[0], np.linspace(1.0, 2.0, 50)
    expected = preconditioner(A) @ x
    assert_allclose(preconditioner(diags(d) @ A @ diags(d)) @ (d * x), expected / d, rtol=1e-11)
    assert_allclose(preconditioner(A + diags(1e-12 * d)) @ x, expected, rtol=1e-9)


def test_scaling_takes_fewer_iterations_than_the_mean():
    """Where the diagonal varies by factors of 100, whichever of A and D is the larger."""
    n = 2000
    A = tmg.ToeplitzOperator(np.r_[2.0, -1.0, np.zeros(n - 2)])
    rng = np.random.default_rng(0)
    b = rng.standard_normal(n)
    for size in (1e-2, 1.0, 1e2):
        d = size * 100.0 ** rng.random(n)
        S, of_mean = A + diags(d), A + d.mean() * sparse.eye_array(n)
        few, more = (
            count_iterations(tmg.cg, S, b, M=tmg.sine_preconditioner(B)) for B in (S, of_mean)
        )
        assert few < more


@each
def test_what_is_not_positive_definite_is_refused(preconditioner):
    A = covariance(300)
    wave = diags(0.01 * np.cos(np.arange(300)))
    with pytest.raises(np.linalg.LinAlgError, match=r"the diagonal of A has the entry -.*: use"):
        preconditioner(A - 2 * sparse.eye_array(300) + wave)
    if preconditioner is not tmg.jacobi_preconditioner:
        # The least eigenvalue of A is near 1/3.
        with pytest.raises(np.linalg.LinAlgError):
            preconditioner(A - 0.6 * sparse.eye_array(300) + wave)


def test_a_sum_in_less_precision():
    S = covariance(500) + diags(diagonals(500)[0])
    assert S.astype(np.float64) is S
    single = S.astype(np.float32)
    M = tmg.chan_preconditioner(S, dtype=np.float32)
    assert single.dtype == M.dtype == np.float32
    x, info = tmg.cg(S, np.ones(500), M=M, inner=single, rtol=1e-12)
    assert info == 0
    assert np.linalg.norm(S @ x - 1.0) <= 1e-12 * np.linalg.norm(np.ones(500))


@pytest.mark.parametrize("n", [20, 300])
def test_a_sum_has_the_digits_and_the_range_of_its_precision(n):
    A = tmg.ToeplitzOperator((1.0 / (1.0 + np.arange(n))).astype(np.float32))
    exact = tmg.ToeplitzOperator(A.c.astype(np.float64))
    d = np.linspace(1.0, 2.0, n)
    d[0] = 1e40
    x = np.random.default_rng(0).standard_normal(n)
    D = sparse.diags_array(d)
    for S, T in ((A @ D, exact @ D), (D @ A + D, D @ exact + D)):
        assert S.dtype == np.float64
        y = S @ x
        assert_allclose(y, T @ x, atol=1e-12 * np.abs(y).max())


def test_a_sum_that_is_made_of_terms_is_as_one_that_is_added():
    A, G = covariance(4), tmg.ToeplitzOperator([3.0, 1.0, 0.5, 0.0], [3.0, 2.0, 1.0, 0.0])
    d = np.arange(1.0, 5.0)
    given = [(None, G, None), (2.0, A, np.float64(3.0)), (None, G.T, None), (d, A, None)]
    S = tmg.ToeplitzSum([*given, (d, A, np.full(4, 0.5))])
    D = sparse.diags_array(d)
    expected = G + 6.0 * A + G.T + 1.5 * (D @ A)
    assert_allclose(S.toarray(), expected.toarray())
    assert_allclose(S.T.toarray(), S.toarray().T)
    assert len(S.terms) == 2
    assert tmg.ToeplitzSum([(None, G, None), (None, G, None)]).is_symmetric is False


@pytest.mark.parametrize(
    ("terms", "kind", "text"),
    [
        ([], ValueError, "terms is empty"),
        ([(None, np.eye(3), None)], TypeError, "must be ToeplitzOperators"),
        ([(None, covariance(3), None), (None, covariance(4), None)], ValueError, "must live on"),
        ([(np.ones(2), covariance(3), None)], ValueError, "left has shape"),
        ([(np.nan, covariance(3), None)], ValueError, "left has entries that are not finite"),
        ([(np.full(3, np.nan), covariance(3), None)], ValueError, "left has entries that are not"),
        ([(sparse.eye_array(3), covariance(3), None)], TypeError, r"the entries D\.diagonal"),
        ([covariance(3)], TypeError, "must be a list of Terms"),
        ([(np.ones(3), covariance(3))], TypeError, "must be a list of Terms"),
        (covariance(3), TypeError, "must be a list of Terms"),
    ],
)
def test_terms_that_make_no_sum(terms, kind, text):
    refuses(kind, text, tmg.ToeplitzSum, terms)


def test_the_bound_of_the_norm_of_a_sum():
    A, (d, e) = covariance(40), diagonals(40)
    S = diags(-d) @ A @ diags(e) + A + diags(e)
    assert np.linalg.norm(S.toarray(), 2) <= S.norm_bound
    assert tmg.MaskedOperator(S, d > d.mean()).norm_bound == S.norm_bound


@pytest.mark.parametrize("factor", [1e-80, 1e80])
def test_sums_out_of_the_range_of_single_precision_are_refused_in_it(factor):
    S = factor * (covariance(40) + diags(diagonals(40)[0]))
    of_float64 = (tmg.jacobi_preconditioner, tmg.multigrid)
    for preconditioner in (f for f in SYMMETRIC if f not in of_float64):
        with pytest.raises(ValueError, match="for a preconditioner in float32 it must be between"):
            preconditioner(S, dtype=np.float32)
    assert solved(tmg.cg, S, tmg.tau_preconditioner(S))


def test_the_component_that_is_refused_is_named():
    good, bad = (tmg.ToeplitzOperator(c) for c in ([2.0, 1.0, 0.5], [1.0, 2.0, 3.0]))
    A = tmg.CoupledOperator([[good, None], [None, bad]])
    with pytest.raises(np.linalg.LinAlgError) as error:
        tmg.componentwise(tmg.tau_preconditioner)(A)
    assert any("This was the matrix of a component" in note for note in error.value.__notes__)


def test_between_complex_diagonals_what_is_hermitian_stays_so():
    """Rounding of the weights |z|² leaves no imaginary part in what stands for Z A Zᴴ."""
    n = 60
    k = np.arange(n)
    z = np.exp(1j * k**2) * (1.5 + 0.5 * np.cos(k))
    Z = sparse.diags_array(z)
    definite = tmg.ToeplitzOperator(0.5**k * np.exp(0.7j * k))
    S = Z @ definite @ Z.conj()
    assert S.is_hermitian
    for make in (tmg.chan_preconditioner, tmg.default_preconditioner, tmg.fft_preconditioner):
        M = make(S)
        assert M.H is M
        _, info = tmg.cg(S, np.ones(n), M=M, rtol=1e-10)
        assert info == 0
    indefinite = tmg.ToeplitzOperator(np.r_[0.5, -0.9 * np.exp(0.7j * k[1:]) * 0.6 ** k[1:]])
    with pytest.raises(np.linalg.LinAlgError, match="may be indefinite"):
        tmg.chan_preconditioner(Z @ indefinite @ Z.conj())
